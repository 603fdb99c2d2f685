"""The numbers behind the figures, from a graph and its recording: nothing here draws.

Times are simulated seconds. A curve is dense, one value a tick, or a staircase,
whose values hold until the next.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np
import numpy.typing as npt

from etac_ros.graph import replay
from etac_ros.graph.graph import Graph, LinkKind
from etac_ros.graph.plant import PlantModule
from etac_ros.graph.recording import Recording
from etac_ros.maths.ticks import seconds
from etac_ros.parameters import FloatArray
from etac_ros.plants.plant import Body, Plant, bodies_of, errors_of, has_attitude, modes_slice_of

_SETTLED = 2.0
"""A run has settled when its error stays within so many times the largest of the steady part."""


@dataclass(frozen=True)
class Curve:
    """Values over time.

    Attributes
    ----------
    times_s
        Shape (n,), ascending.
    values
        Shape (n, m): m curves over the same times.
    """

    times_s: FloatArray
    values: FloatArray

    def between(self, start_s: float, end_s: float) -> Curve:
        """The part within a span, ends included."""
        first, last = np.searchsorted(self.times_s, [start_s, end_s], side="left")
        if last < self.times_s.size and self.times_s[last] == end_s:
            last += 1
        return Curve(self.times_s[first:last], self.values[first:last])


def dynamics(graph: Graph, plant: str) -> Plant:
    """The plant that a plant module simulates."""
    module = graph.modules[plant]
    assert isinstance(module, PlantModule)
    return module.plant


def last_tick(graph: Graph, recording: Recording) -> int:
    """The last tick that every plant has committed."""
    return min(sum(recording.span(plant)) - 1 for plant in graph.plants)


def bodies(graph: Graph) -> dict[str, tuple[str, Body]]:
    """Every body of every plant, by the name of its row: the plant's, and its own where there are several."""
    rows = {}
    for plant in graph.plants:
        for body in bodies_of(dynamics(graph, plant)):
            rows[f"{plant}, {body.name}" if body.name else plant] = (plant, body)
    return rows


def attitude_plants(graph: Graph) -> tuple[str, ...]:
    """Names of the plants that have an attitude."""
    return tuple(plant for plant in graph.plants if has_attitude(dynamics(graph, plant)))


def attitude(graph: Graph, recording: Recording, row: str) -> Curve:
    """Attitude error of a body as 3-2-1 Euler angles [deg]."""
    plant, body = bodies(graph)[row]
    return _of_states(graph, recording, plant, lambda _, states: np.degrees(body.euler_angles(states)))


def attitude_angle(graph: Graph, recording: Recording, plant: str) -> Curve:
    """Attitude error of a plant that has one, as one angle [deg]."""
    body = dynamics(graph, plant)
    assert has_attitude(body)
    return _of_states(graph, recording, plant, lambda _, states: np.degrees(body.attitude_angle(states))[:, np.newaxis])


def rate(graph: Graph, recording: Recording, row: str) -> Curve:
    """Angular velocity error of a body [deg/s]."""
    plant, body = bodies(graph)[row]
    return _of_states(graph, recording, plant, lambda _, states: np.degrees(body.rates(states)))


def modes(graph: Graph, recording: Recording, plant: str) -> Curve:
    """Modal coordinates of a plant, in the units of its labels; no column where it has none."""
    ticks, states = recording.kept(plant)
    where = modes_slice_of(dynamics(graph, plant))
    return Curve(np.asarray(seconds(ticks, graph.ticks_per_second)), states[:, where])


def held_inputs(graph: Graph, recording: Recording, plant: str) -> dict[str, Curve]:
    """What each input port of a plant held, as a staircase from the first committed tick to the last."""
    last = sum(recording.span(plant)) - 1
    curves = {}
    for port, held in replay.held_inputs(graph, recording, plant).items():
        until = np.searchsorted(held.ticks, last, side="right")
        ticks = np.append(held.ticks[:until], last)
        values = np.concatenate([held.values[:until], held.values[until - 1 : until]])
        curves[port] = Curve(np.asarray(seconds(ticks, graph.ticks_per_second)), values)
    return curves


def energy(graph: Graph, recording: Recording, plant: str) -> Curve:
    """Integral of the squared held inputs of a plant [N^2 m^2 s] up to each of their steps; straight lines between."""
    last = sum(recording.span(plant)) - 1
    held = list(replay.held_inputs(graph, recording, plant).values())
    ticks = np.unique(np.concatenate([*(np.minimum(stairs.ticks, last) for stairs in held), [last]]))
    total = replay.energy_until(held, ticks, graph.ticks_per_second)
    return Curve(np.asarray(seconds(ticks, graph.ticks_per_second)), total[:, np.newaxis])


