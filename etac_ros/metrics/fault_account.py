"""What each fault of a run cost: messages, and how far the spacecraft pointed off until all was as before."""

from __future__ import annotations

from dataclasses import replace
from typing import NamedTuple

import numpy as np
from pydantic import BaseModel, ConfigDict, Field

from etac_ros.graph.channel import Way
from etac_ros.graph.faults import Fault, FaultKind
from etac_ros.graph.graph import Graph, Link
from etac_ros.graph.ledger import Event
from etac_ros.graph.plant import PlantModule
from etac_ros.graph.recording import Recording
from etac_ros.graph.replay import deliveries, down_in_real_time
from etac_ros.maths.ticks import seconds
from etac_ros.media.frame import Outcome, landing_tick
from etac_ros.parameters import FloatArray
from etac_ros.plants.plant import errors_of, has_attitude

BEFORE = 0.1
"""The part of a run before a fault whose largest error is the band to which the error has to come back."""


class _Model(BaseModel):
    model_config = ConfigDict(defer_build=True, extra="forbid")


class Excursion(_Model):
    """The error of one plant from a fault on, until the next fault or the end of the run."""

    band_deg: float = Field(description="largest error over the tenth of the run before the fault")
    largest_deg: float = Field(description="largest error from the fault on")
    largest_at_s: float
    left_s: float | None = Field(description="when the error left the band first; null for never")
    back_s: float | None = Field(description="when it was back to stay; null if it never left, or did not come back")


class FaultAccount(_Model):
    """One fault."""

    node: str
    do: FaultKind
    at_s: float
    until_s: float | None = Field(description="when the node went on; null of a kill")
    missed: int = Field(description="messages for the node that were lost to it; of acknowledged links, frames")
    waited: int = Field(description="messages, or frames, that reached it only when it went on")
    unknown: int = Field(
        default=0,
        description="in real time: messages to and from the killed process of which its account, lost with it, says "
        "nothing",
    )
    joined_s: float | None = Field(
        default=None, description="in real time: when the process that took its place was in the run; else null"
    )
    plants: dict[str, Excursion] = Field(description="by plant; only those that have an attitude")

    @property
    def for_s(self) -> float | None:
        """How long it lasted."""
        return None if self.until_s is None else self.until_s - self.at_s


def fault_accounts(graph: Graph, recording: Recording) -> dict[str, FaultAccount]:
    """The account of each fault, in the order in which they began; none of those that a halted run did not reach."""
    ended = min(sum(recording.span(name)) for name in graph.plants)
    begun = [fault for fault in graph.faults if fault.from_tick < ended]
    found = {}
    for place, fault in enumerate(begun):
        until = begun[place + 1].from_tick if place + 1 < len(begun) else graph.end_tick + 1
        stalled = fault.kind is FaultKind.STALL
        killed = fault.kind is FaultKind.KILL
        dead = None if recording.wall is None or stalled else _death(graph, recording, fault)
        if dead is None:
            dead = _Death(sum(_arrived_during(graph, recording, link, fault) for link in graph.hears[fault.node]))
        found[fault.name] = FaultAccount(
            node=fault.node,
            do=fault.kind,
            at_s=float(seconds(fault.from_tick, graph.ticks_per_second)),
            until_s=None if killed else float(seconds(fault.until_tick, graph.ticks_per_second)),
            missed=0 if stalled else dead.affected,
            waited=dead.affected if stalled else 0,
            unknown=dead.unknown,
            joined_s=None if dead.joined is None else float(seconds(dead.joined, graph.ticks_per_second)),
            plants={
                name: _excursion(graph, recording, name, fault, max(until, fault.from_tick + 1))
                for name, module in graph.modules.items()
                if isinstance(module, PlantModule) and has_attitude(module.plant)
            },
        )
    return found


class _Death(NamedTuple):
    affected: int
    unknown: int = 0
    joined: int | None = None


def _death(graph: Graph, recording: Recording, fault: Fault) -> _Death:
    """What became of messages to and from a node of which a real process was killed, as far as anybody can tell.

    What its ledger had handed over until then is known. Of the time since, which is half a second of the wall at most,
    the bag tells what was sent, and nobody what was taken.
    """
    deaths = down_in_real_time(graph, recording, fault.node)
    place = [one.fault for one in deaths].index(fault)
    down = deaths[place].down
    alive = range(deaths[place - 1].down.stop if place else 0, fault.from_tick)
    taken = recording.taken(fault.node)
    sent = {
        (entry.link, entry.sequence) for entry in recording.ledgers.get(fault.node, ()) if entry.event is Event.SENT
    }
    places = {name: number for number, name in enumerate(graph.links)}
    missed = unknown = 0
    for known, links in ((taken.keys(), graph.hears[fault.node]), (sent, graph.sends[fault.node])):
        for link in links:
            unnoted = [m.tick for m in recording.messages[link.name] if (places[link.name], m.sequence) not in known]
            unknown += sum(tick in alive for tick in unnoted)
            missed += sum(tick in down for tick in unnoted) if link.sender != fault.node else 0
    return _Death(missed, unknown, deaths[place].joined)


def _arrived_during(graph: Graph, recording: Recording, link: Link, fault: Fault) -> int:
    """What would have arrived at the node while it was down."""
    if recording.wall is not None:  # to a process that stands still: nobody knows when it would have arrived
        return sum(fault.covers(message.tick) for message in recording.messages[link.name])
    present = replace(link, channel=replace(link.channel, down={}))
    if link.acknowledged is None:
        arrived = deliveries(graph, recording, present, fault.node)
        return sum(fault.covers(one.tick) for one in arrived)
    way = Way(present.channel, fault.node)
    landed = [
        (fate, landing_tick(fate.landed_ns, graph.ticks_per_second))
        for fate in recording.air
        if fate.link == link.name and fate.outcome is Outcome.SENT
    ]
    return sum(fault.covers(tick) for fate, at in landed for tick in way.arrivals(fate.sequence, at, fate.attempt))


def _excursion(graph: Graph, recording: Recording, plant: str, fault: Fault, until: int) -> Excursion:
    """The error from a fault on, up to a tick, which is excluded."""
    module = graph.modules[plant]
    assert isinstance(module, PlantModule)
    first, states = recording.samples(plant)
    assert has_attitude(module.plant)
    angles: FloatArray = np.degrees(module.plant.attitude_angle(errors_of(module.plant, states, first)))
    start = fault.from_tick - first
    before = max(0, start - round(BEFORE * graph.end_tick))
    band = float(angles[before : start + 1].max())
    after = angles[start : until - first]
    outside = np.flatnonzero(after > band)
    back = None
    if outside.size and outside[-1] + 1 < after.size:
        back = fault.from_tick + int(outside[-1]) + 1
    largest = int(np.argmax(after))

    def time(tick: int) -> float:
        return float(seconds(tick, graph.ticks_per_second))

    return Excursion(
        band_deg=band,
        largest_deg=float(after[largest]),
        largest_at_s=time(fault.from_tick + largest),
        left_s=time(fault.from_tick + int(outside[0])) if outside.size else None,
        back_s=None if back is None else time(back),
    )
