"""What the pages and figures look at: a run, perhaps others laid over it, and where its transient ends."""

from __future__ import annotations

from collections import Counter
from dataclasses import dataclass
from functools import cached_property

from etac_ros.metrics.curves import attitude_angle, attitude_plants, transient_end_s
from etac_ros.metrics.decisions import Decisions, Margins, decisions, margins
from etac_ros.metrics.figures import FigureKey
from etac_ros.metrics.summary import PublishedValue
from etac_ros.modules.triggering import triggering_modules
from etac_ros.report.source import ReportedRun
from etac_ros.theorems.bound import Lyapunov
from etac_ros.theorems.papers import theorems_of


@dataclass(frozen=True)
class View:
    """A run as the report shows it.

    Attributes
    ----------
    run
        The run that is reported.
    others
        Runs of the same plants that are laid over it: its baseline, other variants, other controllers.
    """

    run: ReportedRun
    others: tuple[ReportedRun, ...] = ()

    @property
    def runs(self) -> tuple[ReportedRun, ...]:
        """The reported run, then the others."""
        return (self.run, *self.others)

    @property
    def overlaid(self) -> bool:
        """Whether there is more than one run."""
        return bool(self.others)

    @cached_property
    def alone(self) -> View:
        """The reported run without the others, for what cannot be laid over each other."""
        return View(self.run) if self.overlaid else self

    @cached_property
    def labels(self) -> tuple[str, ...]:
        """What each run is called, all different."""
        variant = self.run.scenario.variant
        named = self.overlaid and variant is not None
        labels = [f"this run ({variant})" if named else "this run", *(self._label(other) for other in self.others)]
        twice = {label for label, count in Counter(labels).items() if count > 1}
        labels = [
            f"{label}, {_short(run)}" if label in twice and run.overrides else label
            for label, run in zip(labels, self.runs, strict=True)
        ]
        seen: Counter[str] = Counter()
        for place, label in enumerate(labels):
            seen[label] += 1
            labels[place] = f"{label} ({seen[label]})" if seen[label] > 1 else label
        return tuple(labels)

    @property
    def end_s(self) -> float:
        """Where the time axes end: with the longest run [s]."""
        return max(run.end_s for run in self.runs)

    @cached_property
    def cut_s(self) -> float | None:
        """Where the steady state of the reported run begins, the same in all figures [s]; None if they stay whole."""
        run = self.run
        errors = [attitude_angle(run.graph, run.recording, plant) for plant in attitude_plants(run.graph)]
        if not errors:
            return None
        steady_from_s = run.summary.steady_from_s
        cut_s = transient_end_s(errors, steady_from_s)
        if cut_s is None and run.scenario.run.steady_from_s is not None and 0.0 < steady_from_s < run.end_s:
            return steady_from_s  # the scenario says where, although the error still falls
        return cut_s

    @property
    def steady_words(self) -> str:
        """Where the steady figures of the reported run come from, to begin a sentence with."""
        steady_from_s = self.run.summary.steady_from_s
        return f"From {steady_from_s:g} s on" if steady_from_s < self.run.end_s else "At its end"

    @cached_property
    def decisions(self) -> dict[str, Decisions]:
        """What the trigger rule of each module was shown, where that can be recomputed."""
        run = self.run
        found = {name: decisions(run.graph, run.recording, name) for name in triggering_modules(run.graph)}
        return {name: shown for name, shown in found.items() if shown is not None}

    @cached_property
    def margins(self) -> dict[str, Margins]:
        """What the trigger rule of each module compared, where it compares anything."""
        found = {name: margins(self.run.graph, shown, name) for name, shown in self.decisions.items()}
        return {name: compared for name, compared in found.items() if compared is not None}

    @cached_property
    def lyapunov(self) -> Lyapunov | None:
        """The Lyapunov function of the paper's theorem; None where there is none, or the run is cut off.

        None as well where classes of others were not imported: the theorems build the scenario.
        """
        run = self.run
        found = theorems_of(run.scenario, run.recording) if run.is_complete and not run.left_out else None
        return None if found is None else found.lyapunov

    @property
    def baseline(self) -> ReportedRun | None:
        """The first of the other runs that is the measured baseline of this one."""
        if self.run.is_baseline:
            return None
        return next((other for other in self.others if self._is_baseline(other)), None)

    @property
    def triggering_instants(self) -> int:
        """Those that the paper counts: of all sensors less those that only keep a clock, unless there are no others."""
        every = list(self.run.summary.triggers.values())
        decided = [one for one in every if one.min_interval_s is None or one.min_interval_s != one.max_interval_s]
        return sum(one.count for one in decided or every)

    @property
    def paper_baseline(self) -> PublishedValue | None:
        """The paper's bytes of its baseline, where they stand beside this run and it is complete."""
        return self.run.summary.paper.get(FigureKey("baseline_payload_bytes")) if self.run.is_complete else None

    @property
    def source(self) -> str:
        """What the published figures are called."""
        return self.run.scenario.run.published.source or "paper"

    def shown_in(self, figure: str) -> str:
        """Where the paper shows the same, as ``figs. 4 and 5``; empty if the scenario does not say."""
        places = self.run.scenario.run.published.shown_in or {}
        return places.get(figure) or ""

    def _is_baseline(self, other: ReportedRun) -> bool:
        return other.is_baseline and other.scenario.name == self.run.scenario.name and _alike(self.run, other)

    def _label(self, other: ReportedRun) -> str:
        variant, name = other.scenario.variant, other.scenario.name
        if self._is_baseline(other):
            return f"baseline ({variant})"
        if variant is None:
            return name
        return variant if name == self.run.scenario.name else f"{name}, {variant}"


def _alike(run: ReportedRun, other: ReportedRun) -> bool:
    """Whether two runs have the same plants, start and length: one with another start is nobody's baseline."""
    if run.scenario.run.duration_s != other.scenario.run.duration_s:
        return False
    nodes, others = run.scenario.nodes, other.scenario.nodes
    return all(nodes[name].get(key) == others.get(name, {}).get(key) for name in nodes for key in ("dynamics", "noise"))


def _short(run: ReportedRun) -> str:
    """What a run overrides, each key by its last word."""
    return ", ".join(f"{key.rpartition('.')[2]}={value}" for key, value in run.overrides.items())
