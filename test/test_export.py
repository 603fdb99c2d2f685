"""A bag as tables: the numbers are those of the recording, whatever the file."""

from __future__ import annotations

import csv
import re
import shutil
import subprocess
from pathlib import Path
from typing import Any

import numpy as np
import pyarrow.parquet
import pytest
from scipy.io import loadmat
from typer.testing import CliRunner

import etac_ros
from etac_ros.cli.main import app
from etac_ros.errors import BagError
from etac_ros.export import BagTables, Format, write_tables
from etac_ros.graph import replay
from etac_ros.metrics import curves
from etac_ros.runs import Run, run_in_process
from etac_ros.scenario.load import load


@pytest.fixture(scope="module")
def run(tmp_path_factory: pytest.TempPathFactory) -> Run:
    """A short run of the pair: two bodies, two inputs, several sensors, a watched quantity."""
    return run_in_process(load("qi2022", None, ["duration_s=3"]), tmp_path_factory.mktemp("run") / "bag")


@pytest.fixture(scope="module")
def bag(run: Run) -> BagTables:
    assert run.bag is not None
    return etac_ros.open_bag(run.bag)


def test_every_sample_of_every_table_is_there(run: Run, bag: BagTables) -> None:
    _, states = run.recording.samples("/sim/plant")
    state = bag.table("state")
    assert state.column_names == ["time_s", "tick", "node", "quantity", "component", "value", "unit"]
    assert state.num_rows == states.size
    assert state.column("value").to_numpy().reshape(states.shape[1], -1).T.tolist() == states.tolist()
    attitude = bag.table("attitude").to_pylist()
    assert {(row["node"], row["quantity"], row["unit"]) for row in attitude} == {
        ("/sim/plant/sm", "quaternion", "1"), ("/sim/plant/sm", "euler error", "deg"),
        ("/sim/plant/pm", "quaternion", "1"), ("/sim/plant/pm", "euler error", "deg"),
        ("/sim/plant", "error", "deg"),
    }  # fmt: skip
    q1 = [row["value"] for row in attitude if (row["node"], row["component"]) == ("/sim/plant/pm", "q1")]
    assert q1 == states[:, 1].tolist()
    angle = curves.attitude_angle(run.scenario.graph, run.recording, "/sim/plant")
    errors = [(row["time_s"], row["value"]) for row in attitude if row["quantity"] == "error"]
    assert errors == list(zip(angle.times_s.tolist(), angle.values[:, 0].tolist(), strict=True))
    rate = next(series for series in bag.series("rate") if series.node == "/sim/plant/pm")
    assert (rate.unit, rate.values.tolist()) == ("rad/s", states[:, 4:7].tolist())
    watched = bag.series("watched")[0]
    assert (watched.quantity, watched.unit, watched.values.shape) == ("angle between the modules", "deg", (61, 3))


def test_triggers_and_messages_are_those_of_the_run(run: Run, bag: BagTables) -> None:
    for node, triggers in run.summary.triggers.items():
        rows = [row for row in bag.table("triggers").to_pylist() if row["node"] == node]
        assert [row["time_s"] for row in rows] == triggers.times_s
        assert [row["number"] for row in rows] == list(range(1, triggers.count + 1))
        assert rows[0]["interval_s"] is None
        assert max(row["interval_s"] for row in rows[1:]) == triggers.max_interval_s
    messages = bag.table("messages").to_pylist()
    for link in run.scenario.graph.links.values():
        found = [row for row in messages if row["link"] == link.name]
        sent = run.recording.messages[link.name]
        assert [(row["sequence"], row["tick"], row["step"], row["payload"]) for row in found] == [
            (one.sequence, one.tick, one.step, one.value.tolist()) for one in sent
        ]
        assert {row["kind"] for row in found} == {link.kind.value}
    network = [row["payload_bytes"] for row in messages if row["kind"] == "network"]
    assert (len(network), sum(network)) == (run.summary.network.messages, run.summary.network.payload_bytes)


def test_torque_is_what_was_held(run: Run, bag: BagTables) -> None:
    held = replay.held_inputs(run.scenario.graph, run.recording, "/sim/plant")
    for series in bag.series("torque"):
        assert (series.node, series.unit, series.components) == ("/sim/plant", "N m", ("x", "y", "z"))
        ticks = held[series.quantity].ticks
        assert series.ticks[: ticks.size].tolist() == ticks.tolist()
        assert series.values[: ticks.size].tolist() == held[series.quantity].values.tolist()
        assert series.ticks[-1] == 60


def test_a_rate_thins_samples_and_no_events(run: Run, bag: BagTables) -> None:
    assert run.bag is not None
    thin = etac_ros.open_bag(run.bag, rate_hz=5.0)
    assert sorted(set(thin.table("attitude").column("tick").to_pylist())) == list(range(0, 61, 4))
    assert thin.table("messages").equals(bag.table("messages"))
    with pytest.raises(BagError, match="a rate above 0"):
        etac_ros.open_bag(run.bag, rate_hz=0.0)
    assert set(etac_ros.open_bag(run.bag, rate_hz=1e-300).table("attitude").column("tick").to_pylist()) == {0}
    refused = CliRunner().invoke(app, ["export", str(run.bag), "--to", "csv", "--rate", "nan"])
    assert str(refused.exception).startswith("--rate nan: is no rate")


