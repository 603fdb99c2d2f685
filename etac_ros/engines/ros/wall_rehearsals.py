"""When a process of a real-time run rehearses tick 0: once its instant is known, and again just before it."""

from __future__ import annotations

import os
import time
from collections.abc import Mapping, Sequence

from etac_ros.engines.ros.plan import Plan
from etac_ros.engines.ros.wall_node import TimedNode, WallNode
from etac_ros.graph.graph import Link
from etac_ros.maths.ticks import NANOSECONDS
from etac_ros.maths.wall_clock import WallClock
from etac_ros.parameters import FloatArray
from etac_ros.timing.wall_rehearsal import Rehearsal

_EARLY, _LATE = 12, 2
"""Enough for the interpreter, which adapts to what it runs often; and for the processor's caches."""
_ALONE = 3
_REST_NS = NANOSECONDS // 20
"""Between the early ones and tick 0 at least: others begin later, and windows are on their way."""
_MOST_NS = NANOSECONDS // 100
"""What a rehearsal may take: where one act takes as long, caches are no matter."""
_ROUND = 4
"""So many processes with something to rehearse may share a processor: each has had its turn before tick 0."""


class Rehearsals:
    """Those of one process.

    Parameters
    ----------
    plan
        The run; without ``anew`` nothing is rehearsed, nor by a process that takes the place of a dead one.
    names
        The nodes of the process.
    """

    def __init__(self, plan: Plan, names: Sequence[str]) -> None:
        self._plan = plan
        self._players: Mapping[str, WallNode] = {}
        self._names = [name for name in names if name in plan.graph.modules]
        wanted = plan.anew is not None and plan.birth is None and self._names
        self._early = _EARLY if wanted else 0
        self._first = bool(wanted)
        self._takes_ns = 0
        self._at_hand: list[Rehearsal] = []
        self._processors: set[int] = set()

    def rehearse_alone(self) -> None:
        """Before the process has anything to do with others, to see how long it takes: the first time does not tell."""
        if not self._early:
            return
        assert self._plan.wall is not None
        clock = WallClock(0, self._plan.graph.ticks_per_second, self._plan.wall.rate)
        for _ in range(_ALONE):
            if self._run(self._rehearsal(clock)) is None:
                break
            if self._takes_ns <= _MOST_NS:
                return
        self._early = 0

    def join(self, nodes: Sequence[TimedNode]) -> None:
        """The nodes are there: from here on what is sent goes their way."""
        self._players = {node.name: node for node in nodes if isinstance(node, WallNode)}

    def rehearse_early(self, clock: WallClock) -> bool:
        """Once, if it is time for it and one is due; False if there is nothing to do.

        Parameters
        ----------
        clock
            The instants of ticks on the monotonic clock.
        """
        if not self._early:
            return False
        self._early -= 1
        room = clock.start_ns - time.monotonic_ns() > _REST_NS + _ROUND * self._takes_ns
        if not room or self._run(self._rehearsal(clock)) is None:
            self._early = 0
        elif not self._early:
            self._at_hand = [made for _ in range(_LATE) if (made := self._rehearsal(clock)) is not None]
        return True

    @property
    def ready_ns(self) -> int:
        """How long before tick 0 the process wants to be awake; 0 if there is nothing left to rehearse."""
        return 2 * _ROUND * self._takes_ns if self._at_hand else 0

    def stand_ready(self, due: int) -> None:
        """The first act is near: once more, if there is time, and on the processor on which that will be."""
        if not self._first:
            return
        if not self._processors:
            self._take_processor()
        while self._at_hand and time.monotonic_ns() < due - _ROUND * self._takes_ns:
            self._run(self._at_hand.pop())
            os.sched_yield()
        self._at_hand.clear()

    def _take_processor(self) -> None:
        """Spread those that act over the processors.

        Who wakes while others of its priority have all of them stays on that which it had, so that of four on two
        processors three shared one in most runs, and the last was late by two acts.
        """
        graph = self._plan.graph
        actors = [
            name
            for name in self._plan.modules
            if not (name in graph.plants or graph.modules[name].answers or graph.modules[name].passive)
        ]
        own = next((place for place, name in enumerate(actors) if name in self._names), None)
        if own is not None:
            self._processors = os.sched_getaffinity(0)
            os.sched_setaffinity(0, {sorted(self._processors)[own % len(self._processors)]})

    def over(self) -> None:
        """What was due has been done: after the first act the kernel says again who runs where."""
        if self._processors:
            self._first = False
            os.sched_setaffinity(0, self._processors)
            self._processors = set()

    def _rehearsal(self, clock: WallClock) -> Rehearsal | None:
        assert self._plan.anew is not None
        try:
            return Rehearsal(self._plan.anew(), self._names, clock, self._plan.windows, self._transmit)
        except Exception:
            return None

    def _run(self, rehearsal: Rehearsal | None) -> int | None:
        """How many acts there were; None where a module fails, which its own act will say."""
        began = time.thread_time_ns()  # before the run begins, others may have the processor meanwhile
        try:
            acts = None if rehearsal is None else rehearsal.run()
        except Exception:
            return None
        self._takes_ns = time.thread_time_ns() - began
        return acts

    def _transmit(self, link: Link, value: FloatArray, tick: int) -> FloatArray:
        node = self._players.get(link.sender)
        return value if node is None else node.transmit(link, value, tick)
