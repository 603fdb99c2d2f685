"""The recorder in real time: every message as it came off the wire, at the time at which it came."""

from __future__ import annotations

import time
from collections.abc import Callable
from typing import Any

import numpy as np
from rclpy.context import Context
from std_msgs.msg import Float64MultiArray

from etac_ros.bag.codec import decode_truth, encode_truth
from etac_ros.engines.ros.endpoints import Count, Spinner, Subscription
from etac_ros.engines.ros.messages import decode_window
from etac_ros.engines.ros.plan import RECORDER, Plan
from etac_ros.engines.ros.recorder import Sink, recorded_note
from etac_ros.engines.ros.wall_node import TimedNode
from etac_ros.graph.graph import Link
from etac_ros.graph.module import Window
from etac_ros.graph.topics import ledger_topic, truth_topic, window_topic
from etac_ros.graph.truth import MOST_SAMPLES
from etac_ros.maths.wall_clock import WallClock

_AT_ONCE = 2**62
"""Truth need not wait for messages: whose place in time is known when they come."""

OpenSink = Callable[[WallClock], Sink]
"""Creates the bag, given the instants of ticks on the wall clock."""


class WallRecorderNode(TimedNode):
    """The node that records a real-time run.

    Messages are logged when they were received; their other time is when they were published, which tells the tick.
    Committed samples bear the instant of their last tick instead, since they are published later, many at once.

    Parameters
    ----------
    plan, spinner, context
        As for :class:`~etac_ros.engines.ros.run_node.RunNode`.
    open_sink
        Creates the bag; called once, when the run begins.
    """

    def __init__(self, plan: Plan, spinner: Spinner, context: Context, open_sink: OpenSink) -> None:
        super().__init__(plan, RECORDER, spinner, context)
        self._open_sink = open_sink
        self._sink: Sink | None = None
        self._early: list[tuple[str, bytes, int, int, int]] = []
        self._received: dict[str, Subscription] = {}
        self._written: dict[str, Count] = {}
        self._assembled: dict[str, _Assembled] = {}
        graph = plan.graph
        for link in graph.links.values():
            self._record_link(link)
        for name in plan.modules:
            self._record_as_it_is(ledger_topic(name))
        for plant in graph.plants:
            if plant in graph.external:
                self._assemble(plant)
                continue
            self._record_truth(plant)
            if plan.record_windows:
                self._record_as_it_is(window_topic(plant))

    def on_start(self) -> None:
        """Create the bag."""
        super().on_start()
        assert self.wall is not None
        self._sink = self._open_sink(self.wall)
        self._sink.placed_until(_AT_ONCE)
        early, self._early = self._early, []
        for entry in early:
            self._write(*entry)

    def turn(self, calm: bool = True) -> None:
        """After the end: say what has come."""
        if self.stop is not None:
            for plant, assembled in self._assembled.items():
                self._write_assembled(plant, assembled.rest(self.stop["tick"]))
        self.diagnose(time.monotonic_ns())
        self.settle()

    def leave_note(self) -> dict[str, Any]:
        """Counts of what was received and of what was written."""
        return super().leave_note() | recorded_note(self._received, self._written)

    def abort(self) -> None:
        """Keep what is there."""
        self.close()

    def finish(self) -> None:
        """Complete the bag, also where the last word was missed."""
        self.close()

    def close(self) -> None:
        """Complete the bag."""
        if self._sink is not None:
            self._sink.close()
            self._sink = None

    def _on_end(self, content: Any, sequence: int) -> None:
        self.close()
        super()._on_end(content, sequence)

    def _record_link(self, link: Link) -> None:
        def on_message(data: bytes, sequence: int) -> None:
            self._write(link.topic, data, end.received_ns, end.source_ns, sequence)

        end = self._received[link.topic] = self._listen(link, on_message)

    def _record_as_it_is(self, topic: str) -> None:
        def on_message(data: bytes, sequence: int) -> None:
            self._write(topic, data, end.received_ns, end.source_ns, sequence)

        end = self._received[topic] = self.subscription(Float64MultiArray, topic, on_message)

    def _record_truth(self, plant: str) -> None:
        topic = truth_topic(plant)

        def on_message(data: bytes, sequence: int) -> None:
            first, samples = decode_truth(data)
            assert self.wall is not None
            published = self.wall.instant_ns(first + samples.shape[0] - 1)
            self._write(topic, data, end.received_ns, published, sequence)

        end = self._received[topic] = self.subscription(Float64MultiArray, topic, on_message)

    def _assemble(self, plant: str) -> None:
        """A foreign plant publishes windows only: what a later one does not replace is final."""
        assembled = self._assembled[plant] = _Assembled()

        def on_message(data: bytes, sequence: int) -> None:
            window, _ = decode_window(data, plant)
            self._write_assembled(plant, assembled.take(window))

        end = self.subscription(Float64MultiArray, window_topic(plant), on_message, foreign=True)
        end.open()

    def _write_assembled(self, plant: str, final: tuple[int, Any] | None) -> None:
        if final is None or self.wall is None:
            return
        first, samples = final
        for offset in range(0, samples.shape[0], MOST_SAMPLES):
            rows = samples[offset : offset + MOST_SAMPLES]
            published = self.wall.instant_ns(first + offset + rows.shape[0] - 1)
            topic = truth_topic(plant)
            number = self._written.setdefault(topic, Count()).messages + 1
            cdr = encode_truth(first + offset, rows)
            self._write(topic, cdr, published, published, number)

    def _write(self, topic: str, data: bytes, log_ns: int, published_ns: int, sequence: int) -> None:
        if self._sink is None:
            self._early.append((topic, data, log_ns, published_ns, sequence))
            return
        self._sink.write(topic, data, log_ns, published_ns, sequence)
        count = self._written.setdefault(topic, Count())
        count.messages += 1
        count.cdr_bytes += len(data)


class _Assembled:
    """Final samples out of windows that replace each other."""

    def __init__(self) -> None:
        self._window: Window | None = None
        self._kept: list[Any] = []
        self._first = 0

    def take(self, window: Window) -> tuple[int, Any] | None:
        """Take the next window; returns samples that are final and worth a message: first tick, and rows."""
        before, self._window = self._window, window
        if before is not None and window.start > before.start:
            self._kept.append(before.samples[: window.start - before.start].copy())
        count = sum(len(rows) for rows in self._kept)
        return self._take_kept() if count >= MOST_SAMPLES // 4 else None

    def rest(self, last_tick: int) -> tuple[int, Any] | None:
        """At the end: what is left, up to the last tick."""
        if self._window is not None and self._window.start <= last_tick:
            self._kept.append(self._window.samples[: last_tick + 1 - self._window.start].copy())
        self._window = None
        return self._take_kept()

    def _take_kept(self) -> tuple[int, Any] | None:
        if not self._kept:
            return None
        rows = np.concatenate(self._kept)
        first, self._first = self._first, self._first + len(rows)
        self._kept = []
        return first, rows
