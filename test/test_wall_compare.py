"""A run in real time beside simulated ones: the delay is found that it had, and foreign nodes are refused."""

from __future__ import annotations

import os
from fractions import Fraction
from io import StringIO
from pathlib import Path

import numpy as np
import pytest
from rich.console import Console
from typer.testing import CliRunner
from wall_network import WallNetwork

from etac_ros.cli.compare_clocks import clocks_table, compare_clocks
from etac_ros.cli.main import app
from etac_ros.cli.nodes import OwnOptions, own_options
from etac_ros.engines.ros.wall_time import Tie, check_priority
from etac_ros.errors import ScenarioError
from etac_ros.maths.wall_clock import WallClock
from etac_ros.metrics.clocks import Agreement, states_apart, with_delayed_torques
from etac_ros.metrics.summary import Timing, summarise
from etac_ros.runs import RosOptions, Run, run_in_process, simulate_delayed
from etac_ros.scenario.load import Scenario, load

TICK_NS = 10**9 // 32


@pytest.mark.parametrize("hop_ticks", [0.1, 0.5, 1.0])
def test_the_delay_is_found_that_a_loop_had(hop_ticks: float) -> None:
    """Three hops: from sample to torque 0.3, 1.5 or 3 ticks, felt 1, 2 or 4 ticks later."""
    scenario = load("wu2018", None, ["duration_s=60"])
    hop = round(hop_ticks * TICK_NS)
    run = WallNetwork(scenario.build(), WallClock(0, 32, Fraction(1)), lambda topic, to, now: hop)
    recording = run.run()
    simulated = [simulate_delayed(scenario, ticks) for ticks in range(6)]
    agreement = Agreement([states_apart(run.graph, recording, one.recording) for one in simulated])
    assert agreement.best == {0.1: 1, 0.5: 2, 1.0: 4}[hop_ticks]
    timing = Timing(startup_s=0.0, loop_s=1.0, total_s=1.0)
    real = summarise(scenario, run.graph, recording, "ros", timing)
    table = clocks_table(real, [one.summary for one in simulated], agreement)
    assert f"delay of {agreement.best} tick" in table.notes[0]
    assert table.rows[0].cells[1] == f"{len(recording.messages['filtered_error']):,}"


def test_equal_runs_are_not_apart_and_the_measure_has_no_unit() -> None:
    scenario = load("wu2018", None, ["duration_s=20"])
    recording = run_in_process(scenario).recording
    other = simulate_delayed(scenario, 3).recording
    assert states_apart(scenario.graph, recording, recording) == 0.0
    apart = states_apart(scenario.graph, other, recording)
    for (_, left), (_, right) in zip(other.truth["/plant"], recording.truth["/plant"], strict=False):
        left *= 100.0
        right *= 100.0
    assert states_apart(scenario.graph, other, recording) != 0.0
    assert 0.0 < apart < 1.0


def test_only_torques_are_delayed() -> None:
    graph = load("qi2022").build()
    delayed = with_delayed_torques(graph, 2)
    assert {name for name, link in delayed.links.items() if link.channel.delay_ticks} == {"ncla_torque", "cmg_torque"}
    assert with_delayed_torques(graph, 0).links == dict(graph.links)


