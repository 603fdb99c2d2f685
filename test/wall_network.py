"""A run in real time without a wall clock: workers joined by queues, in a time that a test makes up.

Each message takes as long as ``latency`` says, each node wakes as late as ``lateness`` says. Both are functions, so
that a test can make anybody late by any time at any instant. Nothing sleeps, and a run is the same every time.
"""

from __future__ import annotations

import heapq
from collections.abc import Callable
from typing import Any

from etac_ros.graph.graph import Graph
from etac_ros.graph.ledger import Entry
from etac_ros.graph.recording import Message, Recording
from etac_ros.maths.wall_clock import WallClock
from etac_ros.parameters import FloatArray
from etac_ros.timing.wall import Effect, Halt, Overrun, WallModule, WallPlant, WallWorker
from etac_ros.timing.windows import USUAL_WINDOWS, WindowPolicy
from etac_ros.timing.worker import Commit, Offer, Send

Latency = Callable[[str, str, int], int]
"""How long a message on a topic takes to a receiver, sent at a time, all in nanoseconds."""
Lateness = Callable[[str, int], int]
"""How much later than it wants a node wakes."""

WINDOW = "window of "


class WallNetwork:
    """One run, from its first instant to its last."""

    def __init__(
        self,
        graph: Graph,
        clock: WallClock,
        latency: Latency,
        lateness: Lateness = lambda name, due: 0,
        windows: WindowPolicy = USUAL_WINDOWS,
    ) -> None:
        self.graph = graph
        self.clock = clock
        self.overruns: list[tuple[str, Overrun]] = []
        self.halts: list[tuple[str, Halt]] = []
        self.recording = Recording({name: [] for name in graph.links}, {name: [] for name in graph.plants}, wall=clock)
        self.ledgers: dict[str, list[Entry]] = {name: [] for name in graph.modules}
        self._latency, self._lateness = latency, lateness
        self._events: list[tuple[int, int, Callable[[int], None]]] = []
        self._count = 0
        self._now = 0
        self._numbers = dict.fromkeys(graph.links, 0)
        self._last: dict[tuple[str, str], int] = {}
        self._wakes: dict[str, int] = {}
        self._asleep: dict[str, tuple[int, int]] = {}
        self.workers: dict[str, WallWorker] = {
            name: WallPlant(graph, name, self._of(name), windows)
            if name in graph.plants
            else WallModule(graph, name, self._of(name))
            for name in graph.modules
        }

    def run(self) -> Recording:
        start = self.clock.start_ns - 10**8
        for name in self.workers:
            self._at(start, self._begin(name))
        while self._events:
            self._now, _, act = heapq.heappop(self._events)
            act(self._now)
        for name, worker in self.workers.items():
            self.ledgers[name] += worker.take_ledger()
        self.recording.ledgers = self.ledgers
        return self.recording

    def _begin(self, name: str) -> Callable[[int], None]:
        def begin(now: int) -> None:
            self.workers[name].begin(self.clock, now)
            self._wake_later(name)

        return begin

    def _at(self, when: int, act: Callable[[int], None]) -> None:
        self._count += 1
        heapq.heappush(self._events, (when, self._count, act))

    def _wake_later(self, name: str) -> None:
        due = self.workers[name].next_wake_ns()
        if due is None or self._wakes.get(name) == due:
            return
        self._wakes[name] = due
        due = max(due, self._now)

        def wake(now: int) -> None:
            self._wakes.pop(name, None)
            if not self._sleeps(name, now, wake):
                self.workers[name].progress(now)
                self._wake_later(name)

        late = self._lateness(name, due)
        if late:
            self._asleep[name] = (due, due + late)
        self._at(due + late, wake)

    def _sleeps(self, name: str, now: int, act: Callable[[int], None]) -> bool:
        """Whether a node sleeps: then it does nothing and takes nothing until it wakes."""
        fell, until = self._asleep.get(name, (0, 0))
        if fell <= now < until:
            self._at(until, act)
            return True
        return False

    def _deliver(self, receiver: str, topic: str, take: Callable[[int], None]) -> None:
        """In the order of sending, whatever the latencies: DDS keeps it within a topic."""
        when = max(self._now + self._latency(topic, receiver, self._now), self._last.get((topic, receiver), 0))
        self._last[topic, receiver] = when

        def deliver(now: int) -> None:
            if self._sleeps(receiver, now, deliver):
                return
            take(now)
            self.workers[receiver].progress(now)  # as the loop of a process does after each round
            self._wake_later(receiver)

        self._at(when, deliver)

    def _of(self, name: str) -> Callable[[Effect], None]:
        def emit(effect: Effect) -> None:
            match effect:
                case Send(link, value, _):
                    self._send(link, value)
                case Offer(window, _):
                    for reader in self.graph.readers[name]:
                        worker: Any = self.workers[reader]
                        self._deliver(reader, WINDOW + name, lambda now, w=worker: w.on_window(window, now))
                case Commit(first, samples):
                    self.recording.truth[name].append((first, samples))
                case Overrun():
                    self.overruns.append((name, effect))
                case Halt():
                    self.halts.append((name, effect))

        return emit

    def _send(self, link: Any, value: FloatArray) -> None:
        self._numbers[link.name] += 1
        number, sent = self._numbers[link.name], self._now
        tick = self.clock.tick_at(sent)
        self.recording.messages[link.name].append(Message(number, tick, 0, value))
        for receiver in link.receivers:
            worker: Any = self.workers[receiver]
            self._deliver(receiver, link.name, lambda now, w=worker: w.on_message(link, number, value, sent, now))
