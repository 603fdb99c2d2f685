"""The ROS node of a module: what comes in over DDS goes to a worker, and what the worker does goes out over DDS."""

from __future__ import annotations

import time
from collections.abc import Callable, Sequence
from typing import Any

import numpy as np
from rclpy.context import Context
from std_msgs.msg import Float64MultiArray, String

from etac_ros.bag.codec import decode, encode_truth
from etac_ros.engines.ros.endpoints import Publisher, Spinner, Subscription
from etac_ros.engines.ros.messages import (
    decode_window,
    encode,
    encode_window,
    message_type,
    stamp_ns,
)
from etac_ros.engines.ros.notes import read_order, report_note
from etac_ros.engines.ros.plan import COORDINATOR, RECORDER, Plan
from etac_ros.engines.ros.run_node import RunNode
from etac_ros.errors import RunError
from etac_ros.graph.graph import Link
from etac_ros.graph.topics import go_topic, next_topic, truth_topic, window_topic
from etac_ros.graph.wire import is_stamped
from etac_ros.maths.ticks import nanoseconds, tick_of
from etac_ros.parameters import FloatArray
from etac_ros.timing.orders import Order, Report
from etac_ros.timing.worker import Commit, Effect, ModuleWorker, Obeyed, Offer, PlantWorker, Send, Tell

_TRUTH_SAMPLES = 1024
"""Committed samples that are worth a message: about 57 kB for a rigid body."""
_TRUTH_WAITS_S = 0.2
"""Wall time after which fewer are published, too: what a killed plant can lose. It cuts chunks, never samples."""


class ModuleNode(RunNode):
    """A module on the network.

    Parameters
    ----------
    plan, name, spinner, context
        As for :class:`RunNode`.
    """

    def __init__(self, plan: Plan, name: str, spinner: Spinner, context: Context) -> None:
        super().__init__(plan, name, spinner, context)
        graph = plan.graph
        self.worker = self._make_worker()
        self._incoming: dict[str, Subscription] = {}
        self._go: Subscription | None = None
        self._ticks_per_second = graph.ticks_per_second
        self._outgoing: dict[str, Publisher] = {}
        for link in graph.sends[name]:
            own, foreign = plan.listeners(link)
            self._outgoing[link.name] = self.publisher(message_type(link.wire), link.topic, own, foreign, qos=link.qos)
        for link in graph.hears[name]:
            self._hear(link)
        if plan.duties.needs_orders(name):
            self._go = self.note_subscription(go_topic(name), self._on_go)
        self._next: Publisher | None = None
        if plan.duties.reports(name):
            self._next = self.publisher(String, next_topic(name), (COORDINATOR,))
        if name in graph.reporters and name in graph.reads:
            self._see(graph.reads[name])

    def drained(self) -> bool:
        """Whether all that was sent to this node has come and been dealt with."""
        assert self.stop is not None
        if self.stop["fault"]:
            return True
        sent = self.stop["sent"]
        return (
            self.worker.is_idle()
            and all(publisher.count.messages == sent[link] for link, publisher in self._outgoing.items())
            and all(subscription.count.messages == sent[link] for link, subscription in self._incoming.items())
            and (self._go is None or self._go.count.messages == self.stop["orders"].get(self.name, 0))
        )

    def leave_note(self) -> dict[str, Any]:
        """The counts, and digests of what was done, sent and heard."""
        return {
            **super().leave_note(),
            "done": self.worker.done,
            "sent_values": self.worker.sent_values,
            "values": self.worker.values,
        }

    def _make_worker(self) -> ModuleWorker:
        return ModuleWorker(self.plan.graph, self.plan.duties, self.name, self._on_effect)

    def _hear(self, link: Link) -> None:

        type_name, worker = link.wire.type_name, self.worker
        stamped = worker.wants_stamps and is_stamped(type_name)

        def on_message(data: bytes, sequence: int) -> None:
            tick = self._tick_of(stamp_ns(link.wire, data), link) if stamped else None
            worker.on_message(link, sequence, decode(type_name, data), tick)
            self.settle()

        foreign = link.sender in self.plan.graph.external
        kind = message_type(link.wire)
        self._incoming[link.name] = self.subscription(kind, link.topic, on_message, foreign=foreign, qos=link.qos)

    def _tick_of(self, stamp: int, link: Link) -> int:
        try:
            return tick_of(stamp, self._ticks_per_second)
        except ValueError as error:
            raise RunError(
                f"topic {link.topic}",
                f"{link.sender} has stamped a message with {stamp / 1e9:.9f} s: {error}",
                f"simulated time, a whole number of ticks of 1/{self._ticks_per_second} s, as the message it answers",
                "copy the stamp of the message that is answered, or use wire: compact",
            ) from None

    def _on_go(self, content: Any, sequence: int) -> None:
        self.worker.on_orders([read_order(order) for order in content])
        self.settle()

    def _see(self, plant: str) -> None:
        def on_window(data: bytes, sequence: int) -> None:
            self.worker.on_window(*decode_window(data, plant))
            self.settle()

        self.subscription(Float64MultiArray, window_topic(plant), on_window)

    def _on_effect(self, effect: Effect) -> None:
        match effect:
            case Send(link, value, tick):
                stamp = nanoseconds(tick, self._ticks_per_second)
                self._outgoing[link.name].publish(encode(link.wire, value, stamp))
            case Tell(report, tick, ahead):
                assert self._next is not None
                self._next.publish(self.note(report_note(report, tick, ahead)))
            case _:
                raise TypeError(f"{self.name} is no plant, and has no {effect}")


