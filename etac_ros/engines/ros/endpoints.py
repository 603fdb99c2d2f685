"""Publishers that count, subscriptions that see sequence numbers, and the one loop that waits for messages.

rclpy's executors were measured against the wait set that they are made of: an exchange takes 1.3 to 1.5 times as long
with SingleThreadedExecutor, EventsExecutor cannot deliver the message info. The sequence numbers are the point here,
so this file is the one place that waits, and no other knows how.
"""

from __future__ import annotations

import time
from abc import ABC, abstractmethod
from collections import deque
from collections.abc import Callable, Collection, Iterable
from dataclasses import dataclass
from operator import itemgetter
from typing import Any

from rclpy.duration import Duration
from rclpy.impl.implementation_singleton import rclpy_implementation as _rclpy
from rclpy.node import Node
from rclpy.qos import DurabilityPolicy, HistoryPolicy, QoSProfile, ReliabilityPolicy
from rclpy.serialization import serialize_message

from etac_ros.errors import RunError
from etac_ros.graph.graph import USUAL_QOS, Qos, Reliability
from etac_ros.timing.membership import Succession

DATA = QoSProfile(
    depth=4096,
    history=HistoryPolicy.KEEP_LAST,
    reliability=ReliabilityPolicy.RELIABLE,
    durability=DurabilityPolicy.VOLATILE,
)
"""Nothing of ours is dropped: nobody runs further ahead of the recorder than a part of this depth, and all others
answer each message. A history that keeps all would let any listener that stands still, be it a foreign one, hold up
its publisher."""

LATCHED = QoSProfile(
    depth=1,
    history=HistoryPolicy.KEEP_LAST,
    reliability=ReliabilityPolicy.RELIABLE,
    durability=DurabilityPolicy.TRANSIENT_LOCAL,
)
"""For what a node that joins late has to know."""


def profile(qos: Qos) -> QoSProfile:
    """What DDS is asked for at both ends of a link."""
    if qos == USUAL_QOS:
        return DATA
    best_effort = qos.reliability is Reliability.BEST_EFFORT
    return QoSProfile(
        depth=qos.history,
        history=HistoryPolicy.KEEP_LAST,
        reliability=ReliabilityPolicy.BEST_EFFORT if best_effort else ReliabilityPolicy.RELIABLE,
        durability=DurabilityPolicy.VOLATILE,
    )


LATCHED_READER = QoSProfile(
    depth=1000,
    history=HistoryPolicy.KEEP_LAST,
    reliability=ReliabilityPolicy.RELIABLE,
    durability=DurabilityPolicy.TRANSIENT_LOCAL,
)
"""A reader that keeps one message would let the note of one node push out another's."""

Callback = Callable[[Any, int], None]
"""Takes a serialized message (or what was read of it) and its number on its publisher: 1, 2, ..."""
Reader = Callable[[bytes], Any]
"""Reads a serialized message; None for one that is not of this run."""


@dataclass
class Count:
    """What went through one end of a topic."""

    messages: int = 0
    cdr_bytes: int = 0

    def noted(self) -> list[int]:
        """Both, as notes have them."""
        return [self.messages, self.cdr_bytes]


