"""Who runs a sweep does not matter; its rows hold what single runs say; its file carries what was swept."""

from __future__ import annotations

import json
from collections.abc import Callable
from pathlib import Path
from typing import Any

import pyarrow as pa
import pyarrow.parquet as pq
import pytest
from conftest import SmallScenario

from etac_ros import __version__
from etac_ros.errors import ScenarioError
from etac_ros.runs import run_in_process
from etac_ros.scenario.load import load
from etac_ros.sweep.plan import Plan, make_plan
from etac_ros.sweep.result import SweepResult, read_result, write_result
from etac_ros.sweep.run import sweep
from etac_ros.sweep.sample import run_sample
from etac_ros.sweep.workers import CHUNK_S, chunk_length, here, processes

K = "controller.law.k"
RATE = "plant.dynamics.rate_deg_s"
PUBLISHED = (
    "    seed: 3\n",
    '    seed: 3\n    baseline: clocked\n    published: {source: book, triggers: {value: "9.0"}}\n',
)


@pytest.fixture
def plan(small: SmallScenario) -> Plan:
    return make_plan(str(small(PUBLISHED)), 4, None, [f"{K}=1.0,2.0"], [f"{RATE}=normal:2", f"{K}=uniform:0.1"])


def rows(result: SweepResult) -> list[dict[str, Any]]:
    """All that does not depend on the clock on the wall."""
    return [{key: value for key, value in row.items() if key != "wall_s"} for row in result.table.to_pylist()]


def test_processes_give_the_rows_of_this_process(plan: Plan) -> None:
    seen: list[tuple[int, int]] = []
    alone = sweep(plan, here)
    shared = sweep(plan, processes(2), lambda finished, planned: seen.append((finished, planned)))
    assert rows(shared) == rows(alone)
    assert [row["sample"] for row in rows(alone)] == list(range(8))
    assert seen[0] == (0, 8)
    assert seen[-1] == (8, 8)
    assert len({row["energy_n2m2s"] for row in rows(alone)}) == 8


def test_a_sample_replays_to_the_bit(plan: Plan) -> None:
    row = rows(sweep(plan, here))[5]
    again = run_sample(plan, 5)
    assert row["sample"] == 5
    assert row[f"drawn.{RATE}"] == plan.draws(5)[RATE]
    for key, value in again.summary.figures.items():
        assert row[str(key)] == value, key
    # And to the bit of a run that is given the same values by hand.
    values = [f"{key}={json.dumps(value)}" for key, value in {**plan.draws(5), "seed": row["seed"]}.items()]
    by_hand = run_in_process(load(str(plan.scenario.path), None, [f"{K}=2.0", *values]))
    assert by_hand.recording.samples("/plant")[1].tobytes() == again.recording.samples("/plant")[1].tobytes()
    assert by_hand.summary.final_state == again.summary.final_state


def test_a_row_says_what_its_run_says(plan: Plan) -> None:
    run = run_sample(plan, 3).summary
    row = rows(sweep(plan, here))[3]
    triggers = run.triggers["/sensor"]
    assert (row["run"], row["point"], row["set." + K]) == (1, 1, 2.0)
    assert row["triggers"] == triggers.count > 2
    assert (row["min_interval_s"], row["mean_interval_s"], row["max_interval_s"]) == (
        triggers.min_interval_s, triggers.mean_interval_s, triggers.max_interval_s,
    )  # fmt: skip
    assert row["network_messages"] == run.network.messages
    assert row["network_payload_bytes"] == run.network.payload_bytes
    assert row["network_cdr_bytes"] == run.network.cdr_bytes
    performance = run.performance["/plant"]
    assert row["attitude_error_deg"] == performance.attitude_error_deg
    assert row["max_rate_deg_s"] == performance.max_rate_deg_s
    assert row["energy_n2m2s"] == performance.energy_n2m2s
    assert (row["halted"], row["refused"]) == ("", "")
    assert row["baseline_messages"] == 2 * 20.0 / 0.5


