"""The coordinator: carries orders and reports between time master and modules, begins and ends the run."""

from __future__ import annotations

import os
import sys
import time
from collections.abc import Callable, Mapping, Sequence
from typing import Any

from builtin_interfaces.msg import Time
from rclpy.context import Context
from rosgraph_msgs.msg import Clock
from std_msgs.msg import String

from etac_ros.engines.ros.domain import DOMAIN_VARIABLE
from etac_ros.engines.ros.endpoints import Publisher, Spinner, Subscription
from etac_ros.engines.ros.foreign import Foreign
from etac_ros.engines.ros.messages import open_note
from etac_ros.engines.ros.module_node import PlantNode
from etac_ros.engines.ros.notes import order_note, read_report
from etac_ros.engines.ros.plan import COORDINATOR, RECORDER, Plan
from etac_ros.engines.ros.run_node import RunNode
from etac_ros.errors import RunError
from etac_ros.graph.topics import (
    CLOCK,
    END,
    FAULT,
    JOIN,
    LEAVE,
    MESSAGE_LOG,
    RECORDED,
    START,
    STOP,
    go_topic,
    next_topic,
)
from etac_ros.maths.ticks import NANOSECONDS, nanoseconds
from etac_ros.timing.dispatcher import Call, Command, Dispatcher, Effect
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
_LAST_WORD_S = 2.0
"""How long the coordinator waits to know that its last word has been heard by nodes that nobody else would end."""

Progress = Callable[[int, Mapping[str, int]], None]


