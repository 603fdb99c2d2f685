"""The trigger rule of xie2021's eq. (15): three norms against a threshold of the held value and of time."""

from __future__ import annotations

import math

import numpy as np
import pytest
from hypothesis import HealthCheck, given, settings
from hypothesis import strategies as st
from hypothesis.extra.numpy import arrays
from pydantic import ValidationError

from etac_ros.parameters import FloatArray
from etac_ros.triggers.split_norm import SplitNormThreshold, SplitNormThresholdParameters

patient = settings(deadline=None, max_examples=80, suppress_health_check=[HealthCheck.too_slow])
signals = arrays(np.float64, st.tuples(st.integers(1, 12), st.just(9)), elements=st.floats(-2.0, 2.0))
vectors = arrays(np.float64, 9, elements=st.floats(-2.0, 2.0))


def rule(c1: float = 1.0, c2: float = 1.0, grid: int = 10) -> SplitNormThreshold:
    return SplitNormThreshold(SplitNormThresholdParameters(c1=c1, c2=c2), grid)


# Norms 3, 7 and 9.
ROW = np.array([[1.0, 2.0, -2.0, 2.0, -3.0, 6.0, -1.0, 4.0, 8.0]])


def test_fires_at_the_threshold_itself() -> None:
    """By hand: nothing held, so the threshold at t = 0 is c1, and the error 3 + 7 + 9; not the norm of all, 11.8."""
    error, threshold = rule(c1=19.0).margin(ROW, 0, np.zeros(9))
    assert (error[0], threshold[0]) == (19.0, 19.0)
    assert rule(c1=19.0).first(ROW, 0, np.zeros(9)) == 0
    assert rule(c1=19.0).first(ROW * 0.9999, 0, np.zeros(9)) == -1


def test_relative_part_is_of_the_held_chi_alone() -> None:
    """By hand: |chi_hat| = 5, so the threshold is 5 / sqrt 2 and c1; what else is held, and the signal, add nothing."""
    held = np.array([0.0, 3.0, 4.0, 9.0, 9.0, 9.0, 9.0, 9.0, 9.0])
    rows = np.vstack([held, held + ROW, 10.0 * held])
    errors, thresholds = rule(c1=1e-9).margin(rows, 0, held)
    assert thresholds == pytest.approx([5.0 / math.sqrt(2.0)] * 3, abs=2e-9)
    assert errors == pytest.approx([0.0, 19.0, 45.0 + 2 * 81.0 * math.sqrt(3.0)])


def test_threshold_falls_with_time() -> None:
    """tanh 0 = 0, tanh 1 = 0.76159416, tanh of long = 1."""
    rows = np.zeros((1001, 9))
    _, thresholds = rule(c1=0.5, c2=math.log(4.0)).margin(rows, 0, np.zeros(9))
    assert thresholds[0] == 0.5
    assert thresholds[10] == pytest.approx(0.5 * 4.0**-0.7615941559557649, rel=1e-14)
    assert thresholds[1000] == pytest.approx(0.125, rel=1e-14)
    assert (np.diff(thresholds) <= 0.0).all()
    assert (np.diff(thresholds[:100]) < 0.0).all()


def test_the_same_error_fires_later_only() -> None:
    """0.2 lies between c1 exp(-c2) and c1: it does not fire at first, and does as soon as tanh t passes ln(5) / 2."""
    row = np.zeros((40, 9))
    row[:, 4] = 0.2
    due = math.atanh(math.log(5.0) / 2.0)  # 1.1146 s
    assert rule(c2=2.0).first(row, 0, np.zeros(9)) == math.ceil(10 * due) == 12
    assert rule(c2=2.0).first(row, 5, np.zeros(9)) == 7
    assert rule(c2=2.0).first(row, 12, np.zeros(9)) == 0
    assert rule(c2=2.0, grid=20).first(row, 0, np.zeros(9)) == math.ceil(20 * due)


@given(rows=signals, held=vectors, tick=st.integers(0, 500))
@patient
def test_margin_is_the_papers(rows: FloatArray, held: FloatArray, tick: int) -> None:
    errors, thresholds = rule(0.7, 1.3).margin(rows, tick, held)
    blocks = np.linalg.norm((held - rows).reshape(-1, 3, 3), axis=2)
    t = (tick + np.arange(len(rows))) / 10
    expected = 0.5 * math.sqrt(2.0) * np.linalg.norm(held[:3]) + 0.7 * np.exp(-1.3 * np.tanh(t))
    assert errors == pytest.approx(blocks.sum(axis=1), rel=1e-12)
    assert thresholds == pytest.approx(expected, rel=1e-12)


@given(rows=signals, held=vectors, tick=st.integers(0, 50))
@patient
def test_first_is_the_first_row_over_the_margin(rows: FloatArray, held: FloatArray, tick: int) -> None:
    errors, thresholds = rule().margin(rows, tick, held)
    over = np.flatnonzero(errors >= thresholds)
    assert rule().first(rows, tick, held) == (over[0] if over.size else -1)
    assert rule().first(rows, tick, held, tick - 1) == rule().first(rows, tick, held)


@given(rows=signals, held=vectors, split=st.integers(0, 12), tick=st.integers(0, 30))
@patient
def test_windows_do_not_matter(rows: FloatArray, held: FloatArray, split: int, tick: int) -> None:
    whole = rule(3.0).first(rows, tick, held)
    split = min(split, rows.shape[0])
    first = rule(3.0).first(rows[:split], tick, held)
    if first < 0:
        second = rule(3.0).first(rows[split:], tick + split, held)
        first = split + second if second >= 0 else -1
    assert whole == first
    together = np.array(rule(3.0).margin(rows, tick, held))
    parts = [rule(3.0).margin(rows[:split], tick, held), rule(3.0).margin(rows[split:], tick + split, held)]
    assert together.tobytes() == np.concatenate(parts, axis=1).tobytes()


@given(held=vectors, tick=st.integers(0, 10**6))
@patient
def test_what_has_just_been_sent_does_not_fire(held: FloatArray, tick: int) -> None:
    assert rule(1e-12).first(held[np.newaxis], tick, held) == -1


def test_sizes_that_do_not_fit_are_refused() -> None:
    with pytest.raises(ValueError, match="rows of 9 numbers"):
        rule().first(np.ones((1, 8)), 0, np.zeros(9))
    with pytest.raises(ValueError, match="the held value has 3"):
        rule().margin(np.ones((1, 9)), 0, np.zeros(3))


@pytest.mark.parametrize("values", [{"c1": 0.0, "c2": 1.0}, {"c1": 1.0, "c2": -0.1}, {"c1": 1.0}])
def test_wrong_parameters_are_refused(values: dict[str, float]) -> None:
    with pytest.raises(ValidationError):
        SplitNormThresholdParameters.model_validate(values)
