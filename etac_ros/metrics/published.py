"""The figures of a run that stand beside published ones: which of them do, and how a recording gives them."""

from __future__ import annotations

import math
from collections.abc import Callable, Sequence
from dataclasses import replace
from functools import partial
from typing import NamedTuple

import numpy as np
import numpy.typing as npt

from etac_ros.errors import ScenarioError
from etac_ros.graph.graph import Graph
from etac_ros.graph.module import Window
from etac_ros.graph.plant import PlantModule
from etac_ros.graph.recording import Recording
from etac_ros.graph.replay import energy, held_inputs, last_sent, sent_at_triggers, trigger_ticks
from etac_ros.metrics.figures import OF_SENSORS, FigureKey, key_of
from etac_ros.modules.sensor import Sensor
from etac_ros.modules.triggering import triggering_modules
from etac_ros.parameters import FloatArray
from etac_ros.plants.plant import bodies_of, driven_of, errors_of, has_attitude
from etac_ros.plants.watch import Watch
from etac_ros.scenario.document import choice
from etac_ros.scenario.load import BEARS_NOT, Scenario
from etac_ros.scenario.schema import Measure, Published, PublishedFigure, Statistic

ATTITUDE = "attitude error"
RATE = "rate"
TORQUE = "torque"
ATTITUDE_COMPONENTS = "attitude components"
RATE_RAD_S = "rate in rad/s"
EULER_ANGLES_RAD = "Euler angles in rad"
SIGNAL = "signal"
HOLD_ERROR = "hold error"

_OF_TRIGGERS = {Statistic.COUNT, Statistic.MIN_INTERVAL, Statistic.MEAN_INTERVAL, Statistic.MAX_INTERVAL}


def stands_beside_paper(scenario: Scenario) -> str | None:
    """Why the paper's figures do not stand beside a run of a scenario; None if they do.

    They belong to the scenario, or to its variant, as it stands in its file.
    """
    changed = [key for key in scenario.overrides if key.partition(".")[0] not in BEARS_NOT]
    if not changed:
        return None
    return f"the published figures belong to the scenario as it stands in its file; here {_listed(changed)} changed"


def for_others(scenario: Scenario) -> Scenario:
    """The scenario as it is given away in a file, which does not know what was changed to make it.

    Without the paper's figures, if these do not stand beside it.
    """
    if stands_beside_paper(scenario) is None:
        return scenario
    return replace(scenario, run=scenario.run.model_copy(update={"published": Published()}))


def _listed(names: Sequence[str]) -> str:
    return f"{names[0]} is" if len(names) == 1 else f"{', '.join(names[:-1])} and {names[-1]} are"


def published_figures(scenario: Scenario, graph: Graph) -> dict[FigureKey, PublishedFigure]:
    """The paper's figures of a scenario by what they stand beside; those of nodes that are not there are left out."""
    found = {}
    for name, figure in scenario.published.items():
        node = _whose(figure)
        if node is None or node in graph.modules:
            found[_key(name, figure, graph)] = figure
    return found


def _key(name: str, figure: PublishedFigure, graph: Graph) -> FigureKey:
    node = _whose(figure)
    return key_of(figure.figure or name, node, _alike(graph, node))


def _whose(figure: PublishedFigure) -> str | None:
    return figure.node if figure.node is not None or figure.measure is None else figure.measure.node


def _alike(graph: Graph, node: str | None) -> tuple[str, ...]:
    """All nodes that have what this one has: the plants, or the modules that trigger."""
    return graph.plants if node in graph.plants else triggering_modules(graph)


def sum_of_sent(graph: Graph, recording: Recording, module: str) -> float:
    """Norms of what a module sent at its triggering instants, added up."""
    values = (message.value for message in sent_at_triggers(graph, recording, module))
    return float(sum(math.sqrt(value.dot(value)) for value in values))  # as numpy's norm does, without its questions


def watches_of_module(graph: Graph, recording: Recording, module: str) -> tuple[int, tuple[Watch, ...]]:
    """First tick and watched quantities of a module over the committed samples of its plant."""
    plant = module if module in graph.plants else graph.reads.get(module)
    if plant is None:
        return 0, ()
    first, count = recording.span(plant)
    if not count or not graph.modules[module].watching:
        return first, ()
    _, states = recording.samples(plant)
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
        rad/s``, ``Euler angles in rad`` or ``torque`` [N m] of a plant, ``attitude of BODY`` [deg] and ``rate of
        BODY`` [deg/s] where it has several, what it says of states and torque together, ``signal`` and ``hold error``
        of a sensor, or what the node watches.

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
    for name, of_torques in driven_of(plant, states, first).items():
        of_bodies[name] = partial(_under_torque, of_torques, graph, recording, node)
    if not has_attitude(plant):
        return of_bodies
    return {
        **of_bodies,
        ATTITUDE: lambda: np.degrees(plant.attitude_angle(errors))[:, np.newaxis],
        RATE: lambda: np.degrees(errors[:, plant.rate_slice]),
        ATTITUDE_COMPONENTS: lambda: errors[:, plant.attitude_slice],
        RATE_RAD_S: lambda: errors[:, plant.rate_slice],
        EULER_ANGLES_RAD: lambda: plant.euler_angles(errors),
    }


def _under_torque(
    of_torques: Callable[[FloatArray], FloatArray], graph: Graph, recording: Recording, node: str
) -> FloatArray:
    return of_torques(held_torque(graph, recording, node))


def _in_degrees(angles: Callable[[FloatArray], FloatArray], states: FloatArray) -> FloatArray:
    return np.degrees(angles(states))


