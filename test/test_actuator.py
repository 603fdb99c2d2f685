"""The actuator: any number of axes, limits of each, effectiveness, and how the plant feels them."""

from __future__ import annotations

from typing import Any

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from hypothesis.extra.numpy import arrays
from pydantic import ValidationError

from etac_ros.graph.module import Arrival, Context
from etac_ros.modules.actuator import Actuator, ActuatorParameters
from etac_ros.parameters import FloatArray

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
    ],
)
def test_numbers_that_do_not_fit_are_refused(parameters: dict[str, Any], words: str) -> None:
    with pytest.raises(ValidationError, match=words):
        ActuatorParameters(**parameters)
