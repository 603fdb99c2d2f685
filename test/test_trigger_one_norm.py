"""The 1-norm rule on the angular velocity (flexible section V.C)."""

from __future__ import annotations

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from hypothesis.extra.numpy import arrays
from pydantic import ValidationError

from etac_ros.parameters import FloatArray
from etac_ros.triggers.one_norm import OneNormThreshold, OneNormThresholdParameters

signals = arrays(np.float64, st.tuples(st.integers(1, 12), st.just(6)), elements=st.floats(-2.0, 2.0))
vectors = arrays(np.float64, 6, elements=st.floats(-2.0, 2.0))


def rule(epsilon: float = 0.5, r: float = 0.125) -> OneNormThreshold:
    return OneNormThreshold(OneNormThresholdParameters(epsilon=epsilon, r_rad_s=r), 100)


def test_fires_at_the_threshold_itself() -> None:
    """By hand: held (1, -2, 0.5) has the 1-norm 3.5, the threshold is 1.875; 0.5 + 1.25 + 0.125 off reaches it."""
    held = np.array([1.0, -2.0, 0.5, 0.0, 0.0, 0.0])
    there = np.array([[1.5, -0.75, 0.625, 0.0, 0.0, 0.0]])
    errors, thresholds = rule().margin(there, 0, held)
    assert errors.tolist() == thresholds.tolist() == [1.875]
    assert rule().first(there, 0, held) == 0
    assert rule().first(there - [[1e-9, 0.0, 0.0, 0.0, 0.0, 0.0]], 0, held) == -1


def test_the_norm_is_the_sum_of_magnitudes() -> None:
    """Twice 0.1 is 0.2 >= 0.15 in the 1-norm, and 0.141 < 0.15 in the 2-norm."""
    assert rule(r=0.15).first(np.array([[0.1, -0.1, 0.0]]), 0, np.zeros(3)) == 0
    assert rule(r=0.15).first(np.array([[0.14, 0.0, 0.0]]), 0, np.zeros(3)) == -1


@given(signals, vectors, arrays(np.float64, 3, elements=st.floats(-2.0, 2.0)))
def test_only_omega_counts(rows: FloatArray, held: FloatArray, other: FloatArray) -> None:
    changed_rows, changed_held = rows.copy(), held.copy()
    changed_rows[:, 3:] += other
    changed_held[3:] -= other
    assert rule().first(rows, 0, held) == rule().first(changed_rows, 0, changed_held)
    bare = np.ascontiguousarray(rows[:, :3])
    assert rule().first(rows, 0, held) == rule().first(bare, 0, held[:3].copy())


@given(signals, vectors)
def test_threshold_is_that_of_what_was_transmitted(rows: FloatArray, held: FloatArray) -> None:
    """Not of the signal: it is the same for all samples."""
    _, thresholds = rule().margin(rows, 0, held)
    assert thresholds == pytest.approx(np.full(len(rows), 0.5 * np.abs(held[:3]).sum() + 0.125), rel=1e-14)


@given(signals, vectors)
def test_first_is_the_first_row_over_the_margin(rows: FloatArray, held: FloatArray) -> None:
    errors, thresholds = rule().margin(rows, 5, held)
    assert errors == pytest.approx(np.abs(held[:3] - rows[:, :3]).sum(axis=1), abs=1e-14)
    over = np.flatnonzero(errors >= thresholds)
    assert rule().first(rows, 5, held) == (over[0] if over.size else -1)


@given(signals, vectors, st.integers(0, 12))
def test_windows_do_not_matter(rows: FloatArray, held: FloatArray, split: int) -> None:
    split = min(split, len(rows))
    first = rule().first(rows[:split], 100, held, 98)
    if first < 0:
        second = rule().first(rows[split:], 100 + split, held, 98)
        first = split + second if second >= 0 else -1
    assert rule().first(rows, 100, held, 98) == first


@given(signals)
def test_what_was_just_transmitted_does_not_fire(rows: FloatArray) -> None:
    assert rule(r=1e-6).first(rows[:1], 0, rows[0].copy()) == -1


@pytest.mark.parametrize(("columns", "held"), [(2, 6), (6, 2)])
def test_sizes_that_do_not_fit_are_refused(columns: int, held: int) -> None:
    with pytest.raises(ValueError, match="first 3 columns"):
        rule().first(np.ones((1, columns)), 0, np.ones(held))
    with pytest.raises(ValueError, match="first 3 columns"):
        rule().margin(np.ones((1, columns)), 0, np.ones(held))


@pytest.mark.parametrize(("epsilon", "r"), [(0.0, 1e-6), (-0.5, 1e-6), (0.5, 0.0), (0.5, -1e-6)])
def test_wrong_thresholds_are_refused(epsilon: float, r: float) -> None:
    with pytest.raises(ValidationError, match="greater than 0"):
        rule(epsilon, r)
