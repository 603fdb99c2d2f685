"""Nodes started by hand, each in a process of its own: any order, the same scenario."""

from __future__ import annotations

import signal
import subprocess
from contextlib import suppress
from pathlib import Path

from hands import LIMIT_S, Start
from toy import toy, trace

from etac_ros.bag.read import read_bag
from etac_ros.runs import run_in_process
from etac_ros.scenario.load import load


def node(start: Start, name: str, file: Path, *more: str) -> subprocess.Popen[str]:
    return start("-m", "etac_ros", "node", name, str(file), *more)


def test_any_order(tmp_path: Path, start: Start) -> None:
    scenario = load("wu2018", overrides=["duration_s=100"])
    file = tmp_path / "wu.yaml"
    file.write_text(scenario.text)
    others = [node(start, name, file) for name in ("actuator", "sensor", "controller")]
    others.append(node(start, "plant", file, "--rate", "1000"))
    # Somebody who only listens, and the last to come is the recorder, after another has said that it is ready.
    watcher = start("-m", "etac_ros", "watch")
    assert watcher.stdout is not None
    assert watcher.stdout.readline() == "wu2018: listening\n"
    assert others[1].stdout is not None
    assert "ready" in others[1].stdout.readline()
    recorder = node(start, "recorder", file, "--bag", "bag")
    for process in [*others, recorder]:
        output, _ = process.communicate(timeout=LIMIT_S)
        assert process.returncode == 0, output
    recorded = read_bag(tmp_path / "bag").recording()
    expected = run_in_process(scenario).recording
    assert trace(recorded) == trace(expected)
    output, _ = watcher.communicate(timeout=LIMIT_S)
    assert watcher.returncode == 0, output
    count = len(expected.messages["filtered_error"])
    said = f"{count} triggers, {2 * count} messages and {24 * count} B on the network; the run is over"
    assert output.splitlines()[-1].startswith("wu2018: 100.0 of 100 s simulated")
    assert output.splitlines()[-1].endswith(said)


def test_two_plants_have_a_coordinator_of_their_own(tmp_path: Path, start: Start) -> None:
    scenario = toy(tmp_path, {"a": {"at": [3, 6]}, "b": {"at": [3, 4, 6]}})
    names = [*scenario.nodes, "recorder", "coordinator"]
    file = tmp_path / "toy.yaml"
    processes = [node(start, name, file, *(["--bag", "bag"] if name == "recorder" else [])) for name in names]
    for process in processes:
        output, _ = process.communicate(timeout=LIMIT_S)
        assert process.returncode == 0, output
    assert trace(read_bag(tmp_path / "bag").recording()) == trace(run_in_process(scenario).recording)


def test_another_scenario_is_refused(tmp_path: Path, start: Start) -> None:
    ours, other = tmp_path / "ours.yaml", tmp_path / "other.yaml"
    ours.write_text(load("wu2018", overrides=["duration_s=100"]).text)
    other.write_text(load("wu2018", overrides=["duration_s=100", "sensor.trigger.alpha=0.4"]).text)
    plant = node(start, "plant", ours)
    for name in ("controller", "actuator"):
        node(start, name, ours)
    node(start, "recorder", ours, "--bag", "bag")
    sensor = node(start, "sensor", other)
    for process in (plant, sensor):
        output, _ = process.communicate(timeout=LIMIT_S)
        assert process.returncode == 1
        assert "another scenario" in output
        assert "/sensor" in output


def test_a_node_that_dies_is_named_by_the_others(tmp_path: Path, start: Start) -> None:
    file = tmp_path / "long.yaml"
    file.write_text(load("wu2018", "periodic", ["duration_s=100000", "sensor.trigger.period_s=0.25"]).text)
    plant = node(start, "plant", file)
    rest = [node(start, name, file) for name in ("controller", "actuator")]
    recorder = node(start, "recorder", file, "--bag", "bag")
    sensor = node(start, "sensor", file)
    bag_appears(tmp_path / "bag", recorder)
    sensor.send_signal(signal.SIGKILL)
    output, _ = plant.communicate(timeout=LIMIT_S)
    assert plant.returncode == 1
    assert "/sensor" in output
    for process in [*rest, recorder]:
        process.communicate(timeout=LIMIT_S)
        assert process.returncode == 1
    assert read_bag(tmp_path / "bag").recording().messages["filtered_error"]


def bag_appears(bag: Path, recorder: subprocess.Popen[str]) -> None:
    """Wait until the recorder has something on disk."""
    while recorder.poll() is None:
        if any(file.stat().st_size > 20_000 for file in bag.glob("*.mcap")):
            return
        with suppress(subprocess.TimeoutExpired):
            recorder.wait(0.02)  # and leaves the processor to it
    raise AssertionError(recorder.communicate()[0])
