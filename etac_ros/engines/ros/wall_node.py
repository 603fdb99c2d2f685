"""The nodes of a real-time run: what comes in over DDS goes to a worker with its times, and what it does goes out."""

from __future__ import annotations

import time
from fractions import Fraction
from typing import Any, ClassVar

import numpy as np
from diagnostic_msgs.msg import DiagnosticArray, DiagnosticStatus, KeyValue
from rclpy.context import Context
from rclpy.impl.implementation_singleton import rclpy_implementation as _rclpy
from rclpy.impl.logging_severity import LoggingSeverity
from rclpy.serialization import serialize_message
from std_msgs.msg import Float64MultiArray, Header

from etac_ros.bag.codec import decode, encode_truth
from etac_ros.engines.ros.endpoints import Callback, Publisher, Spinner, Subscription
from etac_ros.engines.ros.messages import decode_window, encode, encode_window, message_type
from etac_ros.engines.ros.plan import COORDINATOR, RECORDER, Plan
from etac_ros.engines.ros.run_node import RunNode
from etac_ros.engines.ros.wall_time import Tie
from etac_ros.errors import RunError
from etac_ros.graph.graph import Link
from etac_ros.graph.ledger import to_rows
from etac_ros.graph.topics import ADMITTED, LEAVE, ledger_topic, truth_topic, window_topic
from etac_ros.graph.truth import MOST_SAMPLES
from etac_ros.maths.ticks import NANOSECONDS, nanoseconds
from etac_ros.maths.wall_clock import WallClock
from etac_ros.parameters import FloatArray
from etac_ros.timing.membership import Succession, births_ns
from etac_ros.timing.wall import Effect, Halt, Overrun, WallModule, WallPlant, WallWorker
from etac_ros.timing.worker import Commit, Offer, Send

_ROUNDS = 20
DIAGNOSTICS = "/diagnostics"
"""Where ROS tools expect them."""
_NOTES_NS = NANOSECONDS // 2
"""How often a node hands its ledger to the recorder; what a killed one can lose."""
_NOTES_AT_LAST_NS = 3 * _NOTES_NS // 2
"""Likewise, where there is always something due."""
_NOTHING = DiagnosticArray()
_NOTHING_RAW = serialize_message(_NOTHING)
_GRACE_NS = NANOSECONDS // 10
"""How long after the last tick a foreign node's answer still counts."""


