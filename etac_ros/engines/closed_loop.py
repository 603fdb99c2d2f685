"""A graph that is one loop of compiled formulas: nobody else could act in between, so a whole run is one kernel.

Plant, sensor, controller and actuator, joined by ideal links, in the rules of :mod:`etac_ros.timing.master`: the sensor
decides on the sample of a tick, what follows from its message takes the steps of that tick, and the plant goes on under
the torque that comes of it. The modules' formulas are those that a run by orders has, rounded to the same wires, so all
bits are the same; what is not such a graph, or comes upon what is no number or out of bounds, is run by orders.
"""

from __future__ import annotations

from collections.abc import Sequence
from typing import NamedTuple

import numpy as np

from etac_ros.graph.graph import Graph
from etac_ros.graph.module import Arrival
from etac_ros.graph.plant import PlantModule
from etac_ros.graph.recording import Message
from etac_ros.graph.spool import Spool
from etac_ros.graph.wire import WireFormat
from etac_ros.maths.finite import all_finite
from etac_ros.maths.rk4 import Answer, Criterion, Stop
from etac_ros.modules.actuator import Actuator
from etac_ros.modules.controller import Controller
from etac_ros.modules.sensor import Sensor
from etac_ros.parameters import FloatArray
from etac_ros.timing.relays import Relays

_TICKS_AT_ONCE = 1 << 15
_EVENTS_AT_ONCE = 1 << 12


class Ran(NamedTuple):
    """What a run leaves behind."""

    messages: dict[str, list[Message]]
    truth: Spool
    events: int


class ClosedLoop:
    """Runs such a graph, from tick 0 to its end.

    Parameters
    ----------
    graph
        Of which :func:`closed_loop_of` has said that it is one.
    sensor, controller, actuator, plant
        Its modules.
    links
        The three links, in the order of the loop.
    criterion, numbers
        When the sensor sends and what follows, and the numbers of both.
    """

    def __init__(
        self,
        graph: Graph,
        sensor: Sensor,
        controller: Controller,
        actuator: Actuator,
        plant: PlantModule,
        links: Sequence[str],
        criterion: Criterion,
        numbers: FloatArray,
    ) -> None:
        self._end = graph.end_tick
        self._sensor, self._controller, self._actuator, self._plant = sensor, controller, actuator, plant
        self._links = [graph.links[link] for link in links]
        self._criterion = criterion
        self._numbers = numbers
        self.sensor = sensor.context.name
        self.plant = plant.context.name
        self.links = tuple(links)

    def run(self) -> Ran | None:
        """The run; None where something is no number, or has left its bounds: that is found out by orders."""
        with np.errstate(all="ignore"):  # what is no number is named elsewhere
            first = self._first()
        if first is None:
            return None
        signal, command, torque = first
        size, held = signal.size, torque.size
        rows = [np.concatenate([[0.0], signal, command, torque])]
        state, tick = self._plant.state, 0
        truth = Spool()
        row = rows[0].size
        events = np.empty(2 + row * _EVENTS_AT_ONCE)
        while tick < self._end:
            stop = Stop(self._criterion, self._numbers, signal, events)
            count = min(_TICKS_AT_ONCE, self._end - tick)
            states = self._plant.plant.propagate_until(stop, state, tick, count, torque)  # type: ignore[attr-defined]
            begin = 0 if tick == 0 else 1
            if events[1] != 0.0 or self._plant.left_bounds(tick + begin, states[begin:]):
                return None
            happened = events[2 : 2 + row * int(events[0])].reshape(-1, row).copy()
            if len(happened):
                signal, torque = happened[-1, 1 : 1 + size].copy(), happened[-1, row - held :].copy()
                rows.append(happened)
            truth.append((tick + begin, states[begin:]))
            tick += len(states) - 1
            state = states[-1]
        table = np.vstack(rows)
        if table[-1, 0] == self._end:  # nobody acts at the end
            table = table[:-1]
        ticks = table[:, 0].astype(np.int64).tolist()
        columns = np.split(table[:, 1:], [size, row - 1 - held], axis=1)
        messages = {
            link.name: [
                Message(number, tick, step, value)
                for number, (tick, value) in enumerate(zip(ticks, np.ascontiguousarray(values), strict=True), 1)
            ]
            for step, (link, values) in enumerate(zip(self._links, columns, strict=True))
        }
        return Ran(messages, truth, len(ticks))

    def _first(self) -> tuple[FloatArray, FloatArray, FloatArray] | None:
        """What is sent at tick 0, as it always is."""
        watched = self._sensor.formed(self._plant.state[np.newaxis].copy(), 0)[0]
        signal = self._links[0].wire.rounded(watched)
        wires = [link.wire for link in self._links]
        taken = (Arrival("signal", self.links[0], signal),)
        command = wires[1].rounded(self._controller.receive(None, taken, None)["command"])
        taken = (Arrival("command", self.links[1], command),)
        torque = wires[2].rounded(self._actuator.receive(None, taken, None)["torque"])
        sound = all(map(all_finite, (watched, signal, command, torque)))
        return (signal, command, torque) if sound else None


def closed_loop_of(graph: Graph) -> ClosedLoop | None:
    """What runs a graph in one go; None where it is no such graph."""
    if not graph.all_own or graph.media or graph.acknowledged or graph.faults or len(graph.modules) != 4:
        return None
    kinds: dict[type, str] = {type(module): name for name, module in graph.modules.items()}
    if set(kinds) != {Sensor, Controller, Actuator, PlantModule}:
        return None
    names = tuple(kinds[kind] for kind in (Sensor, Controller, Actuator, PlantModule))
    sensor, controller, actuator, plant = (graph.modules[name] for name in names)
    assert isinstance(sensor, Sensor)
    assert isinstance(controller, Controller)
    assert isinstance(actuator, Actuator)
    assert isinstance(plant, PlantModule)
    if len(graph.links) != 3 or len(graph.sends[names[0]]) != 1:
        return None
    relay = Relays(graph).of((graph.sends[names[0]][0].name,))
    if relay is None or tuple(hop.module for hop in relay.hops) != names[1:] or len(relay.messages) != 3:
        return None
    stopping, law, applied = sensor.stopping, controller.formula, actuator.formula
    if stopping is None or law is None or applied is None or not plant.can_stop:
        return None
    if len(plant.inputs) != 1 or plant.held.size != actuator.outputs["torque"]:
        return None
    links = [link for link, _ in relay.messages]
    wires = [float(graph.links[link].wire.format is WireFormat.COMPACT) for link in links]
    criterion, watching = stopping
    command, parameters = law
    numbers = np.concatenate([watching, wires, applied, parameters])
    answered = criterion._replace(answer=Answer(command, watching.size))
    return ClosedLoop(graph, sensor, controller, actuator, plant, links, answered, numbers)
