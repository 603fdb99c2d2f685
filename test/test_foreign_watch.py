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
from etac_ros.engines.ros.plan import Plan
from etac_ros.errors import CountMismatch, RunError
from etac_ros.scenario.load import load
from etac_ros.timing.windows import USUAL_WINDOWS

ANSWERS = "/torque_command"
QUESTIONS = "/filtered_error"


class Watched:
    """A run of wu2018 whose controller is foreign; ``sent`` is what is known to be owed."""

    def __init__(self, patch: pytest.MonkeyPatch, *overrides: str) -> None:
        scenario = load("wu2018", None, ["duration_s=10", *(overrides or ("controller.external=true",))])
        self.plan = Plan(scenario.name, scenario.digest, scenario.build(), USUAL_WINDOWS)
        self.bus = Bus()
        self._publisher: Any = None
        self.clock = Clock()
        patch.setattr(foreign, "time", self.clock)
        self.sent = dict.fromkeys(self.plan.graph.links, 0)
        self.ends: list[Subscription] = []
        self.watch = Foreign(self.plan, self.bus.node("coordinator"), self.sent, self._listen)  # type: ignore[arg-type]

    def _listen(self, kind: type, topic: str, callback: Any) -> Subscription:
        end = Subscription(self.bus.node("coordinator"), kind, topic, callback, raw=True, foreign=True)  # type: ignore[arg-type]
        end.open()
        self.ends.append(end)
        return end

    def publisher(self, kind: type = Point32, qos: QoSProfile = DATA) -> Any:
        return self.bus.node("theirs", "/far").create_publisher(kind, ANSWERS, qos)

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