class TimedNode(RunNode):
    """A node that knows when ticks are.

    Attributes
    ----------
    wall
        The instants of ticks on the wall clock; None before the run begins.
    """

    hear_leave: ClassVar[tuple[str, ...]] = (COORDINATOR,)
    wall: WallClock | None = None

    def __init__(self, plan: Plan, name: str, spinner: Spinner, context: Context) -> None:
        self._successions: dict[str, Succession] = {}
        super().__init__(plan, name, spinner, context)
        self._tie = Tie()
        self._diagnostics = self.ros_node.create_publisher(DiagnosticArray, DIAGNOSTICS, 10)
        self._diagnosed_ns = 0
        self._foreign_ends: list[Subscription] = []
        self._last_words: dict[str, Any] = {}
        if plan.birth is not None:
            self.note_subscription(ADMITTED, self._on_admitted, latched=True)

    def subscription(self, kind: type, topic: str, callback: Callback, **how: Any) -> Subscription:
        """A subscription of this node; where processes die and others come, it knows one from the other."""
        subscription = super().subscription(kind, topic, callback, **how)
        if self.plan.mortals and not (how.get("latched") or how.get("shared") or how.get("foreign")):
            late = self.plan.birth is not None or self.name in self.plan.mortals
            clock = None if self.plan.birth is None else self.plan.birth.clock
            births = () if clock is None else births_ns(self.plan.faults, self.plan.sender_of(topic), clock)
            subscription.succession = self._successions[topic] = Succession(births, late)
        return subscription

    def next_wake_ns(self) -> int | None:
        """When there is something to do unasked, on the monotonic clock [ns]; None if there is nothing."""
        return None

    def turn(self, calm: bool = True) -> None:
        """The loop has come round: do what is due.

        Parameters
        ----------
        calm
            Whether nothing of this process is due soon, so that what can wait need not.
        """

    def rehearse(self) -> None:
        """It is to act in a moment: have at hand what that takes."""

    def tell(self) -> None:
        """Nothing is due soon: say what there is to say."""

    def finish(self) -> None:
        """The process is about to end, whichever way it was told to."""
        self.tell()

    def on_start(self) -> None:
        """Take over the instants of ticks."""
        content = self.start
        self.wall = WallClock(int(content["t0_ns"]), int(content["ticks_per_second"]), Fraction(content["rate"]))
        for topic, succession in self._successions.items():
            succession.births_ns = births_ns(self.plan.faults, self.plan.sender_of(topic), self.wall)
        until = self.wall.instant_ns(self.plan.graph.end_tick) + _GRACE_NS
        for subscription in self._foreign_ends:
            subscription.period = (self.wall.start_ns, until)

    def settle(self) -> None:
        """After the end: tell the coordinator the counts whenever they have changed; it knows when all fit."""
        if self.stop is None or self.finished or not self.started:
            return
        words = self.leave_note()
        told: dict[str, Any] = {key: words[key] for key in ("heard", "received") if key in words}
        told["sent"] = {topic: count for topic, count in words["sent"].items() if topic != LEAVE}
        if told != self._last_words:
            self._last_words = told
            self.has_left = True
            self._leaving.publish(self.note(words))

    def diagnose(self, now_ns: int) -> None:
        """Tell who listens how this node is, once a second."""
        if now_ns - self._diagnosed_ns < NANOSECONDS or not self._diagnostics.get_subscription_count():
            return
        self._diagnosed_ns = now_ns
        level, words, values = self._health()
        status = DiagnosticStatus(
            level=level,
            name=f"etac_ros: {self.name}",
            message=words,
            hardware_id=self.plan.scenario,
            values=[KeyValue(key=key, value=value) for key, value in values.items()],
        )
        header = Header(stamp=self.ros_node.get_clock().now().to_msg())
        self._diagnostics.publish(DiagnosticArray(header=header, status=[status]))

    def _health(self) -> tuple[bytes, str, dict[str, str]]:
        """Level, message and values of a diagnostic."""
        words = "waits for the others" if self.wall is None else "runs" if self.stop is None else "has ended"
        return DiagnosticStatus.OK, words, {}

    @property
    def monotonic(self) -> WallClock:
        """The instants of ticks on the monotonic clock of this machine."""
        assert self.wall is not None
        return self._tie.monotonic(self.wall)

    def leave_note(self) -> dict[str, Any]:
        """The counts, and how far somebody has set the wall clock meanwhile."""
        words = {**super().leave_note(), "stepped_s": self._tie.stepped_s()}
        if self.plan.mortals:
            words["incarnation"] = self._incarnation
            words["spans"] = {topic: succession.noted() for topic, succession in self._successions.items()}
        return words

    @property
    def _incarnation(self) -> int:
        return 0 if self.plan.birth is None else self.plan.birth.incarnation

    def _on_start(self, content: Any, sequence: int) -> None:
        if self.started:
            return
        if "t0_ns" not in content:
            raise RunError(
                f"node {self.name}",
                f"runs in real time, and {COORDINATOR} has begun a run in simulated time",
                "the same time for all nodes",
                "start all nodes with the same --clock",
            )
        if self.plan.birth is None:
            super()._on_start(content, sequence)
        # Who comes later is told when it is let in: it has heard this, and the coordinator has not heard of it yet.

    def _on_admitted(self, content: Any, sequence: int) -> None:
        if content["nodes"].get(self.name) == self._incarnation:
            super()._on_start(content["start"], sequence)

    def _listen(self, link: Link, callback: Any) -> Subscription:
        foreign = link.sender in self.plan.graph.external
        subscription = self.subscription(message_type(link.wire), link.topic, callback, foreign=foreign, qos=link.qos)
        if foreign:
            self._foreign_ends.append(subscription)
        return subscription


