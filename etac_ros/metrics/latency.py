"""What a run in real time tells of time: latencies of topics, from sample to torque, lateness of nodes, missed ticks.

All of it comes from the ledgers of the nodes (:mod:`etac_ros.graph.ledger`), so that a report finds in the bag what the
terminal showed.
"""

from __future__ import annotations

from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass
from typing import NamedTuple

import numpy as np
from pydantic import BaseModel, ConfigDict, Field

from etac_ros.graph.graph import Graph
from etac_ros.graph.ledger import NOTHING, Entry, Event
from etac_ros.graph.recording import Recording

_MS = 1e-6
"""Nanoseconds in milliseconds."""


class Distribution(BaseModel):
    """How a quantity is spread."""

    model_config = ConfigDict(defer_build=True, extra="forbid")

    count: int
    least: float
    median: float
    p99: float = Field(description="99 % are no larger")
    most: float


class LoopLatency(BaseModel):
    """From the instant of a triggering sample to the torque that came of it, at one plant's link."""

    model_config = ConfigDict(defer_build=True, extra="forbid")

    ms: Distribution = Field(description="until the torque arrived at the plant [ms]")
    ticks: Distribution = Field(description="until the first tick at which the plant felt it")


class Punctuality(BaseModel):
    """How punctual one node was."""

    model_config = ConfigDict(defer_build=True, extra="forbid")

    wakes: Distribution | None = Field(description="how late it woke for its own acts [ms]; null if it had none")
    missed_ticks: int = Field(description="ticks that it slept through when it had to act")
    stale_acts: int = Field(description="acts on a sample that a torque had changed, since its window came late")
    starved: int = Field(description="times at which it needed a sample that had not come")

    @property
    def overruns(self) -> int:
        """All of that together: 0 for a node that real time did no harm."""
        return self.missed_ticks + self.stale_acts + self.starved


class ForeignCounts(BaseModel):
    """What went to a foreign node, and what came from it."""

    model_config = ConfigDict(defer_build=True, extra="forbid")

    asked: int = Field(description="messages that were sent to it")
    came: int = Field(description="messages that it sent while the run lasted")
    answers: bool = Field(description="whether it is one that answers each message with one on each topic")

    @property
    def fits(self) -> bool:
        """Whether it did as it should, as far as counts tell."""
        return not self.answers or self.came == self.asked


class RealTimeAccount(BaseModel):
    """What a run in real time tells of time."""

    model_config = ConfigDict(defer_build=True, extra="forbid")

    rate: float = Field(description="simulated seconds a second")
    tick_ms: float = Field(description="what a tick lasted [ms]")
    latency_ms: dict[str, Distribution] = Field(
        description="by topic: from the publisher's source timestamp until a node of etac_ros took the message [ms]"
    )
    loops: dict[str, LoopLatency] = Field(description="by the topic of the link that leads to a plant")
    nodes: dict[str, Punctuality] = Field(description="by node")
    foreign: dict[str, ForeignCounts] = Field(default={}, description="by foreign node")
    overruns: int = Field(description="missed ticks, stale acts and missing samples of all nodes")
    clock_stepped_s: float = Field(
        default=0.0, description="how far the wall clock was set while the run lasted, at the node that saw the most"
    )


class Step(NamedTuple):
    """A torque that arrived at a plant, and the triggering sample that it came of."""

    topic: str
    instant_ns: int
    """Of the sample's tick, since that of tick 0."""
    tick: int
    arrived_ns: int
    felt: int


@dataclass(frozen=True)
class _Story:
    """Ledgers by message."""

    graph: Graph
    links: Sequence[str]
    sent: Mapping[tuple[int, int], Entry]
    source_ns: Mapping[tuple[int, int], int]
    heard: Mapping[str, Sequence[tuple[int, int, int]]]
    """What was sent to each foreign node: when, place of the link, number; in the order of time."""

    def cause(self, link: int, number: int) -> tuple[int, int] | None:
        """The message that made its sender send another; None if it acted by itself, or nothing tells.

        A foreign node keeps no ledger: there it is the newest message that had been sent to it.
        """
        entry = self.sent.get((link, number))
        if entry is not None:
            return None if entry.cause == NOTHING else (entry.cause, entry.cause_sequence)
        when = self.source_ns.get((link, number))
        sender = self.graph.links[self.links[link]].sender
        before = [one for one in self.heard.get(sender, ()) if when is not None and one[0] <= when]
        return (before[-1][1], before[-1][2]) if before else None


