"""The relative threshold: it fires at the first sample at which ``|held - s| < alpha |s| + gamma`` fails."""

from __future__ import annotations

from typing import Any

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from hypothesis.extra.numpy import arrays
from pydantic import ValidationError

from etac_ros.parameters import FloatArray
from etac_ros.triggers.relative import RelativeThreshold, RelativeThresholdParameters

GRID = 32
inside = st.floats(0.01, 0.99)
gammas = st.floats(1e-6, 0.1)
numbers = st.floats(-1.0, 1.0)
signals = st.integers(0, 30).flatmap(lambda n: arrays(np.float64, (n, 3), elements=numbers))
near_signals = st.integers(1, 30).flatmap(
    lambda n: arrays(np.float64, (n, 3), elements=st.floats(0.0, 0.2)).map(lambda x: 0.5 + x.cumsum(0) / 10.0)
)
"""Signals that drift away slowly, so that the hit lies somewhere inside."""
helds = arrays(np.float64, 3, elements=numbers)


def rule(alpha: Any, gamma: Any) -> RelativeThreshold:
    return RelativeThreshold(RelativeThresholdParameters(alpha=alpha, gamma=gamma), GRID)


@given(st.one_of(signals, near_signals), helds, inside, gammas, st.booleans())
def test_bound_holds_before_the_index_and_fails_at_it(
    signals: FloatArray, held: FloatArray, alpha: float, gamma: float, from_first: bool
) -> None:
    if from_first and len(signals):
        held = signals[0]
    index = rule(alpha, gamma).first(signals, 0, held)
    error = np.linalg.norm(held - signals, axis=1)
    threshold = alpha * np.linalg.norm(signals, axis=1) + gamma
    before = len(signals) if index < 0 else index
    rounding = 1e-15
    assert (error[:before] < threshold[:before] + rounding).all()
    assert index < len(signals)
    if index >= 0:
        assert error[index] >= threshold[index] - rounding


@given(st.one_of(signals, near_signals), helds, inside, gammas, st.integers(0, 10**6))
def test_window_equals_one_by_one(signals: FloatArray, held: FloatArray, alpha: float, gamma: float, tick: int) -> None:
    trigger = rule(alpha, gamma)
    each = [trigger.first(signals[i : i + 1], tick + i, held) for i in range(len(signals))]
    assert trigger.first(signals, tick, held) == (each.index(0) if 0 in each else -1)


@given(near_signals, inside, gammas, st.data())
def test_windows_of_any_cut_find_the_same_sample(
    signals: FloatArray, alpha: float, gamma: float, data: st.DataObject
) -> None:
    trigger = rule(alpha, gamma)
    held = signals[0]
    cut = data.draw(st.integers(0, len(signals)))
    index = trigger.first(signals[:cut], 0, held)
    if index < 0:
        later = trigger.first(signals[cut:], cut, held)
        index = -1 if later < 0 else cut + later
    assert trigger.first(signals, 0, held) == index


@given(near_signals, helds, inside, gammas)
def test_margin_tells_what_the_rule_compares(signals: FloatArray, held: FloatArray, alpha: float, gamma: float) -> None:
    trigger = rule(alpha, gamma)
    margin = trigger.margin(signals, 0, held)
    assert margin is not None
    error, threshold = margin
    assert error == pytest.approx(np.linalg.norm(held - signals, axis=1), rel=1e-15, abs=1e-300)
    assert threshold == pytest.approx(alpha * np.linalg.norm(signals, axis=1) + gamma, rel=1e-14)
    # The very numbers, not merely near ones: where they cross is where it fires.
    crossed = np.flatnonzero(error >= threshold)
    assert trigger.first(signals, 0, held) == (crossed[0] if crossed.size else -1)


@given(signals, helds, inside, gammas)
def test_looking_changes_nothing(signals: FloatArray, held: FloatArray, alpha: float, gamma: float) -> None:
    trigger = rule(alpha, gamma)
    before = signals.tobytes(), held.tobytes()
    assert trigger.first(signals, 0, held) == trigger.first(signals, 0, held)
    assert (signals.tobytes(), held.tobytes()) == before


def test_touching_the_threshold_fires() -> None:
    # Eq. (8) says "greater or equal": |1.5 - 1| = 0.25 x 1 + 0.25.
    assert rule(0.25, 0.25).first(np.array([[1.0, 0.0, 0.0]]), 0, np.array([1.5, 0.0, 0.0])) == 0


def test_gamma_keeps_a_vanished_signal_quiet() -> None:
    nothing = np.zeros((5, 3))
    assert rule(0.5, 1e-6).first(nothing, 0, np.array([0.9e-6, 0.0, 0.0])) == -1
    assert rule(0.5, 1e-6).first(nothing, 0, np.array([1.1e-6, 0.0, 0.0])) == 0


@pytest.mark.parametrize("alpha", [0.0, 1.0, -0.1, 1.5, float("nan"), float("inf")])
def test_alpha_outside_its_interval_is_refused(alpha: float) -> None:
    with pytest.raises(ValidationError, match="alpha"):
        rule(alpha, 1e-6)


@pytest.mark.parametrize("gamma", [0.0, -1e-6, float("nan"), float("inf")])
def test_gamma_must_be_positive(gamma: float) -> None:
    with pytest.raises(ValidationError, match="gamma"):
        rule(0.5, gamma)
