"""Bags that keep a part of the committed samples, or compressed chunks: what stays exact, and what is refused."""

from __future__ import annotations

import io
from fractions import Fraction
from pathlib import Path

import numpy as np
import pytest
from rich.console import Console
from typer.testing import CliRunner

from etac_ros.bag.codec import encode_truth
from etac_ros.bag.metadata import FILE_NAME
from etac_ros.bag.read import read_bag
from etac_ros.bag.recover import recover
from etac_ros.bag.run_bag import RunBag
from etac_ros.bag.topics import truth_topic
from etac_ros.cli.interrupts import Interrupted
from etac_ros.cli.main import app
from etac_ros.cli.run import RunRequest, run_and_show, ticks_of_truth
from etac_ros.errors import BagError, ScenarioError
from etac_ros.export.tables import open_bag
from etac_ros.graph.spool import TruthFile
from etac_ros.maths.wall_clock import WallClock
from etac_ros.metrics.kept import CUSTOM_DATA_KEY
from etac_ros.report.source import read_run
from etac_ros.report.write import write_report
from etac_ros.runs import RosOptions, Run, run_in_process, run_over_ros
from etac_ros.scenario.load import Scenario, load

OF_THE_RUN = {"final_state", "performance", "watches", "triggers", "network", "internal", "own", "faults", "samples"}
"""What of a summary does not depend on how the bag is kept."""


def scenario_of(*overrides: str, name: str = "wu2018") -> Scenario:
    return load(name, None, ["duration_s=50", "baseline=null", "state_rate_hz=0.5", *overrides])


@pytest.fixture(scope="module")
def whole() -> Run:
    return run_in_process(scenario_of())


@pytest.mark.parametrize(("every", "engine"), [(7, "inprocess"), (0, "inprocess"), (7, "ros")])
def test_the_run_says_what_it_says_with_all_samples_and_its_bag_says_so_too(
    every: int, engine: str, whole: Run, tmp_path: Path
) -> None:
    scenario, bag = scenario_of(f"truth_every={every}"), tmp_path / "bag"
    run = run_in_process(scenario, bag) if engine == "inprocess" else run_over_ros(scenario, bag, RosOptions("one"))
    assert run.recording.digest() == whole.recording.digest()
    exact = whole.summary.model_dump(include=OF_THE_RUN)
    assert run.summary.model_dump(include=OF_THE_RUN) == exact
    read = read_run(bag)
    assert read.summary.model_dump(include=OF_THE_RUN) == exact
    first, samples = whole.recording.samples("/plant")
    ticks, kept = read.recording.kept("/plant")
    due = [tick for tick in range(first, first + len(samples)) if every and (tick % every == 0 or tick == 1600)]
    assert ticks.tolist() == due
    assert kept.tolist() == samples[ticks].tolist()
    assert sum(read.recording.span("/plant")) == (1601 if every else 0)


def test_all_messages_are_kept(whole: Run, tmp_path: Path) -> None:
    run_in_process(scenario_of("truth_every=0"), tmp_path / "bag")
    found = read_bag(tmp_path / "bag").recording()
    assert {name: len(some) for name, some in found.messages.items()} == {
        name: len(some) for name, some in whole.recording.messages.items()
    }


def test_what_needs_every_sample_is_refused(tmp_path: Path) -> None:
    run_in_process(scenario_of("truth_every=7"), tmp_path / "bag")
    with pytest.raises(BagError, match="every 7th committed sample"):
        read_bag(tmp_path / "bag").recording().samples("/plant")
    tables = open_bag(tmp_path / "bag")
    assert "watched" not in tables.names
    assert list(tables.left_out) == ["watched"]
    with pytest.raises(BagError, match="table 'watched': there is none: the bag keeps only every 7th committed sample"):
        tables.table("watched")
    shown = CliRunner().invoke(app, ["export", str(tmp_path / "bag"), "--to", "npz", "--output", str(tmp_path / "to")])
    assert "no table 'watched': the bag keeps only every 7th committed sample" in shown.stderr
    assert set(tables.table("state").column("tick").to_pylist()) == {*range(0, 1601, 7), 1600}
    page = write_report(tmp_path / "bag", output=tmp_path / "report").read_text(encoding="utf-8")
    assert "every 7th tick" in page
    assert not (tmp_path / "report" / "margins.png").exists()


def test_without_samples_there_are_events_and_no_curves(tmp_path: Path) -> None:
    run_in_process(scenario_of("truth_every=0"), tmp_path / "bag")
    tables = open_bag(tmp_path / "bag")
    assert tables.names == ("triggers", "messages")
    assert list(tables.left_out) == ["attitude", "rate", "torque", "state", "watched"]
    with pytest.raises(BagError, match="--truth none"):
        write_report(tmp_path / "bag")


