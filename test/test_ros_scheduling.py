"""In a launched run in simulated time nobody pushes aside who is still sending, and the recorder comes last."""

from __future__ import annotations

import os
from collections.abc import Mapping
from pathlib import Path

import pytest

from etac_ros.runs import RosOptions, run_over_ros
from etac_ros.scenario.load import load


@pytest.mark.parametrize(("rate", "policy"), [(None, os.SCHED_BATCH), (200.0, os.SCHED_OTHER)])
def test_processes_of_a_run_take_turns_and_those_in_real_time_do_not(
    tmp_path: Path, rate: float | None, policy: int
) -> None:
    processes: dict[str, int] = {}
    found: dict[str, tuple[int, int]] = {}

    def look(tick: int, fired: Mapping[str, int]) -> None:
        for name, process in processes.items():
            found[name] = os.sched_getscheduler(process), os.getpriority(os.PRIO_PROCESS, process)

    own = os.sched_getscheduler(0), os.getpriority(os.PRIO_PROCESS, 0)
    run_over_ros(
        load("wu2018", None, ["duration_s=200"]), tmp_path / "bag", RosOptions(rate=rate), look, processes.update
    )
    assert {scheduler for scheduler, _ in found.values()} == {policy}
    later = {name for name, (_, nice) in found.items() if nice > own[1]}
    assert later == ({"/recorder"} if rate is None else set())
    assert (os.sched_getscheduler(0), os.getpriority(os.PRIO_PROCESS, 0)) == own
