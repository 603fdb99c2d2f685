"""Faults of processes in simulated time: a function of the tick, whatever the windows, and the same in both engines."""

from __future__ import annotations

from itertools import pairwise
from pathlib import Path
from typing import Any

import pytest
import yaml
from network import every_interleaving
from test_engines_equal import assert_same
from test_interleavings import assert_as_in_process, network_of
from test_ported_experiments import servo
from toy import toy, trace

from etac_ros.engines.inprocess import InProcess
from etac_ros.errors import ScenarioError
from etac_ros.graph.module import Window
from etac_ros.modules.sensing_controller import SensingController
from etac_ros.report.source import read_run
from etac_ros.runs import RosOptions, run_in_process, run_over_ros
from etac_ros.scenario.load import Scenario, baseline_of, load
from etac_ros.timing.windows import WindowPolicy

Faults = dict[str, dict[str, Any]]


def with_faults(folder: Path, faults: Faults, sensors: dict[str, dict[str, Any]]) -> Scenario:
    """The toy system, 10 ticks a second."""
    scenario = toy(folder, sensors)
    return load(str(scenario.path), None, [f"faults={yaml.safe_dump(faults, default_flow_style=True).strip()}"])


A, B = {"at": [3, 6, 9]}, {"at": [5, 12]}

CASES: dict[str, tuple[Faults, str]] = {
    # b's sensor stands still at ticks 3 to 7. It says nothing at 5; both of a's messages come at 8, in one bag.
    "stall of a sensor": (
        {"x": {"at_s": 0.3, "node": "/b/sensor", "do": "stall", "for_s": 0.5}},
        """
        3:0 a_says#1=3
        3:1 a_push#1=-0.5
        6:0 a_says#2=4.5
        6:1 a_push#2=-0.5
        9:0 a_says#3=6
        9:1 a_push#3=-0.5
        12:0 b_says#1=3012
        12:1 b_push#1=-0.5
        """,
    ),
    # Dead at the same ticks: the messages of 3 and 6 are lost to it, and that of 9 is the first it hears.
    "restart of a sensor": (
        {"x": {"at_s": 0.3, "node": "/b/sensor", "do": "restart", "for_s": 0.5}},
        """
        3:0 a_says#1=3
        3:1 a_push#1=-0.5
        6:0 a_says#2=4.5
        6:1 a_push#2=-0.5
        9:0 a_says#3=6
        9:1 a_push#3=-0.5
        12:0 b_says#1=1012
        12:1 b_push#1=-0.5
        """,
    ),
    # It has heard 3 and 6 and forgotten them with its restart at 8: 9 is the first again.
    "what a restarted one has forgotten": (
        {"x": {"at_s": 0.7, "node": "/b/sensor", "do": "restart", "for_s": 0.1}},
        """
        3:0 a_says#1=3
        3:1 a_push#1=-0.5
        5:0 b_says#1=1005
        5:1 b_push#1=-0.5
        6:0 a_says#2=1004.5
        6:1 a_push#2=-0.5
        9:0 a_says#3=1006
        9:1 a_push#3=-0.5
        12:0 b_says#2=1008.5
        12:1 b_push#2=-0.5
        """,
    ),
    # a's brake dies before tick 6: the plant holds -0.5 on, whatever a says.
    "kill of an actuator": (
        {"x": {"at_s": 0.6, "node": "/a/brake", "do": "kill"}},
        """
        3:0 a_says#1=3
        3:1 a_push#1=-0.5
        5:0 b_says#1=1005
        5:1 b_push#1=-0.5
        6:0 a_says#2=1004.5
        9:0 a_says#3=1006
        12:0 b_says#2=3008.5
        12:1 b_push#2=-0.5
        """,
    ),
    # a's brake would go on at 8, where it stands still again: what came at 6 and 9 comes at 10, in one bag.
    "stalls one after the other": (
        {
            "late": {"at_s": 0.8, "node": "/a/brake", "do": "stall", "for_s": 0.2},
            "early": {"at_s": 0.6, "node": "/a/brake", "do": "stall", "for_s": 0.2},
        },
        """
        3:0 a_says#1=3
        3:1 a_push#1=-0.5
        5:0 b_says#1=1005
        5:1 b_push#1=-0.5
        6:0 a_says#2=1004.5
        9:0 a_says#3=1006
        10:1 a_push#2=-0.5
        12:0 b_says#2=3008.5
        12:1 b_push#2=-0.5
        """,
    ),
}


def lines(text: str) -> list[str]:
    return [line.strip() for line in text.strip().splitlines()]