def real_time_account(graph: Graph, recording: Recording, stepped_s: float = 0.0) -> RealTimeAccount | None:
    """What a run in real time tells of time; None of a run in simulated time.

    Parameters
    ----------
    graph, recording
        The run.
    stepped_s
        How far the wall clock was set meanwhile [s], where that is known.
    """
    wall = recording.wall
    if wall is None:
        return None
    loops: dict[str, list[Step]] = {}
    for step in loop_steps(graph, recording):
        loops.setdefault(step.topic, []).append(step)
    nodes = {name: _punctuality(entries) for name, entries in recording.ledgers.items()}
    return RealTimeAccount(
        rate=float(wall.rate),
        tick_ms=wall.tick_ns * _MS,
        latency_ms={
            topic: found
            for topic, values in latencies_ms(graph, recording).items()
            if (found := distribution(values)) is not None
        },
        loops={topic: loop for topic, steps in loops.items() if (loop := _loop(steps)) is not None},
        nodes=nodes,
        foreign={name: _foreign(graph, recording, name) for name in sorted(graph.external)},
        overruns=sum(node.overruns for node in nodes.values()),
        clock_stepped_s=stepped_s,
    )


def distribution(values: Iterable[float]) -> Distribution | None:
    """How values are spread; None where there are none."""
    found = np.sort(np.fromiter(values, dtype=np.float64))
    if not found.size:
        return None
    median, p99 = np.quantile(found, (0.5, 0.99), method="higher")
    return Distribution(
        count=found.size, least=float(found[0]), median=float(median), p99=float(p99), most=float(found[-1])
    )


def latencies_ms(graph: Graph, recording: Recording) -> dict[str, list[float]]:
    """Latencies of the messages of each topic, at each of its receivers that keeps a ledger [ms]."""
    links = list(graph.links.values())
    found: dict[str, list[float]] = {link.topic: [] for link in links}
    for entries in recording.ledgers.values():
        for entry in entries:
            if entry.event is Event.TAKEN:
                found[links[entry.link].topic].append((entry.time_ns - entry.other_ns) * _MS)
    return found


def lateness_ms(entries: Iterable[Entry]) -> list[float]:
    """How late a node woke for its own acts [ms]."""
    return [(entry.time_ns - entry.other_ns) * _MS for entry in entries if entry.event is Event.WOKEN]


def loop_steps(graph: Graph, recording: Recording) -> list[Step]:
    """Every torque that arrived at a plant of ours, with the triggering sample that it came of."""
    wall = recording.wall
    assert wall is not None
    story = _story(graph, recording)
    found = []
    for plant in graph.plants:
        for entry in recording.ledgers.get(plant, ()):
            if entry.event is not Event.TAKEN or entry.tick >= graph.end_tick:
                continue
            link, number = entry.link, entry.sequence
            seen = {(link, number)}
            while (cause := story.cause(link, number)) is not None and cause not in seen:
                link, number = cause
                seen.add(cause)
            root = story.sent.get((link, number))
            when = story.source_ns.get((link, number))
            if root is not None:
                tick = root.tick
            elif when is not None:
                tick = wall.tick_at(wall.start_ns + when)
            else:
                continue
            instant = wall.instant_ns(tick) - wall.start_ns
            topic = graph.links[story.links[entry.link]].topic
            found.append(Step(topic, instant, tick, entry.time_ns, entry.tick))
    return found


def _story(graph: Graph, recording: Recording) -> _Story:
    links = list(graph.links)
    sent: dict[tuple[int, int], Entry] = {}
    source_ns: dict[tuple[int, int], int] = {}
    for entries in recording.ledgers.values():
        for entry in entries:
            message = entry.link, entry.sequence
            if entry.event is Event.SENT:
                sent[message] = entry
                source_ns.setdefault(message, entry.time_ns)
            elif entry.event is Event.TAKEN:
                source_ns[message] = entry.other_ns
    heard: dict[str, list[tuple[int, int, int]]] = {}
    for (link, number), when in source_ns.items():
        for receiver in graph.external & graph.links[links[link]].receivers.keys():
            heard.setdefault(receiver, []).append((when, link, number))
    return _Story(graph, links, sent, source_ns, {name: sorted(some) for name, some in heard.items()})


def _loop(steps: Sequence[Step]) -> LoopLatency | None:
    ms = distribution((step.arrived_ns - step.instant_ns) * _MS for step in steps)
    ticks = distribution(float(step.felt - step.tick) for step in steps)
    return None if ms is None or ticks is None else LoopLatency(ms=ms, ticks=ticks)


def _foreign(graph: Graph, recording: Recording, name: str) -> ForeignCounts:
    asked = sum(len(recording.messages[link.name]) for link in graph.hears[name])
    came = [len(recording.messages[link.name]) for link in graph.sends[name]]
    return ForeignCounts(asked=asked, came=max(came, default=0), answers=graph.modules[name].answers)


def _punctuality(entries: Sequence[Entry]) -> Punctuality:
    events = [entry.event for entry in entries]
    return Punctuality(
        wakes=distribution(lateness_ms(entries)),
        missed_ticks=sum(entry.cause_sequence for entry in entries if entry.event is Event.WOKEN),
        stale_acts=events.count(Event.STALE),
        starved=events.count(Event.STARVED),
    )
