"""A run as its bag tells it: the scenario inside, the graph built from that, and all that was recorded."""

from __future__ import annotations

import json
from collections.abc import Callable, Mapping
from contextlib import nullcontext
from dataclasses import dataclass, replace
from functools import cached_property
from pathlib import Path
from tempfile import TemporaryDirectory
from typing import Any

from etac_ros.bag.description import DESCRIPTION_ATTACHMENT, RunDescription, from_json
from etac_ros.bag.read import Bag, read_bag
from etac_ros.bag.run_metadata import RECOVERED
from etac_ros.bag.stand_ins import stand_in_graph
from etac_ros.capture.kept import read_from_bag
from etac_ros.errors import BagError, ScenarioError
from etac_ros.graph.graph import Graph
from etac_ros.graph.recording import Recording
from etac_ros.maths.ticks import seconds
from etac_ros.metrics.curves import Curve, energy, held_inputs, last_tick
from etac_ros.metrics.kept import kept_in_bag
from etac_ros.metrics.published import check_measure, watches_of_module
from etac_ros.metrics.summary import Summary, Timing, summarise
from etac_ros.parameters import FloatArray
from etac_ros.plants.watch import Watch
from etac_ros.report.peaks import is_long, with_peaks
from etac_ros.report.plausible import check_fit
from etac_ros.runs import SCENARIO_ATTACHMENT
from etac_ros.scenario.classes import ForeignClassError
from etac_ros.scenario.load import Scenario, load, read_resolved
from etac_ros.scenario.trust import foreign_classes, own_classes_only

_MOST_SHOWN = 80
_TRUST = "etac report --trust, if you trust the classes that the bag names: their code is run"
_NOT_OURS = "draw a bag that etac_ros recorded; this one was changed"


@dataclass(frozen=True)
class ReportedRun:
    """One run, from its bag alone.

    Attributes
    ----------
    scenario
        As it was run, with variant and overrides in place.
    graph
        Built from it; no engine has run it.
    recording
        Messages of the links and committed samples of the plants.
    summary
        Counts, triggers and performance. What a bag cannot know (wall time, memory) is zero or empty.
    metadata
        What the bag says of its run.
    kinds_of_plants
        Class of the dynamics of each plant.
    left_out
        A sentence on what is not shown since classes of others were not imported; empty if nothing is left out.
    """

    scenario: Scenario
    graph: Graph
    recording: Recording
    summary: Summary
    metadata: dict[str, str]
    kinds_of_plants: dict[str, str]
    left_out: str = ""

    @property
    def overrides(self) -> dict[str, Any]:
        """What ``--set`` changed."""
        return dict(self.scenario.overrides)

    @property
    def is_baseline(self) -> bool:
        """Whether this is the run that its scenario compares itself with."""
        return self.scenario.variant is not None and self.scenario.variant == self.scenario.run.baseline

    @cached_property
    def watches(self) -> dict[str, tuple[int, tuple[Watch, ...]]]:
        """First tick and watched quantities of each node that watches something."""
        if not self.recording.is_whole:
            return {}  # of some, what is watched follows from all samples
        found = {name: watches_of_module(self.graph, self.recording, name) for name in self.graph.modules}
        return {name: (first, watches) for name, (first, watches) in found.items() if watches}

    @cached_property
    def held(self) -> dict[str, dict[str, Curve]]:
        """What each input port of each plant holds."""
        return {plant: held_inputs(self.graph, self.recording, plant) for plant in self.graph.plants}

    @cached_property
    def energy(self) -> dict[str, Curve]:
        """Energy that each plant takes [N^2 m^2 s]."""
        return {plant: energy(self.graph, self.recording, plant) for plant in self.graph.plants}

    @property
    def end_s(self) -> float:
        """Simulated time of the last sample that every plant has committed [s]."""
        return float(seconds(last_tick(self.graph, self.recording), self.graph.ticks_per_second))

    @property
    def is_complete(self) -> bool:
        """Whether the run reached the end that its scenario sets."""
        return last_tick(self.graph, self.recording) >= self.graph.end_tick

    @property
    def was_recovered(self) -> str:
        """What had been wrong with the bag before it was repaired; empty if nothing was."""
        return self.metadata.get(RECOVERED, "")


