"""A recording replayed: what arrived where and when, and what was held meanwhile.

The one place that turns sent messages into arrivals. Counts of deliveries, held torques, energy, and what a trigger
rule knew at a tick all come from here, so that they agree on delay, on loss, and on the end of a run.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import NamedTuple

import numpy as np
import numpy.typing as npt

from etac_ros.graph.acknowledged import Event, Taken, replayed
from etac_ros.graph.channel import Way
from etac_ros.graph.faults import Fault, FaultKind
from etac_ros.graph.graph import Graph, Link
from etac_ros.graph.held import HeldInputs
from etac_ros.graph.ledger import Event as Noted
from etac_ros.graph.module import Arrival, Arrivals
from etac_ros.graph.plant import PlantModule
from etac_ros.graph.recording import Message, Recording
from etac_ros.media.frame import landing_tick
from etac_ros.parameters import FloatArray


class Delivery(NamedTuple):
    """A message that reached a receiver: when, within the tick in which step, and what."""

    tick: int
    step: int
    message: Message


@dataclass(frozen=True)
class Staircase:
    """Values that are held until the next.

    Attributes
    ----------
    ticks
        From when on each value is held, strictly ascending, shape (n,).
    values
        Shape (n, m).
    """

    ticks: npt.NDArray[np.int64]
    values: FloatArray

    def over(self, first: int, count: int) -> FloatArray:
        """What is held at each of so many ticks, shape (count, m); not a number before the first value."""
        places = np.searchsorted(self.ticks, np.arange(first, first + count), side="right") - 1
        rows = np.full((count, self.values.shape[1]), np.nan)
        rows[places >= 0] = self.values[places[places >= 0]]
        return rows


def deliveries(graph: Graph, recording: Recording, link: Link, receiver: str) -> list[Delivery]:
    """The messages of a link that reached a receiver, in the order of their sequence numbers; each as often as it did.

    Nobody acts at the end tick or later, so what would arrive there has not arrived.
    """
    if recording.wall is not None:
        return _noted(graph, recording, link, receiver)
    if link.acknowledged is not None:
        return _taken(graph, recording, link, receiver)
    if link.is_ideal:
        sent_by = recording.messages[link.name]
        return [Delivery(sent.tick, sent.step + 1, sent) for sent in sent_by if sent.tick < graph.end_tick]
    found = []
    way = Way(link.channel, receiver)
    landed = recording.landed_ns(link.name) if link.medium else {}
    for message in recording.messages[link.name]:
        sent = message.tick
        if link.medium:
            if message.sequence not in landed:
                continue  # it is waiting, was dropped, or has collided for the last time
            sent = landing_tick(landed[message.sequence], graph.ticks_per_second)
        for arrival in way.arrivals(message.sequence, sent):
            if arrival < graph.end_tick:
                # What is late comes in the first step of its tick, whichever step it was sent in.
                found.append(Delivery(arrival, 1 if arrival > message.tick else message.step + 1, message))
    return found


def conversation(graph: Graph, recording: Recording, link: Link) -> list[Event]:
    """What happened on an acknowledged link: what was taken, and how each wait for an acknowledgement ended."""

    def make() -> list[Event]:
        sent = [(message.sequence, message.tick) for message in recording.messages[link.name]]
        return replayed(link, sent, recording.air, graph.ticks_per_second)

    return recording.remembered(link.name, make)


def _taken(graph: Graph, recording: Recording, link: Link, receiver: str) -> list[Delivery]:
    messages = {message.sequence: message for message in recording.messages[link.name]}
    found = []
    for event in conversation(graph, recording, link):
        if isinstance(event, Taken) and event.receiver == receiver and event.sequence in messages:
            message = messages[event.sequence]
            tick = landing_tick(event.at_ns, graph.ticks_per_second)
            if tick < graph.end_tick:
                found.append(Delivery(tick, 1 if tick > message.tick else message.step + 1, message))
    return found


def _noted(graph: Graph, recording: Recording, link: Link, receiver: str) -> list[Delivery]:
    """In real time nothing tells when a message arrives but the receiver's own ledger.

    Where that has not come (a foreign node keeps none, and of a killed one the end is lost), a message counts in the
    tick in which it was sent, and at a plant from the next one on. None of these has reached a node that was dead then.
    """
    dead = [death.down for death in down_in_real_time(graph, recording, receiver)]
    place = list(graph.links).index(link.name)
    taken = recording.taken(receiver)
    at_plant = int(receiver in graph.plants)
    found = []
    for message in recording.messages[link.name]:
        known = taken.get((place, message.sequence))
        if known is None and any(ticks.start <= message.tick < ticks.stop for ticks in dead):
            continue
        tick = message.tick + at_plant if known is None else known
        if tick < graph.end_tick:
            found.append(Delivery(tick, 1, message))
    return found


class Death(NamedTuple):
    """When a node of a run in real time had no process in it, by the fault that killed one."""

    fault: Fault
    down: range
    """The ticks without one; those after another fault has killed what was to take its place belong to that one."""
    joined: int | None
    """In which tick the process that took its place was in the run, which it notes down itself; None: it never was."""


def down_in_real_time(graph: Graph, recording: Recording, node: str) -> list[Death]:
    """The deaths of a node in a run in real time, in their order.

    It is down from the tick of the fault on, until another process is in the run, or dies on its way.
    """
    wall = recording.wall
    assert wall is not None
    joined = {entry.other_ns: entry.tick for entry in recording.ledgers.get(node, ()) if entry.event is Noted.JOINED}
    deadly = [fault for fault in graph.faults_of(node) if fault.kind is not FaultKind.STALL]
    found = []
    for place, fault in enumerate(deadly):
        back = joined.get(wall.instant_ns(fault.until_tick) - wall.start_ns)
        until = deadly[place + 1].from_tick if place + 1 < len(deadly) else graph.end_tick
        if back is not None and back < until:
            found.append(Death(fault, range(fault.from_tick, back + 1), back))
        else:
            found.append(Death(fault, range(fault.from_tick, until), None))
    return found


def arrivals(graph: Graph, recording: Recording, module: str) -> Mapping[tuple[int, int], Arrivals]:
    """All that arrived at a module, by tick and step in ascending order, as its ``receive`` was given it."""
    found: dict[tuple[int, int], list[Arrival]] = {}
    for link in graph.hears[module]:
        for tick, step, message in deliveries(graph, recording, link, module):
            arrival = Arrival(link.receivers[module], link.name, message.value)
            found.setdefault((tick, step), []).append(arrival)
    return {when: tuple(found[when]) for when in sorted(found)}


def arrivals_by_tick(graph: Graph, recording: Recording, module: str) -> Mapping[int, Arrivals]:
    """All that arrived at a module, by tick, in the order of its steps."""
    found: dict[int, Arrivals] = {}
    for (tick, _), some in arrivals(graph, recording, module).items():
        found[tick] = (*found.get(tick, ()), *some)
    return found


def held_inputs(graph: Graph, recording: Recording, plant: str) -> dict[str, Staircase]:
    """What each input port of a plant held, from its first committed tick on; ports in the plant's order."""
    return recording.once("held inputs", plant, lambda: _held_inputs(graph, recording, plant))


