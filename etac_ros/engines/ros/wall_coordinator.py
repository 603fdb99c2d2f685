"""The coordinator in real time: it says when tick 0 is, watches, and ends the run; nothing waits for it."""

from __future__ import annotations

import time
from collections.abc import Callable
from typing import Any

from builtin_interfaces.msg import Time
from rclpy.context import Context
from rosgraph_msgs.msg import Clock
from std_msgs.msg import String

from etac_ros.engines.ros.convener import Convener
from etac_ros.engines.ros.coordinator import Progress
from etac_ros.engines.ros.endpoints import Spinner
from etac_ros.engines.ros.foreign import Foreign
from etac_ros.engines.ros.plan import COORDINATOR, Plan
from etac_ros.engines.ros.wall_check import mismatch
from etac_ros.engines.ros.wall_node import TimedNode
from etac_ros.errors import RunError
from etac_ros.graph.topics import ADMITTED
from etac_ros.maths.ticks import NANOSECONDS, nanoseconds
from etac_ros.timing.membership import Membership

_LEAD_NS = 3 * NANOSECONDS // 10
"""From the note that the run begins to tick 0: long enough for everybody to hear it, and for the first windows."""
_GRACE_NS = NANOSECONDS // 5
"""From the last tick to the note that the run is over: what was sent until then has come."""
_CLOCK_NS = NANOSECONDS // 100
"""How often ``/clock`` is published, while somebody listens."""
_TELL_NS = NANOSECONDS // 10
_CALM_NS = NANOSECONDS // 20
"""All counts have to fit, and nobody to have new ones, for so long: then nothing is on its way any more."""
_DRAIN_NS = 5 * NANOSECONDS
"""After so long without that, the counts do not fit for good."""


