"""Runs in real time over DDS: the same counts everywhere, times of the wall in the bag, and an end at any moment."""

from __future__ import annotations

import json
import os
import signal
import time
from collections.abc import Mapping
from pathlib import Path

import numpy as np
import pytest
from conftest import FewFigures
from hands import LIMIT_S, Start

from etac_ros.bag.describe import describe
from etac_ros.bag.read import read_bag
from etac_ros.engines.ros.domain import DomainLease
from etac_ros.errors import RunError, ScenarioError
from etac_ros.maths.ticks import NANOSECONDS
from etac_ros.report import write_report
from etac_ros.report.source import read_run
from etac_ros.runs import RosOptions, Run, run_over_ros
from etac_ros.scenario.load import load


@pytest.fixture(scope="module")
def run(tmp_path_factory: pytest.TempPathFactory) -> Run:
    """Forty simulated seconds in two."""
    bag = tmp_path_factory.mktemp("wall") / "bag"
    return run_over_ros(load("wu2018", None, ["duration_s=40"]), bag, RosOptions(rate=20.0))


def test_it_runs_to_its_end_as_the_sensor_triggers(run: Run) -> None:
    first, states = run.recording.samples("/plant")
    assert (first, len(states)) == (0, 40 * 32 + 1)
    count = run.summary.triggers["/sensor"].count
    assert count > 5
    for topic in ("/filtered_error", "/torque_command", "/emulation/torque"):
        assert run.summary.topics[topic].messages == count


def test_it_measures_what_each_message_took(run: Run) -> None:
    account = run.summary.real_time
    assert account is not None
    assert account.rate == 20.0
    assert account.tick_ms == pytest.approx(1000 / 32 / 20)
    assert account.latency_ms.keys() == {"/filtered_error", "/torque_command", "/emulation/torque"}
    for topic, found in account.latency_ms.items():
        assert found.count == run.summary.topics[topic].messages
        assert 0.0 < found.least <= found.median <= found.p99 <= found.most
    loop = account.loops["/emulation/torque"]
    assert loop.ticks.least >= 1.0
    assert loop.ms.least > sum(found.least for found in account.latency_ms.values())
    wakes = account.nodes["/sensor"].wakes
    assert wakes is not None
    assert wakes.count == run.summary.triggers["/sensor"].count
    assert wakes.least >= 0.0  # nobody is early


def test_its_bag_has_times_of_the_wall_and_tells_the_ticks(run: Run) -> None:
    assert run.bag is not None
    bag = read_bag(run.bag)
    wall = bag.recording().wall
    assert wall is not None
    assert abs(time.time_ns() - wall.start_ns) < 600 * NANOSECONDS
    for message in bag.messages():
        assert wall.start_ns - NANOSECONDS < message.publish_time_ns < wall.start_ns + 5 * NANOSECONDS
        if message.topic.link is not None:
            assert message.publish_time_ns <= message.log_time_ns
            tick = wall.tick_at(message.publish_time_ns)
            assert message.tick_time_ns == tick * NANOSECONDS // 32
    logged = [message.log_time_ns for message in bag.messages() if message.topic.link == "filtered_error"]
    assert logged == sorted(logged)


def test_a_report_shows_what_the_terminal_showed(run: Run, few_figures: FewFigures) -> None:
    few_figures("latency")
    assert run.bag is not None
    assert read_run(run.bag).summary.real_time == run.summary.real_time
    page = write_report(run.bag).read_text()
    for words in ("Latency of topics", "From sample to torque", "Punctuality of nodes"):
        assert words in page
    assert 'id="latency"' in page
    assert (run.bag / "report" / "latency.png").stat().st_size > 10_000