@pytest.mark.parametrize("case", list(CASES))
@pytest.mark.parametrize("length", [1, 2, 5, 64])
def test_trace_in_process(case: str, length: int, tmp_path: Path) -> None:
    faults, expected = CASES[case]
    scenario = with_faults(tmp_path, faults, {"a": A, "b": B})
    assert trace(InProcess(scenario.build(), WindowPolicy(length, length)).run()) == lines(expected)


@pytest.mark.parametrize("case", ["stall of a sensor", "what a restarted one has forgotten"])
def test_trace_over_dds(case: str, tmp_path: Path) -> None:
    faults, expected = CASES[case]
    scenario = with_faults(tmp_path, faults, {"a": A, "b": B})
    run = run_over_ros(scenario, tmp_path / "arrivals", RosOptions(processes="namespace"))
    assert trace(run.recording) == lines(expected)


def fault(at_s: float, node: str, do: str, for_s: float | None = None, name: str = "x") -> str:
    lasts = "" if for_s is None else f", for_s: {for_s}"
    return f"faults.{name}={{at_s: {at_s}, node: {node}, do: {do}{lasts}}}"


SYSTEMS: dict[str, tuple[str, str | None, list[str]]] = {
    "wu2018 sensor": ("wu2018", None, ["duration_s=20", fault(2.0, "/sensor", "restart", 3.0)]),
    "wu2018 stalled sensor": ("wu2018", None, ["duration_s=20", fault(2.0, "/sensor", "stall", 3.0)]),
    "wu2018 controller": ("wu2018", None, ["duration_s=20", fault(1.0, "/controller", "stall", 4.0)]),
    "wu2018 three": (
        "wu2018",
        None,
        [
            "duration_s=20",
            fault(1.0, "/controller", "restart", 1.0),
            fault(1.5, "/actuator", "stall", 1.0, "y"),
            fault(8.0, "/sensor", "kill", None, "z"),
        ],
    ),
    # A sensor that acts at known ticks, of which else nobody hears.
    "wu2018 periodic": ("wu2018", "periodic", ["duration_s=6", fault(1.5, "/sensor", "stall", 2.0)]),
    "wu2018 expired": (
        "wu2018",
        None,
        ["duration_s=20", "actuator.time_to_live_s=0.5", fault(0.25, "/actuator", "stall", 2.0)],
    ),
    "wu2018 acknowledged": (
        "wu2018",
        None,
        [
            "duration_s=20",
            "links.filtered_error={delay_ticks: 1, acknowledged: {timeout_s: 0.1, retries: 2}}",
            fault(0.5, "/controller", "restart", 3.0),
        ],
    ),
    "wu2018 late": (
        "wu2018",
        None,
        ["duration_s=20", "links.filtered_error={delay_ticks: 3, loss: 0.3}", fault(1.0, "/controller", "stall", 2.0)],
    ),
    "qi2022": ("qi2022", None, ["duration_s=0.6", fault(0.2, "/pm/controller", "restart", 0.15)]),
    "qi2022 relative": ("qi2022", None, ["duration_s=0.6", fault(0.2, "/pm/relative_sensor", "stall", 0.15)]),
    "shi2022": ("shi2022", None, ["duration_s=2", fault(0.5, "/controller", "stall", 0.5)]),
    "shi2022 events": ("shi2022", "events", ["duration_s=2", fault(0.25, "/controller", "stall", 0.5)]),
    "xie2021": (
        "xie2021",
        None,
        ["duration_s=0.1", fault(0.02, "/sc2/sensor", "restart", 0.03), fault(0.03, "/sc1/sensor", "stall", 0.02, "y")],
    ),
    "xie2021 pull": ("xie2021", "pull", ["duration_s=0.1", fault(0.02, "/sc2/sensor", "restart", 0.03)]),
    "flexible": ("flexible", "periodic", ["duration_s=30", fault(3.0, "/controller", "restart", 4.0)]),
}


@pytest.mark.parametrize("system", list(SYSTEMS))
def test_windows_change_nothing(system: str) -> None:
    scenario = load(*SYSTEMS[system])
    runs = [InProcess(scenario.build(), WindowPolicy(first, most)).run() for first, most in ((1, 1), (3, 7), (64, 512))]
    assert any(runs[0].messages.values())
    for other in runs[1:]:
        assert_same(runs[0], other)


@pytest.mark.parametrize("kind", ["stall", "restart"])
def test_windows_change_nothing_for_a_rule_with_memory(kind: str, tmp_path: Path) -> None:
    scenario = servo(tmp_path, ["sensor.trigger={class: 'ported:Dynamic'}", fault(0.5, "/sensor", kind, 0.3)])
    runs = [InProcess(scenario.build(), WindowPolicy(first, most)).run() for first, most in ((1, 1), (3, 7), (64, 512))]
    for other in runs[1:]:
        assert_same(runs[0], other)


