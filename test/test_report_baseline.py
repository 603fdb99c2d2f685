"""A report compares a run with a baseline of the same plants, start and length, and with no other."""

from __future__ import annotations

from pathlib import Path

import pytest

from etac_ros.report.source import read_run
from etac_ros.report.view import View
from etac_ros.runs import run_in_process
from etac_ros.scenario.load import baseline_of, load


@pytest.mark.parametrize(
    "change", ["plant.dynamics.attitude_euler_deg=[1,2,3]", "duration_s=21", "sensor.noise.enters=both"]
)
def test_a_baseline_of_another_run_is_only_another_run(change: str, tmp_path: Path) -> None:
    scenario = load("wu2018", None, ["duration_s=20"])
    other = load("wu2018", None, ["duration_s=20", change])
    bags = {"run": scenario, "own": baseline_of(scenario), "other": baseline_of(other)}
    for name, made in bags.items():
        assert made is not None
        run_in_process(made, tmp_path / name)
    run, own, foreign = (read_run(tmp_path / name) for name in bags)
    assert View(run, (foreign, own)).baseline is own
    assert View(run, (foreign,)).baseline is None