def test_a_run_that_did_not_end_has_no_figures_of_all_samples(tmp_path: Path) -> None:
    bag = tmp_path / "bag"
    run_in_process(scenario_of("truth_every=7"), bag)
    metadata = bag / FILE_NAME
    metadata.write_text(metadata.read_text().replace(CUSTOM_DATA_KEY, "something_else"))
    with pytest.raises(BagError, match="did not come to sum up"):
        read_run(bag)
    read_bag(bag)


def test_a_reference_that_moves_is_asked_at_the_ticks_that_are_kept(tmp_path: Path) -> None:
    overrides = ["duration_s=4", "baseline=null", "state_rate_hz=0"]
    run_in_process(load("xie2021", None, overrides), tmp_path / "all")
    run_in_process(load("xie2021", None, [*overrides, "truth_every=9"]), tmp_path / "some")
    every = open_bag(tmp_path / "all").table("attitude").to_pydict()
    some = open_bag(tmp_path / "some").table("attitude").to_pydict()
    columns = ("node", "quantity", "component", "tick", "value")
    known = {row[:4]: row[4] for row in zip(*(every[name] for name in columns), strict=True)}
    rows = list(zip(*(some[name] for name in columns), strict=True))
    assert len(rows) == len(known) // 4001 * 446  # ticks 0, 9, ..., 3996, and 4000
    assert all(np.isclose(known[row[:4]], row[4], rtol=1e-12, atol=0.0) for row in rows)


def test_in_real_time_samples_are_thinned_at_the_instants_of_their_ticks(tmp_path: Path) -> None:
    graph = scenario_of().build()
    wall, full = WallClock(10**18, graph.ticks_per_second, Fraction(1)), TruthFile(graph.plants)
    topic = truth_topic("/plant").name
    with RunBag(tmp_path / "bag", graph, {}, {"clock": "wall", "start_ns": str(10**18), "rate": "1"}, wall=wall,
                every=4, whole=full) as bag:  # fmt: skip
        for number, first in enumerate((0, 10, 20), start=1):
            samples = np.arange(first, first + 10.0)[:, np.newaxis] * np.ones(7)
            bag.write(
                topic, encode_truth(first, samples), wall.instant_ns(first + 9), wall.instant_ns(first + 9), number
            )
    ticks, kept = read_bag(tmp_path / "bag").recording().kept("/plant")
    assert ticks.tolist() == [0, 4, 8, 12, 16, 20, 24, 28, 29] == kept[:, 0].tolist()
    chunks = full.truth()["/plant"]
    assert (chunks.first_tick, chunks.ticks) == (0, 30)
    assert [samples[0, 0] for _, samples in chunks] == [0.0, 10.0, 20.0]


@pytest.mark.parametrize("compression", ["lz4", "zstd"])
def test_compressed_chunks_are_read_and_recovered(compression: str, whole: Run, tmp_path: Path) -> None:
    run_in_process(scenario_of("bag_compression=none"), tmp_path / "plain")
    run_in_process(scenario_of(f"bag_compression={compression}"), tmp_path / "bag")
    plain, small = read_bag(tmp_path / "plain"), read_bag(tmp_path / "bag")
    assert small.recording().digest() == plain.recording().digest() == whole.recording.digest()
    assert small.path.stat().st_size < 0.9 * plain.path.stat().st_size
    data = small.path.read_bytes()
    small.path.write_bytes(data[: len(data) // 2])
    (tmp_path / "bag" / FILE_NAME).unlink()
    assert sum(recover(tmp_path / "bag").messages.values()) > 0
    read_bag(tmp_path / "bag")


def test_what_truth_says() -> None:
    assert [ticks_of_truth(words) for words in ("all", "none", "12")] == [1, 0, 12]
    for words in ("0", "-1", "every", "1.5"):
        with pytest.raises(ScenarioError, match="--truth"):
            ticks_of_truth(words)


@pytest.mark.parametrize(("every", "by"), [(1, "(etac info, etac report)"), (7, "(etac info)")])
def test_an_interrupt_promises_no_report_that_is_refused(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, every: int, by: str
) -> None:
    bag = tmp_path / "bag"

    def interrupted(*arguments: object) -> None:
        bag.mkdir()
        (bag / "bag_0.mcap").touch()
        raise KeyboardInterrupt

    monkeypatch.setattr("etac_ros.cli.run._run", interrupted)
    request = RunRequest("wu2018", overrides=(f"truth_every={every}",), engine="inprocess", bag=bag)
    with pytest.raises(Interrupted) as interrupt:
        run_and_show(request, Console(file=io.StringIO()))
    assert interrupt.value.kept.endswith(by)