@pytest.mark.parametrize("system", ["wu2018 three", "wu2018 periodic", "wu2018 acknowledged", "qi2022", "xie2021"])
def test_same_bits_over_dds(system: str, tmp_path: Path) -> None:
    scenario = load(*SYSTEMS[system])
    over_ros = run_over_ros(scenario, tmp_path / "bag", RosOptions(processes="namespace"))
    by_calls = run_in_process(scenario)
    assert_same(over_ros.recording, by_calls.recording)
    assert over_ros.summary.faults == by_calls.summary.faults != {}
    assert over_ros.summary.links == by_calls.summary.links
    assert over_ros.summary.performance == by_calls.summary.performance
    # Whoever reads the bag alone finds the same.
    assert read_run(tmp_path / "bag").summary.faults == by_calls.summary.faults


@pytest.mark.parametrize("kind", ["restart", "stall"])
@pytest.mark.parametrize("node", ["/sensor", "/controller"])
def test_every_interleaving(kind: str, node: str) -> None:
    scenario = load("wu2018", None, ["duration_s=6", fault(0.25, node, kind, 2.0)])
    count = 0
    for network in every_interleaving(network_of(scenario), 3000):
        assert_as_in_process(network, scenario)
        count += 1
    assert count


@pytest.mark.parametrize("variant", ["events", "fitted"])
def test_what_a_law_has_learnt_is_made_anew_from_the_samples(variant: str) -> None:
    scenario = load("shi2022", variant, ["duration_s=4", fault(0.25, "/controller", "stall", 0.5)])
    recording = InProcess(scenario.build()).run()
    first, samples = recording.samples("/plant")
    fresh = scenario.build().modules["/controller"]
    assert isinstance(fresh, SensingController)
    commands = fresh.watched(Window("/plant", 1, first, samples))
    sent = recording.messages["torque_command"]
    until = scenario.graph.faults[0].until_tick
    renewed = 0
    for before, message in pairwise(sent):
        rounded = fresh.wire("command").rounded(commands[message.tick - first])
        changed = message.value != before.value  # the rule renews a part of what it sends, the rest stays
        assert rounded[changed].tolist() == message.value[changed].tolist(), message.tick
        renewed += int(changed.sum()) if message.tick > until else 0
    assert renewed > 5


def test_a_fault_costs_what_the_account_says() -> None:
    scenario = load("wu2018", None, ["duration_s=300", fault(100.0, "/controller", "restart", 60.0)])
    run = run_in_process(scenario)
    found = run.summary.faults["x"]
    sent = run.recording.messages["filtered_error"]
    lost = sum(3200 <= message.tick < 5120 for message in sent)
    assert (found.missed, found.waited) == (lost, 0)
    assert lost == len(sent) - len(run.recording.messages["torque_command"]) > 0
    assert run.summary.links["filtered_error"].lost == lost


def test_a_stall_makes_messages_wait() -> None:
    scenario = load("wu2018", None, ["duration_s=300", fault(100.0, "/controller", "stall", 60.0)])
    run = run_in_process(scenario)
    found = run.summary.faults["x"]
    assert found.missed == 0
    assert found.waited > 0
    answers = [message.tick for message in run.recording.messages["torque_command"]]
    assert 5120 in answers
    assert not [tick for tick in answers if 3200 <= tick < 5120]


def test_the_error_comes_back_into_its_band() -> None:
    scenario = load("wu2018", None, ["duration_s=900", fault(600.0, "/sensor", "stall", 60.0)])
    excursion = run_in_process(scenario).summary.faults["x"].plants["/plant"]
    assert excursion.largest_deg > excursion.band_deg
    assert excursion.left_s is not None
    assert excursion.back_s is not None
    assert 600.0 <= excursion.left_s <= excursion.largest_at_s < excursion.back_s < 900.0


def test_a_dead_loop_does_not_come_back() -> None:
    scenario = load("wu2018", None, ["duration_s=300", fault(100.0, "/actuator", "kill")])
    found = run_in_process(scenario).summary.faults["x"]
    assert found.until_s is None
    assert found.missed > 0
    assert found.plants["/plant"].left_s is not None
    assert found.plants["/plant"].back_s is None


def test_the_first_sample_after_a_restart_is_sent() -> None:
    scenario = load("wu2018", None, ["duration_s=300", fault(100.0, "/sensor", "restart", 20.0)])
    ticks = [message.tick for message in run_in_process(scenario).recording.messages["filtered_error"]]
    assert 120 * 32 in ticks
    assert not [tick for tick in ticks if 3200 <= tick < 3840]


