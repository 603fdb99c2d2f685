"""Experiments as other people have them - servo, wheels, vehicles, other kinds of rules - run in both engines alike."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import numpy as np
import pytest
import yaml
from conftest import FewFigures
from test_engines_equal import assert_same

from etac_ros.engines.inprocess import InProcess
from etac_ros.metrics.cells import energy_heading
from etac_ros.report import write_report
from etac_ros.runs import RosOptions, Run, run_in_process, run_over_ros
from etac_ros.scenario.load import Scenario, load
from etac_ros.timing.windows import WindowPolicy

SERVO = """
/**:
  ros__parameters:
    scenario: servo
    ticks_per_second: 100
    duration_s: 3.0
    links:
      state: {from: /sensor, to: [/controller], kind: network}
      voltage: {from: /controller, to: [/amplifier], kind: network}
      armature: {from: /amplifier, to: [/servo], kind: physical}
/servo:
  ros__parameters: {module: plant, dynamics: {class: "ported:Servo"}}
/sensor:
  ros__parameters:
    module: sensor
    reads: /servo
    signal: {class: "ported:State"}
    trigger: {class: "ported:Distance", bound: 0.1}
/controller:
  ros__parameters: {module: controller, law: {class: "ported:ServoPd"}}
/amplifier:
  ros__parameters: {module: actuator, size: 1, limits: [0.8]}
"""

WATCHED = {
    "sensor": {"signal": {"class": "ported:TrackingError"}},
    "controller": {"law": {"class": "etac_ros.laws.law:Relay", "size": 1}},
}

CASES: dict[str, tuple[list[str], int]] = {
    "servo": ([], 20),
    "servo, float64": (["wire=double"], 20),
    "an armature that is late and sometimes fails": (
        ["links.armature={delay_ticks: 3, loss: 0.2}", "sensor.trigger.longest_silence_s=0.1"],
        20,
    ),
    "dynamic rule": (["sensor.trigger={class: 'ported:Dynamic'}"], 20),
    "dynamic rule, at least every 0.2 s and no sooner than 0.05 s": (
        ["sensor.trigger={class: 'ported:Dynamic', longest_silence_s: 0.2, least_interval_s: 0.05}"],
        15,
    ),
    "self-triggered rule": (["sensor.trigger={class: 'ported:SelfTriggered'}"], 10),
    "rule against a model": (["sensor.trigger={class: 'ported:ModelError'}"], 20),
    "watches (e, omega), sends u": ([f"{node}={value}" for node, value in WATCHED.items()], 20),
}


def servo(folder: Path, overrides: list[str]) -> Scenario:
    path = folder / "servo.yaml"
    tree = yaml.safe_load(SERVO)
    for override in overrides:
        key, _, value = override.partition("=")
        if key in ("sensor", "controller"):
            tree[f"/{key}"]["ros__parameters"].update(yaml.safe_load(value))
    path.write_text(yaml.safe_dump(tree))
    return load(str(path), overrides=[text for text in overrides if text.partition("=")[0] not in WATCHED])


def both(scenario: Scenario, folder: Path) -> Run:
    """The run over DDS, after it has been found the same by calls and in any windows."""
    by_calls = run_in_process(scenario)
    for length in (1, 7):
        assert_same(by_calls.recording, InProcess(scenario.build(), WindowPolicy(length, length)).run())
    over_ros = run_over_ros(scenario, folder / "bag", RosOptions(processes="one"))
    assert_same(over_ros.recording, by_calls.recording)
    assert over_ros.summary.measured == by_calls.summary.measured
    return over_ros


@pytest.mark.parametrize("case", list(CASES))
def test_servo(case: str, tmp_path: Path) -> None:
    overrides, least = CASES[case]
    run = both(servo(tmp_path, overrides), tmp_path)
    count = run.summary.triggers["/sensor"].count
    assert least <= count < 250, count
    performance = run.summary.performance["/servo"]
    assert performance.attitude_error_deg is None
    assert performance.energy_n2m2s > 0.01
    assert not performance.of_torque
    assert energy_heading([performance]) == "input², integrated"
    voltages = np.array([message.value[0] for message in run.recording.messages["armature"]])
    assert np.abs(voltages).max() <= 0.8
    sizes = {"double": 8}.get(run.scenario.run.wire.value, 4)
    assert run.summary.topics["/voltage"].payload_bytes == sizes * run.summary.topics["/voltage"].messages


def test_the_report_of_a_servo_shows_its_states(tmp_path: Path, few_figures: FewFigures) -> None:
    few_figures("overview", "attitude", "rate", "states")
    run_in_process(servo(tmp_path, []), tmp_path / "bag")
    page = write_report(tmp_path / "bag", trust=True).read_text()
    assert "States" in page
    assert "Euler" not in page.partition("<script")[0]


def test_the_report_of_a_signal_that_sends_something_else(tmp_path: Path, few_figures: FewFigures) -> None:
    few_figures("watched", "signal")
    scenario = servo(tmp_path, [f"{node}={value}" for node, value in WATCHED.items()])
    run_in_process(scenario, tmp_path / "bag")
    page = write_report(tmp_path / "bag", trust=True).read_text()
    assert "What the trigger rule is shown at every tick" in page


def test_times_around_a_rule_with_memory(tmp_path: Path) -> None:
    override = "sensor.trigger={class: 'ported:Dynamic', longest_silence_s: 0.2, least_interval_s: 0.05}"
    instants = run_in_process(servo(tmp_path, [override])).summary.triggers["/sensor"].times_s
    gaps = np.round(np.diff(instants), 9)
    assert gaps.min() == 0.05
    assert gaps.max() == 0.2


def test_the_dynamic_rule_against_a_loop_by_hand(tmp_path: Path) -> None:
    """Its instants are those of the textbook's loop over all committed samples."""
    run = run_in_process(servo(tmp_path, ["sensor.trigger={class: 'ported:Dynamic'}", "wire=double"]))
    states = run.recording.samples("/servo")[1]
    eta, held, instants = 0.05, states[0], [0]
    step = 0.01

    def reserve(x: Any) -> Any:
        return 0.1 * np.dot(x, x) - np.dot(x - held, x - held)

    eta_before = eta
    eta = eta_before + step * (-eta_before + reserve(states[0]))
    for tick in range(1, 300):
        x = states[tick]
        if eta + 0.5 * reserve(x) < 0.0:
            held = x
            instants.append(tick)
        eta = eta + step * (-eta + reserve(x))
    assert [round(time * 100) for time in run.summary.triggers["/sensor"].times_s] == instants


def test_model_based_hold(tmp_path: Path) -> None:
    path = tmp_path / "hold.yaml"
    tree = yaml.safe_load(SERVO)
    tree["/**"]["ros__parameters"].update(duration_s=0.5)
    tree["/**"]["ros__parameters"]["links"].update(
        state={"from": "/sensor", "to": ["/controller"], "kind": "network"},
        voltage={"from": "/controller", "to": ["/amplifier"], "kind": "internal"},
    )
    tree["/controller"]["ros__parameters"] = {"module": "ported:ModelHold"}
    tree["/sensor"]["ros__parameters"]["trigger"] = {"class": "ported:ModelError", "bound": 0.1}
    path.write_text(yaml.safe_dump(tree))
    run = both(load(str(path)), tmp_path)
    sent = run.recording.messages["voltage"]
    assert {message.tick for message in sent} == set(range(50))
    assert len({float(message.value[0]) for message in sent}) > 30  # it does not hold a constant


def test_four_wheels(small: Any, tmp_path: Path) -> None:
    axes = "[0.70710678, 0.0, -0.70710678, 0.0, 0.0, 0.70710678, 0.0, -0.70710678" + ", 0.70710678" * 4 + "]"
    path = small(
        ('{class: "etac_ros.laws.wu2018:Proportional", k: 2.0}', '{class: "ported:FourWheels", k: 2.0}'),
        (
            "    module: actuator\n",
            f"    module: actuator\n    size: 4\n    limits: [0.05, 0.05, 0.1, 0.1]\n    axes: {axes}\n"
            "    effectiveness: [1.0, 1.0, 1.0, 0.5]\n",
        ),
    )
    run = both(load(str(path)), tmp_path)
    assert run.summary.topics["/command"].type == "std_msgs/msg/Float32MultiArray"
    assert run.summary.topics["/command"].payload_bytes == 16 * run.summary.topics["/command"].messages
    matrix = np.array(yaml.safe_load(axes)).reshape(3, 4)
    for command, torque in zip(run.recording.messages["command"], run.recording.messages["torque"], strict=True):
        wheels = np.clip(command.value, [-0.05, -0.05, -0.1, -0.1], [0.05, 0.05, 0.1, 0.1]) * [1.0, 1.0, 1.0, 0.5]
        np.testing.assert_allclose(torque.value, matrix @ wheels, atol=1e-15)


def test_ten_vehicles_on_one_plant(tmp_path: Path) -> None:
    path = tmp_path / "track.yaml"
    path.write_text("""
/**:
  ros__parameters:
    scenario: track
    ticks_per_second: 50
    duration_s: 2.0
    formation: {n: 10, prefix: cart}
    links:
      state: {from: "/{self}/sensor", to: ["/{self}/controller"], kind: network}
      command: {from: "/{self}/controller", to: ["/{self}/drive"], kind: internal}
      force: {from: "/{self}/drive", to: ["/track:force{number}"], kind: physical}
/track:
  ros__parameters: {module: plant, dynamics: {class: "ported:Track", vehicles: 10}}
/*/sensor:
  ros__parameters:
    module: sensor
    reads: /track
    signal: {class: "ported:OneVehicle", number: "{number}", vehicles: 10}
    trigger: {class: "ported:Distance", bound: 0.05}
/*/controller:
  ros__parameters: {module: controller, law: {class: "ported:Brake"}}
/*/drive:
  ros__parameters: {module: actuator, size: 1}
""")
    run = both(load(str(path)), tmp_path)
    assert len(run.summary.triggers) == 10
    assert all(triggers.count >= 2 for triggers in run.summary.triggers.values())
    ticks = [message.tick for link in run.recording.messages.values() for message in link]
    assert len(set(ticks)) < len(ticks) / 4  # many act in one tick
