"""The coordinator's watch over foreign nodes, without any: who fits, who owes an answer, who says too much."""

from __future__ import annotations

from typing import Any

import pytest
from fake_ros import Bus, Clock
from geometry_msgs.msg import Point32, Vector3
from rclpy.qos import DurabilityPolicy, QoSProfile, ReliabilityPolicy

from etac_ros.engines.ros import foreign
from etac_ros.engines.ros.endpoints import DATA, Subscription
from etac_ros.engines.ros.foreign import Foreign
from etac_ros.engines.ros.messages import message_type
from etac_ros.engines.ros.plan import Plan
from etac_ros.errors import CountMismatch, RunError
from etac_ros.graph.graph import Link
from etac_ros.scenario.load import load
from etac_ros.timing.windows import USUAL_WINDOWS

ANSWERS = "/torque_command"
QUESTIONS = "/filtered_error"


class Watched:
    """A run of wu2018 whose controller is foreign; ``sent`` is what is known to be owed."""

    def __init__(self, patch: pytest.MonkeyPatch, *overrides: str, token: str = "") -> None:
        scenario = load("wu2018", None, ["duration_s=10", *(overrides or ("controller.external=true",))])
        self.plan = Plan(scenario.name, scenario.digest, scenario.build(), USUAL_WINDOWS, token=token)
        self.bus = Bus()
        self._publisher: Any = None
        self._asker: Any = None
        self.clock = Clock()
        patch.setattr(foreign, "time", self.clock)
        self.sent = dict.fromkeys(self.plan.graph.links, 0)
        self.ends: list[Subscription] = []
        self.watch = Foreign(self.plan, self.bus.node("coordinator"), self.sent, self._listen)  # type: ignore[arg-type]

    def _listen(self, link: Link, callback: Any, foreign: bool) -> Subscription:
        kind = message_type(link.wire)
        end = Subscription(self.bus.node("coordinator"), kind, link.topic, callback, foreign=foreign)  # type: ignore[arg-type]
        end.open()
        self.ends.append(end)
        return end

    def publisher(self, kind: type = Point32, qos: QoSProfile = DATA) -> Any:
        return self.bus.node("theirs", "/far").create_publisher(kind, ANSWERS, qos)

    def ask(self) -> None:
        if self._asker is None:
            self._asker = self.bus.node("sensor").create_publisher(Point32, QUESTIONS, DATA)
        self._asker.publish(Point32())

    def take(self, *topics: str) -> None:
        for topic in topics:
            (end,) = [end for end in self.ends if end.topic == topic]
            end.take()

    def answer(self, times: int) -> None:
        if self._publisher is None:
            self._publisher = self.publisher()
        for _ in range(times):
            self._publisher.publish(Point32())
        self.ends[0].take()


def qos(**changes: Any) -> QoSProfile:
    return QoSProfile(
        **{"depth": 10, "reliability": ReliabilityPolicy.RELIABLE, "durability": DurabilityPolicy.VOLATILE} | changes
    )


def test_all_is_well(monkeypatch: pytest.MonkeyPatch) -> None:
    watched = Watched(monkeypatch)
    assert [end.topic for end in watched.ends] == [ANSWERS]
    assert watched.watch.complete()
    watched.sent["torque_command"] = 2
    assert not watched.watch.complete()
    watched.answer(1)
    assert not watched.watch.complete()
    watched.answer(1)
    assert watched.watch.complete()
    watched.watch.check_all_counted()
    watched.watch.blame()


def test_without_foreign_nodes_there_is_nothing_to_watch(monkeypatch: pytest.MonkeyPatch) -> None:
    watched = Watched(monkeypatch, "seed=3")
    watched.clock.now += 10.0
    assert watched.ends == []
    assert watched.watch.complete()
    assert watched.watch.fits()
    assert watched.watch.misfits() == []
    watched.watch.check_present()
    watched.watch.check_all_counted()


@pytest.mark.parametrize("by", [-1, 1])
def test_one_answer_too_few_or_too_many_at_the_end(by: int, monkeypatch: pytest.MonkeyPatch) -> None:
    watched = Watched(monkeypatch)
    watched.sent["torque_command"] = 3
    watched.answer(3 + by)
    with pytest.raises(
        CountMismatch,
        match=f"node /controller, topic {ANSWERS}: it has sent {3 + by} messages where 3 were asked for",
    ):
        watched.watch.check_all_counted()


