"""The coordinator: who may join, whom it names when nothing comes, and when windows become shorter."""

from __future__ import annotations

import json
from pathlib import Path
from typing import Any

import pytest
from fake_ros import World
from rclpy.serialization import deserialize_message
from rosgraph_msgs.msg import Clock
from std_msgs.msg import String

from etac_ros.engines.ros import coordinator as coordinator_module
from etac_ros.engines.ros.endpoints import DATA
from etac_ros.engines.ros.own_code import own_code
from etac_ros.engines.ros.plan import COORDINATOR, RECORDER
from etac_ros.errors import RunError
from etac_ros.graph.topics import CLOCK, END, MESSAGE_LOG, STOP
from etac_ros.runs import run_in_process
from etac_ros.scenario.load import load


def world(patch: pytest.MonkeyPatch, *overrides: str, variant: str | None = None, **options: Any) -> World:
    return World(load("wu2018", variant, list(overrides) or ["duration_s=10"]), patch, **options)


def content(data: bytes) -> Any:
    return json.loads(deserialize_message(data, String).data)["is"]


def join(one: World, **changes: Any) -> None:
    plan = one.plan
    said = {"node": "/sensor", "scenario": plan.scenario, "digest": plan.digest, "pid": 7, "run": plan.run_id}
    one.coordinator._on_join({**said, **changes}, 1)


def test_all_have_to_be_there_before_it_begins(monkeypatch: pytest.MonkeyPatch) -> None:
    one = world(monkeypatch)
    *first, last = one.plan.nodes
    for name in first:
        join(one, node=name)
        join(one, node=name)  # it may say so twice
    assert not one.coordinator.started
    assert one.coordinator.began == 0.0
    join(one, node=last)
    assert one.coordinator.started
    assert one.coordinator.began == one.clock.now


@pytest.mark.parametrize(
    ("changes", "words"),
    [
        ({"node": "/other"}, r"^node /other: of scenario 'wu2018' is in this ROS domain"),
        ({"digest": "x", "scenario": "mine"}, r"^node /sensor: was started with another scenario \('mine', x\)"),
        ({"clock": "wall"}, r"^node /sensor: runs in wall time\n  expected: simulated time, as the other nodes"),
    ],
)
def test_who_does_not_belong_here_is_named(
    changes: dict[str, Any], words: str, monkeypatch: pytest.MonkeyPatch
) -> None:
    with pytest.raises(RunError, match=words):
        join(world(monkeypatch), **changes)


def test_by_hand_all_are_of_the_same_code(monkeypatch: pytest.MonkeyPatch) -> None:
    by_hand = world(monkeypatch, token="")
    by_hand.coordinator.announce()
    own = own_code()
    join(by_hand, code=own)
    for other in ({"code": f"{own}0"}, {}):
        with pytest.raises(RunError, match=r"^node /actuator: is of another etac_ros"):
            join(by_hand, node="/actuator", **other)


def test_a_node_that_is_there_twice_is_named(monkeypatch: pytest.MonkeyPatch) -> None:
    one = world(monkeypatch)
    join(one)
    with pytest.raises(RunError, match=r"^node /sensor: is there twice"):
        join(one, pid=8)


def test_notes_of_other_runs_are_nothing_to_a_run_with_a_token(monkeypatch: pytest.MonkeyPatch) -> None:
    one = world(monkeypatch)
    join(one, run="other", node="/other")
    join(one, run="other")
    join(one, pid=8)
    by_hand = world(monkeypatch, token="")
    with pytest.raises(RunError, match=r"^node /other"):
        join(by_hand, run="other", node="/other")


@pytest.mark.parametrize("join", [None, [], "x", {}, {"node": "/sensor", "scenario": "x", "digest": "y"}])
def test_what_is_no_joining_is_ignored(join: Any, monkeypatch: pytest.MonkeyPatch) -> None:
    one = world(monkeypatch)
    one.coordinator._on_join(join, 1)
    assert one.coordinator._greeted == {}


def test_who_has_not_appeared_is_named(monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]) -> None:
    one = world(monkeypatch)
    missing = [name for name in one.plan.nodes if name not in ("/sensor", RECORDER)]
    one.clock.now += 15.0
    join(one)
    join(one, node=RECORDER)
    one.clock.now += one.plan.quiet_s - 0.1
    one.coordinator.idle(patient=False)
    one.clock.now += 0.2
    one.coordinator.idle(patient=True)
    said = capsys.readouterr()
    assert not said.out
    assert f"{COORDINATOR}: in ROS domain 0, still waiting for {', '.join(missing)}" in said.err
    one.coordinator.idle(patient=False)  # it has just been said
    one.clock.now += one.plan.quiet_s + 0.1
    with pytest.raises(RunError, match=f"^node {', '.join(missing)}: has not appeared within 20 s"):
        one.coordinator.idle(patient=False)


