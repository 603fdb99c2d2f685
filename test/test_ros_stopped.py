"""A process that stands still is named, whichever it is; a shorter pause costs time and nothing else."""

from __future__ import annotations

import os
import signal
import threading
from collections.abc import Callable
from pathlib import Path

import psutil
import pytest
from toy import trace

from etac_ros.bag.read import read_bag
from etac_ros.engines.ros.run_node import RunNode
from etac_ros.errors import RunError
from etac_ros.runs import RosOptions, Run, run_in_process, run_over_ros
from etac_ros.scenario.load import load

QUARTER = "sensor.trigger.period_s=0.25"
LEASE_S = 4.0
"""After which DDS forgets a peer, in runs whose processes have no common parent."""


def run_and_stop(
    bag: Path, seconds: float, quiet_s: float, act: Callable[[dict[str, int]], None]
) -> tuple[Run, dict[str, int]]:
    """A run in which something happens to a process, once there is something in the bag."""
    pids: dict[str, int] = {}
    acted = False

    def on_progress(tick: int, fired: dict[str, int]) -> None:
        nonlocal acted
        if tick > 0 and not acted:
            acted = True
            act(pids)

    scenario = load("wu2018", "periodic", [f"duration_s={seconds}", QUARTER])
    try:
        return run_over_ros(scenario, bag, RosOptions(quiet_s=quiet_s), on_progress, pids.update), pids
    finally:
        assert acted
        assert not [pid for pid in pids.values() if psutil.pid_exists(pid)]


@pytest.mark.parametrize("victim", ["/plant", "/recorder", "/actuator"])
def test_a_stopped_process_is_named(victim: str, tmp_path: Path) -> None:
    with pytest.raises(RunError, match=r"has stood still for 1 s(.|\n)*stopped by a signal") as caught:
        run_and_stop(tmp_path / "bag", 100000, 1.0, lambda pids: os.kill(pids[victim], signal.SIGSTOP))
    assert victim in caught.value.where
    assert "--quiet-s" in caught.value.remedy
    # It is let go on to save what it has, so the bag is complete.
    assert (tmp_path / "bag/metadata.yaml").exists()
    assert read_bag(tmp_path / "bag").recording().messages["filtered_error"]


@pytest.mark.parametrize("victim", ["/plant", "/recorder"])
def test_a_pause_costs_time_only(victim: str, tmp_path: Path) -> None:
    def pause(pids: dict[str, int]) -> None:
        os.kill(pids[victim], signal.SIGSTOP)
        threading.Timer(LEASE_S + 1.0, os.kill, [pids[victim], signal.SIGCONT]).start()

    run, _ = run_and_stop(tmp_path / "bag", 500, 20.0, pause)
    assert trace(run.recording) == trace(
        run_in_process(load("wu2018", "periodic", ["duration_s=500", QUARTER])).recording
    )


def test_who_computes_for_long_is_waited_for(tmp_path: Path, capfd: pytest.CaptureFixture[str]) -> None:
    law = "controller.law={class: 'standing:BusyLaw', busy_s: 4.0}"
    scenario = load("wu2018", "periodic", ["duration_s=20", law])
    run = run_over_ros(scenario, tmp_path / "bag", RosOptions(quiet_s=3.0))
    assert run.summary.triggers["/sensor"].count == 20
    assert "node /controller" in (told := capfd.readouterr().err)
    assert "has been computing for" in told


def test_who_has_not_heard_of_the_end_is_not_waited_for(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    heard = RunNode._on_end
    monkeypatch.setattr(  # the run's processes inherit it
        RunNode, "_on_end", lambda node, *message: None if node.name == "/sensor" else heard(node, *message)
    )
    pids: dict[str, int] = {}
    run = run_over_ros(load("wu2018", overrides=["duration_s=20"]), tmp_path / "bag", on_start=pids.update)
    assert trace(run.recording) == trace(run_in_process(load("wu2018", overrides=["duration_s=20"])).recording)
    assert not [pid for pid in pids.values() if psutil.pid_exists(pid)]


def test_who_is_blocked_is_named(tmp_path: Path) -> None:
    scenario = load("wu2018", "periodic", ["duration_s=20", "controller.law={class: 'standing:BlockedLaw'}"])
    with pytest.raises(RunError, match=r"node /controller(.|\n)*has stood still for 3 s(.|\n)*: blocked"):
        run_over_ros(scenario, tmp_path / "bag", RosOptions(quiet_s=3.0))
    assert read_bag(tmp_path / "bag").recording().messages["filtered_error"]