class WallNode(TimedNode):
    """A module or a plant in real time.

    Parameters
    ----------
    plan, name, spinner, context
        As for :class:`~etac_ros.engines.ros.run_node.RunNode`.
    """

    worker: WallWorker

    def __init__(self, plan: Plan, name: str, spinner: Spinner, context: Context) -> None:
        super().__init__(plan, name, spinner, context)
        self._outgoing: dict[str, Publisher] = {}
        for link in plan.graph.sends[name]:
            own, foreign = plan.listeners(link)
            self._outgoing[link.name] = self.publisher(message_type(link.wire), link.topic, own, foreign, qos=link.qos)
        self._incoming = {link.name: self._hear(link) for link in plan.graph.hears[name]}
        self._ledger = self.publisher(Float64MultiArray, ledger_topic(name), (RECORDER,))
        self._noted_ns = 0
        self._told_overrun = False
        self._to_tell = ""

    def on_start(self) -> None:
        """Begin to act at the instants of ticks."""
        super().on_start()
        self._warm_up()
        self._noted_ns = time.monotonic_ns()
        birth = self.plan.birth
        since = None if birth is None else birth.fault.until_tick
        self.worker.begin(self.monotonic, time.monotonic_ns(), since)

    def _warm_up(self) -> None:
        """Go through what every message costs, before tick 0: the first time takes several times as long."""
        graph = self.plan.graph
        for link in (*graph.sends[self.name], *graph.hears[self.name]):
            for _ in range(_ROUNDS):
                decode(link.wire.type_name, encode(link.wire, np.zeros(link.wire.size), 0))

    def rehearse(self) -> None:
        """Go through what sending costs once more: after a sleep nothing of it is at hand."""
        for link in self.plan.graph.sends[self.name]:
            encode(link.wire, np.zeros(link.wire.size), 0)
        if not self._diagnostics.get_subscription_count():
            self._diagnostics.publish(_NOTHING)  # heard by nobody, but the same way through DDS

    def transmit(self, link: Link, value: FloatArray, tick: int) -> FloatArray:
        """In a rehearsal: all that becomes of a value that this node sends, but that anybody hears it."""
        data = encode(link.wire, value, nanoseconds(tick, self.plan.graph.ticks_per_second))
        if not self._diagnostics.get_subscription_count():
            self._diagnostics.handle.publish_raw(_NOTHING_RAW)
        return decode(link.wire.type_name, data)

    def next_wake_ns(self) -> int | None:
        """As the worker says."""
        return None if self.stop is not None else self.worker.next_wake_ns()

    def turn(self, calm: bool = True) -> None:
        """Do what is due, and hand over the ledger now and then."""
        now = time.monotonic_ns()
        if self.stop is None:
            self.worker.progress(now)
        self.diagnose(now)
        if self.stop is not None or now - self._noted_ns > (_NOTES_NS if calm else _NOTES_AT_LAST_NS):
            self._hand_over_ledger(now)
            self.settle()

    def _health(self) -> tuple[bytes, str, dict[str, str]]:
        level, words, values = super()._health()
        worker = self.worker
        if worker.missed:
            level, words = DiagnosticStatus.WARN, f"{words}; was too late {worker.missed} times"
        for link, publisher in self._outgoing.items():
            values[f"sent on {publisher.topic}"] = str(publisher.count.messages)
            if link in worker.last_sent:
                values[f"last on {publisher.topic} [s of simulated time]"] = (
                    f"{self._simulated_s(worker.last_sent[link]):.6g}"
                )
        for link, end in self._incoming.items():
            values[f"taken from {end.topic}"] = str(end.count.messages)
            if link in worker.last_taken:
                values[f"last from {end.topic} [s of simulated time]"] = (
                    f"{self._simulated_s(worker.last_taken[link]):.6g}"
                )
        if worker.acts:
            values["own acts"] = str(worker.acts)
            values["latest act was late by [ms]"] = f"{worker.late_ns / 1e6:.3f}"
            values["most late [ms]"] = f"{worker.most_late_ns / 1e6:.3f}"
        values["too late"] = str(worker.missed)
        return level, words, values

    def _simulated_s(self, tick: int) -> float:
        return tick / self.plan.graph.ticks_per_second

    def leave_note(self) -> dict[str, Any]:
        """The counts of what was sent and heard."""
        heard = {link: end.count.messages for link, end in self._incoming.items()}
        return {**super().leave_note(), "heard": heard, "missed": self.worker.missed}

    def abort(self) -> None:
        """Hand over what is noted."""
        self._hand_over_ledger(time.monotonic_ns())
        self._ledger.drain(1.0)

    def _hear(self, link: Link) -> Subscription:
        def on_message(data: bytes, sequence: int) -> None:
            sent = subscription.source_ns - self._tie.ahead_ns
            self._take(link, sequence, decode(link.wire.type_name, data), sent, time.monotonic_ns())

        subscription = self._listen(link, on_message)
        return subscription

    def _take(self, link: Link, sequence: int, value: FloatArray, sent_ns: int, now_ns: int) -> None:
        raise NotImplementedError

    def _on_effect(self, effect: Effect) -> None:
        match effect:
            case Send(link, value, tick):
                if self.stop is None:
                    stamp = nanoseconds(tick, self.plan.graph.ticks_per_second)
                    self._outgoing[link.name].publish(encode(link.wire, value, stamp))
            case Halt(tick, why):
                if self.stop is None:
                    self._fault.publish(self.note({"node": self.name, "halt": why, "tick": tick}))
            case Overrun(tick, now, found):
                self._overrun(tick, now, found)
            case _:
                raise TypeError(f"{self.name} has no {effect}")

    def _overrun(self, tick: int, now: int, found: str) -> None:
        assert self.plan.wall is not None
        at = tick / self.plan.graph.ticks_per_second
        words = f"tick {tick} (simulated time {at:.6g} s) was missed: {found}"
        if self.plan.wall.strict:
            raise RunError(
                f"node {self.name}", words, "no missed tick, with --strict", "a lower --rate, or fewer other programs"
            )
        if not self._told_overrun:
            self._told_overrun = True
            self._to_tell = f"{words}; further ones are counted"

    def tell(self) -> None:
        """Say what there is to say, to standard error and to /rosout for who listens there; not while acts are due.

        Without the logger of rclpy, which looks for its caller in the source of everything that is loaded: that takes
        40 ms the first time, and the first missed tick made many.
        """
        if self._to_tell:
            words, self._to_tell = self._to_tell, ""
            name = self.ros_node.get_logger().name
            _rclpy.rclpy_logging_rcutils_log(LoggingSeverity.WARN, name, words, "", "", 0)

    def _hand_over_ledger(self, now_ns: int) -> None:
        self._noted_ns = now_ns
        entries = self.worker.take_ledger()
        for first in range(0, len(entries), MOST_SAMPLES):
            self._ledger.publish(encode_truth(0, to_rows(entries[first : first + MOST_SAMPLES])))


