"""Runs do not disturb each other: each has a ROS domain of its own, and a domain in use is refused."""

from __future__ import annotations

import os
import socket
import subprocess
import sys
from concurrent.futures import ThreadPoolExecutor
from pathlib import Path

import pytest

from etac_ros.engines.ros.domain import take_domain
from etac_ros.errors import RunError, ScenarioError
from etac_ros.metrics.summary import Summary
from etac_ros.runs import RosOptions, run_in_process, run_over_ros
from etac_ros.scenario.load import load


def test_a_domain_taken_by_a_run_is_refused() -> None:
    lease = take_domain()
    with pytest.raises(RunError, match=f"ROS domain {lease.domain}: is in use"):
        take_domain(lease.domain)
    lease.release()
    take_domain(lease.domain).release()


def test_a_domain_used_by_another_program_is_not_chosen_but_may_be_wanted(monkeypatch: pytest.MonkeyPatch) -> None:
    lease = take_domain()
    lease.release()
    monkeypatch.setattr("etac_ros.engines.ros.domain.DOMAINS", range(lease.domain, lease.domain + 1))
    with socket.socket(socket.AF_INET, socket.SOCK_DGRAM) as other:
        other.bind(("127.0.0.1", 7400 + 250 * lease.domain + 10))
        with pytest.raises(RunError, match="none of"):
            take_domain()
        take_domain(lease.domain).release()


def test_free_domains_are_different() -> None:
    leases = [take_domain() for _ in range(5)]
    assert len({lease.domain for lease in leases}) == 5
    for lease in leases:
        lease.release()


def test_a_domain_out_of_range_is_refused() -> None:
    with pytest.raises(ScenarioError, match="out of range"):
        take_domain(232)


@pytest.mark.skipif(os.getuid() != 0, reason="only root can become somebody else")
def test_a_lease_excludes_other_users_and_leaves_nothing_to_them() -> None:
    def taken_by_somebody_else(domain: int) -> bool:
        child = os.fork()
        if child == 0:
            os.setuid(65534)
            try:
                take_domain(domain)  # nobody releases it: the process ends
            except RunError:
                os._exit(1)
            os._exit(0)
        return os.waitstatus_to_exitcode(os.waitpid(child, 0)[1]) == 0

    lease = take_domain()
    assert not taken_by_somebody_else(lease.domain)
    lease.release()
    assert taken_by_somebody_else(lease.domain)
    take_domain(lease.domain).release()


def test_a_run_refuses_a_domain_in_use_before_it_starts(tmp_path: Path) -> None:
    lease = take_domain()
    with pytest.raises(RunError, match="in use"):
        run_over_ros(load("wu2018"), tmp_path / "bag", RosOptions(domain=lease.domain))
    lease.release()
    assert not (tmp_path / "bag").exists()


def test_two_runs_at_once(tmp_path: Path) -> None:
    expected = run_in_process(load("wu2018")).summary

    def run(number: int) -> Summary:
        command = [sys.executable, "-m", "etac_ros", "run", "wu2018"]
        command += ["--bag", str(tmp_path / f"bag{number}"), "--json", str(tmp_path / f"{number}.json")]
        environment = {**os.environ, "PYTHONPATH": os.pathsep.join(sys.path)}
        done = subprocess.run(command, env=environment, capture_output=True, text=True, timeout=120, check=False)
        assert done.returncode == 0, done.stdout + done.stderr
        return Summary.model_validate_json((tmp_path / f"{number}.json").read_text())

    with ThreadPoolExecutor(2) as pool:
        for summary in pool.map(run, (1, 2)):
            assert summary.triggers == expected.triggers
            assert summary.final_state == expected.final_state