class WallCoordinatorNode(Convener, TimedNode):
    """The node that begins, watches and ends a real-time run.

    Parameters
    ----------
    plan, spinner, context
        As for :class:`~etac_ros.engines.ros.run_node.RunNode`.
    on_progress
        Told the tick now and then.
    on_begin
        Told the instant of tick 0 on the wall clock [ns], as soon as it is known.

    Attributes
    ----------
    halted
        Why a watch ended the run; empty otherwise.
    """

    def __init__(
        self,
        plan: Plan,
        spinner: Spinner,
        context: Context,
        on_progress: Progress,
        on_begin: Callable[[int], None] = lambda start_ns: None,
    ) -> None:
        Convener.__init__(self, plan, spinner, context)
        self.halted = ""
        self._on_progress = on_progress
        self._on_begin = on_begin
        self._membership = Membership(plan.faults)
        self._admitted = self.publisher(String, ADMITTED, latched=True) if plan.revived else None
        self._ended_at: int | None = None
        self._next_clock = self._next_tell = 0
        self._noted_ns = self._stopped_ns = 0
        self.foreign = Foreign(plan, self.ros_node, {}, None)
        self._hear_of_others()

    @property
    def tick(self) -> int:
        """The tick that it is, or at which the run ended."""
        if self._ended_at is not None:
            return self._ended_at
        return 0 if self.wall is None else max(0, min(self._now(), self.plan.graph.end_tick))

    def on_start(self) -> None:
        """Tick 0 is near."""
        TimedNode.on_start(self)
        assert self.wall is not None
        self._on_begin(self.wall.start_ns)
        self.began = time.perf_counter() + (self.wall.start_ns - time.time_ns()) / NANOSECONDS

    def next_wake_ns(self) -> int | None:
        """The next ``/clock``, or the end."""
        if self.wall is None or self.stop is not None:
            return None
        end = self.monotonic.instant_ns(self.plan.graph.end_tick) + _GRACE_NS
        return min(end, self._next_clock) if self._clock.heard else end

    def turn(self, calm: bool = True) -> None:
        """End the run when it is time; let all go when nothing is on its way any more."""
        if self.wall is None or self.finished:
            return
        now = time.monotonic_ns()
        self.diagnose(now)
        if self.stop is not None or self._ended_at is not None:
            self._see_off(now)
        elif now >= self.monotonic.instant_ns(self.plan.graph.end_tick) + _GRACE_NS:
            self._finish(self.plan.graph.end_tick)
        if now >= self._next_tell:
            self._next_tell = now + _TELL_NS
            self._heard = time.monotonic()  # real time goes on by itself
            self._on_progress(self.tick, {})
        if now >= self._next_clock and self._clock.heard:
            self._next_clock = now + _CLOCK_NS
            # Simulated time between ticks, too: who uses it as a clock wants it to go on evenly.
            since = max(0, now - self.monotonic.start_ns)
            end = nanoseconds(self.plan.graph.end_tick, self.plan.graph.ticks_per_second)
            simulated = min(end, int(since * self.wall.rate))
            self._clock.publish(Clock(clock=Time(sec=simulated // NANOSECONDS, nanosec=simulated % NANOSECONDS)))

    def abort(self) -> None:
        """Tell everybody that it is over."""
        if self.stop is None:
            self.end(self.fault or "aborted")
            self._stop.drain(1.0)

    def settle(self) -> None:
        """Nothing: :meth:`turn` sees to the end."""

    def _now(self) -> int:
        return self.monotonic.tick_at(time.monotonic_ns())

    def _start_content(self) -> dict[str, Any]:
        assert self.plan.wall is not None
        graph = self.plan.graph
        t0 = self._tie.ahead_ns + time.monotonic_ns() + _LEAD_NS
        return {
            **super()._start_content(),
            "t0_ns": t0,
            "ticks_per_second": graph.ticks_per_second,
            "rate": str(self.plan.wall.rate),
            "end_tick": graph.end_tick,
            "duration_s": nanoseconds(graph.end_tick, graph.ticks_per_second) / NANOSECONDS,
        }

    def _totals(self) -> dict[str, Any]:
        return {"tick": self.tick}

    def _finish(self, tick: int) -> None:
        self._ended_at = tick
        self._stopped_ns = self._noted_ns = time.monotonic_ns()
        self.end("")

    def _on_join(self, join: Any, sequence: int) -> None:
        returns = isinstance(join, dict) and join.get("run") == self.plan.run_id and join.get("incarnation")
        if not returns or self._admitted is None or self.wall is None:
            super()._on_join(join, sequence)
            return
        node, incarnation = str(join["node"]), int(join["incarnation"])
        if reason := self._membership.refuses(node, incarnation, self._now()):
            raise RunError(
                f"node {node} (process {join['pid']})", reason,
                "only processes that take the place of those that a fault of the scenario has killed",
                "give each run a domain of its own",
            )  # fmt: skip
        self._admitted.publish(self.note({"start": self.start, "nodes": self._membership.present}))

    def _on_fault(self, content: Any, sequence: int) -> None:
        if "halt" not in content:
            super()._on_fault(content, sequence)
        elif self._ended_at is None and self.stop is None:
            self.halted = f"{content['node']}: {content['halt']}"
            self._finish(content["tick"])

    def _on_leave(self, content: Any, sequence: int) -> None:
        self._noted_ns = time.monotonic_ns()
        super()._on_leave(content, sequence)

    def _see_off(self, now: int) -> None:
        tick = self._now()
        missing = [
            name
            for name in self.plan.nodes
            if name != COORDINATOR and name not in self.leave_notes and self._membership.owes(name, tick)
        ]
        if self.fault or missing:
            if now - self._stopped_ns > self.plan.quiet_s * NANOSECONDS and not self.fault:
                raise RunError(f"node {', '.join(missing)}", f"has not left within {self.plan.quiet_s:g} s")
            return
        wrong = mismatch(self.plan, self.leave_notes)
        if wrong is None and now - self._noted_ns > _CALM_NS:
            self.leave()
        elif wrong is not None and now - self._stopped_ns > _DRAIN_NS:
            raise wrong