def read_run(bag: Path, trust: bool = False, shown: bool = False) -> ReportedRun:
    """Read all that a report needs from a bag.

    Parameters
    ----------
    bag
        Directory of the bag.
    trust
        Whether to import classes that are not of etac_ros, if the scenario in the bag names any.
    shown
        Whether the samples are only to be shown: of a very long run then those alone that make up its curves are kept.

    Raises
    ------
    BagError
        If it is no whole bag of etac_ros, carries no scenario or one that cannot be loaded here, or holds no
        samples, or numbers that are those of no run.
    """
    found = read_bag(bag)
    if SCENARIO_ATTACHMENT not in found.attachments:
        names = ", ".join(found.attachments) or "none"
        raise BagError(
            str(bag),
            f"there is no attachment {SCENARIO_ATTACHMENT} in it (attachments: {names})",
            "a bag that carries the scenario of its run",
            "record the run anew with etac run, or with the node /recorder",
        )
    recording, derived = found.recording_and_derived()
    left_out, kept, foreign_left_out = "", None, False
    if recording.every != 1:
        kept = kept_in_bag(bag)
        left_out = (
            f"this bag keeps {_kept_part(recording.every)} (--truth), and all messages. Figures of the whole run were "
            "taken of all samples while it ran; what trigger rules compared and what is watched is left out."
        )
    try:
        with nullcontext() if trust else own_classes_only():
            scenario = _scenario(bag, found, load)
            graph = scenario.build() if recording.wall is None else scenario.build().in_real_time()
    except ForeignClassError as foreign:
        scenario = _scenario(bag, found, read_resolved)
        graph, description = _without_classes(bag, found, recording, derived, foreign)
        kinds = {plant: description.nodes[plant].cls for plant in graph.plants}
        foreign_left_out = True
        names = ", ".join(foreign_classes(scenario.classes))
        left_out += (" " if left_out else "") + (
            f"this bag names classes that are not of etac_ros ({names}), which were not imported. What trigger rules "
            "compared is left out; etac report --trust shows it, and runs their code."
        )
    else:
        kinds = {plant: str(scenario.nodes[plant]["dynamics"]["class"]) for plant in graph.plants}
    scenario = replace(_with_figures_that_can_be_had(scenario, graph), overrides=_overrides(bag, found))
    check_fit(bag, found, graph, recording)
    engine = found.metadata.get("engine", "")
    summary = summarise(
        scenario,
        graph,
        recording,
        "ros" if engine == "ros" else "inprocess",
        Timing(startup_s=0.0, loop_s=0.0, total_s=0.0),
        plane={
            topic.name: (topic.type_name, count.messages, count.cdr_bytes)
            for topic, count in found.topics.items()
            if topic.kind == "emulation"
        },
        measured_cdr={topic.name: count.cdr_bytes for topic, count in found.topics.items()},
        wire=read_from_bag(bag),
        of_samples=kept,
    )
    if shown and not foreign_left_out and is_long(graph, recording):
        recording = with_peaks(graph, recording)
        left_out += (" " if left_out else "") + (
            "This run is very long: curves show the largest and the smallest value of each of many spans, which are "
            "short at first. Figures are those of all samples; what trigger rules compared and what is watched is left "
            "out."
        )
    return ReportedRun(scenario, graph, recording, summary, found.metadata, kinds, left_out)


def _kept_part(every: int) -> str:
    return f"the committed samples of every {every}th tick, and the last" if every else "no committed samples"


def read_other(bag: Path, run: ReportedRun, trust: bool = False, shown: bool = False) -> ReportedRun:
    """Read the bag of a run that is laid over another.

    Raises
    ------
    BagError
        As :func:`read_run`, and if the two are not of the same kinds of plants: their curves would have nothing in
        common. Other parameters of the plants do no harm; the page says which differ.
    """
    other = read_run(bag, trust, shown)
    if other.kinds_of_plants != run.kinds_of_plants:
        raise BagError(
            f"{bag}",
            f"a run of scenario '{other.scenario.name}' with {_named(other.kinds_of_plants)}",
            f"the plants of the first bag, scenario '{run.scenario.name}': {_named(run.kinds_of_plants)}",
            f"lay only runs of the same plants over each other, for instance variants of {run.scenario.name}",
        )
    return other


