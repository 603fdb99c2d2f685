"""What each fault of a run cost: messages, and how far the spacecraft pointed off until all was as before."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
from pydantic import BaseModel, ConfigDict, Field

from etac_ros.graph.channel import Way
from etac_ros.graph.faults import Fault, FaultKind
from etac_ros.graph.graph import Graph, Link
from etac_ros.graph.plant import PlantModule
from etac_ros.graph.recording import Recording
from etac_ros.graph.replay import deliveries
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
        affected = sum(_arrived_during(graph, recording, link, fault) for link in graph.hears[fault.node])
        stalled = fault.kind is FaultKind.STALL
        killed = fault.kind is FaultKind.KILL
        found[fault.name] = FaultAccount(
            node=fault.node,
            do=fault.kind,
            at_s=float(seconds(fault.from_tick, graph.ticks_per_second)),
            until_s=None if killed else float(seconds(fault.until_tick, graph.ticks_per_second)),
            missed=0 if stalled else affected,
            waited=affected if stalled else 0,
            plants={
                name: _excursion(graph, recording, name, fault, max(until, fault.from_tick + 1))
                for name, module in graph.modules.items()
                if isinstance(module, PlantModule) and has_attitude(module.plant)
            },
        )
    return found


def _arrived_during(graph: Graph, recording: Recording, link: Link, fault: Fault) -> int:
    """What would have arrived at the node while it was down."""
    if recording.wall is not None:  # of real processes nobody knows when it would have arrived: at once
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
