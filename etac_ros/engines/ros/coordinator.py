"""The coordinator: carries orders and reports between time master and modules, begins and ends the run."""

from __future__ import annotations

import time
from collections.abc import Callable, Mapping
from typing import Any

from builtin_interfaces.msg import Time
from rclpy.context import Context
from rosgraph_msgs.msg import Clock
from std_msgs.msg import String

from etac_ros.engines.ros.convener import Convener
from etac_ros.engines.ros.endpoints import Publisher, Spinner, Subscription
from etac_ros.engines.ros.foreign import Foreign
from etac_ros.engines.ros.messages import message_type
from etac_ros.engines.ros.module_node import PlantNode
from etac_ros.engines.ros.notes import order_note, read_report
from etac_ros.engines.ros.plan import COORDINATOR, RECORDER, Plan
from etac_ros.errors import RunError
from etac_ros.graph.graph import Link
from etac_ros.graph.topics import MESSAGE_LOG, RECORDED, go_topic, next_topic
from etac_ros.maths.ticks import NANOSECONDS, nanoseconds
from etac_ros.timing.dispatcher import Call, Command, Dispatcher, Effect, Hint
from etac_ros.timing.master import TimeMaster
from etac_ros.timing.orders import Report

_TELL_EVERY_S = 0.1  # wall time between message logs, clock ticks and progress: none of it bears on a result
_LOG_MESSAGES = 400
"""Messages after which the recorder is told of their places, however little time has passed."""
_LOGS_AHEAD = 4
"""Message logs by which a run may be ahead of its recorder. With the messages a log this stays below the depth of a
topic's history, so that a recorder that stands still for a while costs time and no message."""
_SLOW_STEP_S = 1.0
"""Wall time between steps after which windows become shorter."""

Progress = Callable[[int, Mapping[str, int]], None]


