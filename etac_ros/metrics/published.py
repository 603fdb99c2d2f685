"""The figures of a run that stand beside published ones: what they are called, and how a recording gives them."""

from __future__ import annotations

from collections.abc import Callable, Iterable, Mapping
from functools import partial

import numpy as np
import numpy.typing as npt

from etac_ros.errors import ScenarioError
from etac_ros.graph.graph import Graph
from etac_ros.graph.module import Window
from etac_ros.graph.plant import PlantModule
from etac_ros.graph.recording import Recording
from etac_ros.graph.replay import energy, held_inputs, last_sent, trigger_ticks
from etac_ros.modules.sensor import Sensor
from etac_ros.parameters import FloatArray
from etac_ros.plants.plant import bodies_of, errors_of, has_attitude
from etac_ros.plants.watch import Watch
from etac_ros.scenario.document import choice
from etac_ros.scenario.schema import Measure, PublishedFigure, Statistic

ATTITUDE = "attitude error"
RATE = "rate"
TORQUE = "torque"
ATTITUDE_COMPONENTS = "attitude components"
RATE_RAD_S = "rate in rad/s"
SIGNAL = "signal"
HOLD_ERROR = "hold error"

_LABELS = {
    "triggers": "triggering instants",
    "min_interval_s": "shortest interval [s]",
    "mean_interval_s": "mean interval [s]",
    "steady_mean_interval_s": "mean interval, steady [s]",
    "max_interval_s": "longest interval [s]",
    "network_messages": "network messages",
    "network_deliveries": "network deliveries",
    "network_payload_bytes": "network payload [bytes]",
    "baseline_messages": "baseline's network messages",
    "baseline_payload_bytes": "baseline's payload [bytes]",
    "message_reduction_percent": "fewer messages [%]",
    "reduction_percent": "fewer bytes [%]",
    "energy_n2m2s": "energy [N²m²s]",
    "energy_reduction_percent": "less energy [%]",
    "trigger_reduction_percent": "fewer triggers [%]",
    "baseline_more_triggers": "baseline's triggers beyond these",
    "baseline_more_energy_n2m2s": "baseline's energy beyond this [N²m²s]",
}
_OF_TRIGGERS = {Statistic.COUNT, Statistic.MIN_INTERVAL, Statistic.MEAN_INTERVAL, Statistic.MAX_INTERVAL}


_ONLY_BESIDE = (
    "min_interval_s",
    "mean_interval_s",
    "steady_mean_interval_s",
    "energy_",
    "trigger_reduction_percent",
    "baseline_more_",
)
"""Every run has them, and a table shows them where something published stands beside."""


def families(names: Iterable[str], nodes: Iterable[str]) -> dict[str, dict[str, str]]:
    """Figures that several nodes of a formation have alike.

    Parameters
    ----------
    names
        Of figures. One of a node ends in its name, with ``_`` for ``/``.
    nodes
        Full names of nodes.

    Returns
    -------
    dict
        Name without the node, to namespace, to full name of the figure; only where at least two namespaces have it.
    """
    ends = {node.replace("/", "_"): node.rpartition("/") for node in nodes}
    found: dict[tuple[str, str], dict[str, str]] = {}
    for name in names:
        for end, (namespace, _, base) in ends.items():
            if name.endswith(end):
                found.setdefault((name.removesuffix(end), base), {})[namespace] = name
    return {stem: members for (stem, _), members in found.items() if len(members) > 1}


def stands_alone(figure: str) -> bool:
    """Whether a table shows a figure although nothing published stands beside it."""
    return not figure.startswith(_ONLY_BESIDE) and figure != "network_deliveries"


def label(name: str, sensors: Iterable[str], own: str = "") -> str:
    """What a figure is called in a table.

    Parameters
    ----------
    name
        Of the figure.
    sensors
        Full names of the modules that trigger: a figure of one of several ends in its name.
    own
        What the scenario calls it; empty where it has no words of its own.
    """
    if own:
        return own
    for sensor in sensors:
        suffix = sensor.replace("/", "_")
        if name.endswith(suffix) and name.removesuffix(suffix) in _LABELS:
            return f"{_LABELS[name.removesuffix(suffix)]}, {sensor}"
    return _LABELS.get(name, name.replace("_", " "))


