"""Whether the numbers in a bag are those of a run of its graph: figures rely on it, and a bag may hold anything."""

from __future__ import annotations

from pathlib import Path

import numpy as np

from etac_ros.bag.read import Bag
from etac_ros.errors import BagError
from etac_ros.graph.graph import Graph
from etac_ros.graph.recording import Recording
from etac_ros.maths.ticks import seconds
from etac_ros.parameters import FloatArray

LARGEST = 1e100
"""Beyond this, squares and sums of a figure overflow."""

_OF_ONE_RUN = "messages and samples of one run of the scenario in the bag"


def check_fit(bag: Path, found: Bag, graph: Graph, recording: Recording) -> None:
    """Compare a recording with the graph that it is said to come from.

    Raises
    ------
    BagError
        Naming the link or the plant, and what does not fit.
    """
    if found.ticks_per_second != graph.ticks_per_second:
        rates = f"{found.ticks_per_second} ticks a second, and {graph.ticks_per_second} in its scenario"
        raise BagError(f"{bag}: ticks_per_second", rates, _OF_ONE_RUN)
    for plant in graph.plants:
        if recording.every:
            _check_plant(f"{bag}: {plant}", graph, plant, recording)
    for link in graph.links.values():
        where = f"{bag}: link {link.name}"
        if link.name not in recording.messages:
            raise BagError(where, "is not in the bag", "every link of the scenario in it")
        for message in recording.messages[link.name]:
            fault = ""
            if message.value.size != link.wire.size:
                fault = f"has {message.value.size} components, not {link.wire.size}"
            elif message.tick > graph.end_tick and recording.wall is None:  # in real time who is late may send so late
                fault = f"was sent at tick {message.tick}, the run ends with tick {graph.end_tick}"
            elif message.sequence < 1:
                fault = "has no number"
            elif not _drawable(message.value):
                fault = f"carries {message.value.tolist()}"
            if fault:
                raise BagError(where, f"message {message.sequence} {fault}", _OF_ONE_RUN)


def _check_plant(where: str, graph: Graph, plant: str, recording: Recording) -> None:
    first, count = recording.span(plant)
    if count == 0:
        found = "there is not one committed sample of this plant"
        raise BagError(where, found, "a run of at least one tick", "record the run anew")
    if first != 0 or count > graph.end_tick + 1:
        last = first + count - 1
        raise BagError(where, f"samples of ticks {first} to {last}", f"samples from tick 0 to {graph.end_tick}")
    width = graph.modules[plant].state.size  # type: ignore[attr-defined]  # a PlantModule
    for part in recording.parts(plant):
        ticks, states = part.kept(plant)
        if states.shape[1] != width:
            raise BagError(where, f"samples of {states.shape[1]} states", f"samples of {width} states")
        if not _drawable(states):
            row = int(np.argmin((np.abs(states) < LARGEST).all(axis=1)))
            at = seconds(int(ticks[row]), graph.ticks_per_second)
            raise BagError(
                where,
                f"from {at:.6g} s (tick {ticks[row]}) on the state is no number that can be drawn: "
                f"{states[row].tolist()}",
                "finite numbers of a usual size",
                f"report a run that ends before: --set duration_s={at:.6g} or less",
            )


def _drawable(values: FloatArray) -> bool:
    return bool((np.abs(values) < LARGEST).all())  # what is no number is not smaller either
