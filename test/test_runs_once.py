"""One run does its work once: the file is read once, kernels are loaded once, and nothing is built to be looked at."""

from __future__ import annotations

import io
import os
from collections import Counter
from collections.abc import Callable
from pathlib import Path
from typing import Any

import pytest
from rich.console import Console

from etac_ros import runs
from etac_ros.cli.run import RunRequest, run_and_show
from etac_ros.engines.inprocess import InProcess
from etac_ros.runs import RosOptions
from etac_ros.scenario import document
from etac_ros.scenario import load as loading
from etac_ros.scenario.load import load


@pytest.fixture
def counted(monkeypatch: pytest.MonkeyPatch) -> Counter[str]:
    """How often files were read, graphs built and runs made in this process."""
    counts: Counter[str] = Counter()
    parent = os.getpid()

    def counting(name: str, function: Callable[..., Any]) -> Callable[..., Any]:
        def call(*arguments: Any, **named: Any) -> Any:
            counts[name] += os.getpid() == parent
            return function(*arguments, **named)

        return call

    monkeypatch.setattr(document, "_text_of", counting("read", document._text_of))
    monkeypatch.setattr(loading, "build", counting("built", loading.build))
    monkeypatch.setattr(InProcess, "run", counting("run by calls", InProcess.run))
    monkeypatch.setattr(runs, "_warm", set())
    return counts


def play(tmp_path: Path, engine: str, *overrides: str) -> str:
    bag = tmp_path / "bag"
    options = RosOptions("one") if engine == "ros" else RosOptions()
    request = RunRequest("wu2018", None, ("duration_s=20", *overrides), engine, bag=bag, options=options)
    console = Console(file=io.StringIO(), width=200)
    run_and_show(request, console)
    assert isinstance(console.file, io.StringIO)
    return console.file.getvalue()


def test_over_ros_a_graph_is_built_to_be_forked_and_one_to_load_kernels(counted: Counter[str], tmp_path: Path) -> None:
    play(tmp_path, "ros", "baseline=null")
    assert counted == {"read": 1, "built": 2, "run by calls": 1}


def test_by_calls_run_and_baseline_read_the_file_once(counted: Counter[str], tmp_path: Path) -> None:
    said = play(tmp_path, "inprocess", "plant.dynamics.attitude_euler_deg=[350,0,0]", "sensor.trigger.alpha=0.3")
    # Each of the two: one to check and look at, one to load kernels, one to run.
    assert counted == {"read": 1, "built": 6, "run by calls": 4}
    assert "attitude_euler_deg is a rotation of 350 deg" in said
    assert "baseline 'periodic' keeps its own sensor.trigger, whatever --set sensor.trigger.alpha says" in said


def test_the_graph_to_look_at_stays_and_graphs_to_run_are_fresh() -> None:
    scenario = load("wu2018")
    assert scenario.graph is scenario.graph
    assert scenario.build() is not scenario.graph
    drawn = scenario.with_values({"plant.dynamics.attitude_euler_deg": [1.0, 0.0, 0.0]}, 3)
    assert drawn.graph is not scenario.graph