class CoordinatorNode(RunNode):
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
        super().__init__(plan, COORDINATOR, spinner, context)
        self.master = TimeMaster(plan.graph, plan.windows)
        self.leave_notes: dict[str, dict[str, Any]] = {}
        self.fault = ""
        self.loop_s = 0.0
        self.began = 0.0
        self._dispatcher = Dispatcher(plan.graph, plan.duties, self.master, self._on_effect, self._on_step)
        self._plants = plants
        self._on_progress = on_progress
        self._greeted: dict[str, int] = {}
        self._told = 0.0
        self._heard = time.monotonic()
        self._steps = 0
        self._stepped = 0.0
        self._logs = 0
        self._recorded = 0
        ordered = [name for name in plan.modules if plan.duties.needs_orders(name)]
        self._go: dict[str, Publisher] = {
            name: self.publisher(String, go_topic(name), (name,)) for name in ordered if name not in plants
        }
        self._message_log = self.publisher(String, MESSAGE_LOG, (RECORDER,))
        self._start = self.publisher(String, START, latched=True)
        self._stop = self.publisher(String, STOP, latched=True)
        self._end = self.publisher(String, END, latched=True)
        self._clock = self.publisher(Clock, CLOCK)
        for name in plan.modules:
            if plan.duties.reports(name):
                self._hear_next(name)
        for name in plan.duties.remote_plants:
            self._hear_halt(name)
        for plant in plants.values():
            plant.on_obeyed = self._told_by(plant.name)
        self._foreign = Foreign(plan, self.ros_node, self.master.sent, self._listen_to_foreign)
        self.subscription(String, JOIN, self._on_join, latched=True, read=open_note)
        self.note_subscription(FAULT, self._on_fault, latched=True)
        self.note_subscription(LEAVE, self._on_leave, shared=True)
        self.note_subscription(RECORDED, self._on_recorded)

    def idle(self, patient: bool) -> None:
        """Called while nothing arrives: notices who has gone quiet.

        Parameters
        ----------
        patient
            Wait without end for nodes to appear, and say for whom; they are started by hand.

        Raises
        ------
        RunError
            Naming the nodes that owe an answer.
        """
        if not self.started:
            self._begin_if_all_are_there()
            for words in self._foreign.misfits():
                print(f"{self.name}: {words}", file=sys.stderr, flush=True)
        elif self.stop is None:
            self._foreign.check_present()
            if words := self._foreign.slow():
                print(f"{self.name}: {words}", file=sys.stderr, flush=True)
        if self._dispatcher.steps != self._steps:  # the run gets on, whoever brought that about
            self._steps = self._dispatcher.steps
            self._heard = time.monotonic()
        if time.monotonic() - self._heard < self.plan.quiet_s:
            return
        self._heard = time.monotonic()
        if not self.started:
            missing = [name for name in self.plan.nodes if name not in self._greeted]
            if patient:
                print(f"{self.name}: {self._waiting_for(missing)}", file=sys.stderr, flush=True)
                return
            raise RunError(
                f"node {', '.join(missing)}",
                f"has not appeared within {self.plan.quiet_s:g} s",
                "all nodes of the scenario, started with the same parameter file",
                "start it, or see what it printed",
            )
        if self.stop is None:
            self._foreign.blame()
            raise RunError(
                f"node {', '.join(self._owing())}",
                f"has gone quiet at simulated time {self._seconds():.6g} s: no answer for {self.plan.quiet_s:g} s",
                "an answer to every order",
                "is its process still there? see what it printed",
            )
        missing = [name for name in self.plan.nodes if name not in self.leave_notes]
        raise RunError(f"node {', '.join(missing)}", f"has not left within {self.plan.quiet_s:g} s")

    def _waiting_for(self, missing: Sequence[str]) -> str:
        foreign = [] if missing else self._foreign.absent()
        domain = os.environ.get(DOMAIN_VARIABLE, "0")
        return f"in ROS domain {domain}, still waiting for {', '.join([*missing, *foreign]) or 'nobody'}"

    def excuse(self) -> None:
        """Silence counts from now on: a process of the run was stopped, or computes."""
        self._heard = time.monotonic()

    def end(self, fault: str) -> None:
        """End the run, now that it is over or has failed; all others hear of it."""
        self._tell()
        self.fault = fault
        self.loop_s = time.perf_counter() - self.began if self.began else 0.0
        orders = {name: publisher.count.messages for name, publisher in self._go.items()}
        content = {
            "tick": self.master.tick, "fault": fault, "sent": self.master.sent, "orders": orders, "logs": self._logs,
        }  # fmt: skip
        self._stop.publish(self.note(content))

    def abort(self) -> None:
        """Tell the recorder what is known, and everybody that it is over."""
        if self.stop is None:
            self.end(self.fault or "aborted")
            self._message_log.drain(1.0)
            self._stop.drain(1.0)

    def drained(self) -> bool:
        """Whether all other nodes have left."""
        others = [name for name in self.plan.nodes if name != COORDINATOR]
        return all(name in self.leave_notes for name in others) and self._foreign.complete()

    def leave(self) -> None:
        """All counts are in: let everybody go, and know that they have heard it before this process ends."""
        self._foreign.check_all_counted()
        self.leave_notes[self.name] = self.leave_note()
        self._end.publish(self.note({"tick": self.master.tick}))
        if not self.plan.token:  # else the launcher ends who has missed it; those who heard it are gone, unacknowledged
            self._end.drain(_LAST_WORD_S)
        self.finished = True

    @property
    def halted(self) -> str:
        """Why a watch ended the run; empty otherwise."""
        last = [f"{name}: {note['halted']}" for name, note in self.leave_notes.items() if note.get("halted")]
        return self.master.halted or (last[0] if last else "")

    def on_start(self) -> None:
        """Begin: the master's first orders."""
        self.began = self._told = time.perf_counter()
        self._dispatcher.begin()

    def _listen_to_foreign(
        self, kind: type, topic: str, callback: Callable[[Any, int], None], foreign: bool
    ) -> Subscription:
        """A subscription to what a foreign node sends, or is asked, as bytes."""
        return self.subscription(kind, topic, callback, raw=True, foreign=foreign)

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

    def _on_join(self, join: Any, sequence: int) -> None:
        if not isinstance(join, dict) or not {"node", "scenario", "digest", "pid"} <= join.keys():
            return
        name = join["node"]
        ours = join.get("run") == self.plan.run_id
        if not ours and self.plan.token:
            return  # this run's processes know its token: whoever else joins is none of them
        self._heard = time.monotonic()
        if name not in self.plan.nodes:
            raise RunError(
                f"node {name}", f"of scenario '{join['scenario']}' is in this ROS domain", "only this run's nodes",
                "give each run a domain of its own",
            )  # fmt: skip
        if join["digest"] != self.plan.digest:
            raise RunError(
                f"node {name}",
                f"was started with another scenario ('{join['scenario']}', {join['digest']})",
                f"'{self.plan.scenario}', {self.plan.digest}",
                "start all nodes with the file that `etac resolve` prints",
            )
        if self._greeted.setdefault(name, join["pid"]) != join["pid"]:
            raise RunError(
                f"node {name}", "is there twice in this ROS domain", "every node once",
                "give each run a domain of its own",
            )  # fmt: skip
        self._begin_if_all_are_there()

    def _begin_if_all_are_there(self) -> None:
        if len(self._greeted) == len(self.plan.nodes) and not self.started and self._foreign.fits():
            self.started = True
            self.begin_to_count()
            self._start.publish(self.note({"scenario": self.plan.scenario, "digest": self.plan.digest}))
            self.on_start()

    def _on_fault(self, content: Any, sequence: int) -> None:
        if self.stop is None and not self.fault and content["node"] != self.name:
            raise RunError(f"node {content['node']}", content["fault"])

    def _on_leave(self, content: Any, sequence: int) -> None:
        self._heard = time.monotonic()
        self.leave_notes[content["node"]] = content
        self.settle()

    def _on_recorded(self, content: Any, sequence: int) -> None:
        self._heard = time.monotonic()
        self._recorded = content["log"]
        if self._logs - self._recorded < _LOGS_AHEAD:
            self._dispatcher.resume()

    def _on_effect(self, effect: Effect) -> None:
        match effect:
            case Command(module, orders):
                self._go[module].publish(self.note([order_note(order) for order in orders]))
            case Call(plant, order):
                self._plants[plant].obey(order)
            case _:
                self.end("")

    def _on_step(self) -> None:
        now = time.perf_counter()
        if now - self._stepped > _SLOW_STEP_S and self._stepped:
            self.master.shorten_windows()  # a plant that takes long for a sample: others want to hear of it sooner
        self._stepped = now
        if now - self._told > _TELL_EVERY_S or len(self.master.message_log) > _LOG_MESSAGES:
            self._tell()

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
        now = nanoseconds(self.master.tick, self.plan.graph.ticks_per_second)
        self._clock.publish(Clock(clock=Time(sec=now // NANOSECONDS, nanosec=now % NANOSECONDS)))
        self._on_progress(self.master.tick, self.master.fired)

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