class WallModuleNode(WallNode):
    """A module that is no plant."""

    worker: WallModule

    def __init__(self, plan: Plan, name: str, spinner: Spinner, context: Context) -> None:
        incarnation = 0 if plan.birth is None else plan.birth.incarnation
        self.worker = WallModule(plan.graph, name, self._on_effect, incarnation)
        super().__init__(plan, name, spinner, context)
        graph = plan.graph
        if name in graph.reporters and name in graph.reads:
            self._see(graph.reads[name])

    def _take(self, link: Link, sequence: int, value: FloatArray, sent_ns: int, now_ns: int) -> None:
        self.worker.on_message(link, sequence, value, sent_ns, now_ns)

    def _see(self, plant: str) -> None:
        def on_window(data: bytes, sequence: int) -> None:
            if self.stop is None:
                window, _ = decode_window(data, plant)
                self.worker.on_window(window, time.monotonic_ns())

        foreign = plant in self.plan.graph.external
        subscription = self.subscription(Float64MultiArray, window_topic(plant), on_window, foreign=foreign)
        if foreign:
            subscription.open()  # its first window may come before the note that the run has begun


class WallPlantNode(WallNode):
    """A plant: publishes windows ahead, and what has become final."""

    worker: WallPlant

    def __init__(self, plan: Plan, name: str, spinner: Spinner, context: Context) -> None:
        self.worker = WallPlant(plan.graph, name, self._on_effect, plan.windows)
        super().__init__(plan, name, spinner, context)
        readers = [reader for reader in plan.graph.readers[name] if reader not in plan.graph.external]
        foreign = len(plan.graph.readers[name]) - len(readers)
        recorder = (RECORDER,) if plan.record_windows else ()
        self._windows = self.publisher(Float64MultiArray, window_topic(name), (*readers, *recorder), foreign)
        self._truth = self.publisher(Float64MultiArray, truth_topic(name), (RECORDER,))
        self._committed: list[FloatArray] = []
        self._first = 0
        self._new_readers = not plan.revived.isdisjoint(readers)
        self._ends = 0

    def turn(self, calm: bool = True) -> None:
        """As any node; and show a window to a reader that has come anew."""
        if self._new_readers and (ends := self._windows.ends) != self._ends:
            self._ends = ends
            self.worker.show_again(time.monotonic_ns())
        super().turn(calm)

    def abort(self) -> None:
        """Publish the rest of what is final."""
        self._publish_truth()
        self._truth.drain(1.0)
        super().abort()

    def _take(self, link: Link, sequence: int, value: FloatArray, sent_ns: int, now_ns: int) -> None:
        self.worker.on_message(link, sequence, value, sent_ns, now_ns)

    def _on_effect(self, effect: Effect) -> None:
        match effect:
            case Offer(window, grant):
                self._windows.publish(encode_window(window, grant))
            case Commit(first, samples):
                if not self._committed:
                    self._first = first
                self._committed.append(samples)
            case _:
                super()._on_effect(effect)

    def _hand_over_ledger(self, now_ns: int) -> None:
        self._publish_truth()
        super()._hand_over_ledger(now_ns)

    def _publish_truth(self) -> None:
        if not self._committed:
            return
        samples = np.concatenate(self._committed)
        self._committed.clear()
        for first in range(0, samples.shape[0], MOST_SAMPLES):
            self._truth.publish(encode_truth(self._first + first, samples[first : first + MOST_SAMPLES]))