class CoordinatorNode(Convener):
    """The node that advances time.

    Parameters
    ----------
    plan, spinner, context
        As for :class:`RunNode`.
    plants
        Plants in this process; they take orders as calls.
    on_progress
        Told the tick and the triggers so far, now and then.
    """

    def __init__(
        self,
        plan: Plan,
        spinner: Spinner,
        context: Context,
        plants: Mapping[str, PlantNode],
        on_progress: Progress,
    ) -> None:
        super().__init__(plan, spinner, context)
        ahead = plan.windows_ahead
        self.master = TimeMaster(plan.graph, ahead, dict.fromkeys(plan.duties.acting, ahead.longest))
        self._dispatcher = Dispatcher(plan.graph, plan.duties, self.master, self._on_effect, self._on_step)
        self._plants = plants
        self._on_progress = on_progress
        self._told = 0.0
        self._clock_is_heard = False
        self._shown_tick = -1
        self._steps = 0
        self._stepped = 0.0
        self._logs = 0
        self._recorded = 0
        ordered = [name for name in plan.modules if plan.duties.needs_orders(name)]
        self._go: dict[str, Publisher] = {
            name: self.publisher(String, go_topic(name), (name,)) for name in ordered if name not in plants
        }
        self._message_log = self.publisher(String, MESSAGE_LOG, (RECORDER,))
        for name in plan.modules:
            if plan.duties.reports(name):
                self._hear_next(name)
        for name in plan.duties.remote_plants:
            self._hear_halt(name)
        for plant in plants.values():
            plant.on_obeyed = self._told_by(plant.name)
        self.foreign = Foreign(plan, self.ros_node, self.master.sent, self._listen_to_foreign)
        self._hear_of_others()
        self.note_subscription(RECORDED, self._on_recorded)

    def idle(self, patient: bool) -> None:
        """As :meth:`Convener.idle`; the run gets on, whoever brought that about, as long as there are steps."""
        if self._dispatcher.steps != self._steps:
            self._steps = self._dispatcher.steps
            self._heard = time.monotonic()
        super().idle(patient)

    def end(self, fault: str) -> None:
        """End the run, now that it is over or has failed; all others hear of it."""
        self._tell()
        super().end(fault)

    def abort(self) -> None:
        """Tell the recorder what is known, and everybody that it is over."""
        if self.stop is None:
            self.end(self.fault or "aborted")
            self._message_log.drain(1.0)
            self._stop.drain(1.0)

    def drained(self) -> bool:
        """Whether all other nodes have left."""
        others = [name for name in self.plan.nodes if name != COORDINATOR]
        return all(name in self.leave_notes for name in others) and self.foreign.complete()

    def leave(self) -> None:
        """All counts are in: let everybody go, and know that they have heard it before this process ends."""
        self.foreign.check_all_counted()
        super().leave()

    @property
    def tick(self) -> int:
        """The tick that is being worked on, or was last."""
        return self.master.tick

    @property
    def halted(self) -> str:
        """Why a watch ended the run; empty otherwise."""
        last = [f"{name}: {note['halted']}" for name, note in self.leave_notes.items() if note.get("halted")]
        return self.master.halted or (last[0] if last else "")

    def on_start(self) -> None:
        """Begin: the master's first orders."""
        self.began = self._told = time.perf_counter()
        self._clock_is_heard = self._clock.heard
        self._dispatcher.begin()

    def _totals(self) -> dict[str, Any]:
        orders = {name: publisher.count.messages for name, publisher in self._go.items()}
        return {"tick": self.master.tick, "sent": self.master.sent, "orders": orders, "logs": self._logs}

    def _look_after_run(self) -> None:
        self.foreign.check_present()
        if words := self.foreign.slow():
            self.say(words)
        self._go_on()

    def _blame_who_is_quiet(self) -> None:
        self.foreign.blame()
        raise RunError(
            f"node {', '.join(self._owing())}",
            f"has gone quiet at simulated time {self._seconds():.6g} s: no answer for {self.plan.quiet_s:g} s",
            "an answer to every order",
            f"is its process still there? see what it printed{self._may_be_lost()}",
        )

    def _listen_to_foreign(self, link: Link, callback: Callable[[Any, int], None], foreign: bool) -> Subscription:
        """A subscription to what a foreign node sends, or is asked, as bytes."""
        kind = message_type(link.wire)
        return self.subscription(kind, link.topic, callback, foreign=foreign, qos=link.qos)

    def _hear_next(self, module: str) -> None:
        def on_next(content: Any, sequence: int) -> None:
            self._heard = time.monotonic()
            report, tick, ahead = read_report(content)
            self._dispatcher.on_report(module, report, tick, ahead)

        self.note_subscription(next_topic(module), on_next)

    def _hear_halt(self, plant: str) -> None:
        def on_halt(content: Any, sequence: int) -> None:
            report, _, _ = read_report(content)
            self._dispatcher.on_halt(plant, report)

        self.note_subscription(next_topic(plant), on_halt)

    def _told_by(self, plant: str) -> Callable[[Report], None]:
        return lambda report: self._dispatcher.on_obeyed(plant, report)

    def _on_recorded(self, content: Any, sequence: int) -> None:
        self._heard = time.monotonic()
        self._recorded = content["log"]
        self._go_on()

    def _on_effect(self, effect: Effect) -> None:
        match effect:
            case Command(module, orders):
                self._go[module].publish(self.note([order_note(order) for order in orders]))
            case Call(plant, order):
                self._plants[plant].obey(order)
            case Hint(plant, compared):
                self._plants[plant].expect(compared)
            case _:
                self.end("")

    def _go_on(self) -> None:
        """End a pause, unless there is still a reason for it."""
        if self._logs - self._recorded < _LOGS_AHEAD and not self._is_ahead():
            self._dispatcher.resume()

    def _is_ahead(self) -> bool:
        """Whether simulated time has run ahead of the pace that was asked for."""
        pace = self.plan.pace
        return pace is not None and self._seconds() > pace * (time.perf_counter() - self.began)

    def _on_step(self) -> None:
        now = time.perf_counter()
        if now - self._stepped > _SLOW_STEP_S and self._stepped:
            self.master.shorten_windows()  # a plant that takes long for a sample: others want to hear of it sooner
        self._stepped = now
        if now - self._told > _TELL_EVERY_S or len(self.master.message_log) > _LOG_MESSAGES:
            self._tell()
        if self._clock_is_heard and self.master.tick != self._shown_tick:
            self._show_time()
        if self._is_ahead():
            self._dispatcher.pause()

    def _tell(self) -> None:
        """Message log for the recorder, clock for ROS tools, progress for people."""
        self._told = time.perf_counter()
        # Also where nothing was sent: committed samples go to the recorder, too, and must not run away from it.
        self._logs += 1
        content: dict[str, Any] = {"log": self._logs, "transits": self.master.take_message_log()}
        air = self.master.take_air_log()
        if air:
            content["air"] = {"tick": self.master.tick, "fates": air}
        self._message_log.publish(self.note(content))
        if self._logs - self._recorded >= _LOGS_AHEAD:
            self._dispatcher.pause()
        self._show_time()
        self._clock_is_heard = self._clock.heard
        self._on_progress(self.master.tick, self.master.fired)

    def _show_time(self) -> None:
        self._shown_tick = self.master.tick
        now = nanoseconds(self.master.tick, self.plan.graph.ticks_per_second)
        self._clock.publish(Clock(clock=Time(sec=now // NANOSECONDS, nanosec=now % NANOSECONDS)))

    def _owing(self) -> list[str]:
        """Who owes a report; if a plant waits for a message, those who should send it.

        Then whoever else has not reported is innocent: it waits for the window that this plant cannot open yet.
        """
        owing = self._dispatcher.owing()
        waiting = [self._plants[name].worker.waits_for() for name in owing if name in self._plants]
        senders = {self.plan.graph.links[message.link].sender for each in waiting for message in each.messages}
        behind = [RECORDER] if self._logs - self._recorded >= _LOGS_AHEAD else list(self.plan.modules)
        return sorted(senders) or owing or behind

    def _seconds(self) -> float:
        return self.master.tick / self.plan.graph.ticks_per_second
