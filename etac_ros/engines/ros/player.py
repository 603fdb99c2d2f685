"""Playing a bag: its messages as ROS topics, at the pace of their times, with ``/clock``."""

from __future__ import annotations

import math
import time
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from importlib import import_module
from typing import Any

import rclpy
from builtin_interfaces.msg import Time
from rclpy.context import Context
from rclpy.node import Node
from rclpy.qos import DurabilityPolicy, HistoryPolicy, QoSProfile, ReliabilityPolicy
from rclpy.signals import SignalHandlerOptions
from rosgraph_msgs.msg import Clock

from etac_ros.errors import RunError
from etac_ros.graph.topics import CLOCK
from etac_ros.maths.ticks import NANOSECONDS

_CLOCK_S = 0.01
"""While nothing is published the clock goes on, so often."""
_LOOK_S = 0.05
_DEPTH = 1000
_PARTED_S = 30.0
"""How long readers may take to acknowledge what they have been sent."""


@dataclass(frozen=True)
class PlayedTopic:
    """One topic that is published; ``latched`` is for what is said once."""

    name: str
    type_name: str
    latched: bool


@dataclass(frozen=True)
class PlayedMessage:
    """One message as it was recorded, and its time [ns]."""

    topic: str
    cdr: bytes
    time_ns: int


def message_class(type_name: str) -> Any | None:
    """The class of a message type; None where its package is not installed."""
    package, kind, name = type_name.split("/")
    try:
        return getattr(import_module(f"{package}.{kind}"), name)
    except (ImportError, AttributeError):
        return None


def play_messages(
    topics: Sequence[PlayedTopic],
    messages: Sequence[PlayedMessage],
    rate: float,
    domain: int,
    wait: bool = False,
    say: Callable[[str], None] = lambda words: None,
) -> int:
    """Publish messages in their order, each when its time has come.

    Parameters
    ----------
    topics, messages
        What is published, ascending in time.
    rate
        Seconds of the bag a second; infinity publishes as fast as it can.
    domain
        ROS domain.
    wait
        Whether to begin only when somebody listens to one of the topics.
    say
        Told what is happening.

    Returns
    -------
    int
        How many were published.

    Notes
    -----
    A clock is published before each message that is later than the one before, so a node with ``use_sim_time`` never
    knows an earlier time than that of the message which it gets - if it reads ``/clock``, which is best effort, first.
    """
    context = Context()
    rclpy.init(context=context, domain_id=domain, signal_handler_options=SignalHandlerOptions.NO)
    try:
        node = Node("etac_play", context=context, enable_rosout=False, start_parameter_services=False)
        clock = node.create_publisher(Clock, CLOCK, 10)
        publishers = {topic.name: node.create_publisher(_class(topic), topic.name, _qos(topic)) for topic in topics}
        if wait:
            say("waiting for somebody who listens")
            while not any(publisher.get_subscription_count() for publisher in publishers.values()):
                time.sleep(_LOOK_S)
        began, shown_ns = time.monotonic(), -1
        first_ns = messages[0].time_ns if messages else 0
        for message in messages:
            due_s = 0.0 if math.isinf(rate) else (message.time_ns - first_ns) / NANOSECONDS / rate
            while (rest := began + due_s - time.monotonic()) > 0.0:
                if rest > _CLOCK_S:
                    passed_ns = first_ns + int((time.monotonic() - began) * rate * NANOSECONDS)
                    if shown_ns < passed_ns < message.time_ns:
                        clock.publish(_clock(passed_ns))
                        shown_ns = passed_ns
                time.sleep(min(rest, _CLOCK_S))
            if message.time_ns > shown_ns:
                clock.publish(_clock(message.time_ns))
                shown_ns = message.time_ns
            publishers[message.topic].publish(message.cdr)
        for topic, publisher in publishers.items():
            if not publisher.wait_for_all_acked(rclpy.duration.Duration(seconds=_PARTED_S)):
                raise RunError(f"topic {topic}", "somebody who listens does not take what was played", "a live reader")
        return len(messages)
    finally:
        context.try_shutdown()


def _class(topic: PlayedTopic) -> Any:
    found = message_class(topic.type_name)
    assert found is not None  # whoever asks has left out the others
    return found


def _qos(topic: PlayedTopic) -> QoSProfile:
    return QoSProfile(
        history=HistoryPolicy.KEEP_LAST,
        depth=_DEPTH,
        reliability=ReliabilityPolicy.RELIABLE,
        durability=DurabilityPolicy.TRANSIENT_LOCAL if topic.latched else DurabilityPolicy.VOLATILE,
    )


def _clock(time_ns: int) -> Clock:
    seconds, nanoseconds = divmod(time_ns, NANOSECONDS)
    return Clock(clock=Time(sec=seconds, nanosec=nanoseconds))
