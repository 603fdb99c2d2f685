"""A graph made of data: what a bag says of its run, in the place of the classes that ran.

Its modules have the names, ports and parts in the run that the real ones had, so whoever counts messages or draws
curves sees no difference. What only a class could compute of a sample was recorded beside it. No engine can run this.
"""

from __future__ import annotations

from collections import Counter
from collections.abc import Mapping
from functools import partial
from typing import ClassVar, cast

import numpy as np

from etac_ros.bag.description import (
    Columns,
    LinkDescription,
    MediumDescription,
    NodeDescription,
    PlantDescription,
    RunDescription,
)
from etac_ros.errors import RunError
from etac_ros.graph.channel import Channel
from etac_ros.graph.faults import Fault
from etac_ros.graph.graph import Acknowledgement, Graph, Link
from etac_ros.graph.module import Context, Module, Window
from etac_ros.graph.plant import PlantModule, PlantModuleParameters
from etac_ros.graph.recording import Recording
from etac_ros.graph.wire import Wire
from etac_ros.media.frame import Line
from etac_ros.media.medium import MediumPlan
from etac_ros.parameters import FloatArray, Parameters
from etac_ros.plants.plant import Body, Plant
from etac_ros.plants.watch import Watch


def stand_in_graph(run: RunDescription, recording: Recording, derived: Mapping[str, FloatArray]) -> Graph:
    """Build the graph of a run from its bag alone.

    Parameters
    ----------
    run, recording, derived
        All from one bag.

    Raises
    ------
    ValueError
        If they do not belong together.
    """
    modules: dict[str, Module] = {}
    for name, node in run.nodes.items():
        plant = name if node.plant is not None else node.reads
        first, states = (0, np.empty((0, 0))) if plant is None else recording.samples(plant)
        rows = _Rows(run.derived.get(name, ()), first, _checked(name, run, derived, states.shape[0]))
        if node.plant is None:
            modules[name] = cast(Module, StandIn(node, rows))  # all that is asked of a module after a run
        else:
            if states.ndim != 2 or states.shape[1] != len(node.plant.labels):
                found = "no samples" if not states.size else f"samples of {states.shape[1]} states"
                raise ValueError(f"{name}: {found} instead of {len(node.plant.labels)} states")
            kind = RecordedPlant if node.plant.attitude is None else RecordedAttitudePlant
            dynamics = cast(Plant, kind(node, node.plant, states, rows))
            context = Context(name, run.ticks_per_second, 0)
            modules[name] = RecordedPlantModule(context, PlantModuleParameters(), dynamics)
    faults = tuple(Fault(**fault.model_dump()) for fault in run.faults or ())
    links = {
        name: Link(
            name,
            link.topic,
            link.kind,
            link.sender,
            link.port,
            link.receivers,
            Wire(link.wire, link.size),
            _channel(name, link, run.ticks_per_second, () if recording.wall is not None else faults),
            link.medium or "",
            None if link.acknowledged is None else Acknowledgement(**link.acknowledged.model_dump()),
        )
        for name, link in run.links.items()
    }
    reads = {name: node.reads for name, node in run.nodes.items() if node.reads is not None}
    external = frozenset(name for name, node in run.nodes.items() if node.external)
    media = {name: _medium(name, medium) for name, medium in (run.media or {}).items()}
    return Graph(modules, reads, links, run.ticks_per_second, run.end_tick, external, media, faults)


def _channel(name: str, link: LinkDescription, ticks_per_second: int, faults: tuple[Fault, ...]) -> Channel:
    down = {
        node: tuple(fault for fault in faults if fault.node == node)
        for node in link.receivers
        if any(fault.node == node for fault in faults)
    }
    return Channel(
        link.seed,
        name,
        link.delay_ticks,
        link.loss,
        link.outages,
        link.jitter,
        link.bursts,
        link.duplication or 0.0,
        ticks_per_second,
        down,
    )


def _medium(name: str, medium: MediumDescription) -> MediumPlan:
    lines = {
        name: Line(line.sender, line.payload_bytes, line.frame_bytes, line.duration_ns, bool(line.answers))
        for name, line in medium.lines.items()
    }
    return MediumPlan(
        name,
        0,
        medium.rate_bit_s,
        medium.propagation_ns,
        medium.queue_length,
        medium.queue_full,
        lines,
        None,
        medium.powers_w,
    )


class _Rows:
    """What was derived of a node's samples, by what it is."""

    def __init__(self, columns: tuple[Columns, ...], first: int, rows: FloatArray) -> None:
        self.columns = columns
        self.first = first
        self.rows = rows

    def at(self, tick: int, count: int) -> FloatArray:
        """The rows of some ticks."""
        return self.rows[tick - self.first : tick - self.first + count]

    def watches(self, window: Window) -> tuple[Watch, ...]:
        """What was watched at the samples of a window."""
        rows = self.at(window.start, len(window.samples))
        return tuple(
            Watch(part.of, part.unit, rows[:, slice(*part.span)], part.axes, part.bound, part.notice)
            for part in self.columns
            if part.quantity == "watch"
        )

    def parts(self, quantity: str) -> list[Columns]:
        """The columns of a quantity."""
        return [part for part in self.columns if part.quantity == quantity]