class PlantNode(ModuleNode):
    """A plant on the emulation plane: opens windows, and publishes what is committed.

    Where the coordinator lives in the same process, its orders come as calls of :meth:`obey`, and it sets
    ``on_obeyed`` to be told of what a report says here.
    """

    on_obeyed: Callable[[Report], None] | None = None

    def __init__(self, plan: Plan, name: str, spinner: Spinner, context: Context) -> None:
        super().__init__(plan, name, spinner, context)
        self._committed: list[FloatArray] = []
        self._first_committed = 0
        self._count = 0
        self._published = time.monotonic()
        readers = (*plan.graph.readers[name], *((RECORDER,) if plan.record_windows else ()))
        self._windows = self.publisher(Float64MultiArray, window_topic(name), readers)
        remote = name in plan.duties.remote_plants
        self._halts = self.publisher(String, next_topic(name), (COORDINATOR,)) if remote else None
        self._truth = self.publisher(Float64MultiArray, truth_topic(name), (RECORDER,))

    def obey(self, order: Order) -> None:
        """Obey an order as soon as the messages that it names are here."""
        self.worker.on_orders([order])

    def expect(self, compared: Sequence[float]) -> None:
        """Take a hint of what its reader compares with from now on."""
        self._plant_worker().expect(compared)

    def drained(self) -> bool:
        """Whether the last order has been obeyed."""
        assert self.stop is not None
        return bool(self.stop["fault"]) or (self._plant_worker().closed and super().drained())

    def leave_note(self) -> dict[str, Any]:
        """The counts, and why the run had to end if the last samples said so."""
        return {**super().leave_note(), "halted": self._plant_worker().plant.halt}

    def leave(self) -> None:
        """Publish the rest of what is committed, then leave."""
        self.publish_truth()
        super().leave()

    def abort(self) -> None:
        """Publish the rest of what is committed."""
        self.publish_truth()
        self._truth.drain(1.0)

    def publish_truth(self) -> None:
        """Publish what has been committed since the last time."""
        if self._committed:
            self._truth.publish(encode_truth(self._first_committed, np.concatenate(self._committed)))
            self._committed.clear()
            self._count = 0
        self._published = time.monotonic()

    def _make_worker(self) -> PlantWorker:
        return PlantWorker(self.plan.graph, self.plan.duties, self.name, self._on_effect)

    def _plant_worker(self) -> PlantWorker:
        assert isinstance(self.worker, PlantWorker)
        return self.worker

    def _on_effect(self, effect: Effect) -> None:
        match effect:
            case Offer(window, grant):
                self._windows.publish(encode_window(window, grant))
                if self._count >= _TRUTH_SAMPLES or time.monotonic() - self._published > _TRUTH_WAITS_S:
                    self.publish_truth()  # after the window, which others wait for
            case Commit(first, samples):
                self._keep(first, samples)
            case Obeyed(report):
                self._obeyed(report)
            case _:
                super()._on_effect(effect)

    def _obeyed(self, report: Report) -> None:
        if self.on_obeyed is not None:
            self.on_obeyed(report)
        elif report.halt and self._halts is not None:
            self._halts.publish(self.note(report_note(report, 0, None)))
        if self._plant_worker().closed:
            self.publish_truth()
            self.settle()

    def _keep(self, first: int, samples: FloatArray) -> None:
        if not self._committed:
            self._first_committed = first
        self._committed.append(samples)
        self._count += samples.shape[0]