def test_resolved_and_baseline_have_the_faults(tmp_path: Path) -> None:
    scenario = load("wu2018", None, [fault(100.0, "/sensor", "restart", 20.0), "faults.x.at_s=200"])
    path = tmp_path / "resolved.yaml"
    path.write_text(scenario.text)
    again = load(str(path))
    assert again.digest == scenario.digest
    assert again.graph.faults == scenario.graph.faults != ()
    assert again.graph.faults[0].from_tick == 200 * 32
    baseline = baseline_of(scenario)
    assert baseline is not None
    assert baseline.graph.faults == scenario.graph.faults


BAD: dict[str, tuple[str, list[str], str]] = {
    "unknown node": (
        "wu2018",
        [fault(1.0, "/sensr", "kill")],
        r"there is no node '/sensr'\s+expected: '/sensor'",
    ),
    "plant": ("wu2018", [fault(1.0, "/plant", "kill")], "/plant is a plant, and physics does not stop"),
    "off the grid": ("wu2018", [fault(1.01, "/sensor", "kill")], r"faults\.x\.at_s.*ticks of 1/32 s"),
    "length off the grid": ("wu2018", [fault(1.0, "/sensor", "stall", 0.01)], r"faults\.x\.for_s.*ticks"),
    "beyond the run": ("wu2018", [fault(1000.0, "/sensor", "kill")], r"at_s: found 1000, and the run ends at 1000 s"),
    "back too late": ("wu2018", [fault(990.0, "/sensor", "stall", 10.0)], "for_s: it would go on at 1000 s"),
    "no length": ("wu2018", [fault(1.0, "/sensor", "stall")], "a stall lasts a while: it needs the key 'for_s'"),
    "length of a kill": ("wu2018", [fault(1.0, "/sensor", "kill", 2.0)], "a kill is for good"),
    "unknown kind": ("wu2018", [fault(1.0, "/sensor", "explode")], r'faults\.x\.do: found "explode"'),
    "before the start": ("wu2018", [fault(-1.0, "/sensor", "kill")], r"faults\.x\.at_s: found -1"),
    "overlap": (
        "wu2018",
        [fault(1.0, "/sensor", "stall", 2.0), fault(2.0, "/sensor", "kill", None, "y")],
        r"faults\.y\.at_s: begins at 2 s, and /sensor is down until 3 s, by 'x'",
    ),
    "after a kill": (
        "wu2018",
        [fault(1.0, "/sensor", "kill"), fault(2.0, "/sensor", "stall", 1.0, "y")],
        "is down for good, by 'x'",
    ),
    "foreign": ("wu2018", ["controller.external=true", fault(1.0, "/controller", "kill")], "cannot play|foreign node"),
    "waits for acknowledgements": (
        "wu2018",
        ["links.filtered_error.acknowledged={timeout_s: 0.1}", fault(1.0, "/sensor", "stall", 1.0)],
        "/sensor waits for acknowledgements",
    ),
    "memory of a law": ("shi2022", [fault(1.0, "/controller", "restart", 1.0)], "needs every sample from the start on"),
}


@pytest.mark.parametrize("case", list(BAD))
def test_refused(case: str) -> None:
    name, overrides, expected = BAD[case]
    with pytest.raises(ScenarioError, match=expected):
        load(name, None, overrides)


def test_in_real_time_the_process_stands_still(tmp_path: Path) -> None:
    scenario = load("wu2018", None, ["duration_s=50", fault(20.0, "/controller", "stall", 20.0)])
    run = run_over_ros(scenario, tmp_path / "bag", RosOptions(rate=20.0))
    found = run.summary.faults["x"]
    assert (found.missed, found.waited > 0) == (0, True)
    answers = [message.tick for message in run.recording.messages["torque_command"]]
    assert len(answers) == len(run.recording.messages["filtered_error"])  # it takes all when it goes on
    assert not [tick for tick in answers if 30 * 32 <= tick < 40 * 32]
    assert max(answers) >= 40 * 32
    assert read_run(tmp_path / "bag").summary.faults == run.summary.faults


def test_in_real_time_a_node_needs_its_own_process(tmp_path: Path) -> None:
    scenario = load("wu2018", None, ["duration_s=50", fault(20.0, "/controller", "stall", 20.0)])
    with pytest.raises(ScenarioError, match="is done to the process of /controller, which has to have one of its own"):
        run_over_ros(scenario, tmp_path / "bag", RosOptions(rate=20.0, processes="one"))