class Publisher:
    """Publishes on one topic and counts.

    Parameters
    ----------
    node
        The owner.
    kind, topic
        Message class and topic name.
    listeners
        Full names of the nodes whose subscriptions have to be matched before the run begins.
    foreign
        How many subscriptions of foreign nodes, whose names nobody knows, have to be matched besides.
    latched
        Keep the last message for late joiners.
    qos
        Of a link; for what is not latched.
    """

    def __init__(
        self,
        node: Node,
        kind: type,
        topic: str,
        listeners: Collection[str] = (),
        foreign: int = 0,
        latched: bool = False,
        qos: Qos = USUAL_QOS,
    ) -> None:
        self.topic = topic
        self.count = Count()
        self._listeners = frozenset(listeners)
        self._foreign = foreign
        self._node = node
        self._matched = False
        self._publisher = node.create_publisher(kind, topic, LATCHED if latched else profile(qos))
        self._publish_raw = self._publisher.handle.publish_raw
        self.on_sent: Callable[[str], None] | None = None
        """Told the topic of each message that has been sent."""

    def publish(self, message: Any) -> int:
        """Publish a message, serialized or not; returns its sequence number."""
        serialized = message if isinstance(message, bytes) else serialize_message(message)
        # Counted first: a receiver may answer before this call returns.
        self.count.messages += 1
        self.count.cdr_bytes += len(serialized)
        self._publish_raw(serialized)
        if self.on_sent is not None:
            self.on_sent(self.topic)
        return self.count.messages

    @property
    def matched(self) -> bool:
        """Whether all expected subscriptions are there. A stranger that listens, too, stands for none of them."""
        if not self._matched and self._publisher.get_subscription_count() >= len(self._listeners) + self._foreign:
            there = [name_of(end) for end in self._node.get_subscriptions_info_by_topic(self.topic)]
            strangers = [name for name in there if name not in self._listeners]
            self._matched = self._listeners <= set(there) and len(strangers) >= self._foreign
        return self._matched

    @property
    def heard(self) -> bool:
        """Whether anybody listens now."""
        return bool(self._publisher.get_subscription_count())

    @property
    def ends(self) -> int:
        """How many subscriptions are matched; of processes that have died unseen, too."""
        return int(self._publisher.get_subscription_count())

    def missing(self) -> str:
        """What is still missing here, in words."""
        there = [name_of(end) for end in self._node.get_subscriptions_info_by_topic(self.topic)]
        missing = sorted(self._listeners - set(there))
        if len([name for name in there if name not in self._listeners]) < self._foreign:
            missing.append("a foreign node")
        return f"{self.topic} (no subscription of {', '.join(missing)})" if missing else self.topic

    def drain(self, seconds: float) -> bool:
        """Wait until every receiver has acknowledged everything, at most this long."""
        return bool(self._publisher.wait_for_all_acked(Duration(seconds=seconds)))


class Taker(ABC):
    """What a loop serves."""

    topic: str
    handle: Any
    """Of a subscription of rclpy."""

    def take(self) -> None:
        """Take all messages that wait."""
        while self.take_one():
            pass

    @abstractmethod
    def take_one(self) -> bool:
        """Take one of them; False if there was none."""


