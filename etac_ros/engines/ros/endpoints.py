"""Publishers that count, subscriptions that see sequence numbers, and the one loop that waits for messages.

rclpy's executors were measured against the wait set that they are made of: an exchange takes 1.3 to 1.5 times as long
with SingleThreadedExecutor, EventsExecutor cannot deliver the message info. The sequence numbers are the point here,
so this file is the one place that waits, and no other knows how.
"""

from __future__ import annotations

import time
from collections.abc import Callable
from dataclasses import dataclass
from operator import itemgetter
from typing import Any

from rclpy.duration import Duration
from rclpy.impl.implementation_singleton import rclpy_implementation as _rclpy
from rclpy.node import Node
from rclpy.qos import DurabilityPolicy, HistoryPolicy, QoSProfile, ReliabilityPolicy
from rclpy.serialization import serialize_message

from etac_ros.errors import RunError

DATA = QoSProfile(
    history=HistoryPolicy.KEEP_ALL,
    reliability=ReliabilityPolicy.RELIABLE,
    durability=DurabilityPolicy.VOLATILE,
)
"""Nothing is dropped and nothing is repeated. A keep-last history loses messages in a burst."""

LATCHED = QoSProfile(
    depth=1,
    history=HistoryPolicy.KEEP_LAST,
    reliability=ReliabilityPolicy.RELIABLE,
    durability=DurabilityPolicy.TRANSIENT_LOCAL,
)
"""For what a node that joins late has to know."""

_LATCHED_READER = QoSProfile(
    history=HistoryPolicy.KEEP_ALL,
    reliability=ReliabilityPolicy.RELIABLE,
    durability=DurabilityPolicy.TRANSIENT_LOCAL,
)
"""A reader that keeps one message would let the greeting of one node push out another's."""

Callback = Callable[[Any, int], None]
"""Takes a message (or its bytes) and its sequence number on its publisher: 1, 2, ..."""


@dataclass
class Count:
    """What went through one end of a topic."""

    messages: int = 0
    cdr_bytes: int = 0


class Publisher:
    """Publishes on one topic and counts.

    Parameters
    ----------
    node
        The owner.
    kind, topic
        Message class and topic name.
    listeners
        How many subscriptions have to be matched before the run begins.
    latched
        Keep the last message for late joiners.
    """

    def __init__(self, node: Node, kind: type, topic: str, listeners: int, latched: bool = False) -> None:
        self.topic = topic
        self.listeners = listeners
        self.count = Count()
        self._publisher = node.create_publisher(kind, topic, LATCHED if latched else DATA)

    def publish(self, message: Any) -> int:
        """Publish a message; returns its sequence number."""
        serialized = serialize_message(message)
        # Counted first: a receiver may answer before this call returns.
        self.count.messages += 1
        self.count.cdr_bytes += len(serialized)
        self._publisher.publish(serialized)
        return self.count.messages

    @property
    def matched(self) -> bool:
        """Whether all expected subscriptions are there."""
        return int(self._publisher.get_subscription_count()) >= self.listeners

    def drain(self, seconds: float) -> bool:
        """Wait until every receiver has acknowledged everything, at most this long."""
        return bool(self._publisher.wait_for_all_acked(Duration(seconds=seconds)))


class Subscription:
    """Receives one topic, in order, and notices a gap.

    Parameters
    ----------
    node, kind, topic, callback
        Owner, message class, topic name, and who takes the messages.
    raw
        Hand over serialized bytes.
    latched
        Also get the last message from before joining.
    shared
        The topic has several publishers, so sequence numbers tell nothing.
    """

    def __init__(
        self,
        node: Node,
        kind: type,
        topic: str,
        callback: Callback,
        raw: bool = False,
        latched: bool = False,
        shared: bool = False,
    ) -> None:
        self.topic = topic
        self.count = Count()
        self._node = node
        self._kind = kind
        self._raw = raw
        self._callbacks = [callback]
        self._continuous = not latched and not shared
        profile = _LATCHED_READER if latched else DATA
        subscription = node.create_subscription(kind, topic, _unused, profile, raw=raw)
        self.handle = subscription.handle

    def also(self, callback: Callback) -> None:
        """Let another node of this process hear the same."""
        self._callbacks.append(callback)

    @property
    def matched(self) -> bool:
        """Whether a publisher of the topic is known."""
        return bool(self._node.count_publishers(self.topic))

    def take(self) -> None:
        """Hand all waiting messages to the callback."""
        while (taken := self.handle.take_message(self._kind, self._raw)) is not None:
            message, info = taken
            sequence = int(info["publication_sequence_number"])
            self.count.messages += 1
            if self._raw:
                self.count.cdr_bytes += len(message)
            if self._continuous and sequence != self.count.messages:
                raise RunError(
                    f"topic {self.topic}",
                    f"message {sequence} of its publisher came as number {self.count.messages}",
                    "every message once, in order, from one publisher",
                    "is another program publishing on this topic in this ROS domain?",
                )
            for callback in self._callbacks:
                callback(message, sequence)


class Spinner:
    """Waits for messages of several subscriptions and hands them out, in one thread.

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
        self._subscriptions: list[Subscription] = []
        self._by_pointer: dict[int, tuple[int, Subscription]] = {}
        self._of_all: dict[str, Subscription] = {}
        self._wait_set: Any = None

    def add(self, subscription: Subscription) -> None:
        """Listen to one more subscription."""
        self._by_pointer[subscription.handle.pointer] = (len(self._subscriptions), subscription)
        self._subscriptions.append(subscription)
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
        if self._wait_set is None:
            self._wait_set = _rclpy.WaitSet(len(self._subscriptions), 0, 0, 0, 0, 0, self._context.handle)
        wait_set = self._wait_set
        wait_set.clear_entities()
        for subscription in self._subscriptions:
            wait_set.add_subscription(subscription.handle)
        if self._gather_s:
            time.sleep(self._gather_s)
        wait_set.wait(int(timeout_s * 1e9))
        ready = wait_set.get_ready_entities("subscription")
        if not ready:
            return False
        for _, subscription in sorted((self._by_pointer[pointer] for pointer in ready), key=itemgetter(0)):
            subscription.take()
        return True


def _unused(message: Any) -> None:
    raise AssertionError("messages are taken by Subscription.take, not by an executor")
