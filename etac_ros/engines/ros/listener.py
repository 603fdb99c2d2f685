"""Who listens to a run that others have started, in either time, and publishes nothing.

What it needs to know of the run is told on a latched topic of the coordinator's. In simulated time the message log
tells of every message, so that the links themselves need not be heard; in real time they are.
"""

from __future__ import annotations

import os
import time
from collections.abc import Callable
from dataclasses import dataclass
from fractions import Fraction
from functools import partial
from typing import Any

import rclpy
from rclpy.context import Context
from rclpy.node import Node
from rclpy.signals import SignalHandlerOptions
from std_msgs.msg import Float64MultiArray, String

from etac_ros.bag.codec import decode_truth
from etac_ros.bag.monitor import EVERY_S, Monitor, Picture
from etac_ros.engines.ros.endpoints import DATA, LATCHED_READER, Spinner, Taker, profile
from etac_ros.engines.ros.messages import message_type, open_note
from etac_ros.errors import RunError
from etac_ros.graph.graph import Graph, Link
from etac_ros.graph.topics import END, LEAVE, MESSAGE_LOG, SCENARIO, START, STOP, truth_topic
from etac_ros.maths.wall_clock import WallClock
from etac_ros.media.frame import Fate, Outcome

_WAIT_S = 0.05
_GATHER_S = 0.005
_LOOK_S = 1.0
_LAST_WORDS_S = 0.5
"""From the note that the run is over to the end: what was sent before has come by then."""


@dataclass(frozen=True)
class Told:
    """What a run says of itself: name and digest of its scenario, its clock, and its complete parameters as JSON."""

    run: str
    scenario: str
    digest: str
    clock: str
    text: str


class _Ear(Taker):
    """A subscription that takes what comes, as bytes with the number on its publisher."""

    def __init__(self, node: Node, kind: type, topic: str, hear: Callable[[bytes, int, int], None], qos: Any) -> None:
        self.topic = topic
        self._kind = kind
        self._hear = hear
        self._subscription = node.create_subscription(kind, topic, lambda message: None, qos, raw=True)
        self.handle = self._subscription.handle

    def take_one(self) -> bool:
        """Hand on the first that waits."""
        taken = self.handle.take_message(self._kind, True)
        if taken is None:
            return False
        data, info = taken
        self._hear(data, int(info["publication_sequence_number"]), info["source_timestamp"])
        return True