def watches_of_module(graph: Graph, recording: Recording, module: str) -> tuple[int, tuple[Watch, ...]]:
    """First tick and watched quantities of a module over the committed samples of its plant."""
    plant = module if module in graph.plants else graph.reads.get(module)
    if plant is None:
        return 0, ()
    first, states = recording.samples(plant)
    if not states.shape[0]:
        return first, ()
    return first, graph.modules[module].watches(Window(plant, 1, first, np.ascontiguousarray(states)))


def held_torque(graph: Graph, recording: Recording, plant: str) -> FloatArray:
    """What acts on a plant from each committed tick on [N m]: its input, or several of them side by side."""
    first, states = recording.samples(plant)
    held = held_inputs(graph, recording, plant).values()
    return np.concatenate([stairs.over(first, states.shape[0]) for stairs in held], axis=1)


def quantity(graph: Graph, recording: Recording, node: str, name: str) -> tuple[int, FloatArray]:
    """First tick and values, shape (n, m), of a quantity of a node.

    Parameters
    ----------
    node
        A plant, or a module that watches something.
    name
        ``attitude error`` [deg], ``attitude components`` (of the error, as in the state), ``rate`` [deg/s], ``rate in
        rad/s`` or ``torque`` [N m] of a plant, ``attitude of BODY`` [deg] and ``rate of BODY`` [deg/s] where it has
        several, ``signal`` and ``hold error`` of a sensor, or what the node watches.

    Raises
    ------
    KeyError
        If there is no such quantity.
    """
    first, watches = watches_of_module(graph, recording, node)
    for watch in watches:
        if watch.name == name:
            return first, watch.values
    if name == SIGNAL and node not in graph.plants:
        return _signal(graph, recording, node)
    if name == HOLD_ERROR and node not in graph.plants:
        return _hold_error(graph, recording, node)
    return first, _of_plant(graph, recording, node)[name]()


def _signal(graph: Graph, recording: Recording, node: str) -> tuple[int, FloatArray]:
    """What a sensor forms of its plant's committed samples, free of noise and filters."""
    module = graph.modules[node]
    if not isinstance(module, Sensor):
        raise KeyError(SIGNAL)
    first, states = recording.samples(graph.reads[node])
    return first, module.formed(np.ascontiguousarray(states), first)


def _hold_error(graph: Graph, recording: Recording, node: str) -> tuple[int, FloatArray]:
    """What a sensor last sent less its signal at each tick; at a triggering instant that has become zero."""
    first, signals = _signal(graph, recording, node)
    held = last_sent(graph, recording, node)
    return first, (np.nan if held is None else held.over(first, signals.shape[0])) - signals


def _of_plant(graph: Graph, recording: Recording, node: str) -> dict[str, Callable[[], FloatArray]]:
    module = graph.modules[node]
    if not isinstance(module, PlantModule):
        return {}
    plant = module.plant
    first, states = recording.samples(node)
    errors = errors_of(plant, states, first)
    of_bodies: dict[str, Callable[[], FloatArray]] = {}
    for body in bodies_of(plant):
        if body.name:
            of_bodies[f"attitude of {body.name}"] = partial(_in_degrees, body.euler_angles, errors)
            of_bodies[f"rate of {body.name}"] = partial(_in_degrees, body.rates, errors)
    of_bodies[TORQUE] = lambda: held_torque(graph, recording, node)
    if not has_attitude(plant):
        return of_bodies
    return {
        **of_bodies,
        ATTITUDE: lambda: np.degrees(plant.attitude_angle(errors))[:, np.newaxis],
        RATE: lambda: np.degrees(errors[:, plant.rate_slice]),
        ATTITUDE_COMPONENTS: lambda: errors[:, plant.attitude_slice],
        RATE_RAD_S: lambda: errors[:, plant.rate_slice],
    }


def _in_degrees(angles: Callable[[FloatArray], FloatArray], states: FloatArray) -> FloatArray:
    return np.degrees(angles(states))