def test_parquet_and_csv_hold_the_tables(bag: BagTables, tmp_path: Path) -> None:
    for path in write_tables(bag, Format.PARQUET, tmp_path / "p"):
        assert pyarrow.parquet.read_table(path).to_pylist() == bag.table(path.stem).to_pylist()
    paths = write_tables(bag, Format.CSV, tmp_path / "c")
    assert [path.stem for path in paths] == list(bag.names)
    for path in paths:
        with path.open(newline="", encoding="utf-8") as file:
            read = list(csv.DictReader(file))
        for row, expected in zip(read, bag.table(path.stem).to_pylist(), strict=True):
            for name, value in expected.items():
                if isinstance(value, list):
                    assert [float(word) for word in row[name].split()] == value
                elif isinstance(value, (int, float)):
                    assert float(row[name]) == value
                else:
                    assert row[name] == (value or "")


def test_mat_and_npz_hold_the_arrays(run: Run, bag: BagTables, tmp_path: Path) -> None:
    (mat,) = write_tables(bag, Format.MAT, tmp_path)
    (npz,) = write_tables(bag, Format.NPZ, tmp_path)
    matlab, numpy = loadmat(mat, simplify_cells=True), np.load(npz)
    _, states = run.recording.samples("/sim/plant")
    pm = matlab["attitude"]["sim_plant_pm"]
    assert pm["quaternion"].tolist() == states[:, 0:4].tolist()
    assert numpy["attitude.sim_plant_pm.quaternion"].tolist() == states[:, 0:4].tolist()
    assert numpy["attitude.sim_plant_pm.time_s"].tolist() == pm["time_s"].tolist() == (np.arange(61) / 20).tolist()
    sent = run.recording.messages["relative"]
    assert matlab["messages"]["relative"]["payload"].tolist() == [one.value.tolist() for one in sent]
    assert numpy["messages.relative.tick"].tolist() == [one.tick for one in sent]
    held = replay.held_inputs(run.scenario.graph, run.recording, "/sim/plant")["torque_pm"]
    assert numpy["torque.sim_plant.torque_pm.value"][: held.ticks.size].tolist() == held.values.tolist()


def test_the_command_writes_what_is_asked_for(run: Run, tmp_path: Path) -> None:
    done = CliRunner().invoke(
        app, ["export", str(run.bag), "--to", "csv", "--table", "triggers", "--output", str(tmp_path)]
    )
    assert (done.exit_code, [path.name for path in tmp_path.iterdir()]) == (0, ["triggers.csv"])


def test_what_is_no_table_is_named_with_those_that_are(bag: BagTables, tmp_path: Path) -> None:
    with pytest.raises(BagError, match="attitude, rate, torque, state, watched, triggers, messages"):
        bag.table("attitdue")
    with pytest.raises(BagError, match="table 'attitdue'"):
        write_tables(bag, "csv", tmp_path / "none", ["attitdue"])
    assert not (tmp_path / "none").exists()
    (tmp_path / "file").write_text("")
    with pytest.raises(BagError, match="choose another with --output"):
        write_tables(bag, "csv", tmp_path / "file")


def test_the_lines_of_the_docs_do_what_they_say(run: Run) -> None:
    page = (Path(__file__).parents[1] / "docs" / "bags.md").read_text(encoding="utf-8")
    (lines,) = re.findall(r"```python\n(import etac_ros\n.*?)```", page, re.DOTALL)
    names: dict[str, Any] = {}
    exec(lines.replace("bags/BAG", str(run.bag)), names)
    angle = curves.attitude_angle(run.scenario.graph, run.recording, "/sim/plant")
    assert names["error"]["value"].tolist() == angle.values[:, 0].tolist()


@pytest.mark.skipif(shutil.which("octave-cli") is None, reason="Octave is not installed")
def test_octave_reads_what_the_docs_show(tmp_path: Path) -> None:
    page = (Path(__file__).parents[1] / "docs" / "bags.md").read_text(encoding="utf-8")
    (lines,) = re.findall(r"```octave\n(.*?)```", page, re.DOTALL)
    short = run_in_process(load("wu2018", None, ["duration_s=40"]), tmp_path / "BAG")
    write_tables(etac_ros.open_bag(tmp_path / "BAG"), Format.MAT, tmp_path)
    load_line, *_ = lines.splitlines()  # drawing takes a display
    code = f"{load_line} printf('%.17g\\n', attitude.plant.error(end), triggers.sensor.time_s);"
    done = subprocess.run(
        ["octave-cli", "--norc", "--eval", code], cwd=tmp_path, capture_output=True, text=True, check=False
    )
    last, *instants = [float(line) for line in done.stdout.split()]
    assert last == short.summary.performance["/plant"].attitude_error_deg, done.stderr
    assert instants == short.summary.triggers["/sensor"].times_s
