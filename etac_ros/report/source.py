"""A run as its bag tells it: the scenario inside, the graph built from that, and all that was recorded."""

from __future__ import annotations

import json
from collections.abc import Mapping
from dataclasses import dataclass, replace
from functools import cached_property
from pathlib import Path
from tempfile import TemporaryDirectory
from typing import Any

from etac_ros.bag.read import Bag, read_bag
from etac_ros.bag.run_metadata import RECOVERED
from etac_ros.errors import BagError, ScenarioError
from etac_ros.graph.graph import Graph
from etac_ros.graph.recording import Recording
from etac_ros.maths.ticks import seconds
from etac_ros.metrics.curves import Curve, energy, held_inputs, last_tick
from etac_ros.metrics.published import watches_of_module
from etac_ros.metrics.summary import Summary, Timing, summarise
from etac_ros.plants.watch import Watch
from etac_ros.runs import SCENARIO_ATTACHMENT, scenario_in
from etac_ros.scenario.load import Scenario


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
    """

    scenario: Scenario
    graph: Graph
    recording: Recording
    summary: Summary
    metadata: dict[str, str]

    @property
    def overrides(self) -> dict[str, Any]:
        """What ``--set`` changed."""
        return dict(self.scenario.overrides)

    @property
    def is_baseline(self) -> bool:
        """Whether this is the run that its scenario compares itself with."""
        return self.scenario.variant is not None and self.scenario.variant == self.scenario.run.baseline

    @property
    def kinds_of_plants(self) -> dict[str, str]:
        """Class of the dynamics of each plant."""
        return {plant: str(self.scenario.nodes[plant]["dynamics"]["class"]) for plant in self.graph.plants}

    @cached_property
    def watches(self) -> dict[str, tuple[int, tuple[Watch, ...]]]:
        """First tick and watched quantities of each node that watches something."""
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


def read_run(bag: Path) -> ReportedRun:
    """Read all that a report needs from a bag.

    Raises
    ------
    BagError
        If it is no whole bag of etac_ros, carries no scenario or one that cannot be loaded here, or holds no
        samples.
    """
    found = read_bag(bag)
    scenario = replace(_scenario(bag, found), overrides=_overrides(found))
    graph = scenario.build()
    recording = found.recording()
    _check_fit(bag, graph, recording)
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
            if topic.link is None
        },
        measured_cdr={topic.name: count.cdr_bytes for topic, count in found.topics.items()},
    )
    return ReportedRun(scenario, graph, recording, summary, found.metadata)


def read_other(bag: Path, run: ReportedRun) -> ReportedRun:
    """Read the bag of a run that is laid over another.

    Raises
    ------
    BagError
        As :func:`read_run`, and if the two are not of the same kinds of plants: their curves would have nothing in
        common. Other parameters of the plants do no harm; the page says which differ.
    """
    other = read_run(bag)
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


def _overrides(found: Bag) -> dict[str, Any]:
    """What the bag says was changed by ``--set``; the scenario inside has it in place already."""
    try:
        overrides = json.loads(found.metadata.get("overrides") or "{}")
    except ValueError:
        return {}
    return overrides if isinstance(overrides, dict) else {}


def _apart(where: str, one: Any, other: Any) -> list[str]:
    if one == other:
        return []
    if isinstance(one, Mapping) and isinstance(other, Mapping):
        keys = dict.fromkeys([*one, *other])
        return [name for key in keys for name in _apart(f"{where}.{key}", one.get(key), other.get(key))]
    return [where]


def _named(kinds: Mapping[str, str]) -> str:
    return ", ".join(f"{plant} ({kind})" for plant, kind in kinds.items())


def _scenario(bag: Path, found: Bag) -> Scenario:
    if SCENARIO_ATTACHMENT not in found.attachments:
        names = ", ".join(found.attachments) or "none"
        raise BagError(
            str(bag),
            f"there is no attachment {SCENARIO_ATTACHMENT} in it (attachments: {names})",
            "a bag that carries the scenario of its run",
            "record the run anew with etac run, or with the node /recorder",
        )
    with TemporaryDirectory() as folder:
        try:
            return scenario_in(bag, Path(folder))
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


def _check_fit(bag: Path, graph: Graph, recording: Recording) -> None:
    for link in graph.links:
        if link not in recording.messages:
            raise BagError(f"{bag}: link {link}", "is not in the bag", "every link of the scenario in it")
    for plant in graph.plants:
        _, states = recording.samples(plant)
        if states.shape[0] == 0:
            raise BagError(
                f"{bag}: {plant}",
                "there is not one committed sample of this plant",
                "a run of at least one tick",
                "record the run anew",
            )
        width = graph.modules[plant].state.size  # type: ignore[attr-defined]  # a PlantModule
        if states.shape[1] != width:
            raise BagError(f"{bag}: {plant}", f"samples of {states.shape[1]} states", f"samples of {width} states")