@pytest.mark.parametrize("hop_ticks", [0.3, 60.0, 3000.0])
def test_it_is_shown_beside_what_was_measured(
    hop_ticks: float, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """However late things came: also where no torque came before the end, as on a machine that stands still."""
    hop = round(hop_ticks * TICK_NS / 20)

    def run_on_a_made_up_clock(scenario: Scenario, bag: Path, options: RosOptions) -> Run:
        clock = WallClock(0, scenario.run.ticks_per_second, Fraction(options.rate or 1))
        run = WallNetwork(scenario.build(), clock, lambda topic, to, now: hop)
        recording = run.run()
        timing = Timing(startup_s=0.0, loop_s=1.0, total_s=1.0)
        return Run(scenario, summarise(scenario, run.graph, recording, "ros", timing), recording, bag)

    monkeypatch.setattr("etac_ros.cli.compare_clocks.run_over_ros", run_on_a_made_up_clock)
    text = StringIO()
    console = Console(file=text, width=200, markup=False)
    compare_clocks("wu2018", None, ["duration_s=20"], RosOptions(rate=20.0), tmp_path / "bag", console)
    shown = text.getvalue()
    for words in ("real time", "simulated, 1", "agrees best with a delay of", "states apart", "Punctuality of nodes"):
        assert words in shown
    assert ("From sample to torque" in shown) == (hop_ticks < 3000.0)


def test_foreign_nodes_cannot_be_simulated(tmp_path: Path) -> None:
    with pytest.raises(ScenarioError, match="/controller: is foreign, and cannot be simulated"):
        compare_clocks("wu2018", None, ["controller.external=true"], RosOptions(rate=1.0), tmp_path / "bag", Console())


@pytest.mark.parametrize(
    ("arguments", "said"),
    [
        (["run", "wu2018", "--strict"], "--strict: is for --clock wall"),
        (["run", "wu2018", "--priority", "5"], "--priority 5: is for --clock wall"),
        (["run", "wu2018", "--clock", "wall", "--engine", "inprocess"], "--clock wall: is for --engine ros"),
        (["run", "wu2018", "--engine", "inprocess", "--processes", "one"], "--processes: is for --engine ros"),
        (["run", "wu2018", "--state-rate", "inf"], "--state-rate inf: is no rate"),
        (["run", "wu2018", "--engine", "inprocess", "--truth", "7"], "--truth 7: is for a bag, and by calls none"),
        (["run", "wu2018", "--engine", "inprocess", "--compression", "lz4"], "--compression lz4: is for a bag"),
        (["run", "wu2018", "--only", "/"], "--only /: has no run to join"),
        (["node", "/sensor", "wu2018", "--bag", "here"], "/sensor: --bag here: is written by the recorder"),
        (["run", "wu2018", "--set", "links.filtered_error.history=2147483648"], "less than or equal to 2147483647"),
        (["node", "/sensor", "wu2018", "--clock", "wall", "--priority", "100"], "is no real-time priority"),
        (["compare", "wu2018", "--clock", "wall", "--variant", "noise", "--variant", "radio"], "more than once"),
        (["compare", "wu2018", "--rate", "3"], "--rate 3: is for --clock wall"),
        (["run", "qi2022", "--only", "/nosuch", "--join", "7"], "--only /nosuch: is no namespace of this scenario"),
        (["node", "/sensor", "wu2018", "--rate", "3"], "--rate 3: in simulated time is for the node that keeps it"),
    ],
)
def test_what_contradicts_itself_is_refused(arguments: list[str], said: str) -> None:
    done = CliRunner().invoke(app, arguments)
    assert isinstance(done.exception, ScenarioError)
    assert said in str(done.exception)
    assert "joins" not in done.output


def test_a_priority_that_is_not_allowed_is_said_before_anything_starts(monkeypatch: pytest.MonkeyPatch) -> None:
    def refuse(*arguments: object) -> None:
        raise PermissionError

    before = os.sched_getscheduler(0)
    check_priority(0)
    monkeypatch.setattr(os, "sched_setscheduler", refuse)
    with pytest.raises(ScenarioError, match=r"--priority 10: is not allowed to this user\n.*\n.*rtprio"):
        check_priority(10)
    assert os.sched_getscheduler(0) == before


def test_executables_take_the_options_of_etac_node() -> None:
    assert own_options("sensor", ["--clock", "wall", "--rate", "20"]) == OwnOptions(clock="wall", rate=20.0)
    assert own_options("sensor", []) == OwnOptions()
    assert own_options("sensor", ["--peers", "10.0.0.2", "--interface", "eth0"]) == OwnOptions(
        peers="10.0.0.2", interface="eth0"
    )
    assert own_options("sensor", ["--quiet-s", "60"]).quiet_s == 60.0
    urgent = ["--strict", "--clock", "wall", "--priority", "10"]
    assert own_options("sensor", urgent) == OwnOptions(clock="wall", strict=True, priority=10)
    for wrong, said in (
        (["--clock"], "expected one argument"),
        (["--clock", "sundial"], "invalid choice: 'sundial'"),
        (["--strict"], "--strict: is for --clock wall"),
        (["--priority", "3"], "--priority 3: is for --clock wall"),
        (["--quiet-s", "4"], "--quiet-s 4: is not allowed"),
        (["--clock", "wall", "--rate", "fast"], "invalid float value: 'fast'"),
        (["--clock", "wall", "--priority", "1.5"], "invalid int value: '1.5'"),
        (["--peers"], "expected one argument"),
        (["--pears", "x"], "is not understood"),
    ):
        with pytest.raises(ScenarioError, match=said):
            own_options("sensor", wrong)


def test_the_two_clocks_of_a_machine_are_tied_closely() -> None:
    one, other = Tie(), Tie()
    assert abs(one.ahead_ns - other.ahead_ns) < 10**6
    assert abs(one.stepped_s()) < 1e-3
    wall = WallClock(1_700_000_000 * 10**9, 32, Fraction(20))
    assert one.monotonic(wall).start_ns == wall.start_ns - one.ahead_ns
    assert np.sign(one.ahead_ns) == 1  # it is later than the machine's start
