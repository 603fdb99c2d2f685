"""What only the classes of a run can compute of its committed samples: angles, rates, and what is watched.

A run of etac_ros' own classes needs none of this: whoever reads its bag has the same classes. Where a scenario names
classes of others, these numbers are recorded beside the truth, so that nobody has to import them to look at the run.
They never cross a wire. A message has the layout of truth (:mod:`etac_ros.graph.truth`), with columns as
:class:`~etac_ros.bag.description.Columns` say, and stands in the bag before the truth that it was derived of.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np

from etac_ros.bag.description import Columns
from etac_ros.errors import RunError
from etac_ros.graph.graph import Graph
from etac_ros.graph.module import Window
from etac_ros.graph.plant import PlantModule
from etac_ros.parameters import FloatArray
from etac_ros.plants.plant import Plant, bodies_of, errors_of, has_attitude
from etac_ros.plants.watch import Watch

_Parts = list[tuple[Columns, FloatArray]]


@dataclass(frozen=True)
class Derivation:
    """What is derived of a plant's samples for one node: the plant itself, or a module that watches it.

    Attributes
    ----------
    node, plant
        Full names.
    columns
        What stands in a row.
    rows
        Computes the rows from the tick of the first sample and the samples, chunk by chunk from tick 0 on.
    """

    node: str
    plant: str
    columns: tuple[Columns, ...]
    rows: Callable[[int, FloatArray], FloatArray]


def derivations(graph: Graph) -> tuple[Derivation, ...]:
    """All that has to be recorded beside the truth of a graph.

    Parameters
    ----------
    graph
        No engine has run it, nor will: laws with memory are folded over the samples once more.

    Raises
    ------
    RunError
        If a class of the scenario fails at it.
    """
    found = []
    for name, module in graph.modules.items():
        plant = name if isinstance(module, PlantModule) else graph.reads.get(name)
        if plant is None:
            continue
        parts = _of_plant if isinstance(module, PlantModule) else _of_watcher
        state = graph.modules[plant].state[np.newaxis]  # type: ignore[attr-defined]  # a PlantModule
        columns = tuple(column for column, _ in _guarded(graph, name, parts, plant, 0, state))
        if columns:
            found.append(Derivation(name, plant, columns, _rows(graph, name, parts, plant)))
    return tuple(found)


_PartsOf = Callable[[Graph, str, str, int, FloatArray], _Parts]


def _rows(graph: Graph, node: str, parts: _PartsOf, plant: str) -> Callable[[int, FloatArray], FloatArray]:
    def rows(first: int, samples: FloatArray) -> FloatArray:
        values = [value for _, value in _guarded(graph, node, parts, plant, first, samples)]
        if parts is _of_watcher:
            graph.modules[node].advance(first + samples.shape[0] - 1, Window(plant, 1, first, samples))
        return np.hstack(values)

    return rows


def _guarded(graph: Graph, node: str, parts: _PartsOf, plant: str, first: int, samples: FloatArray) -> _Parts:
    samples = np.ascontiguousarray(samples)
    try:
        return _in_place([(c, np.asarray(v, np.float64)) for c, v in parts(graph, node, plant, first, samples)])
    except Exception as error:  # a user's class can fail in any way
        raise RunError(
            f"{node}: samples from tick {first} on",
            f"its class failed to say what they mean ({type(error).__name__}: {error})",
            "angles, rates and watched quantities, one row a sample",
        ) from error


def _of_plant(graph: Graph, node: str, plant: str, first: int, samples: FloatArray) -> _Parts:
    module = graph.modules[node]
    assert isinstance(module, PlantModule)
    dynamics: Plant = module.plant
    errors = errors_of(dynamics, samples, first)
    parts: _Parts = [(_columns("errors"), errors)] if errors is not samples else []
    if has_attitude(dynamics):
        parts.append((_columns("attitude angle", unit="rad"), dynamics.attitude_angle(errors)[:, np.newaxis]))
    for body in bodies_of(dynamics):
        parts.append((_columns("euler angles", body.name, "rad"), body.euler_angles(errors)))
        parts.append((_columns("rates", body.name, "rad/s"), body.rates(errors)))
    return parts + _watched(module.watches(Window(plant, 1, first, samples)))


def _of_watcher(graph: Graph, node: str, plant: str, first: int, samples: FloatArray) -> _Parts:
    return _watched(graph.modules[node].watches(Window(plant, 1, first, samples)))


def _watched(watches: tuple[Watch, ...]) -> _Parts:
    return [
        (
            Columns(
                quantity="watch", of=watch.name, unit=watch.unit, span=(0, 0), axes=tuple(watch.axes),
                bound=watch.bound, notice=watch.notice,
            ),
            watch.values,
        )
        for watch in watches
    ]  # fmt: skip


def _columns(quantity: str, of: str = "", unit: str = "") -> Columns:
    return Columns.model_validate({"quantity": quantity, "of": of, "unit": unit, "span": (0, 0)})


def _in_place(parts: _Parts) -> _Parts:
    """The same with the columns' places in a row."""
    placed, start = [], 0
    for column, values in parts:
        stop = start + values.shape[1]
        placed.append((column.model_copy(update={"span": (start, stop)}), values))
        start = stop
    return placed
