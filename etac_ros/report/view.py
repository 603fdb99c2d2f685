"""What the pages and figures look at: a run, perhaps another one beside it, and where its transient ends."""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property

from etac_ros.report.figures.data import Margins, attitude_angle, margins, transient_end_s, trigger_modules
from etac_ros.report.source import ReportedRun
from etac_ros.scenario.schema import PublishedFigure


@dataclass(frozen=True)
class View:
    """A run as the report shows it.

    Attributes
    ----------
    run
        The run that is reported.
    other
        Another run of the same scenario, its baseline as a rule; None if none was given.
    """

    run: ReportedRun
    other: ReportedRun | None = None

    @cached_property
    def cut_s(self) -> float | None:
        """Where the steady state begins, the same in all figures [s]; None if the figures stay whole."""
        run = self.run
        return transient_end_s([attitude_angle(run.graph, run.recording, plant) for plant in run.graph.plants])

    @cached_property
    def margins(self) -> dict[str, Margins]:
        """What the trigger rule of each sensor compared, where it compares anything."""
        graph = self.run.graph
        found = {name: margins(graph, self.run.recording, name) for name in trigger_modules(graph)}
        return {name: compared for name, compared in found.items() if compared is not None}

    @property
    def other_label(self) -> str:
        """What the other run is called beside this one."""
        if self.other is None:
            return ""
        variant = self.other.scenario.variant
        if self.other.is_baseline:
            return f"baseline ({variant})"
        return f"variant {variant}" if variant and variant != self.run.scenario.variant else "other run"

    @property
    def baseline(self) -> ReportedRun | None:
        """The other run where it is the measured baseline of this one."""
        other = self.other
        return other if other is not None and other.is_baseline and not self.run.is_baseline else None

    @property
    def paper_baseline(self) -> PublishedFigure | None:
        """The paper's bytes of its baseline, where they belong to a run as long as this one."""
        if "duration_s" in self.run.overrides or not self.run.is_complete:
            return None
        return self.run.scenario.published.get("baseline_payload_bytes")

    @property
    def source(self) -> str:
        """What the published figures are called."""
        return self.run.scenario.run.published.source or "paper"

    def shown_in(self, figure: str) -> str:
        """Where the paper shows the same, as ``figs. 4 and 5``; empty if the scenario does not say."""
        places = self.run.scenario.run.published.shown_in or {}
        return places.get(figure, "")