def silent(patch: pytest.MonkeyPatch, name: str, *overrides: str, variant: str | None = None) -> World:
    """A run in which a node takes nothing any more after its first second."""
    one = world(patch, *overrides, variant=variant)
    one.join()
    for _ in range(12):
        one.spinner.once(0.05)
    node: Any = one.nodes[name]
    for subscription in node._subscriptions:
        for taking in ("take", "take_one"):
            patch.setattr(subscription, taking, lambda s=subscription: bool(s.handle.waiting.clear()))
    one.spin()
    return one


@pytest.mark.parametrize(("name", "named"), [("/sensor", "/sensor"), ("/actuator", "/actuator")])
def test_who_owes_an_answer_is_named(name: str, named: str, monkeypatch: pytest.MonkeyPatch) -> None:
    one = silent(monkeypatch, name, "duration_s=100")
    assert one.coordinator.stop is None
    one.clock.now += one.plan.quiet_s - 0.5
    one.coordinator.idle(patient=False)
    one.coordinator.excuse()
    one.clock.now += one.plan.quiet_s - 0.5
    one.coordinator.idle(patient=False)
    one.clock.now += 1.0
    with pytest.raises(RunError, match=rf"^node {named}: has gone quiet at simulated time .* no answer for 20 s"):
        one.coordinator.idle(patient=True)


@pytest.mark.parametrize(("reliability", "hinted"), [("best_effort", True), ("reliable", False)])
def test_a_message_that_dds_may_have_lost_is_named(
    reliability: str, hinted: bool, monkeypatch: pytest.MonkeyPatch
) -> None:
    """Behind the last message of all comes none whose number would show the gap: who waits for it waits in vain."""
    one = silent(monkeypatch, "/actuator", "duration_s=100", f"links.torque_command.reliability={reliability}")
    one.coordinator.idle(patient=False)
    one.clock.now += one.plan.quiet_s + 1.0
    with pytest.raises(RunError, match="has gone quiet") as caught:
        one.coordinator.idle(patient=False)
    assert ("best effort: /torque_command" in str(caught.value)) == hinted


def test_steps_are_a_sign_of_life(monkeypatch: pytest.MonkeyPatch) -> None:
    one = silent(monkeypatch, "/actuator", "duration_s=100")
    one.clock.now += 100.0
    one.coordinator._steps -= 1  # a step was made since it was idle last
    one.coordinator.idle(patient=False)


def test_who_has_not_left_is_named(monkeypatch: pytest.MonkeyPatch) -> None:
    one = world(monkeypatch)
    monkeypatch.setattr(one.nodes["/controller"], "drained", lambda: False)
    one.join()
    one.spin()
    assert one.coordinator.stop is not None
    one.coordinator.idle(patient=True)
    one.clock.now += one.plan.quiet_s + 1.0
    # It has not left itself: it waits for the other, as the recorder does.
    with pytest.raises(RunError, match=f"^node /controller, {COORDINATOR}, {RECORDER}: has not left within 20 s"):
        one.coordinator.idle(patient=True)


def test_the_last_word_tells_how_much_was_sent(monkeypatch: pytest.MonkeyPatch) -> None:
    one = World(load("xie2021", None, ["duration_s=0.1"]), monkeypatch)
    one.run()
    (stop,) = map(content, one.bus.said(STOP))
    assert stop["tick"] == one.plan.graph.end_tick
    assert stop["fault"] == ""
    assert stop["sent"] == {name: len(one.bus.said(link.topic)) for name, link in one.plan.graph.links.items()}
    for name, count in stop["orders"].items():
        assert count == len(one.bus.said(f"/emulation{name}/go")) > 0
    assert len(one.bus.said(END)) == 1


def test_an_aborted_run_says_so_once(monkeypatch: pytest.MonkeyPatch) -> None:
    one = world(monkeypatch, "duration_s=100")
    one.join()
    for _ in range(6):
        one.spinner.once(0.05)
    one.clock.now += 2.5
    one.coordinator.abort()
    (stop,) = map(content, one.bus.said(STOP))
    assert stop["fault"] == "aborted"
    assert one.coordinator.loop_s == 2.5
    one.coordinator.stop = stop
    one.coordinator.abort()
    assert len(one.bus.said(STOP)) == 1
    other = world(monkeypatch)
    other.coordinator.fault = "it burns"
    other.coordinator.abort()
    assert content(other.bus.said(STOP)[0])["fault"] == "it burns"
    assert other.coordinator.loop_s == 0.0