def plants_apart(run: ReportedRun, other: ReportedRun) -> tuple[str, ...]:
    """The parameters of the plants in which two runs differ, as ``/plant.dynamics.rate_rad_s``."""
    found: list[str] = []
    for plant in run.graph.plants:
        found += _apart(plant, run.scenario.nodes[plant], other.scenario.nodes[plant])
    return tuple(found)


def _apart(where: str, one: Any, other: Any) -> list[str]:
    if one == other:
        return []
    if isinstance(one, Mapping) and isinstance(other, Mapping):
        keys = dict.fromkeys([*one, *other])
        return [name for key in keys for name in _apart(f"{where}.{key}", one.get(key), other.get(key))]
    return [where]


def _named(kinds: Mapping[str, str]) -> str:
    return ", ".join(f"{plant} ({kind})" for plant, kind in kinds.items())


def _overrides(bag: Path, found: Bag) -> dict[str, Any]:
    text = found.metadata.get("overrides") or "{}"
    try:
        values = json.loads(text)
    except (ValueError, RecursionError):
        values = None
    if not isinstance(values, dict):
        shown = text if len(text) < _MOST_SHOWN else f"{text[:_MOST_SHOWN]}..."
        raise BagError(f"{bag}: overrides", f"found {shown}", "values by key, as JSON", _NOT_OURS)
    return values


def _scenario(bag: Path, found: Bag, read: Callable[[str], Scenario]) -> Scenario:
    with TemporaryDirectory() as folder:
        path = Path(folder, SCENARIO_ATTACHMENT)
        path.write_bytes(found.attachments[SCENARIO_ATTACHMENT])
        try:
            scenario = read(str(path))
        except ForeignClassError:
            raise
        except ScenarioError as error:
            # The path of the copy would mean nothing to the reader: it is gone by now.
            reason = f"{error.where}: {error.found}".replace(f"{folder}/", "")
            version = found.metadata.get("version", "unknown")
            raise BagError(
                f"{bag}: {SCENARIO_ATTACHMENT}",
                f"the scenario in the bag cannot be loaded here: {reason}",
                f"the classes and keys that etac_ros {version} had when it recorded the run",
                "draw it where it was recorded, or put the packages that it names on PYTHONPATH",
            ) from None
        except (RecursionError, OverflowError, ValueError, TypeError, LookupError, AttributeError) as error:
            reason = f"it makes no sense ({type(error).__name__}: {error})".replace(f"{folder}/", "")
            raise BagError(f"{bag}: {SCENARIO_ATTACHMENT}", reason, "the scenario of a run", _NOT_OURS) from error
    return scenario


def _without_classes(
    bag: Path, found: Bag, recording: Recording, derived: dict[str, FloatArray], foreign: ForeignClassError
) -> tuple[Graph, RunDescription]:
    """The graph as the bag describes it, in the place of the one that only the classes could build."""
    if DESCRIPTION_ATTACHMENT not in found.attachments:
        raise BagError(
            f"{bag}: {SCENARIO_ATTACHMENT}",
            f"{foreign.found}, and the bag does not describe its run without it (no attachment "
            f"{DESCRIPTION_ATTACHMENT})",
            "a bag of which everything is known without importing anything",
            _TRUST,
        )
    try:
        description = from_json(found.attachments[DESCRIPTION_ATTACHMENT])
        return stand_in_graph(description, recording, derived), description
    except ValueError as error:
        where, wanted = f"{bag}: {DESCRIPTION_ATTACHMENT}", "a description of the run that fits the rest of the bag"
        raise BagError(where, str(error), wanted, _TRUST) from None


def _with_figures_that_can_be_had(scenario: Scenario, graph: Graph) -> Scenario:
    """The scenario without the published figures of which this graph could not tell a measured one."""
    kept = {}
    for name, figure in scenario.published.items():
        try:
            if figure.measure is not None:
                check_measure(figure.measure, graph, name)
        except ScenarioError:
            continue
        kept[name] = figure
    if len(kept) == len(scenario.published):
        return scenario
    published = scenario.run.published.model_copy()
    published.__pydantic_extra__ = kept
    return replace(scenario, run=scenario.run.model_copy(update={"published": published}))