class StandIn:
    """What is known of a module after a run."""

    def __init__(self, node: NodeDescription, rows: _Rows) -> None:
        self.inputs = dict(node.inputs)
        self.outputs = dict(node.outputs)
        self.answers = node.answers
        self.passive = node.passive
        self.triggers = node.triggers
        self.senses = node.senses
        self.hold_ticks = node.hold_ticks
        self.watching = True
        self.watches = rows.watches


class RecordedPlantModule(PlantModule):
    """A plant module whose watched quantities stand in the bag."""

    @property
    def watching(self) -> bool:
        """What it watched was recorded."""
        return True

    def watches(self, window: Window) -> tuple[Watch, ...]:
        """What was watched."""
        assert isinstance(self.plant, RecordedPlant)
        return self.plant.recorded.watches(window)


class RecordedPlant:
    """A plant that has been simulated: its samples, and what its class said of them.

    What it calls the errors of its states are rows that hold, behind the errors themselves, the angles and rates that
    were recorded with them; so functions of errors are columns of these rows.
    """

    Parameters: ClassVar[type[Parameters]] = Parameters

    def __init__(self, node: NodeDescription, plant: PlantDescription, states: FloatArray, rows: _Rows) -> None:
        self.labels = plant.labels
        self.inputs = dict(node.inputs)
        self.modes_slice = slice(*plant.modes)
        self.recorded = rows
        self._start: FloatArray = states[0]
        errors = rows.parts("errors")
        self._width = len(plant.labels)
        self._errors = rows.rows[:, slice(*errors[0].span)] if errors else states[:, : self._width]

    def initial_state(self) -> FloatArray:
        """The first committed sample."""
        return self._start

    def errors(self, states: FloatArray, tick: int) -> FloatArray:
        """States less reference from a tick on, and behind them all that was derived."""
        place = tick - self.recorded.first
        known = self._errors[place : place + states.shape[0]]
        return np.hstack([known, self.recorded.at(tick, states.shape[0])])

    def bodies(self) -> tuple[Body, ...]:
        """Every body with its recorded angles and rates."""
        pairs = zip(self.recorded.parts("euler angles"), self.recorded.parts("rates"), strict=True)
        return tuple(Body(angles.of, partial(self._of, angles), partial(self._of, rates)) for angles, rates in pairs)

    def propagate(self, state: FloatArray, tick: int, count: int, held: FloatArray) -> FloatArray:
        """Refuse to go on."""
        raise RunError("a plant in a bag", "was asked to move", "its recorded samples only")

    def _of(self, part: Columns, errors: FloatArray) -> FloatArray:
        start, stop = part.span
        return errors[:, self._width + start : self._width + stop]


class RecordedAttitudePlant(RecordedPlant):
    """The same of a plant that has an attitude."""

    def __init__(self, node: NodeDescription, plant: PlantDescription, states: FloatArray, rows: _Rows) -> None:
        super().__init__(node, plant, states, rows)
        self.attitude_slice = slice(*(plant.attitude or (0, 0)))
        self.rate_slice = slice(*(plant.rate or (0, 0)))

    def attitude_angle(self, states: FloatArray) -> FloatArray:
        """Attitude error as one angle [rad], as it was recorded."""
        (angle,) = self.recorded.parts("attitude angle")
        angles: FloatArray = self._of(angle, states)[:, 0]
        return angles

    def euler_angles(self, states: FloatArray) -> FloatArray:
        """Attitude error of the first body as 3-2-1 Euler angles [rad], as they were recorded."""
        return self._of(self.recorded.parts("euler angles")[0], states)


def _checked(name: str, run: RunDescription, derived: Mapping[str, FloatArray], samples: int) -> FloatArray:
    """The rows of a node, one for each of its plant's samples."""
    columns = run.derived.get(name, ())
    plant = run.nodes[name].plant
    if plant is not None:
        _check_plant(name, plant, columns)
    if not columns:
        return np.empty((samples, 0))
    rows = derived.get(name, np.empty((0, 0)))[:samples]
    width = columns[-1].span[1]
    if rows.shape != (samples, width):
        raise ValueError(f"{name}: {rows.shape[0]} rows of {rows.shape[1]} derived columns, not {samples} of {width}")
    return rows


def _check_plant(name: str, plant: PlantDescription, columns: tuple[Columns, ...]) -> None:
    counts = Counter(part.quantity for part in columns)
    sizes = {part.quantity: part.span[1] - part.span[0] for part in columns}
    states = len(plant.labels)
    spans = [span for span in (plant.attitude, plant.rate, plant.modes) if span is not None]
    angles = 0 if plant.attitude is None else 1
    fits = (
        all(start <= stop <= states for start, stop in spans)
        and (plant.attitude is None) == (plant.rate is None)
        and counts["attitude angle"] == sizes.get("attitude angle", 0) == angles
        and counts["euler angles"] == counts["rates"] >= angles
        and counts["errors"] <= 1
        and sizes.get("errors", states) == states
    )
    if not fits:
        raise ValueError(f"{name}: what was derived of its samples is not what is derived of such a plant")