def test_an_answer_may_overtake_the_report_of_its_question_and_no_more(monkeypatch: pytest.MonkeyPatch) -> None:
    watched = Watched(monkeypatch)
    watched.sent["torque_command"] = 4
    watched.answer(5)
    assert watched.watch.complete()
    with pytest.raises(CountMismatch, match="it has sent 6 messages where 4 were asked for"):
        watched.answer(1)


def test_who_owes_an_answer_is_named(monkeypatch: pytest.MonkeyPatch) -> None:
    watched = Watched(monkeypatch)
    watched.sent["torque_command"] = 5
    watched.answer(3)
    with pytest.raises(RunError, match=f"node /controller: owes an answer on {ANSWERS}: of 5 there came 3"):
        watched.watch.blame()


def test_who_has_gone_is_named_if_it_owes(monkeypatch: pytest.MonkeyPatch) -> None:
    watched = Watched(monkeypatch)
    watched.answer(1)
    watched.sent["torque_command"] = 1
    watched.bus.writers.clear()
    watched.clock.now += 1.0
    watched.watch.check_present()  # it owes nothing
    watched.sent["torque_command"] = 2
    watched.watch.check_present()  # it was looked for a moment ago
    watched.clock.now += 0.9
    watched.watch.check_present()
    watched.clock.now += 0.2
    with pytest.raises(RunError, match=f"node /controller: has gone: nobody publishes {ANSWERS} any more, after 1 m"):
        watched.watch.check_present()


def test_one_that_owes_and_is_there_is_left_in_peace(monkeypatch: pytest.MonkeyPatch) -> None:
    watched = Watched(monkeypatch)
    watched.answer(1)
    watched.sent["torque_command"] = 2
    watched.clock.now += 5.0
    watched.watch.check_present()


def test_who_fits(monkeypatch: pytest.MonkeyPatch) -> None:
    watched = Watched(monkeypatch)
    assert not watched.watch.fits()
    watched.publisher(Vector3)
    assert not watched.watch.fits()
    watched.publisher(qos=qos(reliability=ReliabilityPolicy.BEST_EFFORT))
    assert not watched.watch.fits()
    watched.publisher()
    assert watched.watch.fits()


def test_two_of_one_role_do_not_fit(monkeypatch: pytest.MonkeyPatch) -> None:
    watched = Watched(monkeypatch)
    watched.publisher()
    watched.bus.node("other").create_publisher(Point32, ANSWERS, DATA)
    assert not watched.watch.fits()
    watched.clock.now += 1.0
    assert watched.watch.misfits() == [f"/far/theirs and /other publish on {ANSWERS}; expected: one of them"]


def test_misfits_are_told_once_and_not_too_often(monkeypatch: pytest.MonkeyPatch) -> None:
    watched = Watched(monkeypatch)
    watched.publisher(Vector3)
    watched.publisher(qos=qos(reliability=ReliabilityPolicy.BEST_EFFORT))
    node = watched.bus.node("theirs", "/far")
    node.create_subscription(Vector3, QUESTIONS, lambda _: None, qos())
    node.create_subscription(Point32, QUESTIONS, lambda _: None, qos(durability=DurabilityPolicy.TRANSIENT_LOCAL))
    node.create_subscription(Point32, QUESTIONS, lambda _: None, qos())
    # Ours: the recorder hears it, too, whatever it asks for.
    watched.bus.node("recorder").create_subscription(Vector3, QUESTIONS, lambda _: None, qos())
    assert watched.watch.misfits() == []
    watched.clock.now += 1.0
    assert watched.watch.misfits() == [
        f"/far/theirs publishes geometry_msgs/msg/Vector3 on {ANSWERS}; expected: geometry_msgs/msg/Point32",
        f"/far/theirs offers best effort on {ANSWERS}; asked for: reliable",
        f"/far/theirs subscribes to geometry_msgs/msg/Vector3 on {QUESTIONS}; sent there: geometry_msgs/msg/Point32",
        f"/far/theirs asks for transient local on {QUESTIONS}; offered: volatile",
    ]
    watched.clock.now += 1.0
    assert watched.watch.misfits() == []


