"""The ROS node of a module: orders, windows and messages in, messages and reports out."""

from __future__ import annotations

import time
from collections import deque
from collections.abc import Callable
from typing import Any

import numpy as np
from rclpy.context import Context
from std_msgs.msg import Float64MultiArray, String

from etac_ros.engines.ros.endpoints import Publisher, Spinner, Subscription
from etac_ros.engines.ros.messages import (
    decode,
    decode_window,
    encode,
    encode_truth,
    encode_window,
    message_type,
    note,
    read_note,
    stamp_ns,
)
from etac_ros.engines.ros.notes import read_order, report_note
from etac_ros.engines.ros.plan import Plan
from etac_ros.engines.ros.run_node import RunNode
from etac_ros.graph.driver import Driver, Sent
from etac_ros.graph.graph import Link
from etac_ros.graph.module import Arrival, Window
from etac_ros.graph.plant import PlantModule
from etac_ros.graph.topics import go_topic, next_topic, truth_topic, window_topic
from etac_ros.maths.ticks import nanoseconds, tick_of
from etac_ros.parameters import FloatArray
from etac_ros.timing.orders import Close, Deliver, Fire, Look, MessageId, Open, Order, Report

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
        self._driver = Driver(graph, name)
        self._inbox: dict[MessageId, FloatArray] = {}
        self._orders: deque[Order] = deque()
        self._incoming: dict[str, Subscription] = {}
        self._sees = graph.reads.get(name)
        self._go: Subscription | None = None
        self._acts_on_arrival = plan.acts_on_arrival(name)
        self._arrived: deque[tuple[MessageId, int | None]] = deque()
        self._windows_ahead: deque[tuple[Window, int]] = deque()
        self._proposal: int | None = None
        self._ticks_per_second = graph.ticks_per_second
        self._outgoing: dict[str, Publisher] = {
            link.name: self.publisher(message_type(link.wire), link.topic, plan.listeners(link))
            for link in graph.sends[name]
        }
        for link in graph.hears[name]:
            self._hear(link)
        if plan.needs_orders(name):
            self._go = self.subscription(String, go_topic(name), self._on_go)
        self._next: Publisher | None = None
        if name in graph.reporters:
            if plan.reports(name):
                self._next = self.publisher(String, next_topic(name), 1)
            if name in graph.reads:
                self.subscription(Float64MultiArray, window_topic(graph.reads[name]), self._on_window)

    def enqueue(self, order: Order) -> None:
        """Obey an order as soon as the messages that it names are here."""
        self._orders.append(order)
        self._work()

    def drained(self) -> bool:
        """Whether all that was sent to this node has come and been dealt with."""
        assert self.stop is not None
        if self.stop["fault"]:
            return True
        orders_due = self.stop["orders"].get(self.name, 0)
        return (
            not self._orders
            and not self._arrived
            and not self._windows_ahead
            and all(publisher.count.messages == self.stop["sent"][link] for link, publisher in self._outgoing.items())
            and all(
                subscription.count.messages == self.stop["sent"][link] for link, subscription in self._incoming.items()
            )
            and (self._go is None or self._go.count.messages == orders_due)
        )

    def _hear(self, link: Link) -> None:
        def on_message(message: Any, sequence: int) -> None:
            self._on_message(link, message, sequence)

        self._incoming[link.name] = self.subscription(message_type(link.wire), link.topic, on_message)

    def _on_message(self, link: Link, message: Any, sequence: int) -> None:
        identity = MessageId(link.name, sequence)
        if not link.channel.drops(self.name, sequence):
            self._inbox[identity] = decode(message)
            if self._acts_on_arrival:
                stamp = stamp_ns(message)
                self._arrived.append((identity, None if stamp is None else tick_of(stamp, self._ticks_per_second)))
            self._work()
        self.settle()

    def _on_go(self, message: Any, sequence: int) -> None:
        self._orders.extend(read_order(order) for order in read_note(message))
        self._work()
        self.settle()

    def _on_window(self, message: Any, sequence: int) -> None:
        assert self._sees is not None
        self._windows_ahead.append(decode_window(message, self._sees))
        self._work()
        self.settle()

    def _work(self) -> None:
        """Do all that can be done with what is here; the rest waits for what is still under way."""
        while True:
            if self._arrived and self._has_sample(self._arrived[0][1]):
                identity, tick = self._arrived.popleft()
                sent = self._driver.receive(tick, self._arrivals((identity,)))
                self._acted(tick or 0, self._send(sent, self._nanoseconds(tick or 0)))
            elif self._orders and self._can_take(self._orders[0]):
                self._obey(self._orders.popleft())
            elif self._windows_ahead and self._may_see(self._windows_ahead[0][0]):
                window, grant = self._windows_ahead.popleft()
                self._driver.see(window)
                if not self._driver.module.passive:
                    self._look(window.start - 1, grant)
            else:
                return

    def _may_see(self, window: Window) -> bool:
        """Whether nothing is left to do in the windows before.

        A window that begins after a tick that this module has named tells that the tick is over. So the order to fire
        at it is under way, on another topic, and has to be obeyed first.
        """
        return self._proposal is None or self._proposal >= window.start

    def _has_sample(self, tick: int | None) -> bool:
        """Whether the window with the sample of a tick is here, if the module sees windows at all."""
        if self._sees is None:
            return True
        window = self._driver.window
        assert tick is not None
        return window is not None and tick <= window.last

    def _can_take(self, order: Order) -> bool:
        """Whether all that an order names is here: messages, and the window that was opened before it."""
        if not isinstance(order, Fire | Deliver):
            return True
        window = self._driver.window
        seen = 0 if window is None else window.epoch
        needed = order.messages if isinstance(order, Deliver) else ()
        return seen >= order.epoch and all(message in self._inbox for message in needed)

    def _obey(self, order: Order) -> None:
        match order:
            case Look(_, after, grant):
                self._look(after, grant)
            case Fire(_, tick, _, alone):
                sent, concluded = self._act(tick, alone)
                self._proposal = None  # of a module that always fires alike, until it is asked again
                if self._driver.module.fires_on is None:
                    self._report_act(Report(sent, concluded=concluded, halt=self._driver.module.halt), tick)
            case Deliver(_, tick, _, arrivals, _):
                answers = self._driver.receive(tick, self._arrivals(arrivals))
                self._acted(tick, self._send(answers, self._nanoseconds(tick)))
            case _:
                raise TypeError(f"{self.name} is no plant, and cannot obey {order}")

    def _look(self, after: int, grant: int) -> None:
        proposal = self._driver.look(after)
        if proposal is None or proposal > grant:
            self._proposal = proposal
            self._report(Report(proposal=proposal), after, None)
            return
        sent, concluded = self._act(proposal, alone=True)
        report = Report(sent, proposal, fired=True, concluded=concluded, halt=self._driver.module.halt)
        self._report_act(report, proposal)

    def _act(self, tick: int, alone: bool) -> tuple[tuple[str, ...], tuple[str, ...] | None]:
        """Fire, and conclude at once where nothing can arrive."""
        fired = self._driver.fire(tick)
        if not alone or not self._driver.module.concludes:
            return self._send(fired, self._nanoseconds(tick)), None
        # The conclusion is the head of the longer way, to the plant and back; the topics differ, so order is free.
        concluded = self._send(self._driver.conclude(tick), self._nanoseconds(tick))
        return self._send(fired, self._nanoseconds(tick)), concluded

    def _acted(self, tick: int, sent: tuple[str, ...]) -> None:
        if self._next is not None:
            self._report_act(Report(sent, halt=self._driver.module.halt), tick)

    def _report_act(self, report: Report, tick: int) -> None:
        """Report what was done, together with the next own act."""
        self._proposal = None if self._driver.module.passive else self._driver.look(tick)
        self._report(report, tick, self._proposal)

    def _report(self, report: Report, tick: int, ahead: int | None) -> None:
        if self._next is not None:  # else the coordinator knows it beforehand
            self._next.publish(note(report_note(report, tick, ahead)))

    def _arrivals(self, messages: tuple[MessageId, ...]) -> tuple[Arrival, ...]:
        links = self.plan.graph.links
        return tuple(
            Arrival(links[message.link].receivers[self.name], message.link, self._inbox.pop(message))
            for message in messages
        )

    def _send(self, sent: Sent, nanoseconds: int) -> tuple[str, ...]:
        for link, value in sent:
            self._outgoing[link.name].publish(encode(link.wire, value, nanoseconds))
        return tuple(link.name for link, _ in sent)

    def _nanoseconds(self, tick: int) -> int:
        return nanoseconds(tick, self._ticks_per_second)