class Subscription(Taker):
    """Receives one topic, as bytes, in order, and notices a gap.

    Parameters
    ----------
    node, kind, topic, callback
        Owner, message class, topic name, and who takes the messages.
    latched
        Also get the last message from before joining.
    shared
        The topic has several publishers, so sequence numbers tell nothing.
    foreign
        The publisher is no node of ours. It may have published before: its first message after :meth:`open` is
        number 1, and what came before that does not count.
    qos
        Of a link; for what is not latched.
    read
        Reads each message; where it returns None, the message is a stranger's: it is counted, and else ignored.

    Attributes
    ----------
    strangers
        Messages that were not of this run.
    source_ns, received_ns
        When the message that is handed over was published, and when it was received, by the wall clock [ns].
    period
        Of a foreign publisher: when its messages count, by their source timestamps ``[from, until)`` [ns]. So all who
        hear it agree on which do.
    succession
        Numbers messages where faults let other processes take the place of the publisher's, or of this one; None where
        both are the same from start to end.
    """

    def __init__(
        self,
        node: Node,
        kind: type,
        topic: str,
        callback: Callback,
        *,
        latched: bool = False,
        shared: bool = False,
        foreign: bool = False,
        qos: Qos = USUAL_QOS,
        read: Reader | None = None,
    ) -> None:
        self.topic = topic
        self.count = Count()
        self.strangers = 0
        self.source_ns = 0
        self.received_ns = 0
        self.period: tuple[int, int] | None = None
        self.succession: Succession | None = None
        self._qos = qos
        self._node = node
        self._kind = kind
        self._read = read
        self._callbacks = [callback]
        self._continuous = not latched and not shared
        self._foreign = foreign
        self._closed = foreign
        self._base = 0
        self._matched = False
        wanted = LATCHED_READER if latched else profile(qos)
        subscription = node.create_subscription(kind, topic, _unused, wanted, raw=True)
        self.handle = subscription.handle

    def also(self, callback: Callback) -> None:
        """Let another node of this process hear the same."""
        self._callbacks.append(callback)

    def open(self) -> None:
        """The run begins: from here on a foreign publisher's messages count."""
        self._closed = False

    def expect_nobody(self) -> None:
        """The publisher may be dead: it is not waited for."""
        self._matched = True

    @property
    def matched(self) -> bool:
        """Whether a publisher of the topic is known."""
        self._matched = self._matched or bool(self._node.count_publishers(self.topic))
        return self._matched

    def deserted(self) -> bool:
        """Whether no publisher is there any more."""
        return not self._node.count_publishers(self.topic)

    def take_one(self) -> bool:
        """Hand a waiting message to the callback; False if none was there."""
        taken = self.handle.take_message(self._kind, True)
        if taken is None:
            return False
        data, info = taken
        if self._closed:
            self.strangers += 1
            return True
        self.source_ns, self.received_ns = info["source_timestamp"], info["received_timestamp"]
        content = None
        if self.period is None or self.period[0] <= self.source_ns < self.period[1]:
            content = data if self._read is None else self._read(data)
        if content is None:
            self.strangers += 1
            return True
        sequence = int(info["publication_sequence_number"])
        if self._foreign and not self.count.messages:
            self._base = sequence - 1
        self.count.messages += 1
        self.count.cdr_bytes += len(data)
        number = sequence - self._base
        if self._continuous and self.succession is not None:
            placed = self.succession.number(sequence, self.source_ns)
            if placed is None:
                raise self._gap(number)
            number = placed
        elif self._continuous and number != self.count.messages:
            raise self._gap(number)
        for callback in self._callbacks:
            callback(content, number)
        return True

    def _gap(self, number: int) -> RunError:
        remedy = "is another program publishing on this topic in this ROS domain?"
        if self._qos.reliability is Reliability.BEST_EFFORT:
            remedy = f"its link is best effort, and DDS has lost messages: reliability: reliable. Or else, {remedy}"
        elif self._qos.history < USUAL_QOS.history:
            remedy = f"its link keeps the last {self._qos.history} only: a longer history. Or else, {remedy}"
        there = sorted({name_of(end) for end in self._node.get_publishers_info_by_topic(self.topic)})
        if len(there) > 1:
            remedy = f"{' and '.join(there)} publish on it: one of them does not belong here"
        return RunError(
            f"topic {self.topic}",
            f"message {number} of its publisher came as number {self.count.messages}",
            "every message once, in order, from one publisher",
            remedy,
        )


_OWN_IN_TURN = 64
"""Messages of this process to itself that are taken in turn before others are looked for."""


