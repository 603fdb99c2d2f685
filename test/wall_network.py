"""A run in real time without a wall clock: workers joined by queues, in a time that a test makes up.

Each message takes as long as ``latency`` says, each node wakes as late as ``lateness`` says. Both are functions, so
that a test can make anybody late by any time at any instant. Nothing sleeps, and a run is the same every time.

Faults kill workers, with what they have not handed over of their ledgers, and let others take their places.
"""

from __future__ import annotations

import heapq
from collections.abc import Callable, Sequence
from typing import Any

from etac_ros.graph.faults import Fault, FaultKind
from etac_ros.graph.graph import Graph
from etac_ros.graph.ledger import Entry
from etac_ros.graph.recording import Message, Recording
from etac_ros.maths.wall_clock import WallClock
from etac_ros.parameters import FloatArray
from etac_ros.timing.membership import Succession, birth_ns, births_ns, mortals, restarts_of
from etac_ros.timing.wall import Effect, Halt, Overrun, WallModule, WallPlant, WallWorker
from etac_ros.timing.windows import USUAL_WINDOWS, WindowPolicy
from etac_ros.timing.worker import Commit, Offer, Send

Latency = Callable[[str, str, int], int]
"""How long a message on a topic takes to a receiver, sent at a time, all in nanoseconds."""
Lateness = Callable[[str, int], int]
"""How much later than it wants a node wakes."""

WINDOW = "window of "
LOST_NS = 500_000_000
"""What is lost of the ledger of one that is killed: it hands it over twice a second."""


class WallNetwork:
    """One run, from its first instant to its last."""

    def __init__(
        self,
        graph: Graph,
        clock: WallClock,
        latency: Latency,
        lateness: Lateness = lambda name, due: 0,
        windows: WindowPolicy = USUAL_WINDOWS,
        faults: Sequence[Fault] = (),
        anew: Callable[[], Graph] | None = None,
        up_ns: int = 0,
    ) -> None:
        self.graph = graph
        self.clock = clock
        self._faults, self._anew, self._up_ns = tuple(faults), anew, up_ns
        self._incarnation = dict.fromkeys(graph.modules, 0)
        self._alive = dict.fromkeys(graph.modules, True)
        self._successions: dict[tuple[str, str], Succession] = {}
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
        for fault in self._faults:
            self._at(self.clock.instant_ns(fault.from_tick), self._kill(fault.node))
            if fault.kind is FaultKind.RESTART:
                self._at(birth_ns(fault, self.clock) + self._up_ns, self._revive(fault))
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

    def _kill(self, name: str) -> Callable[[int], None]:
        def kill(now: int) -> None:
            self._alive[name] = False
            handed_over = now - self.clock.start_ns - LOST_NS
            self.ledgers[name] += [one for one in self.workers[name].take_ledger() if one.time_ns < handed_over]

        return kill

    def _revive(self, fault: Fault) -> Callable[[int], None]:
        name = fault.node

        def revive(now: int) -> None:
            assert self._anew is not None
            later = [one for one in self._faults if one.node == name and one.from_tick > fault.from_tick]
            if any(one.kind is not FaultKind.STALL and self.clock.instant_ns(one.from_tick) <= now for one in later):
                return  # killed on its way
            incarnation = restarts_of(self._faults, name).index(fault) + 1
            self._incarnation[name], self._alive[name] = incarnation, True
            for key in [key for key in self._successions if key[0] == name]:
                del self._successions[key]
            for link in self.graph.sends[name]:
                self._numbers[link.name] = 0
            worker = self.workers[name] = WallModule(self._anew(), name, self._of(name), incarnation)
            plant = self.graph.reads.get(name)
            if plant is not None and name in self.graph.readers[plant]:
                shows: Any = self.workers[plant]
                shows.show_again(now)
                self._wake_later(plant)
            worker.begin(self.clock, now, fault.until_tick)
            self._wake_later(name)

        return revive

    def _number(self, receiver: str, link: Any, sequence: int, sent: int) -> int:
        """The number of a message at a receiver, as it finds it out by itself."""
        key = receiver, link.name
        if key not in self._successions:
            births = births_ns(self._faults, link.sender, self.clock)
            self._successions[key] = Succession(births, receiver in mortals(self._faults))
        number = self._successions[key].number(sequence, sent)
        assert number is not None, (receiver, link.name, sequence, sent)
        return number

    def _at(self, when: int, act: Callable[[int], None]) -> None:
        self._count += 1
        heapq.heappush(self._events, (when, self._count, act))

    def _wake_later(self, name: str) -> None:
        due = self.workers[name].next_wake_ns()
        if due is None or self._wakes.get(name) == due:
            return
        self._wakes[name] = due
        due = max(due, self._now)

        alive = self._incarnation[name]

        def wake(now: int) -> None:
            if self._incarnation[name] != alive or not self._alive[name]:
                return
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

        alive = self._incarnation[receiver]

        def deliver(now: int) -> None:
            if self._incarnation[receiver] != alive or not self._alive[receiver]:
                return  # volatile: it was sent to one that is no more
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
                        if not self._alive[reader]:
                            continue
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
        sequence, sent = self._numbers[link.name], self._now
        tick = self.clock.tick_at(sent)
        recorded = self._number("recorder", link, sequence, sent)
        self.recording.messages[link.name].append(Message(recorded, tick, 0, value))

        def take(receiver: str, worker: Any) -> Callable[[int], None]:
            def on_message(now: int) -> None:
                number = self._number(receiver, link, sequence, sent)
                assert number == recorded
                worker.on_message(link, number, value, sent, now)

            return on_message

        for receiver in link.receivers:
            if self._alive[receiver]:
                self._deliver(receiver, link.name, take(receiver, self.workers[receiver]))
