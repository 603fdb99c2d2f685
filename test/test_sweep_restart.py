"""A sweep that was interrupted keeps what is finished, goes on there, and leaves no process."""

from __future__ import annotations

import contextlib
import os
import re
import signal
import subprocess
import sys
from collections.abc import Iterator, Sequence
from pathlib import Path

import psutil
import pytest
from conftest import SmallScenario

from etac_ros.errors import RunError, ScenarioError
from etac_ros.sweep.journal import SUFFIX
from etac_ros.sweep.plan import Plan, make_plan
from etac_ros.sweep.result import read_result
from etac_ros.sweep.run import sweep, sweep_to_file
from etac_ros.sweep.sample import Row
from etac_ros.sweep.workers import here, processes

RATE = "plant.dynamics.rate_deg_s"


def made(small: SmallScenario, runs: int = 8, *sets: str) -> Plan:
    return make_plan(str(small()), runs, None, sets, [f"{RATE}=normal:2"])


class Counting:
    """Runs samples here, counts them, and is interrupted after some."""

    def __init__(self, until: int = 1000) -> None:
        self.samples: list[int] = []
        self._until = until

    def __call__(self, plan: Plan, samples: Sequence[int]) -> Iterator[list[Row]]:
        for rows in here(plan, samples):
            if len(self.samples) == self._until:
                raise KeyboardInterrupt
            self.samples += [row["sample"] for row in rows]
            yield rows


def interrupted(plan: Plan, path: Path, after: int) -> None:
    with pytest.raises(KeyboardInterrupt):
        sweep_to_file(plan, path, Counting(after))


def test_it_goes_on_where_it_was_left(small: SmallScenario, tmp_path: Path) -> None:
    plan, path = made(small), tmp_path / "out.parquet"
    interrupted(plan, path, 3)
    part = read_result(path)
    assert part.table["sample"].to_pylist() == [0, 1, 2]
    assert not part.complete
    rest = Counting()
    whole = sweep_to_file(plan, path, rest)
    assert rest.samples == [3, 4, 5, 6, 7]
    assert whole.complete
    assert not path.with_name(path.name + SUFFIX).exists()
    assert whole.table.drop_columns(["wall_s"]).equals(sweep(plan, here).table.drop_columns(["wall_s"]))
    nothing = Counting()
    assert sweep_to_file(plan, path, nothing).table.equals(whole.table)
    assert nothing.samples == []


def test_a_line_that_was_cut_off_is_run_again(small: SmallScenario, tmp_path: Path) -> None:
    plan, path = made(small), tmp_path / "out.parquet"
    interrupted(plan, path, 3)
    path.unlink()  # as after a power cut: only the journal is there
    journal = path.with_name(path.name + SUFFIX)
    journal.write_bytes(journal.read_bytes()[:-20])
    again = Counting(2)
    with pytest.raises(KeyboardInterrupt):
        sweep_to_file(plan, path, again)
    assert again.samples == [2, 3]
    rest = Counting()
    assert sweep_to_file(plan, path, rest).complete
    assert rest.samples == [4, 5, 6, 7]


@pytest.mark.parametrize("line", [1, 3])
def test_a_damaged_journal_is_refused(small: SmallScenario, tmp_path: Path, line: int) -> None:
    plan, path = made(small), tmp_path / "out.parquet"
    interrupted(plan, path, 3)
    journal = path.with_name(path.name + SUFFIX)
    lines = journal.read_text().splitlines()
    lines[line - 1] = lines[line - 1][:-5]
    journal.write_text("\n".join(lines) + "\n")
    with pytest.raises(ScenarioError, match=f"damaged in line {line}"):
        sweep_to_file(plan, path, here)


@pytest.mark.parametrize("finished", [3, 1000])
@pytest.mark.parametrize(
    ("change", "said"),
    [
        (["controller.law.k=3.0"], "--set"),
        (["seed=4"], "seed"),
        (["controller.law.k=1.0,2.0"], "--set with several values"),
    ],
)
def test_another_sweep_is_refused(
    small: SmallScenario, tmp_path: Path, change: list[str], said: str, finished: int
) -> None:
    path = tmp_path / "out.parquet"
    if finished < 8:
        interrupted(made(small), path, finished)
    else:
        sweep_to_file(made(small), path, here)
    before = path.read_bytes()
    with pytest.raises(ScenarioError, match="what differs") as caught:
        sweep_to_file(made(small, 8, *change), path, here)
    assert said in str(caught.value)
    assert path.read_bytes() == before
    path.unlink()
    if finished < 8:  # the journal alone says so, too
        with pytest.raises(ScenarioError, match="what differs"):
            sweep_to_file(made(small, 8, *change), path, here)


