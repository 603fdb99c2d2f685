"""Runs longer than memory: committed samples lie on disk, and whatever is made of them is made part by part."""

from __future__ import annotations

import tracemalloc
from collections.abc import Callable
from pathlib import Path

import numpy as np
import pytest

from etac_ros.bag import read
from etac_ros.bag.chunks import BagChunks
from etac_ros.bag.read import read_bag
from etac_ros.errors import BagError
from etac_ros.graph import recording, spool
from etac_ros.graph.spool import Spool, StoredChunks
from etac_ros.runs import run_in_process
from etac_ros.scenario.load import load

SMALL = 32 * 1024
"""Bytes of samples that stay in memory in these tests: a run of wu2018 has 56 bytes a tick, 32 ticks a second."""


@pytest.fixture
def little_memory(monkeypatch: pytest.MonkeyPatch) -> None:
    """What takes a gigabyte of samples takes a few kilobytes."""
    monkeypatch.setattr(recording, "PART_TICKS", 1024)
    monkeypatch.setattr(read, "KEPT_BYTES", SMALL)
    monkeypatch.setattr(spool.Spool.__init__, "__defaults__", (SMALL,))


def peak_of(work: Callable[[], object]) -> int:
    tracemalloc.start()
    try:
        work()
        return tracemalloc.get_traced_memory()[1]
    finally:
        tracemalloc.stop()


def scenario_of(duration_s: float, name: str = "wu2018") -> Callable[[Path | None], object]:
    scenario = load(name, None, ["baseline=null", f"duration_s={duration_s}", "state_rate_hz=0.1"])
    run_in_process(scenario)  # compiles, and what is imported is imported
    return lambda bag: run_in_process(scenario, bag)


def test_a_spool_gives_back_what_it_was_given(tmp_path: Path) -> None:
    chunks = [(10 * k, np.arange(30.0).reshape(10, 3) + k) for k in range(9)]
    kept = Spool(kept_bytes=1000)
    for chunk in chunks:
        kept.append(chunk)
    assert (kept.first_tick, kept.ticks, len(kept)) == (0, 90, 9)
    assert [first for first, _ in kept] == [first for first, _ in chunks]
    for (_, found), (_, given) in zip(kept, chunks, strict=True):
        assert (found == given).all()
    assert kept[-1][0] == 80
    assert [first for first, _ in kept[7:]] == [70, 80]


def test_a_spool_leaves_no_file(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setenv("TMPDIR", str(tmp_path))
    monkeypatch.setattr("tempfile.tempdir", None)
    kept = Spool(kept_bytes=100)
    kept.append((0, np.ones((50, 3))))
    assert list(tmp_path.iterdir()) == []
    assert kept[0][1].sum() == 150.0


@pytest.mark.parametrize("name", ["wu2018", "shi2022", "qi2022"])
def test_the_summary_and_the_bits_are_the_same_part_by_part(
    name: str, tmp_path: Path, request: pytest.FixtureRequest
) -> None:
    scenario = load(name, None, ["baseline=null", "duration_s=60", "state_rate_hz=0.1"])
    whole = run_in_process(scenario)
    request.getfixturevalue("little_memory")
    apart = run_in_process(scenario, tmp_path / "bag")
    assert all(isinstance(chunks, StoredChunks) for chunks in apart.recording.truth.values())
    read_back = read_bag(tmp_path / "bag").recording()
    assert all(isinstance(chunks, BagChunks) for chunks in read_back.truth.values())
    assert whole.recording.digest() == apart.recording.digest() == read_back.digest()
    unlike = {"timing", "bag"}
    assert apart.summary.model_dump(exclude=unlike) == whole.summary.model_dump(exclude=unlike)


@pytest.mark.usefixtures("little_memory")
def test_a_run_of_four_times_the_length_takes_no_more_memory(tmp_path: Path) -> None:
    short, long = scenario_of(500.0), scenario_of(2000.0)
    few = peak_of(lambda: short(tmp_path / "short"))
    many = peak_of(lambda: long(tmp_path / "long"))
    # Its samples alone take 2.7 MB more. What grows with the messages of the links, which are fewer by far, may.
    assert many < few + 600_000
    bags = [read_bag(tmp_path / name) for name in ("short", "long")]
    few, many = (peak_of(lambda bag=bag: bag.recording().digest()) for bag in bags)  # type: ignore[misc]
    assert many < few + 600_000


@pytest.mark.usefixtures("little_memory")
def test_a_bag_that_changes_while_it_is_read_is_named(tmp_path: Path) -> None:
    scenario_of(60.0)(tmp_path / "bag")
    bag = read_bag(tmp_path / "bag")
    chunks = bag.recording().truth["/plant"]
    bag.path.write_bytes(bag.path.read_bytes()[: bag.path.stat().st_size // 4])
    with pytest.raises(BagError, match="cut off"):
        list(chunks)
