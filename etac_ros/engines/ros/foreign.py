"""What is known of foreign nodes, which nobody here started: whether they fit, what they owe, and when they go."""

from __future__ import annotations

import time
from collections.abc import Callable, Mapping
from typing import Any

from rclpy.node import Node
from rclpy.qos import DurabilityPolicy, ReliabilityPolicy

from etac_ros.engines.ros.endpoints import Subscription, name_of
from etac_ros.engines.ros.messages import message_type
from etac_ros.engines.ros.plan import Plan
from etac_ros.errors import CountMismatch, RunError
from etac_ros.graph.graph import Link
from etac_ros.graph.topics import window_topic
from etac_ros.graph.wire import TABLE_TYPE

Listen = Callable[[type, str, Callable[[Any, int], None]], Subscription]
"""Subscribes to a topic of a foreign node."""

_LOOK_S = 1.0


class Foreign:
    """The coordinator's watch over foreign nodes: it hears what they send, and knows what they were asked for.

    Parameters
    ----------
    plan
        Says who is foreign.
    node
        The coordinator's ROS node.
    sent
        Messages that each link is known to owe so far; read as it grows.
    listen
        Subscribes the coordinator; None where nobody is asked for anything, as in real time, so that no answers are
        counted here.
    """

    def __init__(self, plan: Plan, node: Node, sent: Mapping[str, int], listen: Listen | None) -> None:
        graph = plan.graph
        foreign = graph.external
        self._plan = plan
        self._node = node
        self._sent = sent
        self._answers: dict[str, Subscription] = {}
        self._offered = [(link.topic, link.wire.type_name) for link in graph.links.values() if link.sender in foreign]
        self._offered += [(window_topic(name), TABLE_TYPE) for name in graph.plants if name in foreign]
        self._asked = [
            (link.topic, link.wire.type_name) for link in graph.links.values() if foreign & link.receivers.keys()
        ]
        self._looked = time.monotonic()
        self._said: set[str] = set()
        if listen is not None:
            for link in graph.links.values():
                if link.sender in foreign:
                    self._answers[link.name] = listen(message_type(link.wire), link.topic, self._check_lead(link))

    def complete(self) -> bool:
        """Whether all answers that were asked for have come."""
        return all(self._owed(link) <= 0 for link in self._answers)

    def fits(self) -> bool:
        """Whether every topic of a foreign node has one publisher, which DDS joins with our subscriptions."""
        return all(sum(self._joins(kind, end) for end in self._publishers(topic)) == 1 for topic, kind in self._offered)

    def misfits(self) -> list[str]:
        """What does not fit, in words that have not been said yet; looked for now and then."""
        if not self._is_time():
            return []
        fresh = [words for words in self._misfits() if words not in self._said]
        self._said.update(fresh)
        return fresh

    def check_present(self) -> None:
        """Notice now and then who has gone.

        Raises
        ------
        RunError
            If a foreign node that owes an answer is not there any more.
        """
        if not self._is_time():
            return
        for link, end in self._answers.items():
            if self._owed(link) > 0 and end.deserted():
                raise RunError(
                    f"node {self._link(link).sender}",
                    f"has gone: nobody publishes {end.topic} any more, after {end.count.messages} messages",
                    "a foreign node that answers until the run is over",
                    "see what it printed",
                )

    def blame(self) -> None:
        """Name the foreign node that owes an answer, if one does.

        Raises
        ------
        RunError
            With its topic and counts.
        """
        for link, end in self._answers.items():
            if (owed := self._owed(link)) > 0:
                raise RunError(
                    f"node {self._link(link).sender}",
                    f"owes an answer on {end.topic}: of {end.count.messages + owed} there came {end.count.messages}",
                    "one answer to each message, as a reliable publisher sends it",
                    "see what it printed, and whether it hears what it is asked",
                )

    def check_all_counted(self) -> None:
        """At the end: nobody has sent more than was asked for, or less.

        Raises
        ------
        CountMismatch
            Naming node, topic and counts.
        """
        for link, end in self._answers.items():
            if self._owed(link):
                raise self._wrong_count(link, end)

    def _check_lead(self, link: Link) -> Callable[[Any, int], None]:
        may_lead = max(1, len(self._plan.graph.hears[link.sender]))

        def on_message(data: Any, sequence: int) -> None:
            # A question and its answer may both overtake the report that the question was asked.
            if -self._owed(link.name) > may_lead:
                raise self._wrong_count(link.name, self._answers[link.name])

        return on_message

    def _is_time(self) -> bool:
        now = time.monotonic()
        due = now - self._looked >= _LOOK_S and bool(self._offered or self._asked)
        if due:
            self._looked = now
        return due

    def _owed(self, link: str) -> int:
        return self._sent[link] - self._answers[link].count.messages

    def _link(self, name: str) -> Link:
        return self._plan.graph.links[name]

    def _wrong_count(self, link: str, end: Subscription) -> CountMismatch:
        return CountMismatch(
            f"node {self._link(link).sender}, topic {end.topic}",
            f"it has sent {end.count.messages} messages where {self._sent[link]} were asked for",
            "exactly one message for each that it receives, and none by itself",
        )

    def _publishers(self, topic: str) -> list[Any]:
        return list(self._node.get_publishers_info_by_topic(topic))

    def _joins(self, kind: str, end: Any) -> bool:
        return end.qos_profile.reliability is not ReliabilityPolicy.BEST_EFFORT and end.topic_type == kind

    def _misfits(self) -> list[str]:
        """Why DDS does not join a foreign node's end of a topic with ours, in words."""
        found = []
        for topic, kind in self._offered:
            ends = self._publishers(topic)
            fit = sorted(name_of(end) for end in ends if self._joins(kind, end))
            if len(fit) > 1:
                found.append(f"{' and '.join(fit)} publish on {topic}; expected: one of them")
            for end in ends:
                if end.topic_type != kind:
                    found.append(f"{name_of(end)} publishes {end.topic_type} on {topic}; expected: {kind}")
                elif not self._joins(kind, end):
                    found.append(f"{name_of(end)} offers best effort on {topic}; asked for: reliable")
        own = set(self._plan.nodes)
        for topic, kind in self._asked:
            for end in self._node.get_subscriptions_info_by_topic(topic):
                if name_of(end) in own:
                    continue
                if end.topic_type != kind:
                    found.append(f"{name_of(end)} subscribes to {end.topic_type} on {topic}; sent there: {kind}")
                elif end.qos_profile.durability is DurabilityPolicy.TRANSIENT_LOCAL:
                    found.append(f"{name_of(end)} asks for transient local on {topic}; offered: volatile")
        return found