def test_logs_clock_and_progress_come_as_time_goes_on(monkeypatch: pytest.MonkeyPatch) -> None:
    one = world(monkeypatch, "duration_s=30", variant="periodic")
    one.join()
    while one.spinner.once(0.05):
        one.clock.now += 0.06
    clocks = [deserialize_message(data, Clock).clock for data in one.bus.said(CLOCK)]
    times = [clock.sec + clock.nanosec * 1e-9 for clock in clocks]
    assert [tick / 32 for tick in one.progress] == pytest.approx(times)
    assert times == sorted(times)
    assert len(times) > 10
    assert times[-1] == 30.0
    logs = [content(data) for data in one.bus.said(MESSAGE_LOG)]
    assert [log["log"] for log in logs] == list(range(1, len(logs) + 1))
    assert len(logs) > 10
    told = [tuple(transit[:2]) for log in logs for transit in log["transits"]]
    assert len(told) == len(set(told)) == sum(one.coordinator.master.sent.values())


def test_where_time_stands_still_a_log_is_told_when_it_is_long(monkeypatch: pytest.MonkeyPatch) -> None:
    one = world(monkeypatch, "duration_s=30", "sensor.trigger.period_s=0.03125", variant="periodic")
    one.run()
    logs = [content(data)["transits"] for data in one.bus.said(MESSAGE_LOG)]
    assert all(400 < len(log) <= 410 for log in logs[:-1])
    assert len(logs) > 5


@pytest.mark.parametrize(("pause", "shorter"), [(0.9, False), (1.1, True)])
def test_a_slow_step_makes_windows_shorter(pause: float, shorter: bool, monkeypatch: pytest.MonkeyPatch) -> None:
    one = world(monkeypatch, "duration_s=100")
    shortened: list[None] = []
    monkeypatch.setattr(one.coordinator.master, "shorten_windows", lambda: shortened.append(None))
    one.coordinator._on_step()
    assert shortened == []  # the first has no step before it
    one.clock.now += pause
    one.coordinator._on_step()
    assert bool(shortened) == shorter


def test_a_watch_of_the_last_samples_ends_the_run_too(monkeypatch: pytest.MonkeyPatch) -> None:
    one = world(monkeypatch)
    assert one.coordinator.halted == ""
    one.coordinator.leave_notes = {"/sensor": {}, "/plant": {"halted": "too far"}}
    assert one.coordinator.halted == "/plant: too far"
    one.coordinator.master.halted = "/x: first"
    assert one.coordinator.halted == "/x: first"


def test_a_fault_that_it_told_itself_is_no_news(monkeypatch: pytest.MonkeyPatch) -> None:
    one = world(monkeypatch)
    one.coordinator._on_fault({"node": COORDINATOR, "fault": "x"}, 1)
    with pytest.raises(RunError, match=r"^node /sensor: x"):
        one.coordinator._on_fault({"node": "/sensor", "fault": "x"}, 1)
    one.coordinator.fault = "known"
    one.coordinator._on_fault({"node": "/sensor", "fault": "x"}, 1)
    one.coordinator.fault = ""
    one.coordinator.stop = {"fault": ""}
    one.coordinator._on_fault({"node": "/sensor", "fault": "x"}, 1)
    assert coordinator_module._LOGS_AHEAD * coordinator_module._LOG_MESSAGES < 4096  # a topic's depth


def test_who_listens_to_the_clock_hears_of_every_event(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    def times(heard: bool) -> list[float]:
        one = world(monkeypatch)
        if heard:
            one.bus.node("tool").create_subscription(Clock, CLOCK, lambda _: None, DATA)
        one.run()
        clocks = [deserialize_message(data, Clock).clock for data in one.bus.said(CLOCK)]
        return [clock.sec + clock.nanosec * 1e-9 for clock in clocks]

    shown = times(heard=True)
    assert len(times(heard=False)) <= 2
    assert shown == sorted(shown)
    fired = run_in_process(load("wu2018", None, ["duration_s=10"])).recording.messages["filtered_error"]
    assert {message.tick / 32 for message in fired} <= set(shown)


def test_what_an_editor_leaves_and_line_ends_are_no_other_code(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr("etac_ros.__file__", str(tmp_path / "__init__.py"))
    found = set()
    for text in (b"a = 1\n", b"a = 1\r\n"):
        (tmp_path / "module.py").write_bytes(text)
        found.add(own_code.__wrapped__())
        (tmp_path / ".#module.py").unlink(missing_ok=True)
        (tmp_path / ".#module.py").symlink_to("somebody@somewhere")
    (tmp_path / "module.py").write_bytes(b"a = 2\n")
    assert len(found) == 1
    assert own_code.__wrapped__() not in found
