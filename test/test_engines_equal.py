"""Both engines give the same messages and the same committed states, to the last bit."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest

from etac_ros.engines.inprocess import InProcess
from etac_ros.graph.recording import Recording
from etac_ros.runs import RosOptions, run_in_process, run_over_ros
from etac_ros.scenario.load import load
from etac_ros.timing.windows import WindowPolicy

CASES = {
    "as published": (None, []),
    "time-triggered": ("periodic", ["duration_s=60"]),
    "noise": ("noise", ["duration_s=30"]),
    "filtered noise": ("filtered-noise", ["duration_s=200"]),
    "stamped": (None, ["duration_s=200", "wire=stamped"]),
    "mixed wires": (None, ["duration_s=200", "links.torque_command.wire=stamped"]),
    "delay": (None, ["duration_s=200", "links.filtered_error.delay_ticks=3"]),
    "delay and loss": (
        None,
        [
            "duration_s=200",
            "links.torque_command={delay_ticks: 2, loss: 0.3}",
            "links.filtered_error.loss=0.2",
        ],
    ),
    "sub-steps": (None, ["duration_s=100", "plant.dynamics.substeps=4"]),
}


def assert_same(one: Recording, other: Recording) -> None:
    """Same messages at the same places in time with the same bits, and the same committed samples."""
    assert one.messages.keys() == other.messages.keys()
    for link, messages in one.messages.items():
        places = [(message.sequence, message.tick, message.step) for message in messages]
        assert places == [(m.sequence, m.tick, m.step) for m in other.messages[link]], link
        for mine, theirs in zip(messages, other.messages[link], strict=True):
            assert mine.value.tobytes() == theirs.value.tobytes(), f"{link}#{mine.sequence}"
    assert one.air == other.air
    for plant in one.truth:
        first, samples = one.samples(plant)
        assert (first, samples.tobytes()) == (other.samples(plant)[0], other.samples(plant)[1].tobytes())


@pytest.mark.parametrize("case", list(CASES))
def test_same_bits(case: str, tmp_path: Path) -> None:
    variant, overrides = CASES[case]
    scenario = load("wu2018", variant, overrides)
    over_ros = run_over_ros(scenario, tmp_path / "bag")
    by_calls = run_in_process(scenario)
    assert_same(over_ros.recording, by_calls.recording)
    assert over_ros.summary.final_state == by_calls.summary.final_state
    assert over_ros.summary.triggers == by_calls.summary.triggers
    assert over_ros.summary.network == by_calls.summary.network
    assert over_ros.summary.performance == by_calls.summary.performance


@pytest.mark.parametrize(("first", "longest"), [(1, 1), (7, 7), (64, 4096)])
def test_windows_change_nothing(first: int, longest: int) -> None:
    usual = run_in_process(load("wu2018")).recording
    assert_same(usual, InProcess(load("wu2018").build(), WindowPolicy(first, longest)).run())


@pytest.mark.parametrize("processes", ["namespace", "one"])
def test_spread_changes_nothing(processes: str, tmp_path: Path) -> None:
    scenario = load("wu2018", overrides=["duration_s=100"])
    run = run_over_ros(scenario, tmp_path / "bag", RosOptions(processes=processes))
    assert_same(run.recording, run_in_process(scenario).recording)


def test_a_different_start_is_noticed() -> None:
    """The comparison itself can fail."""
    one = run_in_process(load("wu2018", overrides=["duration_s=10"]))
    other = run_in_process(
        load(
            "wu2018",
            overrides=["duration_s=10", "plant.dynamics.attitude_euler_deg=[10.0, 5.0, -5.000000001]"],
        )
    )
    with pytest.raises(AssertionError):
        assert_same(one.recording, other.recording)
    assert not np.array_equal(one.recording.samples("/plant")[1], other.recording.samples("/plant")[1])
