"""The actuator: any number of axes, limits of each, effectiveness, and how the plant feels them."""

from __future__ import annotations

from typing import Any

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from hypothesis.extra.numpy import arrays
from pydantic import ValidationError

from etac_ros.engines.inprocess import InProcess
from etac_ros.graph.module import Arrival, Context
from etac_ros.metrics.accounts import HoldAccount, hold_accounts
from etac_ros.modules.actuator import Actuator, ActuatorParameters
from etac_ros.parameters import FloatArray
from etac_ros.runs import run_in_process
from etac_ros.scenario.load import load

numbers = st.floats(-1e6, 1e6)


def answer(command: FloatArray, **parameters: Any) -> FloatArray:
    actuator = Actuator(Context("/actuator", 10, 1), ActuatorParameters(**parameters))
    arrivals = (Arrival("command", "command", command),)
    return actuator.receive(None, arrivals, None)["torque"]


@given(arrays(np.float64, 3, elements=numbers), st.floats(0.01, 10.0))
def test_one_limit_for_all_axes(command: FloatArray, limit: float) -> None:
    assert np.array_equal(answer(command, limit_nm=limit), np.clip(command, -limit, limit))
    assert answer(command).tobytes() == command.tobytes()


@given(arrays(np.float64, 4, elements=numbers), arrays(np.float64, 4, elements=st.floats(0.01, 10.0)))
def test_limits_and_effectiveness_of_each_wheel(command: FloatArray, limits: FloatArray) -> None:
    left = np.array([1.0, 0.5, 0.0, 2.0])
    found = answer(command, size=4, limits=tuple(limits), effectiveness=tuple(left))
    assert np.array_equal(found, left * np.clip(command, -limits, limits))


@given(arrays(np.float64, 4, elements=numbers), arrays(np.float64, (3, 4), elements=st.floats(-1.0, 1.0)))
def test_wheel_axes(command: FloatArray, axes: FloatArray) -> None:
    found = answer(command, size=4, axes=tuple(axes.ravel()))
    np.testing.assert_allclose(found, axes @ command, rtol=1e-12, atol=1e-6)
    assert found.shape == (3,)


@pytest.mark.parametrize(
    ("parameters", "words"),
    [
        ({"limits": (1.0, 1.0)}, "3 numbers in limits, one for each of 'size'; found 2"),
        ({"size": 4, "effectiveness": (1.0,)}, "4 numbers in effectiveness"),
        ({"size": 4, "axes": (1.0,) * 6}, "rows of 4 numbers in axes"),
        ({"limit_nm": 1.0, "limits": (1.0, 1.0, 1.0)}, "one of limit_nm"),
        ({"effectiveness": (1.0, -0.1, 1.0)}, "greater than or equal to 0"),
        ({"safe_command": (1.0, 0.0, 0.0)}, "say time_to_live_s, too"),
        ({"safe_command": (1.0,), "time_to_live_s": 1.0}, "3 numbers in safe_command"),
    ],
)
def test_numbers_that_do_not_fit_are_refused(parameters: dict[str, Any], words: str) -> None:
    with pytest.raises(ValidationError, match=words):
        ActuatorParameters(**parameters)


# Commands once a second; those of 5, 6 and 7 s are lost.
OUTAGE = ["duration_s=12", "links.torque_command.outages={actuator: [5.0, 8.0]}"]


def test_a_command_that_outlives_its_time_gives_way_to_the_safe_one() -> None:
    keys = ["actuator.time_to_live_s=1.5", "actuator.safe_command=[0.5, 0.0, -0.5]", "actuator.limit_nm=0.3"]
    graph = load("wu2018", "periodic", [*OUTAGE, *keys]).build()
    recording = InProcess(graph).run()
    torques = {message.tick: message.value.tolist() for message in recording.messages["torque"]}
    # The command of 4 s (tick 128) is in time for 48 ticks more.
    assert list(torques) == [*range(0, 129, 32), 177, *range(256, 384, 32)]
    assert torques[177] == [0.3, 0.0, -0.3]
    assert hold_accounts(graph, recording) == {
        "/actuator": HoldAccount(time_to_live_s=1.5, expired=1, safe_s=(256 - 177) / 32)
    }


def test_the_safe_command_is_zero_and_a_command_at_the_last_tick_is_in_time() -> None:
    graph = load("wu2018", "periodic", [*OUTAGE, "actuator.time_to_live_s=1.0"]).build()
    recording = InProcess(graph).run()
    expired = [message for message in recording.messages["torque"] if message.step == 0]
    assert [(message.tick, message.value.tolist()) for message in expired] == [(161, [0.0, 0.0, 0.0])]


def test_without_a_time_to_live_nothing_expires_and_no_account_is_given() -> None:
    summary = run_in_process(load("wu2018", "periodic", OUTAGE)).summary
    assert summary.holds == {}


def test_a_command_at_the_tick_at_which_the_one_before_expires_comes_behind_the_safe_one() -> None:
    # Nine ticks of life, commands at 0, 10, 20 (lost) and 30: the first expires at 10, just before the second comes.
    keys = ["links.torque_command.outages={actuator: [0.5, 0.875]}", "actuator.time_to_live_s=0.28125"]
    period = ["duration_s=1", "sensor.trigger.period_s=0.3125"]
    graph = load("wu2018", "periodic", [*period, *keys]).build()
    recording = InProcess(graph).run()
    assert [(message.tick, message.step) for message in recording.messages["torque"]] == [
        (0, 2), (10, 0), (10, 2), (20, 0), (30, 2),
    ]  # fmt: skip
    account = hold_accounts(graph, recording)["/actuator"]
    assert (account.expired, account.safe_s) == (2, 10 / 32)