def check(figures: Mapping[str, PublishedFigure], graph: Graph, file: str) -> None:
    """Refuse a figure that no run of this graph could give.

    Raises
    ------
    ScenarioError
        Naming the figure and what there is.
    """
    empty = Recording(
        messages={name: [] for name in graph.links},
        truth={name: [(0, graph.modules[name].state[np.newaxis])] for name in graph.plants},  # type: ignore[attr-defined]
    )
    for name, figure in figures.items():
        if figure.measure is None:
            continue
        where = f"{file}: published.{name}.measure"
        node = _node(figure.measure, graph, where)
        if figure.measure.statistic in _OF_TRIGGERS or figure.measure.statistic is Statistic.ENERGY:
            continue
        _, watches = watches_of_module(graph, empty, node)
        known = [*(watch.name for watch in watches), *_of_plant(graph, empty, node)]
        known += [SIGNAL, HOLD_ERROR] if isinstance(graph.modules[node], Sensor) else []
        if figure.measure.quantity not in known:
            raise ScenarioError(
                f"{where}.quantity", f"found '{figure.measure.quantity}'", f"one of: {', '.join(known)}"
            )


def _node(measure: Measure, graph: Graph, where: str) -> str:
    triggering = tuple(name for name in graph.reporters if graph.modules[name].triggers)
    candidates = triggering if measure.statistic in _OF_TRIGGERS else tuple(graph.modules)
    if measure.node is not None:
        if measure.node not in candidates:
            raise ScenarioError(f"{where}.node", f"found '{measure.node}'", choice(measure.node, candidates))
        return measure.node
    usual = triggering if measure.statistic in _OF_TRIGGERS else graph.plants
    if len(usual) != 1:
        raise ScenarioError(f"{where}.node", "is missing", f"one of: {', '.join(usual)}")
    return usual[0]


def measure(wanted: Measure, graph: Graph, recording: Recording) -> float | None:
    """A figure of a recorded run.

    Returns
    -------
    float or None
        None where the run does not have it: no interval, or never settled.
    """
    node = _node(wanted, graph, "measure")
    rate = graph.ticks_per_second
    from_tick = round(wanted.from_s * rate)
    until_tick = graph.end_tick if wanted.until_s is None else round(wanted.until_s * rate)
    if wanted.statistic in _OF_TRIGGERS:
        ticks = trigger_ticks(graph, recording, node)
        return _of_instants(wanted.statistic, ticks[(ticks >= from_tick) & (ticks <= until_tick)], rate)
    if wanted.statistic is Statistic.ENERGY:
        return energy(graph, recording, node, from_tick, until_tick)
    assert wanted.quantity is not None
    first, values = quantity(graph, recording, node, wanted.quantity)
    part = values[max(from_tick - first, 0) : until_tick - first + 1]
    return _of_values(wanted, part, max(from_tick, first), rate) if part.shape[0] else None


def _of_instants(statistic: Statistic, ticks: npt.NDArray[np.int64], rate: int) -> float | None:
    if statistic is Statistic.COUNT:
        return float(ticks.size)
    gaps = np.diff(ticks) / rate
    if not gaps.size:
        return None
    match statistic:
        case Statistic.MIN_INTERVAL:
            return float(gaps.min())
        case Statistic.MAX_INTERVAL:
            return float(gaps.max())
        case _:
            return float(gaps.mean())


def _of_values(wanted: Measure, values: FloatArray, first_tick: int, rate: int) -> float | None:
    norms = np.linalg.norm(values, axis=1)
    match wanted.statistic:
        case Statistic.LARGEST:
            return float(norms.max())
        case Statistic.LARGEST_COMPONENT:
            return float(np.abs(values).max())
        case Statistic.MEAN:
            return float(norms.mean())
        case Statistic.DEVIATION:
            return float(norms.std())
        case Statistic.FINAL:
            return float(norms[-1])
        case _:
            assert wanted.bound is not None
            outside = np.flatnonzero(np.abs(values).max(axis=1) > wanted.bound)
            if not outside.size:
                return float(first_tick / rate)
            settled = int(outside[-1]) + 1
            return None if settled == values.shape[0] else float((first_tick + settled) / rate)
