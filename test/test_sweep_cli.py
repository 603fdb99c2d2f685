"""``etac sweep`` on the command line."""

from __future__ import annotations

import json
from pathlib import Path

import pytest
from conftest import SmallScenario
from test_cli import etac

from etac_ros.metrics.figures import FigureKey
from etac_ros.sweep.result import read_result

RATE = "plant.dynamics.rate_deg_s"


@pytest.mark.parametrize(
    ("arguments", "said"),
    [
        (["wu2019"], ["wu2019", "'wu2018'?"]),
        (["wu2018", "--runs", "0"], ["--runs 0", "1 or more"]),
        (["wu2018", "--set", "sensor.triger.alpha=0.3,0.4"], ["triger", "'trigger'?"]),
        (["wu2018", "--set", "sensor.trigger.alpha="], ["empty"]),
        (["wu2018", "--dispersion", "plant.module=normal:1"], ["plant.module", "number"]),
        (["wu2018", "--workers", "0"], ["--workers 0", "1 or more"]),
        (["wu2018", "--runs", "3", "--replay", "3"], ["sample 3", "0 to 2"]),
        (["wu2018", "--scheduler", "tcp://127.0.0.1:9", "--workers", "2"], ["--workers", "--scheduler"]),
        (["wu2018", "--set", "duration_s=10", "--output", "file/out.parquet"], ["file/out.parquet", "--output"]),
        (["wu2018", "--set", "duration_s=10", "--output", "file"], ["file", "no Parquet file"]),
    ],
)
def test_bad_input_runs_nothing(arguments: list[str], said: list[str], tmp_path: Path) -> None:
    (tmp_path / "file").write_text("mine")
    done = etac("sweep", *arguments, cwd=tmp_path)
    assert done.returncode == 2, done.stderr
    for words in said:
        assert words in done.stderr
    assert "Traceback" not in done.stderr
    assert (tmp_path / "file").read_text() == "mine"
    assert [path.name for path in tmp_path.iterdir()] == ["file"]


def test_a_sweep_its_summary_and_a_replay(small: SmallScenario, tmp_path: Path) -> None:
    command = [
        "sweep",
        str(small()),
        "--runs",
        "5",
        "--set",
        "controller.law.k=1.0,2.0",
        "--dispersion",
        f"{RATE}=normal:2",
    ]
    done = etac(*command, cwd=tmp_path)
    assert done.returncode == 0, done.stderr
    for words in ("controller.law.k = 1.0", "triggering instants", "shortest inter-event time", f"{RATE}: normal 2"):
        assert words in done.stdout
    (path,) = (tmp_path / "sweeps").iterdir()
    result = read_result(path)
    assert result.complete
    assert result.table.num_rows == 10
    again = etac(*command, cwd=tmp_path)
    assert again.stdout == done.stdout  # nothing ran: the same wall times
    replay = etac(*command, "--replay", "7", "--json", "seven.json", cwd=tmp_path)
    assert replay.returncode == 0, replay.stderr
    assert "run 3 at grid point 1" in replay.stdout
    summary = json.loads((tmp_path / "seven.json").read_text())
    row = result.table.to_pylist()[7]
    for one in summary["measured"]:
        assert row[str(FigureKey(one["figure"], one["node"]))] == one["value"]
    assert summary["seed"] == row["seed"]
    assert summary["overrides"][RATE] == row[f"drawn.{RATE}"]


def test_a_replay_over_dds_is_the_same_run_with_a_bag(small: SmallScenario, tmp_path: Path) -> None:
    path = small(("    seed: 3\n", "    seed: 3\n    baseline: clocked\n"))
    command = ["sweep", str(path), "--runs", "3", "--dispersion", f"{RATE}=normal:2", "--replay", "2"]
    calls = etac(*command, "--json", "calls.json", cwd=tmp_path)
    ros = etac(*command, "--engine", "ros", "--bag", "bag", "--json", "ros.json", cwd=tmp_path)
    assert calls.returncode == ros.returncode == 0, calls.stderr + ros.stderr
    one, other = (json.loads((tmp_path / name).read_text()) for name in ("calls.json", "ros.json"))
    assert (one["engine"], other["engine"]) == ("inprocess", "ros")
    for key in ("final_state", "triggers", "measured", "seed", "overrides"):
        assert one[key] == other[key], key
    assert [figure["value"] for figure in one["measured"] if figure["figure"] == "baseline_messages"] == [80.0]
    info = etac("info", "bag", cwd=tmp_path)
    assert info.returncode == 0
    assert str(one["seed"]) in info.stdout
