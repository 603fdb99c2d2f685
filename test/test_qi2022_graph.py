"""The cableless formation as a node graph: the paper's cases, both sites of the trigger, and its parts by hand."""

from __future__ import annotations

import os
import re
import subprocess
import sys
from pathlib import Path

import numpy as np
import pytest
from test_engines_equal import assert_same

from etac_ros.cli.compare import compare
from etac_ros.cli.show import make_console
from etac_ros.engines.inprocess import InProcess
from etac_ros.engines.ros.domain import take_domain
from etac_ros.errors import RunHalted, ScenarioError
from etac_ros.metrics import curves
from etac_ros.metrics.summary import Summary
from etac_ros.report.source import read_run
from etac_ros.report.view import View
from etac_ros.runs import RosOptions, run_in_process, run_over_ros
from etac_ros.scenario.load import load
from etac_ros.timing.windows import WindowPolicy

VARIANTS = ["case2", "case3", "tuned", "periodic", "heartbeat", "measurement", "site-sm", "smc"]


@pytest.mark.parametrize(
    ("variant", "count", "low", "high"),
    [(None, 196, 187, 225), ("case2", 208, 190, 260), ("case3", 232, 214, 285), ("tuned", 196, 191, 201)],
)
def test_counts_beside_the_papers(variant: str | None, count: int, low: int, high: int) -> None:
    summary = run_in_process(load("qi2022", variant)).summary
    measured = summary.triggers["/pm/relative_sensor"].count
    assert low <= measured <= high
    assert abs(measured / count - 1.0) < 0.16
    assert summary.network.messages == measured
    assert summary.watches["/sim/plant"][0].largest == pytest.approx(0.424, abs=5e-4)


@pytest.mark.parametrize(
    ("variant", "messages", "payload_each", "updates"),
    [(None, None, 12, None), ("measurement", None, 60, None), ("site-sm", 2000, 60, 205), ("smc", 2000, 60, 2000)],
)
def test_what_the_air_carries(
    variant: str | None, messages: int | None, payload_each: int, updates: int | None
) -> None:
    """With the trigger on the PM only triggered messages cross the air; as printed, every sample does."""
    summary = run_in_process(load("qi2022", variant)).summary
    air = summary.topics["/pm/relative"]
    assert summary.network == type(summary.network)(
        messages=air.messages,
        deliveries=air.messages,
        payload_bytes=air.payload_bytes,
        cdr_bytes=air.cdr_bytes,
    )
    assert air.payload_bytes == payload_each * air.messages
    assert air.messages == (messages or summary.triggers["/pm/relative_sensor"].count)
    applied = summary.topics["/emulation/sm/cmg_torque"].messages
    assert applied == summary.topics["/sm/torque_s"].messages
    assert abs(applied - (updates or air.messages)) <= 5


@pytest.mark.parametrize("variant", [None, *VARIANTS])
def test_same_bits_over_dds(variant: str | None, tmp_path: Path) -> None:
    scenario = load("qi2022", variant, ["duration_s=10"])
    over_ros = run_over_ros(scenario, tmp_path / "bag", RosOptions(processes="namespace"))
    assert_same(over_ros.recording, run_in_process(scenario).recording)


@pytest.mark.parametrize("variant", [None, "site-sm"])
def test_windows_change_nothing(variant: str | None) -> None:
    scenario = load("qi2022", variant, ["duration_s=20"])
    usual = InProcess(scenario.build(), WindowPolicy(1, 1)).run()
    assert_same(usual, InProcess(scenario.build(), WindowPolicy(8, 64)).run())


def test_leaving_the_air_clearance_ends_the_run_alike(tmp_path: Path) -> None:
    scenario = load("qi2022", None, ["sm/cmg.limit_nm=0.001"])
    with pytest.raises(RunHalted, match=r"about x is 0\.929\d* deg at 0\.75 s \(tick 15\).*state \[") as by_calls:
        run_in_process(scenario)
    with pytest.raises(RunHalted) as over_ros:
        run_over_ros(scenario, tmp_path / "bag")
    assert str(over_ros.value) == str(by_calls.value)