def test_more_runs_and_other_files_are_other_sweeps(small: SmallScenario, tmp_path: Path) -> None:
    path = tmp_path / "out.parquet"
    sweep_to_file(made(small), path, here)
    with pytest.raises(ScenarioError, match=re.escape("--runs (8 there, 9 here)")):
        sweep_to_file(made(small, 9), path, here)
    file = small()
    file.write_text(file.read_text().replace("k: 2.0", "k: 2.5"))
    with pytest.raises(ScenarioError, match="the scenario itself"):
        sweep_to_file(make_plan(str(file), 8, None, [], [f"{RATE}=normal:2"]), path, here)


def test_a_foreign_file_is_never_touched(small: SmallScenario, tmp_path: Path) -> None:
    path = tmp_path / "out.parquet"
    path.write_text("mine")
    with pytest.raises(ScenarioError, match=r"out\.parquet"):
        sweep_to_file(made(small), path, here)
    assert path.read_text() == "mine"
    assert list(tmp_path.glob("out*")) == [path]


def test_an_unwritable_folder_is_refused_before_anything_runs(small: SmallScenario, tmp_path: Path) -> None:
    (tmp_path / "file").write_text("")
    counting = Counting()
    with pytest.raises(ScenarioError, match="cannot be written"):
        sweep_to_file(made(small), tmp_path / "file" / "out.parquet", counting)
    assert counting.samples == []


def test_a_worker_that_dies_is_an_error_and_costs_no_finished_run(small: SmallScenario, tmp_path: Path) -> None:
    plan, path = made(small, 40), tmp_path / "out.parquet"

    def kill_one(finished: int, planned: int) -> None:
        if finished >= 2:
            for child in workers_of(os.getpid()):
                with contextlib.suppress(psutil.NoSuchProcess):
                    child.kill()

    with pytest.raises(RunError, match="worker process died"):
        sweep_to_file(plan, path, processes(2), kill_one)
    kept = read_result(path).table.num_rows
    assert 2 <= kept < 40
    rest = Counting()
    assert sweep_to_file(plan, path, rest).complete
    assert len(rest.samples) == 40 - kept


def workers_of(pid: int) -> list[psutil.Process]:
    """The processes that a process has started, but for the server and the tracker that start none of our runs."""
    found = []
    for child in psutil.Process(pid).children(recursive=True):
        with contextlib.suppress(psutil.NoSuchProcess):  # gone since it was listed
            if child.ppid() != pid:  # a worker is a child of the server
                found.append(child)
    return found


def command(path: Path, output: Path) -> subprocess.Popen[str]:
    arguments = ["sweep", str(path), "--runs", "100000", "--dispersion", f"{RATE}=normal:2", "--workers", "2"]
    environment = {**os.environ, "PYTHONPATH": os.pathsep.join(str(Path(p).resolve()) for p in sys.path if p)}
    return subprocess.Popen(
        [sys.executable, "-m", "etac_ros", *arguments, "--output", str(output)],
        env=environment,
        stdout=subprocess.PIPE,
        stderr=subprocess.PIPE,
        text=True,
        start_new_session=True,  # so that a Ctrl-C can be sent to all of it, as a terminal does
    )


def wait_for_rows(process: subprocess.Popen[str], journal: Path) -> list[psutil.Process]:
    """Wait until rows have come, and return all processes of the command."""
    while not journal.exists() or journal.read_bytes().count(b"\n") < 5:
        ended, _ = psutil.wait_procs([psutil.Process(process.pid)], timeout=0.05)  # looks again twenty times a second
        assert not ended, process.communicate()
    return psutil.Process(process.pid).children(recursive=True)


def test_ctrl_c_leaves_a_usable_part_and_no_process(small: SmallScenario, tmp_path: Path) -> None:
    output = tmp_path / "out.parquet"
    process = command(small(), output)
    others = wait_for_rows(process, output.with_name(output.name + SUFFIX))
    assert len(others) >= 2
    os.killpg(process.pid, signal.SIGINT)
    _, errors = process.communicate(timeout=60)
    assert process.returncode == 130, errors
    assert "the same command goes on" in errors
    assert "Traceback" not in errors
    assert psutil.wait_procs(others, timeout=30)[1] == []
    part = read_result(output)
    assert 4 <= part.table.num_rows < 100000
    assert not part.complete


def test_a_killed_command_leaves_no_process_and_its_rows(small: SmallScenario, tmp_path: Path) -> None:
    output = tmp_path / "out.parquet"
    process = command(small(), output)
    others = wait_for_rows(process, output.with_name(output.name + SUFFIX))
    process.kill()
    process.communicate(timeout=60)
    assert psutil.wait_procs(others, timeout=30)[1] == []
    rows = output.with_name(output.name + SUFFIX).read_bytes().count(b"\n") - 1
    assert rows >= 4