def _held_inputs(graph: Graph, recording: Recording, plant: str) -> dict[str, Staircase]:
    module = graph.modules[plant]
    assert isinstance(module, PlantModule)
    first = recording.first_tick(plant)
    hold = HeldInputs(module.inputs, [link.name for link in graph.hears[plant]])
    totals = {first: hold.total()}
    if len(module.inputs) == len(graph.hears[plant]) == 1:  # as mostly: then it holds what came last
        (link,) = graph.hears[plant]
        came = deliveries(graph, recording, link, plant)
        totals |= {tick: message.value for tick, _, message in sorted(came, key=_when)}
    else:
        for (tick, _), some in arrivals(graph, recording, plant).items():
            totals[tick] = hold.take(some)
    ticks = np.array(list(totals), dtype=np.int64)
    values = np.array(list(totals.values()))
    ends = np.cumsum(list(module.inputs.values()))[:-1]
    parts = np.split(values, ends, axis=1)
    return {port: Staircase(ticks, part) for port, part in zip(module.inputs, parts, strict=True)}


def _when(delivery: Delivery) -> tuple[int, int]:
    tick, step, _ = delivery
    return tick, step


def energy_until(held: Sequence[Staircase], ticks: npt.NDArray[np.int64], ticks_per_second: int) -> FloatArray:
    """Integral of the squared held inputs up to each of these ticks, exact since they are piecewise constant.

    In N^2 m^2 s where the inputs are torques [N m].
    """
    steps = np.unique(np.concatenate([stairs.ticks for stairs in held]))
    power = np.zeros(steps.size)
    for stairs in held:
        values = stairs.values[np.searchsorted(stairs.ticks, steps, side="right") - 1]
        power += np.einsum("ij,ij->i", values, values)
    before = np.concatenate([[0.0], np.cumsum(power[:-1] * np.diff(steps))])
    inside = np.maximum(ticks, steps[0])
    places = np.searchsorted(steps, inside, side="right") - 1
    return np.asarray((before[places] + power[places] * (inside - steps[places])) / ticks_per_second)


def energy(graph: Graph, recording: Recording, plant: str, first_tick: int, last_tick: int) -> float:
    """Integral of the squared held inputs of a plant between two ticks [N^2 m^2 s]."""
    held = list(held_inputs(graph, recording, plant).values())
    start, end = energy_until(held, np.array([first_tick, max(first_tick, last_tick)]), graph.ticks_per_second)
    return float(end - start)


def last_sent(graph: Graph, recording: Recording, module: str) -> Staircase | None:
    """The last-sent value of a module that triggers; None where it has sent nothing."""
    return recording.once("last sent", module, lambda: _last_sent(graph, recording, module))


def _last_sent(graph: Graph, recording: Recording, module: str) -> Staircase | None:
    sent = {message.tick: message.value for message in sent_at_triggers(graph, recording, module)}
    if not sent:
        return None
    return Staircase(np.array(list(sent), dtype=np.int64), np.array(list(sent.values())))


def sent_at_triggers(graph: Graph, recording: Recording, module: str) -> list[Message]:
    """What a module sent at its triggering instants: the messages of a link of the port that its trigger decides on.

    Several links of that port carry the same values at the same ticks, so one of them tells.
    """
    port = graph.modules[module].triggers
    links = [link for link in graph.sends[module] if link.port == port]
    return recording.messages[links[0].name] if links else []


def trigger_ticks(graph: Graph, recording: Recording, module: str) -> npt.NDArray[np.int64]:
    """Triggering instants of a module: the ticks at which it sent what its trigger decides on, each once."""
    ticks = {message.tick for message in sent_at_triggers(graph, recording, module)}
    return np.array(sorted(ticks), dtype=np.int64)