@pytest.mark.parametrize("heard", [(QUESTIONS, ANSWERS), (ANSWERS, QUESTIONS)], ids=["in order", "overtaken"])
def test_who_answers_when_asked_is_left_in_peace(heard: tuple[str, str], monkeypatch: pytest.MonkeyPatch) -> None:
    watched = Watched(monkeypatch, token="x")
    for count in (1, 2, 3):
        watched.ask()
        watched.answer(0)
        watched._publisher.publish(Point32())
        watched.sent["torque_command"] = count
        watched.take(*heard)
        assert watched.watch.complete()
    watched.watch.check_all_counted()


@pytest.mark.parametrize("heard", [(QUESTIONS, ANSWERS), (ANSWERS, QUESTIONS)], ids=["in order", "overtaken"])
def test_a_message_before_its_question_is_proof_of_a_timer(
    heard: tuple[str, str], monkeypatch: pytest.MonkeyPatch
) -> None:
    watched = Watched(monkeypatch, token="x")
    watched.ask()
    watched.sent["torque_command"] = 1
    watched.answer(2)  # the second by itself: one ahead, which the counts alone allow
    watched.sent["torque_command"] = 2
    watched.ask()
    message = rf"node /controller, topic {ANSWERS}: its message 2 was published .* before the one that it should answer"
    with pytest.raises(CountMismatch, match=message):
        watched.take(*heard)


def test_an_answer_whose_question_has_not_been_heard_is_waited_for(monkeypatch: pytest.MonkeyPatch) -> None:
    watched = Watched(monkeypatch, token="x")
    watched.ask()
    watched.sent["torque_command"] = 1
    watched.answer(1)
    assert not watched.watch.complete()
    watched.take(QUESTIONS)
    assert watched.watch.complete()


def test_clocks_of_several_machines_prove_nothing(monkeypatch: pytest.MonkeyPatch) -> None:
    watched = Watched(monkeypatch)
    assert [end.topic for end in watched.ends] == [ANSWERS]
    assert watched.plan.listeners(watched.plan.graph.links["filtered_error"]) == (("/recorder",), 1)
    at_once = Watched(monkeypatch, token="x")
    assert at_once.plan.listeners(at_once.plan.graph.links["filtered_error"]) == (("/recorder", "/coordinator"), 1)


def test_who_is_waited_for_is_said_once(monkeypatch: pytest.MonkeyPatch) -> None:
    watched = Watched(monkeypatch)
    assert watched.watch.slow() == ""
    watched.sent["torque_command"] = 3
    watched.answer(2)
    assert watched.watch.slow() == ""
    watched.clock.now += 1.9
    assert watched.watch.slow() == ""
    watched.clock.now += 0.2
    said = watched.watch.slow()
    assert said.startswith(f"waiting for /controller to answer on {ANSWERS}: of 3 answers there came 2; after ")
    watched.clock.now += 5.0
    assert watched.watch.slow() == ""


def test_who_is_absent_is_named_with_its_topic(monkeypatch: pytest.MonkeyPatch) -> None:
    watched = Watched(monkeypatch)
    assert watched.watch.absent() == [f"/controller (no publisher of {ANSWERS} that fits)"]
    watched.publisher()
    assert watched.watch.absent() == []


def test_a_run_begins_once_all_have_fitted_for_a_while(monkeypatch: pytest.MonkeyPatch) -> None:
    """What a foreign publisher sends before it has found our subscriptions would be lost, and it finds them later."""
    watched = Watched(monkeypatch)
    assert not watched.watch.is_ready()
    first = watched.publisher()
    assert not watched.watch.is_ready()
    watched.clock.now += foreign._SETTLES_S / 2
    watched.bus.writers.remove(first.end)
    assert not watched.watch.is_ready()
    watched.publisher()
    watched.clock.now += foreign._SETTLES_S / 2
    assert not watched.watch.is_ready()
    watched.clock.now += foreign._SETTLES_S
    assert watched.watch.is_ready()


def test_without_foreign_publishers_a_run_begins_at_once(monkeypatch: pytest.MonkeyPatch) -> None:
    assert Watched(monkeypatch, "seed=1").watch.is_ready()