class Spinner:
    """Waits for messages of several subscriptions and hands them out, in one thread.

    To wait costs a little for each subscription that is waited for, so where many nodes share a process it would be
    most of a run. What this process has sent to itself is there already (DDS hands it over within the call that sends
    it), so it is taken without waiting; now and then, and where nothing of that kind is left, all others have their
    turn.

    Parameters
    ----------
    context
        The initialised rclpy context.
    gather_s
        Wall time to let more messages come in before they are handed out, for who only listens: it wakes up less
        often, and leaves the processor to those that others wait for.
    """

    def __init__(self, context: Any, gather_s: float = 0.0) -> None:
        self._context = context
        self._gather_s = gather_s
        self._subscriptions: list[Taker] = []
        self._handles: list[Any] = []
        self._by_pointer: dict[int, tuple[int, Taker]] = {}
        self._of_all: dict[str, Subscription] = {}
        self._services: dict[int, Any] = {}
        self._wait_set: Any = None
        self._by_topic: dict[str, list[Taker]] = {}
        self._own: deque[Taker] = deque()
        """Those to which this process has sent something that they have not taken."""
        self._own_in_turn = 0
        self._sent_here: set[str] = set()
        self._seen_sent = 0
        self._others: list[Any] = []

    def sent(self, topic: str) -> None:
        """Take note that this process has sent a message, perhaps to itself."""
        if topic in self._by_topic:
            self._own += self._by_topic[topic]
            self._sent_here.add(topic)

    def _handles_of_others(self) -> list[Any]:
        """Of the topics that this process does not send on itself; the others are waited for when it has no more."""
        if self._seen_sent != len(self._sent_here):
            self._seen_sent = len(self._sent_here)
            self._others = [one.handle for one in self._subscriptions if one.topic not in self._sent_here]
        return self._others

    def serve(self, services: Iterable[Any]) -> None:
        """Answer requests to these services, too: those of nodes that ROS tools are shown."""
        self._services |= {service.handle.pointer: service for service in services}
        self._wait_set = None

    def add(self, subscription: Taker) -> None:
        """Listen to one more subscription."""
        self._by_pointer[subscription.handle.pointer] = (len(self._subscriptions), subscription)
        self._subscriptions.append(subscription)
        self._handles.append(subscription.handle)
        self._by_topic.setdefault(subscription.topic, []).append(subscription)
        self._wait_set = None

    def for_all(self, topic: str, make: Callable[[], Subscription], callback: Callback) -> Subscription:
        """The one subscription of this process to what is told to all nodes; ``make`` makes it for the first."""
        if topic in self._of_all:
            self._of_all[topic].also(callback)
        else:
            self._of_all[topic] = make()
            self.add(self._of_all[topic])
        return self._of_all[topic]

    def once(self, timeout_s: float) -> bool:
        """Wait for messages and hand them out; False if none came in time."""
        while self._own and self._own_in_turn < _OWN_IN_TURN:
            self._own_in_turn += 1
            if self._own.popleft().take_one():
                return True
        self._own_in_turn = 0
        if self._wait_set is None:
            self._wait_set = _rclpy.WaitSet(
                len(self._subscriptions), 0, 0, 0, len(self._services), 0, self._context.handle
            )
        handles = self._handles
        if self._own:  # only a glance at what others send
            handles, timeout_s = self._handles_of_others(), 0.0
        wait_set = self._wait_set
        wait_set.clear_entities()
        for handle in handles:
            wait_set.add_subscription(handle)
        for service in self._services.values():
            wait_set.add_service(service.handle)
        if self._gather_s:
            time.sleep(self._gather_s)
        wait_set.wait(int(timeout_s * 1e9))
        if self._services:
            for pointer in wait_set.get_ready_entities("service"):
                _answer(self._services[pointer])
        ready = wait_set.get_ready_entities("subscription")
        if not ready:
            return bool(self._own)
        ends = [self._by_pointer[pointer] for pointer in ready]
        for _, subscription in sorted(ends, key=itemgetter(0)) if len(ends) > 1 else ends:
            if self._gather_s:
                subscription.take()
            else:
                subscription.take_one()  # to ask for a second takes time, and there seldom is one: else it is next
        return True


def _answer(service: Any) -> None:
    request, header = service.handle.service_take_request(service.srv_type.Request)
    if header is not None:
        service.send_response(service.callback(request, service.srv_type.Response()), header)


def name_of(end: Any) -> str:
    """Full name of the node that an endpoint of a topic belongs to."""
    return f"{end.node_namespace.rstrip('/')}/{end.node_name}"


def _unused(message: Any) -> None:
    raise AssertionError("messages are taken by Subscription.take, not by an executor")