class RunListener:
    """Joins a ROS domain and listens.

    Parameters
    ----------
    domain
        The ROS domain; the environment has been prepared for it.
    """

    def __init__(self, domain: int) -> None:
        self._domain = domain
        self._context = Context()
        rclpy.init(context=self._context, domain_id=domain, signal_handler_options=SignalHandlerOptions.NO)
        self._node = Node(
            f"etac_watch_{os.getpid()}", context=self._context, enable_rosout=False, start_parameter_services=False
        )
        self._spinner = Spinner(self._context, _GATHER_S)
        self._told: Told | None = None
        self._fault = ""
        self._over: float | None = None
        self._wall: WallClock | None = None
        self._logs = 0
        self._hear_notes(SCENARIO, self._on_scenario)

    def close(self) -> None:
        """Leave the domain."""
        self._context.try_shutdown()

    def wait(self, goes_on: Callable[[], bool] = lambda: True) -> Told | None:
        """What the run says of itself, as soon as there is one; None when there is no reason to wait any more."""
        while self._told is None and goes_on():
            self._spinner.once(_WAIT_S)
        return self._told

    def follow(self, graph: Graph, show: Callable[[Picture], None]) -> None:
        """Show the run until it is over.

        Parameters
        ----------
        graph
            That of the run's scenario.
        show
            Given pictures of it.

        Raises
        ------
        RunError
            If the run fails, or is not there any more.
        """
        assert self._told is not None
        monitor = Monitor(graph)
        self._links = {link.name: link for link in graph.links.values()}
        self._by_topic = {link.topic: link for link in graph.links.values()}
        self._hear_notes(START, self._on_start)
        self._hear_notes(STOP, partial(self._on_stop, monitor))
        self._hear_notes(END, self._on_end)
        for plant in graph.plants:
            self._hear(Float64MultiArray, truth_topic(plant), partial(self._on_truth, monitor, plant), DATA)
        if self._told.clock:
            self._hear_notes(LEAVE, partial(self._on_leave, monitor), DATA)
            for link in graph.links.values():
                hear = partial(self._on_message, monitor, link)
                self._hear(message_type(link.wire), link.topic, hear, profile(link.qos))
        else:
            self._hear_notes(MESSAGE_LOG, partial(self._on_message_log, monitor), DATA)
        shown = looked = time.monotonic()
        while self._over is None or time.monotonic() < self._over + _LAST_WORDS_S:
            self._spinner.once(_WAIT_S)
            now = time.monotonic()
            if now - shown >= EVERY_S:
                shown = now
                show(monitor.picture)
            if now - looked >= _LOOK_S and self._over is None:
                looked = now
                self._check_present()
        show(monitor.picture)
        if self._fault:
            raise RunError(f"the run in ROS domain {self._domain}", f"has failed: {self._fault}")

    def _check_present(self) -> None:
        if not self._node.count_publishers(SCENARIO):
            raise RunError(
                f"the run in ROS domain {self._domain}", "is not there any more, and has not said that it is over"
            )

    def _hear(self, kind: type, topic: str, hear: Callable[[bytes, int, int], None], qos: Any) -> None:
        self._spinner.add(_Ear(self._node, kind, topic, hear, qos))

    def _hear_notes(self, topic: str, hear: Callable[[dict[str, Any]], None], qos: Any = LATCHED_READER) -> None:
        def on_note(data: bytes, sequence: int, source_ns: int) -> None:
            note = open_note(data)
            if note is not None and (self._told is None or note["run"] == self._told.run):
                hear(note)

        self._hear(String, topic, on_note, qos)

    def _on_scenario(self, note: dict[str, Any]) -> None:
        if self._told is None and {"run", "scenario", "digest", "clock", "text"} <= note.keys():
            self._told = Told(note["run"], note["scenario"], note["digest"], note["clock"], note["text"])

    def _on_start(self, note: dict[str, Any]) -> None:
        if "t0_ns" in note:
            self._wall = WallClock(note["t0_ns"], note["ticks_per_second"], Fraction(note["rate"]))

    def _on_stop(self, monitor: Monitor, note: dict[str, Any]) -> None:
        self._fault = note["fault"]
        for name, count in note.get("sent", {}).items():
            self._sent(monitor, self._links[name], count, None)
        monitor.reached(note["tick"])
        if self._fault:
            self._on_end(note)

    def _on_leave(self, monitor: Monitor, note: dict[str, Any]) -> None:
        for topic, (count, _) in note["sent"].items():
            if topic in self._by_topic:
                self._sent(monitor, self._by_topic[topic], count, None)

    def _on_end(self, note: dict[str, Any]) -> None:
        self._over = time.monotonic()

    def _on_truth(self, monitor: Monitor, plant: str, data: bytes, sequence: int, source_ns: int) -> None:
        monitor.committed(plant, *decode_truth(data))

    def _on_message(self, monitor: Monitor, link: Link, data: bytes, sequence: int, source_ns: int) -> None:
        tick = None if self._wall is None else max(0, self._wall.tick_at(source_ns))
        self._sent(monitor, link, sequence, tick)

    def _on_message_log(self, monitor: Monitor, note: dict[str, Any]) -> None:
        self._logs += 1
        if self._logs == 1 and note["log"] > 1:
            monitor.picture.from_tick = min((tick for _, _, tick, _ in note["transits"]), default=monitor.picture.tick)
        for name, number, tick, _ in note["transits"]:
            self._sent(monitor, self._links[name], number, tick)
        for link, sequence, outcome, *times in note.get("air", {}).get("fates", ()):
            monitor.landed(Fate(link, sequence, Outcome(outcome), *times))

    def _sent(self, monitor: Monitor, link: Link, count: int, tick: int | None) -> None:
        flow = monitor.picture.flows[link.name]
        if count > flow.messages:
            monitor.sent(link, count, link.wire.cdr_bytes, flow.last_tick if tick is None else tick)
