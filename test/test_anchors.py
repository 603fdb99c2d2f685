"""The work of `./scripts/bench anchors` is the scenario's: the same numbers, and as many instants as its text says."""

from __future__ import annotations

import ast
import importlib
import re
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from etac_ros.runs import run_in_process
from etac_ros.scenario.load import load

BENCH = Path(__file__).resolve().parent.parent / "bench"


@pytest.fixture
def workload(monkeypatch: pytest.MonkeyPatch) -> Any:
    monkeypatch.syspath_prepend(str(BENCH / "others"))
    return importlib.import_module("workload")


def test_the_numbers_are_those_of_the_scenario(workload: Any) -> None:
    scenario = load("wu2018")
    dynamics, disturbance = scenario.nodes["/plant"]["dynamics"], scenario.nodes["/plant"]["dynamics"]["disturbance"]
    sensor = scenario.nodes["/sensor"]
    assert scenario.run.ticks_per_second == workload.TICKS_PER_SECOND
    assert workload.J.ravel().tolist() == dynamics["inertia_kg_m2"]
    assert workload.CONSTANT.tolist() == disturbance["constant_nm"]
    assert workload.SINE.tolist() == disturbance["sine_nm"]
    assert workload.COSINE.tolist() == disturbance["cosine_nm"]
    assert disturbance["frequency_rad_s"] == workload.FREQUENCY
    assert sensor["signal"]["beta"] == workload.BETA
    assert (sensor["trigger"]["alpha"], sensor["trigger"]["gamma"]) == (workload.ALPHA, workload.GAMMA)
    assert scenario.nodes["/controller"]["law"]["k"] == workload.K
    assert scenario.nodes["/actuator"]["limit_nm"] == workload.LIMIT


def test_the_scenario_has_the_instants_that_are_said(workload: Any) -> None:
    tree = ast.parse((BENCH / "anchors.py").read_text(encoding="utf-8"))
    (start,) = (
        ast.literal_eval(node.value)
        for node in tree.body
        if isinstance(node, ast.Assign) and ast.unparse(node.targets[0]) == "START"
    )
    np.testing.assert_allclose(start, workload.START[:4], rtol=0.0, atol=1e-15)
    run = run_in_process(
        load("wu2018", None, [f"plant.dynamics.attitude_q={start}", "plant.dynamics.attitude_euler_deg=null"])
    )
    said = re.search(r"give (\d+) triggering instants", workload.__doc__)
    assert said is not None
    assert sum(figures.count for figures in run.summary.triggers.values()) == int(said[1])


def test_everything_that_is_compared_can_be_installed() -> None:
    wanted = set(re.findall(r'^    Way\(.*\("\w+\.py".*?\), "(\w+)"', (BENCH / "anchors.py").read_text(), re.MULTILINE))
    listed = {line for line in (BENCH / "anchors.txt").read_text().splitlines() if not line.startswith("#")}
    assert wanted
    assert wanted <= listed