class PlantNode(ModuleNode):
    """A plant on the emulation plane: opens windows, and publishes what is committed.

    Where the coordinator lives in the same process, its orders come as calls of :meth:`enqueue`, and it sets
    ``on_obeyed`` to be told of what a report says here.
    """

    on_obeyed: Callable[[Report], None] | None = None

    def __init__(self, plan: Plan, name: str, spinner: Spinner, context: Context) -> None:
        super().__init__(plan, name, spinner, context)
        module = plan.graph.modules[name]
        assert isinstance(module, PlantModule)
        self._plant = module
        self._closed = False
        self._committed: list[FloatArray] = []
        self._first_committed = 0
        self._count = 0
        self._published = time.monotonic()
        readers = len(plan.graph.readers[name]) + int(plan.record_windows)
        self._windows = self.publisher(Float64MultiArray, window_topic(name), readers)
        self._halts = self.publisher(String, next_topic(name), 1) if name in plan.remote_plants else None
        self._truth = self.publisher(Float64MultiArray, truth_topic(name), 1)

    def drained(self) -> bool:
        """Whether the last order has been obeyed."""
        assert self.stop is not None
        return bool(self.stop["fault"]) or (self._closed and super().drained())

    def leave_note(self) -> dict[str, Any]:
        """The counts, and why the run had to end if the last samples said so."""
        return {**super().leave_note(), "halted": self._plant.halt}

    def leave(self) -> None:
        """Publish the rest of what is committed, then leave."""
        self.publish_truth()
        super().leave()

    def abort(self) -> None:
        """Publish the rest of what is committed."""
        self.publish_truth()
        self._truth.drain(1.0)

    def _obey(self, order: Order) -> None:
        match order:
            case Open(_, tick, length, grant):
                self._commit(tick)
                if not self._plant.halt:
                    self._windows.publish(encode_window(self._plant.open(length), grant))
                elif self._halts is not None:
                    self._halts.publish(note(report_note(Report(halt=self._plant.halt), tick, None)))
                self._obeyed()
            case Close(_, tick):
                self._commit(tick)
                self.publish_truth()
                self._closed = True
                self._obeyed()
                self.settle()
            case Deliver(_, tick, _, arrivals, _):
                self._plant.receive(tick, self._arrivals(arrivals), None)
            case _:
                raise TypeError(f"{self.name} is a plant, and cannot obey {order}")

    def _obeyed(self) -> None:
        if self.on_obeyed is not None:
            self.on_obeyed(Report(halt=self._plant.halt))

    def _commit(self, tick: int) -> None:
        start, samples = self._plant.commit(tick)
        if not samples.shape[0]:
            return
        if not self._committed:
            self._first_committed = start
        self._committed.append(samples)
        self._count += samples.shape[0]
        if self._count >= _TRUTH_SAMPLES or time.monotonic() - self._published > _TRUTH_WAITS_S:
            self.publish_truth()

    def publish_truth(self) -> None:
        """Publish what has been committed since the last time."""
        if self._committed:
            self._truth.publish(encode_truth(self._first_committed, np.concatenate(self._committed)))
            self._committed.clear()
            self._count = 0
        self._published = time.monotonic()
