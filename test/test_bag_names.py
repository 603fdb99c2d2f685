"""Default names of bags: of runs that start at once each gets its own, and nobody touches another's."""

from __future__ import annotations

import subprocess
import sys
from collections import Counter
from concurrent.futures import ThreadPoolExecutor
from multiprocessing import get_context
from multiprocessing.synchronize import Barrier
from pathlib import Path

import pytest
from conftest import SmallScenario

from etac_ros.bag.reserve import claim, is_reserved, release, reserve
from etac_ros.bag.write import check_writable
from etac_ros.errors import BagError
from etac_ros.runs import free_bag_directory, make_readable, run_in_process
from etac_ros.scenario.load import load

STARTS = 40


def start_together(arguments: tuple[Path, int]) -> list[Path]:
    folder, count = arguments
    _together.wait()
    return [reserve(folder, "run_12_00_00") for _ in range(count)]


def set_barrier(barrier: Barrier) -> None:
    global _together
    _together = barrier


def test_forty_processes_that_start_in_the_same_second_get_forty_directories(tmp_path: Path) -> None:
    folder = tmp_path / "not" / "there" / "yet"
    context = get_context("fork")
    barrier = context.Barrier(8)
    with context.Pool(8, set_barrier, (barrier,)) as pool:
        found = pool.map(start_together, [(folder, STARTS // 8)] * 8, chunksize=1)
    paths = [path for some in found for path in some]
    assert len(set(paths)) == len(paths) == STARTS
    assert sorted(folder.iterdir()) == sorted(paths)
    assert all(is_reserved(path) for path in paths)
    assert folder / "run_12_00_00" in paths


def test_a_reserved_directory_is_taken_over_once(tmp_path: Path) -> None:
    directory = reserve(tmp_path, "bag")
    check_writable(directory)

    def take(_: int) -> str:
        try:
            claim(directory)
        except FileExistsError:
            return "exists"
        return "mine"

    with ThreadPoolExecutor(STARTS) as threads:
        assert Counter(threads.map(take, range(STARTS))) == {"mine": 1, "exists": STARTS - 1}
    assert not is_reserved(directory)
    with pytest.raises(BagError, match="exists already"):
        check_writable(directory)
    assert not release(directory)
    assert directory.is_dir()


def test_what_is_not_needed_is_given_back(tmp_path: Path) -> None:
    directory = reserve(tmp_path, "bag")
    assert release(directory)
    assert not list(tmp_path.iterdir())
    assert reserve(tmp_path, "bag") == directory


def test_a_bag_of_another_is_neither_taken_nor_given_back(tmp_path: Path) -> None:
    (tmp_path / "bag").mkdir()
    (tmp_path / "bag" / "bag_0.mcap").write_text("theirs")
    assert reserve(tmp_path, "bag") == tmp_path / "bag_2"
    assert not release(tmp_path / "bag")
    with pytest.raises(FileExistsError):
        claim(tmp_path / "bag")
    assert (tmp_path / "bag" / "bag_0.mcap").read_text() == "theirs"


def test_a_run_writes_into_what_it_reserved(small: SmallScenario, tmp_path: Path) -> None:
    scenario = load(str(small()), "patient")
    directory = free_bag_directory(scenario, tmp_path / "bags")
    assert directory.name.startswith("small_patient_")
    run_in_process(scenario, directory)
    assert {path.name for path in directory.iterdir()} == {"metadata.yaml", f"{directory.name}_0.mcap"}


def test_a_failed_run_leaves_no_reservation(small: SmallScenario, tmp_path: Path) -> None:
    directory = free_bag_directory(load(str(small())), tmp_path / "bags")
    make_readable(directory)
    assert not directory.exists()


def test_names_of_scenarios_do_not_lead_elsewhere(small: SmallScenario, tmp_path: Path) -> None:
    scenario = load(str(small(("scenario: small", "scenario: ../../x y"))))
    assert free_bag_directory(scenario, tmp_path / "bags").parent == tmp_path / "bags"


def test_a_folder_that_cannot_be_made_is_said(tmp_path: Path) -> None:
    (tmp_path / "file").write_text("")
    with pytest.raises(BagError, match=r"file/bags/bag: cannot be made \(Not a directory\)"):
        reserve(tmp_path / "file" / "bags", "bag")


def test_bad_input_reserves_nothing(tmp_path: Path) -> None:
    command = [sys.executable, "-m", "etac_ros", "run", "wu2018", "--json", "none/summary.json"]
    done = subprocess.run(command, cwd=tmp_path, capture_output=True, text=True, timeout=120, check=False)
    assert done.returncode == 2, done.stderr
    assert not list(tmp_path.iterdir())
