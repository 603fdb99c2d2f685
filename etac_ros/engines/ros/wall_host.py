"""One process of a real-time run: a loop that wakes for messages and for instants."""

from __future__ import annotations

import gc
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
from etac_ros.engines.ros.wall_time import be_punctual
from etac_ros.maths.ticks import NANOSECONDS

_LOOK_NS = NANOSECONDS // 20
_SHORT_NS = NANOSECONDS // 500
"""What the housekeeping of a loop takes at most, by far."""
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
        """Nothing: here everybody is to wake at once, and :func:`be_punctual` sees to that when the run begins."""

    def _take_part(self) -> None:
        assert self._plan.wall is not None
        only_listens = list(self._names) == [RECORDER]
        be_punctual(0 if only_listens else self._plan.wall.priority)  # nobody waits for the recorder
        gc.collect()
        gc.freeze()
        gc.disable()  # it would stop a loop for milliseconds, whenever it likes
        look = 0
        while not all(node.finished for node in self._nodes):
            now = time.monotonic_ns()
            # Not just before an act: that can wait, the act cannot.
            if now >= look + _LOOK_NS or (now >= look and self._due_ns(now + NANOSECONDS) - now > _SHORT_NS):
                look = now + _LOOK_NS
                self._be_idle()
                self._look_around()
                if self._is_at_rest(now):
                    gc.collect(0)
                now = time.monotonic_ns()
            wake = min(max(look, now + _SHORT_NS), self._due_ns(look + _LOOK_NS))
            self._spinner.once(max(0, wake - now) / NANOSECONDS)
            for node in self._timed:
                node.turn()
        for node in self._timed:
            node.finish()

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


def host_of(plan: Plan) -> type[Host]:
    """What a process of a run is played by."""
    return Host if plan.wall is None else WallHost
