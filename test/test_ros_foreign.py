"""A foreign controller in plain rclpy takes part, run after run; where it misbehaves it is named, with its topic."""

from __future__ import annotations

import signal
from collections.abc import Sequence
from pathlib import Path

import pytest
from hands import LIMIT_S, Start, foreign
from toy import trace

from etac_ros.engines.ros.domain import DomainLease
from etac_ros.engines.ros.liveness import QUIET_S
from etac_ros.errors import CountMismatch, RunError
from etac_ros.runs import RosOptions, Run, run_in_process, run_over_ros
from etac_ros.scenario.load import load

DURATION = "duration_s=100"


def run(lease: DomainLease, bag: Path, quiet_s: float = QUIET_S, overrides: Sequence[str] = ()) -> Run:
    lease.release()
    scenario = load("wu2018", overrides=[DURATION, "controller.external=true", *overrides])
    return run_over_ros(scenario, bag, RosOptions(domain=lease.domain, quiet_s=quiet_s))


def test_it_serves_one_run_after_another(tmp_path: Path, start: Start, lease: DomainLease) -> None:
    process = foreign(start)
    own = run_in_process(load("wu2018", overrides=[DURATION]))
    for bag in ("one", "two"):
        assert trace(run(lease, tmp_path / bag).recording) == trace(own.recording)
    assert process.poll() is None


def test_what_it_published_before_does_not_count(tmp_path: Path, start: Start, lease: DomainLease) -> None:
    foreign(start, "--before", "7")
    assert run(lease, tmp_path / "bag").summary.topics["/torque_command"].messages > 5


@pytest.mark.parametrize(
    "misbehaviour",
    [["--replies", "2"], ["--twice-at", "3"], ["--timer", "0.002"]],
    ids=["always", "once", "by a timer of its own"],
)
def test_answers_without_a_question(misbehaviour: list[str], tmp_path: Path, start: Start, lease: DomainLease) -> None:
    foreign(start, *misbehaviour)
    # Its count or a time of publication gives it away, whichever is seen first.
    told = r"it has sent \d+ messages where \d+ were asked|its message \d+ was published .* before the one"
    with pytest.raises(CountMismatch, match=f"node /controller, topic /torque_command: ({told})"):
        run(lease, tmp_path / "bag")


@pytest.mark.parametrize("stamp", ["copied", "wall"])
def test_stamps_of_who_need_not_know_the_time_are_its_own_affair(
    stamp: str, tmp_path: Path, start: Start, lease: DomainLease
) -> None:
    foreign(start, "--stamped", stamp)
    over_ros = run(lease, tmp_path / "bag", overrides=["wire=stamped"])
    assert trace(over_ros.recording) == trace(
        run_in_process(load("wu2018", overrides=[DURATION, "wire=stamped"])).recording
    )


def test_a_stamp_that_is_needed_has_to_be_simulated_time(tmp_path: Path, start: Start, lease: DomainLease) -> None:
    foreign(start, "--stamped", "wall")
    # An actuator that hands on its torque stamped has to know the time.
    stamped = ["wire=stamped", "links.torque.kind=internal", "links.torque.topic=/torque"]
    with pytest.raises(RunError, match=r"topic /torque_command: /controller has stamped a message with"):
        run(lease, tmp_path / "bag", overrides=stamped)


def test_one_that_falls_silent(tmp_path: Path, start: Start, lease: DomainLease) -> None:
    foreign(start, "--mute-after", "4")
    with pytest.raises(RunError, match=r"node /controller: owes an answer on /torque_command: of 5 there came 4"):
        run(lease, tmp_path / "bag", quiet_s=2.0)


def test_one_that_dies(tmp_path: Path, start: Start, lease: DomainLease) -> None:
    foreign(start, "--die-after", "4")
    with pytest.raises(RunError, match=r"node /controller: (has gone|owes an answer on /torque_command)"):
        run(lease, tmp_path / "bag", quiet_s=3.0)


@pytest.mark.parametrize(
    ("misfit", "said"),
    [
        ("--best-effort", "offers best effort on /torque_command; asked for: reliable"),
        ("--transient-local", "asks for transient local on /filtered_error; offered: volatile"),
        ("--wrong-type", "publishes geometry_msgs/msg/Vector3 on /torque_command; expected: geometry_msgs/msg/Point32"),
    ],
)
def test_one_that_does_not_fit_is_told_why_it_is_waited_for(
    misfit: str, said: str, start: Start, lease: DomainLease
) -> None:
    foreign(start, misfit)
    lease.release()
    command = ["run", "wu2018", "--set", DURATION, "--set", "controller.external=true", "--domain", str(lease.domain)]
    waiting = start("-m", "etac_ros", *command)
    assert waiting.stdout is not None
    lines = []
    for line in waiting.stdout:
        lines.append(line)
        if said in line:
            break
    waiting.send_signal(signal.SIGINT)
    rest, _ = waiting.communicate(timeout=LIMIT_S)
    assert any(said in line for line in lines), "".join(lines) + rest


def test_a_listener_that_stands_still_holds_up_nobody(tmp_path: Path, start: Start, lease: DomainLease) -> None:
    process = foreign(start, "--only-listen")
    process.send_signal(signal.SIGSTOP)
    lease.release()
    scenario = load("wu2018", "periodic", ["sensor.trigger.period_s=0.03125", "duration_s=200"])
    over_ros = run_over_ros(scenario, tmp_path / "bag", RosOptions(domain=lease.domain))
    assert over_ros.summary.topics["/filtered_error"].messages == 6400  # more than any history holds
    assert trace(over_ros.recording) == trace(run_in_process(scenario).recording)


def test_notes_of_others_are_ignored(tmp_path: Path, start: Start, lease: DomainLease) -> None:
    foreign(start, "--fakes")
    lease.release()
    scenario = load("wu2018", overrides=["duration_s=200"])
    over_ros = run_over_ros(scenario, tmp_path / "bag", RosOptions(domain=lease.domain))
    assert trace(over_ros.recording) == trace(run_in_process(scenario).recording)
    assert over_ros.summary.strangers["/emulation/join"] >= 1


def test_messages_that_are_sent_later_arrive_all_the_same(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setenv("RMW_FASTRTPS_PUBLICATION_MODE", "ASYNCHRONOUS")
    scenario = load("wu2018", overrides=["duration_s=200"])
    over_ros = run_over_ros(scenario, tmp_path / "bag")
    assert trace(over_ros.recording) == trace(run_in_process(scenario).recording)
