"""The first tick of a process of a real-time run before its time, on modules of its own. No I/O; the time is pretended.

What is done for the first time takes several times as long: code and data are in none of the processor's caches, pages
are copied that a forked process shares with its parent, and the interpreter has not yet adapted to what it runs. At
tick 0 all modules of a formation act at once, and on few processors the last would be late by the sum of all that.
"""

from __future__ import annotations

from collections import deque
from collections.abc import Callable, Collection
from functools import partial

from etac_ros.graph.graph import Graph, Link
from etac_ros.graph.module import Window
from etac_ros.maths.wall_clock import WallClock
from etac_ros.parameters import FloatArray
from etac_ros.timing.wall import Effect, WallModule, WallPlant, WallWorker
from etac_ros.timing.windows import WindowPolicy
from etac_ros.timing.worker import Offer, Send

Transmit = Callable[[Link, FloatArray, int], FloatArray]
"""What becomes of a value between its sender and its receivers, given the tick: the same value."""


class Rehearsal:
    """Some modules at tick 0, with the messages between them. Nothing leaves it but by ``transmit``.

    Parameters
    ----------
    graph
        Built for this rehearsal and nothing else: its modules are not those of the run.
    names
        The modules; plants whose samples they see are added.
    clock
        The instants of ticks.
    policy
        How far the scenario lets plants compute ahead.
    transmit
        Is handed each value that is sent.
    """

    def __init__(
        self, graph: Graph, names: Collection[str], clock: WallClock, policy: WindowPolicy, transmit: Transmit
    ) -> None:
        self._graph = graph
        self._clock = clock
        self._transmit = transmit
        seen = {graph.reads[name] for name in names if name in graph.reads}
        there = [name for name in graph.modules if name in seen | set(names) and name not in graph.external]
        self._modules = {
            name: WallModule(graph, name, partial(self._on_effect, name)) for name in there if name not in graph.plants
        }
        self._plants = {
            name: WallPlant(graph, name, partial(self._on_effect, name), policy)
            for name in there
            if name in graph.plants
        }
        self._deliveries: deque[Callable[[], None]] = deque()
        before = clock.instant_ns(0) - 1
        for worker in self._workers:
            worker.begin(clock, before)
        self._deliver()

    @property
    def _workers(self) -> list[WallWorker]:
        return [*self._modules.values(), *self._plants.values()]

    def run(self) -> int:
        """Let all that is due at tick 0 be done; returns how many acts that were."""
        now = self._clock.instant_ns(0)
        for worker in self._workers:
            worker.progress(now)
        self._deliver()
        return sum(worker.acts for worker in self._workers)

    def _deliver(self) -> None:
        while self._deliveries:
            self._deliveries.popleft()()

    def _on_effect(self, name: str, effect: Effect) -> None:
        match effect:
            case Send(link, value, tick):
                received = self._transmit(link, value, tick)
                self._deliveries += [partial(self._hand_over, link, received, receiver) for receiver in link.receivers]
            case Offer(window, _):
                self._deliveries += [partial(self._show, window, reader) for reader in self._graph.readers[name]]
            case _:
                pass  # what is final, or would be said, of a run that is none

    def _hand_over(self, link: Link, value: FloatArray, receiver: str) -> None:
        now = self._clock.instant_ns(0)
        worker = self._modules.get(receiver) or self._plants.get(receiver)
        if worker is not None:
            worker.on_message(link, 1, value, now, now)
            worker.progress(now)

    def _show(self, window: Window, reader: str) -> None:
        if reader in self._modules:
            self._modules[reader].on_window(window, self._clock.instant_ns(0) - 1)
