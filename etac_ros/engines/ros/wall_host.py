"""One process of a real-time run: a loop that wakes for messages and for instants."""

from __future__ import annotations

import gc
import os
import time
from collections.abc import Callable
from typing import Any

from rclpy.context import Context

from etac_ros.engines.ros.count_check import Outcome
from etac_ros.engines.ros.endpoints import Spinner
from etac_ros.engines.ros.host import Host
from etac_ros.engines.ros.plan import COORDINATOR, RECORDER, Plan
from etac_ros.engines.ros.run_node import RunNode
from etac_ros.engines.ros.wall_coordinator import WallCoordinatorNode
from etac_ros.engines.ros.wall_node import TimedNode, WallModuleNode, WallPlantNode
from etac_ros.engines.ros.wall_recorder import WallRecorderNode
from etac_ros.engines.ros.wall_rehearsals import Rehearsals
from etac_ros.engines.ros.wall_time import be_punctual
from etac_ros.maths.ticks import NANOSECONDS

_LOOK_NS = NANOSECONDS // 20
_SHORT_NS = NANOSECONDS // 500
"""What the housekeeping of a loop takes at most, by far."""
_NEVER_NS = 2**63
_READY_NS = NANOSECONDS // 500
"""How long before an act a process with a priority is awake."""
_GATHER_S = 0.002
"""How long the recorder lets messages gather: their times come from DDS, and others need the processor more."""


class WallHost(Host):
    """As :class:`~etac_ros.engines.ros.host.Host`, in real time."""

    def _create(self, context: Context) -> None:
        only_listens = list(self._names) == [RECORDER]
        self._spinner = Spinner(context, _GATHER_S if only_listens else 0.0)
        self._timed: list[TimedNode] = []
        for name in sorted(self._names, key=lambda name: name == COORDINATOR):
            node = self._node(name, context)
            self._timed.append(node)
            self._nodes.append(node)

    def _node(self, name: str, context: Context) -> TimedNode:
        if name == COORDINATOR:
            self._wall_coordinator = WallCoordinatorNode(
                self._plan, self._spinner, context, self._on_progress, self._on_begin
            )
            self._coordinator = self._wall_coordinator
            return self._wall_coordinator
        if name == RECORDER:
            assert self._open_sink is not None
            open_sink: Any = self._open_sink
            return WallRecorderNode(self._plan, self._spinner, context, open_sink)
        kind: Callable[..., RunNode] = WallPlantNode if name in self._plan.graph.plants else WallModuleNode
        node = kind(self._plan, name, self._spinner, context)
        assert isinstance(node, TimedNode)
        return node

    def _before_threads(self) -> None:
        """Here everybody is to wake at once, and :func:`be_punctual` sees to that when the run begins."""
        self._rehearsals = Rehearsals(self._plan, self._names)
        self._rehearsals.rehearse_alone()

    def _make_ready(self) -> None:
        """It is, before DDS has threads."""

    def _take_part(self) -> None:
        assert self._plan.wall is not None
        only_listens = list(self._names) == [RECORDER]
        priority = 0 if only_listens else self._plan.wall.priority  # nobody waits for the recorder
        be_punctual(priority)
        gc.collect()
        gc.freeze()
        gc.disable()  # it would stop a loop for milliseconds, whenever it likes
        stands_ready = priority > 0 and any(isinstance(node, WallModuleNode) for node in self._timed)
        look = 0
        self._stood_ready_for = 0
        self._rehearsals.join(self._timed)
        while not all(node.finished for node in self._nodes):
            now = time.monotonic_ns()
            # Not just before an act: that can wait, the act cannot.
            if now >= look + _LOOK_NS or (now >= look and self._due_ns(now + NANOSECONDS) - now > _SHORT_NS):
                look = now + _LOOK_NS
                self._be_idle()
                self._look_around()
                if self._is_at_rest(now):
                    gc.collect(0)
                    for node in self._timed:
                        node.tell()
                now = time.monotonic_ns()
            rehearses = self._timed[0].wall is not None and self._rehearsals.rehearse_early(self._timed[0].monotonic)
            due = self._due_ns(look + _LOOK_NS)
            wake = now if rehearses else min(max(look, now + _SHORT_NS), due)
            # At most half of the time: who keeps the processor nearly all of it is held up by the kernel.
            ready = max(min(_READY_NS, (due - self._stood_ready_for) // 2), self._rehearsals.ready_ns)
            if stands_ready and 0 < due - now <= ready:
                self._stand_ready(due)
            else:
                ahead = ready if stands_ready and wake == due else 0
                self._spinner.once(max(0, wake - ahead - now) / NANOSECONDS)
            now = time.monotonic_ns()
            calm = self._due_ns(now + NANOSECONDS) - now > _SHORT_NS
            for node in self._by_urgency():
                node.turn(calm)
                if priority:
                    # Else a process with a priority keeps its processor through a whole chain of messages from node to
                    # node in it, of 2 ms, while others of the same priority are late for their acts.
                    os.sched_yield()
            self._rehearsals.over()
        for node in self._timed:
            node.finish()

    def _stand_ready(self, due: int) -> None:
        """Be awake shortly before an act, with all at hand that it needs; whoever has the same priority may go first.

        A wake-up takes 0.1 to 0.2 ms, now and then 2 where the machine is a virtual one, and an act after a sleep in
        which others have used the processor three times as long as one right after another.
        """
        self._stood_ready_for = due
        self._rehearsals.stand_ready(due)
        min(self._timed, key=_wakes).rehearse()
        while time.monotonic_ns() < due:
            os.sched_yield()

    def _by_urgency(self) -> list[TimedNode]:
        """Who is due first has its turn first: what the others do may take as long as a tick."""
        if len(self._timed) == 1:
            return self._timed
        return sorted(self._timed, key=_wakes)

    def _due_ns(self, otherwise: int) -> int:
        return min((due for node in self._timed if (due := node.next_wake_ns()) is not None), default=otherwise)

    def _is_at_rest(self, now: int) -> bool:
        return self._due_ns(now + NANOSECONDS) - now > NANOSECONDS // 100

    def _outcome(self) -> Outcome | None:
        if self._coordinator is None:
            return None
        coordinator = self._wall_coordinator
        notes = coordinator.leave_notes
        sent = {
            link.name: sum(note["sent"].get(link.topic, [0])[0] for note in notes.values())
            for link in self._plan.graph.links.values()
        }
        return Outcome(
            tick=coordinator.tick,
            halted=coordinator.halted,
            fired={},
            sent=sent,
            done={},
            leave_notes=dict(notes),
            began_s=coordinator.began,
            loop_s=coordinator.loop_s,
        )


def _wakes(node: TimedNode) -> int:
    due = node.next_wake_ns()
    return _NEVER_NS if due is None else due


def host_of(plan: Plan) -> type[Host]:
    """What a process of a run is played by."""
    return Host if plan.wall is None else WallHost
