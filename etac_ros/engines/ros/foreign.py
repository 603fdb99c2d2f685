"""What is known of foreign nodes, which nobody here started: whether they fit, what they owe, and when they go."""

from __future__ import annotations

import time
from collections.abc import Callable, Mapping
from typing import Any, NamedTuple

from rclpy.node import Node
from rclpy.qos import DurabilityPolicy, ReliabilityPolicy

from etac_ros.engines.ros.causes import Causes
from etac_ros.engines.ros.endpoints import Subscription, name_of
from etac_ros.engines.ros.plan import Plan
from etac_ros.errors import CountMismatch, RunError
from etac_ros.graph.graph import Link, Reliability
from etac_ros.graph.topics import window_topic
from etac_ros.graph.wire import TABLE_TYPE

Listen = Callable[[Link, Callable[[Any, int], None], bool], Subscription]
"""Subscribes to a topic of a foreign node; the last argument says whether the node itself is the publisher."""

_LOOK_S = 1.0
_SETTLES_S = 0.5
"""How long foreign publishers get to find our subscriptions once these have found them: DDS takes some 10 ms."""
_SLOW_S = 2.0
"""Wall time after which it is said for which foreign node the run waits; an error it is after ``quiet_s``."""


class _Topic(NamedTuple):
    """A topic at one end of which a foreign node is to be."""

    name: str
    kind: str
    sender: str
    best_effort: bool = False


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
        links = graph.links.values()
        self._offered = [_of_link(link) for link in links if link.sender in foreign]
        self._offered += [_Topic(window_topic(name), TABLE_TYPE, name) for name in graph.plants if name in foreign]
        self._asked = [_of_link(link) for link in links if foreign & link.receivers.keys()]
        self._looked = time.monotonic()
        self._said: set[str] = set()
        self._causes: dict[str, Causes] = {}
        self._questions: dict[str, Subscription] = {}
        self._owing_since: tuple[int, float] | None = None
        self._called_slow = False
        self._fitting_since: float | None = None
        if listen is not None:
            for link in graph.links.values():
                if link.sender in foreign:
                    self._answers[link.name] = listen(link, self._on_answer(link), True)
                    for question in graph.hears[link.sender]:
                        if plan.listens_to_question(question):
                            self._causes[link.name] = Causes()
                            self._ask(link, question, listen)

    def _ask(self, answer: Link, question: Link, listen: Listen) -> None:
        def on_question(data: Any, sequence: int) -> None:
            end = self._questions[answer.name]
            self._check_cause(answer, self._causes[answer.name].question(end.source_ns))

        self._questions[answer.name] = listen(question, on_question, False)

    def complete(self) -> bool:
        """Whether all answers that were asked for have come, each after its question."""
        return all(self._owed(link) <= 0 for link in self._answers) and all(
            causes.settled for causes in self._causes.values()
        )

    def absent(self) -> list[str]:
        """Foreign nodes that have not appeared, with the topic that nobody publishes."""
        return [
            f"{topic.sender} (no publisher of {topic.name} that fits)"
            for topic in self._offered
            if not any(self._joins(topic, end) for end in self._publishers(topic))
        ]

    def slow(self) -> str:
        """For which foreign node the run has been waiting for a while; said once a run, empty otherwise."""
        owing = next((link for link in self._answers if self._owed(link) > 0), None)
        if owing is None:
            self._owing_since = None
            return ""
        end, now = self._answers[owing], time.monotonic()
        if self._owing_since is None or self._owing_since[0] != end.count.messages:
            self._owing_since = end.count.messages, now
        if self._called_slow or now - self._owing_since[1] < _SLOW_S:
            return ""
        self._called_slow = True
        return (
            f"waiting for {self._link(owing).sender} to answer on {end.topic}: of "
            f"{end.count.messages + self._owed(owing)} answers there came {end.count.messages}; "
            f"after {self._plan.quiet_s:g} s without one the run fails"
        )

    def fits(self) -> bool:
        """Whether every topic of a foreign node has one publisher, which DDS joins with our subscriptions."""
        return all(sum(self._joins(topic, end) for end in self._publishers(topic)) == 1 for topic in self._offered)

    def is_ready(self) -> bool:
        """Whether all have fitted for a while, so that they have found our subscriptions, too; asked again and again.

        DDS tells each side apart from the other, and only ours can be seen here: what a publisher sends before it has
        found a subscription is lost.
        """
        if not self._offered:
            return True
        now = time.monotonic()
        if not self.fits():
            self._fitting_since = None
            return False
        if self._fitting_since is None:
            self._fitting_since = now
        return now - self._fitting_since >= _SETTLES_S

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

    def _check_cause(self, answer: Link, early: tuple[int, int] | None) -> None:
        if early is None:
            return
        number, by_ns = early
        raise CountMismatch(
            f"node {answer.sender}, topic {answer.topic}",
            f"its message {number} was published {by_ns / 1e6:.3g} ms before the one that it should answer",
            "exactly one message for each that it receives, and none by itself",
            "publish in the callback of the subscription: no timer of its own, and no second answer",
        )

    def _on_answer(self, link: Link) -> Callable[[Any, int], None]:
        may_lead = max(1, len(self._plan.graph.hears[link.sender]))

        def on_message(data: Any, sequence: int) -> None:
            # A question and its answer may both overtake the report that the question was asked.
            end = self._answers[link.name]
            if link.name in self._causes:
                self._check_cause(link, self._causes[link.name].answer(end.source_ns))
            if -self._owed(link.name) > may_lead:
                raise self._wrong_count(link.name, end)

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

    def _publishers(self, topic: _Topic) -> list[Any]:
        return list(self._node.get_publishers_info_by_topic(topic.name))

    def _joins(self, topic: _Topic, end: Any) -> bool:
        offers = end.qos_profile.reliability is not ReliabilityPolicy.BEST_EFFORT
        return (offers or topic.best_effort) and end.topic_type == topic.kind

    def _misfits(self) -> list[str]:
        """Why DDS does not join a foreign node's end of a topic with ours, in words."""
        found = []
        for topic in self._offered:
            ends = self._publishers(topic)
            fit = sorted(name_of(end) for end in ends if self._joins(topic, end))
            if len(fit) > 1:
                found.append(f"{' and '.join(fit)} publish on {topic.name}; expected: one of them")
            for end in ends:
                if end.topic_type != topic.kind:
                    found.append(f"{name_of(end)} publishes {end.topic_type} on {topic.name}; expected: {topic.kind}")
                elif not self._joins(topic, end):
                    found.append(f"{name_of(end)} offers best effort on {topic.name}; asked for: reliable")
        own = set(self._plan.nodes)
        for topic in self._asked:
            for end in self._node.get_subscriptions_info_by_topic(topic.name):
                if name_of(end) in own:
                    continue
                if end.topic_type != topic.kind:
                    words = f"subscribes to {end.topic_type} on {topic.name}; sent there: {topic.kind}"
                    found.append(f"{name_of(end)} {words}")
                elif end.qos_profile.durability is DurabilityPolicy.TRANSIENT_LOCAL:
                    found.append(f"{name_of(end)} asks for transient local on {topic.name}; offered: volatile")
                elif topic.best_effort and end.qos_profile.reliability is ReliabilityPolicy.RELIABLE:
                    found.append(f"{name_of(end)} asks for reliable on {topic.name}; offered: best effort")
        return found


def _of_link(link: Link) -> _Topic:
    best_effort = link.qos.reliability is Reliability.BEST_EFFORT
    return _Topic(link.topic, link.wire.type_name, link.sender, best_effort)
