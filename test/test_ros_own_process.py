"""A run in a program that uses rclpy or threads takes a process of its own, and leaves the program as it was."""

from __future__ import annotations

import os
import subprocess
import sys
import threading
from concurrent.futures import ThreadPoolExecutor
from pathlib import Path

import pytest
from toy import trace

from etac_ros.bag.read import read_bag
from etac_ros.engines.ros import own_process
from etac_ros.errors import RunError, ScenarioError
from etac_ros.runs import RosOptions, Run, run_in_process, run_over_ros
from etac_ros.scenario.load import load

SHORT = ["duration_s=20"]
LIMIT_S = 90

USES_RCLPY = """
import os, sys
from pathlib import Path
import rclpy

rclpy.init(domain_id={domain})
node = rclpy.create_node("mine")
{afterwards}
from etac_ros.runs import load, run_over_ros

before = dict(os.environ)
run = run_over_ros(load("wu2018", overrides=["duration_s=20"]), Path("bag"))
assert dict(os.environ) == before
print(run.summary.triggers["/sensor"].count)
"""


def in_a_thread(number: int, folder: Path) -> Run:
    assert threading.current_thread() is not threading.main_thread()
    assert own_process.is_needed()
    told: list[int] = []
    pids: dict[str, int] = {}
    run = run_over_ros(
        load("wu2018", overrides=SHORT),
        folder / f"bag{number}",
        on_progress=lambda tick, fired: told.append(tick),
        on_start=pids.update,
    )
    assert told
    assert "/sensor" in pids
    return run


def test_two_threads_each_get_their_run(tmp_path: Path) -> None:
    expected = run_in_process(load("wu2018", overrides=SHORT))
    before = dict(os.environ)
    with ThreadPoolExecutor(2) as pool:
        for run in pool.map(lambda number: in_a_thread(number, tmp_path), (1, 2)):
            assert trace(run.recording) == trace(expected.recording)
            assert run.summary.final_state == expected.summary.final_state
            assert run.summary.bag == str(run.bag)
    assert dict(os.environ) == before


@pytest.mark.parametrize("afterwards", ["", "node.destroy_node(); rclpy.shutdown()"], ids=["in use", "was in use"])
def test_a_program_that_uses_rclpy(afterwards: str, tmp_path: Path) -> None:
    script = USES_RCLPY.format(domain=99, afterwards=afterwards)
    done = subprocess.run(
        [sys.executable, "-c", script],
        cwd=tmp_path,
        env={**os.environ, "PYTHONPATH": os.pathsep.join(sys.path), "FASTDDS_BUILTIN_TRANSPORTS": "UDPv4"},
        capture_output=True,
        text=True,
        timeout=LIMIT_S,
        check=False,
    )
    assert done.returncode == 0, done.stderr
    expected = run_in_process(load("wu2018", overrides=SHORT)).summary.triggers["/sensor"].count
    assert done.stdout.split()[-1] == str(expected)


def test_a_program_bound_to_another_dds(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setenv("RMW_IMPLEMENTATION", "rmw_cyclonedds_cpp")
    run_over_ros(load("wu2018", overrides=SHORT), tmp_path / "bag", RosOptions())
    assert os.environ["RMW_IMPLEMENTATION"] == "rmw_cyclonedds_cpp"
    assert read_bag(tmp_path / "bag").recording().messages["filtered_error"]


def test_here_no_other_process_is_needed() -> None:
    assert not own_process.is_needed()


def test_errors_come_back_as_they_are(tmp_path: Path) -> None:
    scenario = load("wu2018", "periodic", ["duration_s=20", "controller.law.class=broken:BrokenLaw"])
    with ThreadPoolExecutor(1) as pool:
        failed = pool.submit(run_over_ros, scenario, tmp_path / "bag").exception()
    assert isinstance(failed, RunError)
    assert "/controller" in failed.where
    assert "the law is broken" in str(failed)


def test_a_scenario_that_has_changed_is_not_run(tmp_path: Path) -> None:
    file = tmp_path / "wu.yaml"
    file.write_text(load("wu2018", overrides=SHORT).text)
    scenario = load(str(file))
    file.write_text(load("wu2018", overrides=["duration_s=30"]).text)
    with ThreadPoolExecutor(1) as pool:
        failed = pool.submit(run_over_ros, scenario, tmp_path / "bag").exception()
    assert isinstance(failed, ScenarioError)
    assert "has changed since" in str(failed)


def test_a_process_that_dies_is_told() -> None:
    with pytest.raises(RunError, match="has ended with exit code 3"):
        own_process.call("broken:leave", {}, lambda kind, content: None)