def test_the_file_carries_what_was_swept(plan: Plan, tmp_path: Path) -> None:
    found = write_result(sweep(plan, here), tmp_path / "deep" / "sweep.parquet")
    assert found.path is not None
    again = read_result(found.path)
    assert again.table.equals(found.table)
    assert again.complete
    said = again.description
    assert (said["version"], said["seed"], said["runs"]) == (__version__, 3, 4)
    assert said["points"] == [{K: 1.0}, {K: 2.0}]
    assert said["dispersions"] == {RATE: {"normal": 2.0}, K: {"uniform": 0.1}}
    assert said["published"] == [{}, {}]  # at no point of the grid it is the scenario as it stands in its file
    assert {"numpy", "numba", "python"} <= set(said["versions"])
    copy = tmp_path / "copy.yaml"
    copy.write_text(said["scenario_text"])
    assert load(str(copy)).digest == plan.scenario.digest
    # Other programs read it, too.
    assert pq.read_schema(found.path).field("triggers").type == pa.float64()


def damage_cut(path: Path) -> None:
    path.write_bytes(path.read_bytes()[:-40])


def damage_text(path: Path) -> None:
    path.write_text("run,triggers\n1,84\n")


def foreign(path: Path) -> None:
    pq.write_table(pa.table({"run": [1, 2]}), path)


def without_a_column(path: Path) -> None:
    pq.write_table(pq.read_table(path).drop_columns(["seed"]), path)


def other_format(path: Path) -> None:
    table = pq.read_table(path)
    description = json.loads(table.schema.metadata[b"etac_ros.sweep"]) | {"format": 99}
    pq.write_table(table.replace_schema_metadata({b"etac_ros.sweep": json.dumps(description).encode()}), path)


@pytest.mark.parametrize(
    ("spoil", "said"),
    [
        (damage_cut, "damaged"),
        (damage_text, "no Parquet"),
        (foreign, "something else"),
        (without_a_column, "something else"),
        (other_format, "format 99"),
        (Path.unlink, "no such file"),
    ],
)
def test_a_file_that_is_no_result_is_refused(
    plan: Plan, tmp_path: Path, spoil: Callable[[Path], None], said: str
) -> None:
    path = tmp_path / "sweep.parquet"
    write_result(sweep(plan, here), path)
    spoil(path)
    with pytest.raises(ScenarioError, match=said) as caught:
        read_result(path)
    assert str(path) in str(caught.value)


def test_a_run_that_a_watch_ends_is_a_row() -> None:
    # The modules touch at 0.9 deg; half of these starts are beyond it after a while, or at once.
    plan = make_plan("qi2022", 6, None, ["duration_s=2.0"], ["sim/plant.dynamics.attitude_sm_q=rotation_deg:0.6"])
    found = rows(sweep(plan, here))
    ended = [row for row in found if row["halted"]]
    assert 0 < len(ended) < len(found)
    assert all("angle between the modules" in row["halted"] for row in ended)
    assert all(row["triggers /pm/attitude_sensor"] >= 1.0 for row in found if not row["halted"])


def test_a_draw_that_the_scenario_refuses_is_a_row(small: SmallScenario) -> None:
    plan = make_plan(str(small()), 12, None, [], ["sensor.trigger.alpha=uniform:0.8"])
    found = rows(sweep(plan, here))
    drawn = {row["sample"]: row["drawn.sensor.trigger.alpha"] for row in found}
    for row in found:
        assert bool(row["refused"]) == (not 0.0 < drawn[row["sample"]] < 1.0)
        assert (row["triggers"] is None) == bool(row["refused"])
    assert {bool(row["refused"]) for row in found} == {True, False}
    assert all("alpha" in row["refused"] for row in found if row["refused"])


def test_without_dispersions_only_noise_and_losses_differ(small: SmallScenario) -> None:
    quiet = rows(sweep(make_plan(str(small()), 3), here))
    assert len({row["energy_n2m2s"] for row in quiet}) == 1
    assert len({row["seed"] for row in quiet}) == 3
    noise = "sensor.noise={enters: both, attitude_deg: 0.1, rate_deg_s: 0.1}"
    noisy = rows(sweep(make_plan(str(small()), 3, None, [noise]), here))
    assert len({row["energy_n2m2s"] for row in noisy}) == 3


@pytest.mark.parametrize(
    ("wall_s", "left", "workers", "length"),
    [
        (0.0, 1000, 2, 1),
        (0.01, 1000, 2, int(CHUNK_S / 0.01)),
        (10.0, 1000, 2, 1),
        (1e-9, 10**6, 2, 256),
        (0.001, 8, 2, 2),
    ],
)
def test_chunks_are_short_in_time_and_fair_at_the_end(wall_s: float, left: int, workers: int, length: int) -> None:
    assert chunk_length(wall_s, left, workers) == length
