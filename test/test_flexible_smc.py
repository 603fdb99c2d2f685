"""The event-triggered sliding mode that the flexible paper compares with (section V.C)."""

from __future__ import annotations

from typing import Any

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from hypothesis.extra.numpy import arrays
from pydantic import ValidationError

from etac_ros.laws.flexible_smc import (
    EventTriggeredSlidingMode,
    EventTriggeredSlidingModeParameters,
    RateAndSurface,
    RateAndSurfaceParameters,
)
from etac_ros.parameters import FloatArray

PRINTED = {
    "inertia_bound_kg_m2": 360.0,
    "mu_1_s": 3.0,
    "disturbance_bound_nm": 1.0,
    "alpha_1_nm": 0.001,
    "beta_1_nms": 530.0,
}
signals = arrays(np.float64, 6, elements=st.floats(-1.0, 1.0))


def law(**changes: Any) -> EventTriggeredSlidingMode:
    return EventTriggeredSlidingMode(EventTriggeredSlidingModeParameters.model_validate({**PRINTED, **changes}), 100)


def signal(slope: tuple[float, float, float] = (2.0, 2.0, 2.0)) -> RateAndSurface:
    return RateAndSurface(RateAndSurfaceParameters(slope_rad_s=slope), 100)


def test_torque_by_hand() -> None:
    """``|omega|_1 = 0.35``: ``(360 x 3 + 530) 0.35 + 1 + 0.001 = 564.501``; no torque on an axis where s is zero."""
    torque = law().command(np.array([0.1, -0.2, 0.05, 1e-9, -7.0, 0.0]))
    assert torque == pytest.approx([-564.501, 564.501, 0.0], rel=1e-14)


@pytest.mark.parametrize(
    ("alone", "expected"),
    [
        ({"disturbance_bound_nm": 0.25}, 0.25),
        ({"alpha_1_nm": 0.5}, 0.5),
        ({"beta_1_nms": 2.0}, 1.2),
    ],
)
def test_each_part_of_the_gain(alone: dict[str, float], expected: float) -> None:
    """With ``|omega|_1 = 0.6``, on top of ``J* mu |omega|_1 = 2 x 0.5 x 0.6``."""
    nothing = {"disturbance_bound_nm": 0.0, "alpha_1_nm": 0.0, "beta_1_nms": 0.0}
    part = law(inertia_bound_kg_m2=2.0, mu_1_s=0.5, **{**nothing, **alone})
    torque = part.command(np.array([0.1, 0.2, -0.3, -1.0, -1.0, 1.0]))
    assert torque == pytest.approx(np.array([1.0, 1.0, -1.0]) * (0.6 + expected), rel=1e-14)


def test_at_rest_the_bound_of_the_disturbance_is_left() -> None:
    """The least torque of an axis: with the printed 1 N m the figures' 6e-3 N m is out of reach."""
    assert law().command(np.array([0.0, 0.0, 0.0, 1e-12, 1e-12, -1e-12])) == pytest.approx([-1.001, -1.001, 1.001])


@given(signals)
def test_torque_opposes_the_surface_on_each_axis(received: FloatArray) -> None:
    torque = law().command(received)
    s = received[3:]
    assert np.array_equal(np.sign(torque), -np.sign(s))
    acting = np.abs(torque[s != 0.0])
    assert np.ptp(acting) == 0.0 if acting.size else True


@given(signals, st.permutations([0, 1, 2]))
def test_no_axis_is_special(received: FloatArray, order: list[int]) -> None:
    turned = received[[*order, *[3 + axis for axis in order]]]
    assert law().command(turned) == pytest.approx(law().command(received)[order], rel=1e-14, abs=0.0)


def test_the_size_of_the_surface_does_not_matter() -> None:
    small, large = (np.array([0.1, 0.0, 0.2, *(scale * np.array([1.0, -2.0, 3.0]))]) for scale in (1e-6, 1e6))
    assert np.array_equal(law().command(small), law().command(large))


def test_surface_by_hand() -> None:
    """``s = omega + K p`` with a diagonal of three different numbers."""
    row = np.array([[0.1, -0.2, 0.3, 0.01, 0.02, -0.03, *[9.0] * 8]])
    expected = [0.01, 0.02, -0.03, 0.21, -0.78, 1.47]
    assert signal((2.0, 4.0, 5.0)).evaluate(row)[0] == pytest.approx(expected, rel=1e-14)


@given(arrays(np.float64, st.tuples(st.integers(1, 8), st.just(14)), elements=st.floats(-1.0, 1.0)))
def test_rows_have_the_bits_of_each(rows: FloatArray) -> None:
    apart = np.vstack([signal().evaluate(rows[i : i + 1]) for i in range(len(rows))])
    assert signal().evaluate(rows).tobytes() == apart.tobytes()


def test_law_takes_what_the_signal_sends() -> None:
    assert signal().size == law().signal_size == 6
    assert law().command_size == 3


@pytest.mark.parametrize("size", [3, 5, 7])
def test_signals_of_another_size_are_refused(size: int) -> None:
    with pytest.raises(ValueError, match=r"\[omega \(3\), s \(3\)\]"):
        law().command(np.ones(size))


@pytest.mark.parametrize(
    "change",
    [{"inertia_bound_kg_m2": 0.0}, {"mu_1_s": -1.0}, {"disturbance_bound_nm": -1e-3}, {"alpha_1_nm": -1.0},
     {"beta_1_nms": -1.0}, {"gamma": 1.0}],
)  # fmt: skip
def test_wrong_gains_are_refused(change: dict[str, float]) -> None:
    with pytest.raises(ValidationError, match=next(iter(change))):
        law(**change)


def test_a_surface_that_leads_away_is_refused() -> None:
    with pytest.raises(ValidationError, match="greater than 0"):
        signal((2.0, -2.0, 2.0))
