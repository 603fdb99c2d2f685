"""The trigger rule of shi2022's eq. (21): every axis has a threshold, which falls with time."""

from __future__ import annotations

import math

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from hypothesis.extra.numpy import arrays
from pydantic import ValidationError

from etac_ros.parameters import FloatArray
from etac_ros.triggers.componentwise import ComponentThreshold, ComponentThresholdParameters

GRID = 100
signals = arrays(np.float64, st.tuples(st.integers(1, 12), st.just(3)), elements=st.floats(-3.0, 3.0))
vectors = arrays(np.float64, 3, elements=st.floats(-2.0, 2.0))
ticks = st.integers(0, 8000)
axes = st.sampled_from(["any", "all"])


def rule(beta: float = 0.25, delta: float = 0.5, axes: str = "any") -> ComponentThreshold:
    parameters = ComponentThresholdParameters.model_validate({"beta": beta, "delta": delta, "axes": axes})
    return ComponentThreshold(parameters, GRID)


def reference(tau: FloatArray, u: FloatArray, t: float, axes: str) -> bool:
    """Eq. (21), axis by axis, for the parameters of :func:`rule`."""
    over = [abs(tau[i] - u[i]) >= 0.25 * abs(u[i]) + math.exp(-0.5 * t) for i in range(3)]
    return any(over) if axes == "any" else all(over)


def test_fires_at_the_threshold_itself() -> None:
    """At t = 0 with ``u = (2, 0, -1)`` the thresholds are 1.5, 1 and 1.25."""
    u = np.array([2.0, 0.0, -1.0])
    assert rule().first(np.array([[3.5, 0.0, -1.0]]), 0, u) == 0
    assert rule().first(np.array([[2.0, -1.0, -1.0]]), 0, u) == 0
    assert rule().first(np.array([[2.0, 0.0, 0.25]]), 0, u) == 0
    assert rule().first(np.array([[3.499, -0.999, 0.249]]), 0, u) == -1


def test_one_axis_is_enough_or_all_are_needed() -> None:
    two = np.array([[1.5, -1.5, 0.5], [1.5, -1.5, 1.5]])
    assert rule().first(two, 0, np.zeros(3)) == 0
    assert rule(axes="all").first(two, 0, np.zeros(3)) == 1


def test_threshold_falls_with_the_tick() -> None:
    """0.5 is reached by exp(-0.5 t) at t = 2 ln 2 = 1.3863 s: the first tick after it is 139."""
    rows = np.full((200, 3), 0.5)
    assert rule().first(rows, 0, np.zeros(3)) == 139
    assert rule().first(rows, 100, np.zeros(3)) == 39
    assert rule().first(rows, 139, np.zeros(3)) == 0
    assert ComponentThreshold(ComponentThresholdParameters(beta=0.25, delta=0.5), 10).first(rows, 0, np.zeros(3)) == 14


def test_margin_is_of_the_axis_that_decides() -> None:
    """Thresholds 1.5, 1, 1.25 as above; the errors 1.2, 0.9, 0.5 use 0.8, 0.9 and 0.4 of them."""
    u = np.array([2.0, 0.0, -1.0])
    tau = u + np.array([1.2, -0.9, 0.5])
    for which, error, threshold in (("any", 0.9, 1.0), ("all", 0.5, 1.25)):
        errors, thresholds = rule(axes=which).margin(tau[np.newaxis], 0, u)
        assert (errors[0], thresholds[0]) == pytest.approx((error, threshold))


@given(signals, vectors, ticks, axes)
def test_it_is_the_papers_inequality(rows: FloatArray, held: FloatArray, tick: int, axes: str) -> None:
    fires = [reference(row, held, (tick + k) / GRID, axes) for k, row in enumerate(rows)]
    assert rule(axes=axes).first(rows, tick, held) == (fires.index(True) if True in fires else -1)


@given(signals, vectors, ticks, axes)
def test_first_is_the_first_row_over_the_margin(rows: FloatArray, held: FloatArray, tick: int, axes: str) -> None:
    errors, thresholds = rule(axes=axes).margin(rows, tick, held)
    over = np.flatnonzero(errors >= thresholds)
    assert rule(axes=axes).first(rows, tick, held) == (over[0] if over.size else -1)


@given(signals, vectors, ticks, st.integers(0, 12), axes)
def test_windows_do_not_matter(rows: FloatArray, held: FloatArray, tick: int, split: int, axes: str) -> None:
    split = min(split, len(rows))
    found = rule(axes=axes).first(rows[:split], tick, held) if split else -1
    if found < 0 and split < len(rows):
        rest = rule(axes=axes).first(rows[split:], tick + split, held)
        found = split + rest if rest >= 0 else -1
    assert found == rule(axes=axes).first(rows, tick, held)


@given(
    signals,
    vectors,
    ticks,
    axes,
    st.permutations(range(3)),
    arrays(np.float64, 3, elements=st.sampled_from([-1.0, 1.0])),
)
def test_axes_and_signs_are_alike(
    rows: FloatArray, held: FloatArray, tick: int, axes: str, order: list[int], signs: FloatArray
) -> None:
    turned = rule(axes=axes).first(np.ascontiguousarray((rows * signs)[:, order]), tick, (held * signs)[order])
    assert turned == rule(axes=axes).first(rows, tick, held)


@pytest.mark.parametrize("axes", ["any", "all"])
def test_where_the_exponential_has_vanished_nothing_fires_on_nothing(axes: str) -> None:
    """exp(-0.5 t) is 0 in float64 after 1491 s: with no torque held the threshold is 0, and 0 >= 0."""
    late = 2000 * GRID
    assert rule(axes=axes).first(np.zeros((1, 3)), late, np.zeros(3)) == 0
    errors, thresholds = rule(axes=axes).margin(np.zeros((1, 3)), late, np.zeros(3))
    assert (errors[0], thresholds[0]) == (0.0, 0.0)


def test_an_axis_without_threshold_is_over_it_and_the_others_need_not_be() -> None:
    late, held = 2000 * GRID, np.array([0.0, 1.0, 0.0])
    rows = np.array([[0.0, 1.1, 0.0]])  # 0 >= 0, 0.1 < 0.25, 0 >= 0
    assert rule().first(rows, late, held) == 0
    assert rule(axes="all").first(rows, late, held) == -1


def test_sizes_that_do_not_fit_are_refused() -> None:
    for call in (rule().first, rule().margin):
        with pytest.raises(ValueError, match="4 columns do not fit a held torque of 3"):
            call(np.zeros((1, 4)), 0, np.zeros(3))


@pytest.mark.parametrize("change", [{"beta": 0.0}, {"beta": 1.0}, {"delta": 0.0}, {"axes": "some"}])
def test_wrong_parameters_are_refused(change: dict[str, float]) -> None:
    with pytest.raises(ValidationError):
        ComponentThresholdParameters.model_validate({"beta": 0.01, "delta": 0.1, **change})