def test_the_printed_panels_are_refused() -> None:
    with pytest.raises(ScenarioError, match=r"not positive definite(.|\n)*\+3\.66 1/s"):
        load("qi2022", "printed")


def test_three_parts_make_one_run(tmp_path: Path) -> None:
    lease = take_domain()
    lease.release()
    environment = {**os.environ, "PYTHONPATH": os.pathsep.join(path for path in sys.path if path)}

    def part(namespace: str, *more: str) -> subprocess.Popen[str]:
        command = [sys.executable, "-m", "etac_ros", "run", "qi2022", "--only", namespace]
        command += ["--join", str(lease.domain), "--set", "duration_s=5", *more]
        return subprocess.Popen(
            command, cwd=tmp_path, env=environment, stdout=subprocess.PIPE, stderr=subprocess.STDOUT, text=True
        )

    parts = [
        part("/pm", "--bag", "pm", "--json", "pm.json", "--live"),
        part("/sm"),
        part("/sim", "--bag", "bag", "--json", "summary.json"),
    ]
    shown = []
    for process in parts:
        output, _ = process.communicate(timeout=90)
        assert process.returncode == 0, output
        shown.append(output)
    assert (
        "--bag, --json, --live: no effect here; the part that keeps time paces and records the run, give it there"
        in shown[0]
    )
    assert "ws://" not in shown[0]
    assert "no effect" not in shown[1] + shown[2]
    summary = Summary.model_validate_json((tmp_path / "summary.json").read_text())
    expected = run_in_process(load("qi2022", None, ["duration_s=5"])).summary
    assert summary.triggers == expected.triggers
    assert summary.final_state == expected.final_state


def test_a_part_needs_a_run_to_join(tmp_path: Path) -> None:
    done = subprocess.run(
        [sys.executable, "-m", "etac_ros", "run", "qi2022", "--only", "/pm"],
        cwd=tmp_path,
        env={**os.environ, "PYTHONPATH": os.pathsep.join(path for path in sys.path if path)},
        capture_output=True,
        text=True,
        timeout=60,
        check=False,
    )
    assert done.returncode == 2
    assert "--join ID" in done.stderr


def test_compare_shows_the_cases_beside_the_paper(capsys: pytest.CaptureFixture[str]) -> None:
    compare("qi2022", ["case1", "site-sm"], [], make_console())
    shown = capsys.readouterr().out
    (counts,) = [
        line for line in shown.splitlines() if line.startswith("case1 ") and "triggering instants, /pm" in line
    ]
    assert re.search(r" 210 +196 +\S+ to \S+!", counts)  # measured, printed, the spread of dispersed starts
    assert "network /pm -> /sm" in shown
    (row,) = [line for line in shown.splitlines() if line.startswith("site-sm") and " / 120,000" in line]
    assert "2,000 / 120,000" in row


def test_compare_of_a_changed_scenario_says_why_nothing_of_the_paper_stands_there(
    capsys: pytest.CaptureFixture[str],
) -> None:
    compare("qi2022", ["case1", "case3"], ["duration_s=2"], make_console())
    shown = capsys.readouterr().out
    assert "no figures of the paper: " in shown
    assert "duration_s is changed" in shown
    assert "5 to 95 %" not in shown


def test_report_has_both_bodies_and_the_margin_of_the_relative_sensor(tmp_path: Path) -> None:
    """Figures 4, 5 and 9 to 11: recomputed from the bag, the rule fires just where a message was sent."""
    run_in_process(load("qi2022", None, ["duration_s=20"]), tmp_path / "bag")
    run = read_run(tmp_path / "bag")
    assert list(curves.bodies(run.graph)) == ["/sim/plant, SM to PM", "/sim/plant, PM to orbit"]
    pm = curves.attitude(run.graph, run.recording, "/sim/plant, PM to orbit")
    assert np.abs(pm.values[0]).max() == pytest.approx(1.5, abs=0.05)
    found = View(run).margins["/pm/relative_sensor"]
    assert np.array_equal(found.errors >= found.thresholds, found.fired)
    assert found.fired.sum() == run.summary.triggers["/pm/relative_sensor"].count - 1
