"""The recorder: takes every message off the wire as bytes, learns its place in time from the message log, keeps it."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from typing import Any, Protocol

from rclpy.context import Context
from std_msgs.msg import Float64MultiArray, String

from etac_ros.bag.clock import AFTER_ALL_STEPS, log_time_ns
from etac_ros.bag.codec import decode_truth, encode_truth
from etac_ros.engines.ros.endpoints import Count, Spinner, Subscription
from etac_ros.engines.ros.messages import decode_window, message_type
from etac_ros.engines.ros.plan import COORDINATOR, RECORDER, Plan
from etac_ros.engines.ros.run_node import RunNode
from etac_ros.graph.air import to_rows
from etac_ros.graph.graph import Link
from etac_ros.graph.topics import AIR, LEAVE, MESSAGE_LOG, RECORDED, truth_topic, window_topic
from etac_ros.graph.truth import MOST_SAMPLES
from etac_ros.maths.ticks import nanoseconds
from etac_ros.media.frame import Fate, Outcome


class Sink(Protocol):
    """Where the recorder puts messages: a bag."""

    def write(self, topic: str, cdr: bytes, log_time_ns: int, publish_time_ns: int, sequence: int) -> None:
        """Keep one message."""
        ...

    def placed_until(self, tick_time_ns: int) -> None:
        """Take note that all messages up to a simulated time are written, so that truth up to there may follow."""
        ...

    def secure(self) -> None:
        """Make what is written survive a kill."""
        ...

    def close(self) -> None:
        """Complete the bag."""
        ...


def recorded_note(received: Mapping[str, Subscription], written: Mapping[str, Count]) -> dict[str, Any]:
    """What a recorder's last note says beside any node's: counts by topic of what came and of what is in the bag."""
    return {
        "received": {topic: subscription.count.noted() for topic, subscription in received.items()},
        "written": {topic: count.noted() for topic, count in written.items()},
    }


class RecorderNode(RunNode):
    """The node that records.

    Parameters
    ----------
    plan, spinner, context
        As for :class:`RunNode`.
    open_sink
        Creates the bag; called once, when the run begins.
    """

    def __init__(self, plan: Plan, spinner: Spinner, context: Context, open_sink: Callable[[], Sink]) -> None:
        super().__init__(plan, RECORDER, spinner, context)
        self._open_sink = open_sink
        self._sink: Sink | None = None
        self._received: dict[str, Subscription] = {}
        self._waiting: dict[tuple[str, int], bytes] = {}
        self._places: dict[tuple[str, int], tuple[int, int]] = {}
        self._written: dict[str, Count] = {}
        self._leave_notes: dict[str, dict[str, Any]] = {}
        self._tick = 0
        self._logged = 0
        for link in plan.graph.links.values():
            self._hear(link)
        for plant in plan.graph.plants:
            self._record_truth(truth_topic(plant))
            if plan.record_windows:
                self._record_windows(window_topic(plant))
        self._log = self._acknowledged = self._air_tables = 0
        self._recorded = self.publisher(String, RECORDED, (COORDINATOR,))
        self.note_subscription(MESSAGE_LOG, self._on_message_log)
        self.note_subscription(LEAVE, self._on_leave, shared=True)

    def on_start(self) -> None:
        """Create the bag."""
        self._bag()

    def drained(self) -> bool:
        """Whether every message that others say they sent is in the bag."""
        assert self.stop is not None
        if self.stop["fault"]:
            return False  # the process's end closes the bag: who can tell what still comes?
        others = [name for name in self.plan.modules if name not in self._leave_notes]
        if others or self._log < self.stop["logs"]:
            return False
        sent = {link.topic: self.stop["sent"][link.name] for link in self.plan.graph.links.values()}
        for leave_note in self._leave_notes.values():
            for topic, (messages, _) in leave_note["sent"].items():
                if topic in self._received:
                    sent[topic] = messages
        return not self._waiting and all(
            self._received[topic].count.messages >= messages for topic, messages in sent.items()
        )

    def leave(self) -> None:
        """Close the bag, then say what is in it."""
        self.close()
        super().leave()

    def leave_note(self) -> dict[str, Any]:
        """Counts of what was received and of what was written."""
        return super().leave_note() | recorded_note(self._received, self._written)

    def abort(self) -> None:
        """Keep what is there: messages whose tick nobody told any more go to the last tick that is known."""
        self.close()

    def close(self) -> None:
        """Write what waits and complete the bag."""
        if self._sink is None:
            return
        for (name, sequence), data in sorted(self._waiting.items()):
            self._write(self.plan.graph.links[name].topic, data, self._tick, 0, sequence)
        self._waiting.clear()
        self._sink.close()
        self._sink = None

    def _bag(self) -> Sink:
        # A first message may overtake the note that the run has begun: they are on different topics.
        if self._sink is None:
            self._sink = self._open_sink()
        return self._sink

    def _hear(self, link: Link) -> None:
        def on_message(data: bytes, sequence: int) -> None:
            self._waiting[link.name, sequence] = data
            self._sort_in(link.name, sequence)
            if not self._places and self._log > self._acknowledged:
                self._all_placed()
            self.settle()

        foreign = link.sender in self.plan.graph.external
        kind = message_type(link.wire)
        self._received[link.topic] = self.subscription(kind, link.topic, on_message, foreign=foreign, qos=link.qos)

    def _record_truth(self, topic: str) -> None:
        def on_message(data: bytes, sequence: int) -> None:
            first, samples = decode_truth(data)
            last = first + samples.shape[0] - 1
            self._tick = max(self._tick, last)
            self._write(topic, data, last, AFTER_ALL_STEPS, sequence)
            self.settle()

        self._received[topic] = self.subscription(Float64MultiArray, topic, on_message)

    def _record_windows(self, topic: str) -> None:
        def on_message(data: bytes, sequence: int) -> None:
            window, _ = decode_window(data, topic)
            self._write(topic, data, window.start, 0, sequence)
            self.settle()

        self._received[topic] = self.subscription(Float64MultiArray, topic, on_message)

    def _on_message_log(self, content: Any, sequence: int) -> None:
        self._log = content["log"]
        if "air" in content:
            self._record_air(content["air"])
        for name, number, tick, step in content["transits"]:
            self._places[name, number] = (tick, step)
            self._tick = max(self._tick, tick)
            self._logged = max(self._logged, tick)
            self._sort_in(name, number)
        if not self._places:
            self._all_placed()
        self.settle()

    def _record_air(self, told: Any) -> None:
        """Write what became of frames on shared media: the coordinator tells it with the places of messages."""
        fates = [Fate(link, sequence, Outcome(outcome), *times) for link, sequence, outcome, *times in told["fates"]]
        rows = to_rows(fates, list(self.plan.graph.links))
        for first in range(0, rows.shape[0], MOST_SAMPLES):
            self._air_tables += 1
            cdr = encode_truth(told["tick"], rows[first : first + MOST_SAMPLES])
            self._write(AIR, cdr, told["tick"], AFTER_ALL_STEPS, self._air_tables)

    def _all_placed(self) -> None:
        """Every message that was told of is in the bag: truth may follow, and the run need not wait for us."""
        # Messages of the last tick may still be under way.
        self._bag().placed_until(nanoseconds(self._logged - 1, self.plan.graph.ticks_per_second))
        self._bag().secure()  # first: what is acknowledged is not lost, whoever kills us
        self._acknowledged = self._log
        self._recorded.publish(self.note({"log": self._log}))

    def _sort_in(self, name: str, number: int) -> None:
        """Write a message once both it and its place in time are here."""
        key = (name, number)
        if key in self._waiting and key in self._places:
            tick, step = self._places.pop(key)
            self._write(self.plan.graph.links[name].topic, self._waiting.pop(key), tick, step, number)

    def _on_leave(self, content: Any, sequence: int) -> None:
        self._leave_notes[content["node"]] = content
        self.settle()

    def _write(self, topic: str, data: bytes, tick: int, step: int, sequence: int) -> None:
        published = nanoseconds(tick, self.plan.graph.ticks_per_second)
        self._bag().write(topic, data, log_time_ns(published, step), published, sequence)
        count = self._written.setdefault(topic, Count())
        count.messages += 1
        count.cdr_bytes += len(data)