def check(scenario: Scenario, graph: Graph) -> None:
    """Refuse published figures that no run of this scenario could give; pass over those that do not stand beside it.

    Raises
    ------
    ScenarioError
        Naming the figure and what there is.
    """
    unchanged = stands_beside_paper(scenario) is None
    beside: dict[FigureKey, str] = {}
    for name, figure in scenario.published.items():
        where = f"{scenario.path}: published.{name}"
        key = _key(name, figure, graph)
        if beside.setdefault(key, name) != name:
            raise ScenarioError(
                where, f"stands beside the figure '{key}', as {beside[key]} does", "one figure of the paper for each"
            )
        if unchanged:
            _check_node(figure, name, graph, where)
        node = _whose(figure)
        if figure.measure is not None and (node is None or node in graph.modules):
            check_measure(figure.measure, graph, f"{where}.measure")


def _check_node(figure: PublishedFigure, name: str, graph: Graph, where: str) -> None:
    node = _whose(figure)
    if node is not None and node not in graph.modules:
        raise ScenarioError(f"{where}.node", f"found '{node}'", choice(node, graph.modules))
    if node is None and (figure.figure or name) in OF_SENSORS and len(triggering_modules(graph)) > 1:
        raise ScenarioError(f"{where}.node", "is missing", f"one of: {', '.join(triggering_modules(graph))}")


def check_measure(wanted: Measure, graph: Graph, where: str) -> None:
    """Refuse what cannot be measured in any run of a graph.

    Raises
    ------
    ScenarioError
        Naming what there is.
    """
    node = _node(wanted, graph, where)
    if wanted.statistic in _OF_TRIGGERS or wanted.statistic is Statistic.ENERGY:
        return
    empty = Recording(
        messages={name: [] for name in graph.links},
        truth={name: [(0, graph.modules[name].state[np.newaxis])] for name in graph.plants},  # type: ignore[attr-defined]
    )
    _, watches = watches_of_module(graph, empty, node)
    known = [*(watch.name for watch in watches), *_of_plant(graph, empty, node)]
    known += [SIGNAL, HOLD_ERROR] if isinstance(graph.modules[node], Sensor) else []
    if wanted.quantity not in known:
        raise ScenarioError(f"{where}.quantity", f"found '{wanted.quantity}'", f"one of: {', '.join(known)}")


def _node(measure: Measure, graph: Graph, where: str) -> str:
    candidates = triggering_modules(graph) if measure.statistic in _OF_TRIGGERS else tuple(graph.modules)
    if measure.node is not None:
        if measure.node not in candidates:
            raise ScenarioError(f"{where}.node", f"found '{measure.node}'", choice(measure.node, candidates))
        return measure.node
    usual = triggering_modules(graph) if measure.statistic in _OF_TRIGGERS else graph.plants
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
    plant = node if node in graph.plants else graph.reads.get(node)
    # Tick by tick, unless a law with memory watches it.
    apart = plant is not None and (node in graph.plants or wanted.quantity in (SIGNAL, HOLD_ERROR))
    pieces = []
    for part in recording.parts(plant) if apart and plant is not None else (recording,):
        first, values = quantity(graph, part, node, wanted.quantity)
        values = values[max(from_tick - first, 0) : max(until_tick - first + 1, 0)]
        if values.shape[0]:
            pieces.append(_piece(wanted, values, max(from_tick, first)))
    return _of_pieces(wanted, pieces, rate) if pieces else None


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


class _Piece(NamedTuple):
    """What a part of a run says of a quantity.

    Attributes
    ----------
    first, ticks
        Its first tick, and how many there are.
    value
        The statistic of this part.
    mean
        Mean of the norms, where a mean or a deviation is wanted.
    """

    first: int
    ticks: int
    value: float
    mean: float = 0.0


_NEVER = -1.0


def _piece(wanted: Measure, values: FloatArray, first: int) -> _Piece:
    count = values.shape[0]
    match wanted.statistic:
        case Statistic.LARGEST_COMPONENT:
            return _Piece(first, count, float(np.abs(values).max()))
        case Statistic.SETTLING_TIME:
            assert wanted.bound is not None
            outside = np.flatnonzero(np.abs(values).max(axis=1) > wanted.bound)
            return _Piece(first, count, float(first + outside[-1]) if outside.size else _NEVER)
    norms = np.linalg.norm(values, axis=1)
    match wanted.statistic:
        case Statistic.LARGEST:
            return _Piece(first, count, float(norms.max()))
        case Statistic.MEAN:
            return _Piece(first, count, float(norms.mean()), float(norms.mean()))
        case Statistic.DEVIATION:
            return _Piece(first, count, float(norms.std()), float(norms.mean()))
        case _:
            return _Piece(first, count, float(norms[-1]))


def _of_pieces(wanted: Measure, pieces: Sequence[_Piece], rate: int) -> float | None:
    last = pieces[-1]
    match wanted.statistic:
        case Statistic.SETTLING_TIME:
            outside = max(piece.value for piece in pieces)
            if outside == _NEVER:
                return float(pieces[0].first / rate)
            settled = int(outside) + 1
            return None if settled == last.first + last.ticks else float(settled / rate)
        case Statistic.LARGEST | Statistic.LARGEST_COMPONENT:
            return float(np.max([piece.value for piece in pieces]))
        case Statistic.MEAN | Statistic.DEVIATION if len(pieces) > 1:
            counts = [piece.ticks for piece in pieces]
            mean = float(np.average([piece.mean for piece in pieces], weights=counts))
            if wanted.statistic is Statistic.MEAN:
                return mean
            squares = [piece.value**2 + (piece.mean - mean) ** 2 for piece in pieces]
            return float(np.sqrt(np.average(squares, weights=counts)))
        case _:
            return last.value