def test_strict_ends_a_run_at_a_rate_that_nobody_holds(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    scenario = load("wu2018", "periodic", ["duration_s=1000", "sensor.trigger.period_s=0.03125"])
    with pytest.raises(RunError, match=r"node /\w+: tick \d+ \(simulated time .* s\) was missed: .*\n.*--strict"):
        run_over_ros(scenario, tmp_path / "bag", RosOptions(rate=10_000.0, strict=True))
    if not any((tmp_path / "bag").glob("*.mcap")):
        assert "the run ended before anything was recorded; there is no bag" in capsys.readouterr().err
        return
    recording = read_bag(tmp_path / "bag").recording()
    assert recording.wall is not None
    description = describe(tmp_path / "bag")
    assert description.duration_s <= 1000.0
    ledgers = [row for row in description.topics if row.topic.endswith("/ledger")]
    assert ledgers
    assert all(row.first_s is None for row in ledgers)


def test_an_interrupted_run_leaves_a_readable_bag(tmp_path: Path) -> None:
    def interrupt(tick: int, fired: Mapping[str, int]) -> None:
        if tick > 100:
            os.kill(os.getpid(), signal.SIGINT)

    with pytest.raises(KeyboardInterrupt):
        run_over_ros(load("wu2018"), tmp_path / "bag", RosOptions(rate=20.0), interrupt)
    recording = read_bag(tmp_path / "bag").recording()
    assert recording.messages["filtered_error"]
    assert np.isfinite(recording.samples("/plant")[1]).all()


def test_a_node_that_dies_ends_the_run_and_is_named(tmp_path: Path) -> None:
    pids: dict[str, int] = {}

    def kill(tick: int, fired: Mapping[str, int]) -> None:
        if tick > 100 and "/controller" in pids:
            os.kill(pids.pop("/controller"), signal.SIGKILL)

    with pytest.raises(RunError, match=r"node /controller \(process \d+\): was killed by SIGKILL"):
        run_over_ros(load("wu2018"), tmp_path / "bag", RosOptions(rate=20.0), kill, pids.update)
    assert read_bag(tmp_path / "bag").recording().messages["filtered_error"]


@pytest.mark.slow  # a run outlasts the discovery of a node with DDS's own settings, which takes up to three seconds
def test_a_listener_gets_diagnostics_and_the_clock(tmp_path: Path, start: Start, lease: DomainLease) -> None:
    listener = start(str(Path(__file__).parent / "tool_listener.py"))
    assert listener.stdout is not None
    assert listener.stdout.readline().strip() == "ready"
    lease.release()
    scenario = load("wu2018", None, ["duration_s=160"])
    run_over_ros(scenario, tmp_path / "bag", RosOptions(domain=lease.domain, rate=20.0))
    listener.send_signal(signal.SIGTERM)
    heard = json.loads(listener.communicate(timeout=LIMIT_S)[0])
    assert heard["clock"] == sorted(heard["clock"])
    assert 0.0 <= heard["clock"][0] < heard["clock"][-1] <= 160.0
    assert {f"etac_ros: {name}" for name in ("/plant", "/sensor", "/controller", "/actuator")} <= heard["nodes"].keys()
    assert int(heard["nodes"]["etac_ros: /sensor"]["own acts"]) > 0


@pytest.mark.parametrize(
    ("rate", "overrides", "said"),
    [
        (0.0, [], "--rate 0: is no rate"),
        (1.0, ["links.filtered_error.delay_ticks=2"], "--clock wall: links filtered_error: have an emulated delay"),
        (1.0, ["links.torque_command.loss=0.1"], "--clock wall: links torque_command: have an emulated delay"),
        (1.0, ["links.filtered_error.acknowledged={timeout_s: 1.0}"], "links filtered_error: have an emulated delay"),
        (1.0, ["faults.x={at_s: 1.0, node: /sensor, do: stall, for_s: 90.0}"], "fault x: would stand still for 90 s"),
    ],
)
def test_what_cannot_be_is_refused_before_anything_starts(
    rate: float, overrides: list[str], said: str, tmp_path: Path
) -> None:
    with pytest.raises(ScenarioError, match=said):
        run_over_ros(load("wu2018", None, overrides), tmp_path / "bag", RosOptions(rate=rate))
    assert not (tmp_path / "bag").exists()