def instants_s(graph: Graph, recording: Recording, module: str) -> FloatArray:
    """Triggering instants of a module [s]."""
    return np.asarray(seconds(replay.trigger_ticks(graph, recording, module), graph.ticks_per_second))


def intervals(instants: FloatArray) -> Curve:
    """Inter-event times [s], each at the instant that ends it."""
    return Curve(instants[1:], np.diff(instants)[:, np.newaxis])


def cumulative_bytes(graph: Graph, recording: Recording) -> Curve:
    """Payload that the network links had carried up to each time [bytes], a staircase over the whole run."""
    rate_1_s = graph.ticks_per_second
    sizes = [
        (message.tick, link.wire.payload_bytes)
        for link in graph.links.values()
        if link.kind is LinkKind.NETWORK
        for message in recording.messages[link.name]
    ]
    sent = np.array(sorted(sizes), dtype=np.int64).reshape(-1, 2)
    ticks, places = np.unique(sent[:, 0], return_inverse=True)
    totals = np.cumsum(np.bincount(places, sent[:, 1], ticks.size))
    end = max(last_tick(graph, recording), int(ticks[-1]) if ticks.size else 0)
    start = [] if ticks.size and ticks[0] == 0 else [0]
    ticks = np.concatenate([start, ticks, [end]])
    totals = np.concatenate([np.zeros(len(start)), totals, totals[-1:] if totals.size else [0.0]])
    return Curve(np.asarray(seconds(ticks, rate_1_s)), np.asarray(totals, dtype=np.float64)[:, np.newaxis])


def transient_end_s(errors: list[Curve], steady_from_s: float) -> float | None:
    """Where the transient ends and the steady state begins, a round number of seconds.

    The steady state begins when every error stays within twice its largest of the steady part. There is none where
    an error still falls by more than that within this part, or where the run ended before it.

    Parameters
    ----------
    errors
        One curve a plant, each of one column.
    steady_from_s
        Where the part begins from which the steady figures of the summary are taken [s].

    Returns
    -------
    float or None
        None if there is no transient, or nothing else.
    """
    duration = min(float(curve.times_s[-1]) for curve in errors)
    if duration <= steady_from_s or any(_still_falls(curve, steady_from_s) for curve in errors):
        return None
    end = max(_settled_s(curve, steady_from_s) for curve in errors)
    if end <= 0.0:
        return None
    step = _round_up(duration / 20.0)
    cut = step * float(np.ceil(end / step))
    return cut if cut < duration else None


def _late(error: Curve, steady_from_s: float) -> tuple[FloatArray, int]:
    """Sizes of an error, and where the steady part of the run begins."""
    return np.abs(error.values[:, 0]), int(np.searchsorted(error.times_s, steady_from_s))


def _still_falls(error: Curve, steady_from_s: float) -> bool:
    size, late = _late(error, steady_from_s)
    middle = (late + size.size) // 2
    return middle > late and bool(size[late:middle].max() > _SETTLED * size[middle:].max())


def _settled_s(error: Curve, steady_from_s: float) -> float:
    size, late = _late(error, steady_from_s)
    outside = np.flatnonzero(size > _SETTLED * size[late:].max())
    return float(error.times_s[outside[-1]]) if outside.size else 0.0


def _round_up(value: float) -> float:
    power = 10.0 ** np.floor(np.log10(value))
    return float(power * next(factor for factor in (1.0, 2.0, 5.0, 10.0) if factor * power >= value * 0.999))


def _of_states(
    graph: Graph, recording: Recording, plant: str, values: Callable[[Plant, FloatArray], FloatArray]
) -> Curve:
    body = dynamics(graph, plant)
    ticks, states = recording.kept(plant)
    return Curve(np.asarray(seconds(ticks, graph.ticks_per_second)), values(body, errors_at(body, ticks, states)))


def errors_at(plant: Plant, ticks: npt.NDArray[np.int64], states: FloatArray) -> FloatArray:
    """States less reference at ascending ticks: one that moves is asked tick by tick where some are left out."""
    if ticks.size == 0 or ticks[-1] - ticks[0] == ticks.size - 1:
        return errors_of(plant, states, int(ticks[0]) if ticks.size else 0)
    if not hasattr(plant, "errors"):
        return errors_of(plant, states, 0)
    pairs = zip(ticks.tolist(), states, strict=True)
    return np.concatenate([errors_of(plant, state[np.newaxis], tick) for tick, state in pairs])
