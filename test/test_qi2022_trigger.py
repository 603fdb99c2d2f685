"""The trigger rule of qi2022's eq. (11), with and without a heartbeat."""

from typing import Any

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from hypothesis.extra.numpy import arrays
from test_qi2022_numbers import SM_LAW, TICKS_PER_SECOND, TRIGGER, made, patient, sections

from etac_ros.parameters import FloatArray
from etac_ros.triggers.state_relative import StateRelativeThreshold, StateRelativeThresholdParameters
from etac_ros.triggers.timing import RuleTiming, timed


def _rule(delta: float = 1.0, epsilon: float = 2.0) -> StateRelativeThreshold:
    parameters = StateRelativeThresholdParameters(delta=delta, epsilon=epsilon)
    return StateRelativeThreshold(parameters, TICKS_PER_SECOND)


def _beating(silence: float) -> Any:
    return timed(_rule(), RuleTiming(longest_silence_s=silence), TICKS_PER_SECOND)


def _row(tau: list[float], omega: list[float], q: list[float]) -> FloatArray:
    return np.array([*tau, *omega, *q])


signals = arrays(np.float64, st.tuples(st.integers(1, 12), st.just(9)), elements=st.floats(-2.0, 2.0))
vectors = arrays(np.float64, 3, elements=st.floats(-2.0, 2.0))


def test_fires_at_the_threshold_itself() -> None:
    """By hand: ``|tau_held - tau| = 5``; ``epsilon |omega + delta q| = 2 |(1, 0, 0) + 2 (0.75, 0, 0)| = 5``."""
    rows = np.array([_row([3.0, 4.0, 0.0], [1.0, 0.0, 0.0], [0.75, 0.0, 0.0])])
    rule = _rule(delta=2.0, epsilon=2.0)
    error, threshold = rule.margin(rows, 0, np.zeros(3))
    assert error[0] == 5.0
    assert threshold[0] == 5.0
    assert rule.first(rows, 0, np.zeros(3)) == 0
    just_below = rows * np.array([0.999] * 3 + [1.0] * 6)
    assert rule.first(just_below, 0, np.zeros(3)) == -1


def test_attitude_can_cancel_rate_in_the_threshold() -> None:
    """The norm is that of the sum, not the sum of norms: on the line omega = -delta q any error fires."""
    rows = np.array([_row([1e-9, 0.0, 0.0], [-1.0, 0.5, 0.0], [0.5, -0.25, 0.0])])
    assert _rule(delta=2.0).first(rows, 0, np.zeros(3)) == 0
    assert _rule(delta=1.9).first(rows, 0, np.zeros(3)) == -1


def test_nothing_at_all_fires() -> None:
    """0 >= 0: the rule as printed."""
    assert _rule().first(np.zeros((1, 9)), 0, np.zeros(3)) == 0


@given(rows=signals, held=vectors)
@patient
def test_first_is_the_first_row_over_the_margin(rows: FloatArray, held: FloatArray) -> None:
    errors, thresholds = _rule().margin(rows, 0, held)
    over = np.flatnonzero(errors >= thresholds)
    assert _rule().first(rows, 7, held) == (over[0] if over.size else -1)


@given(rows=signals, held=vectors, exponent=st.integers(-20, 20))
@patient
def test_the_rule_has_no_scale_of_its_own(rows: FloatArray, held: FloatArray, exponent: int) -> None:
    """Torque, rate and attitude a power of two larger: the same decision (subnormal numbers apart)."""
    rows, held = np.round(rows, 6), np.round(held, 6)
    factor = 2.0**exponent
    assert _rule().first(rows * factor, 0, held * factor) == _rule().first(rows, 0, held)


@given(rows=signals, held=vectors, split=st.integers(0, 12))
@patient
def test_windows_do_not_matter(rows: FloatArray, held: FloatArray, split: int) -> None:
    rule = _beating(0.3)
    whole = rule.first(rows, 100, held, 98)
    split = min(split, rows.shape[0])
    first = rule.first(rows[:split], 100, held, 98)
    if first < 0:
        second = rule.first(rows[split:], 100 + split, held, 98)
        first = split + second if second >= 0 else -1
    assert whole == first


@given(rows=signals, held=vectors, tick=st.integers(0, 50), since=st.integers(0, 30), silence=st.integers(1, 10))
@patient
def test_heartbeat_fires_in_time_and_never_delays(
    rows: FloatArray, held: FloatArray, tick: int, since: int, silence: int
) -> None:
    plain = _rule().first(rows, tick, held)
    beating = _beating(silence / TICKS_PER_SECOND).first(rows, tick, held, tick - since)
    due = max(0, silence - since)
    expected = [index for index in (plain, due) if 0 <= index < rows.shape[0]]
    assert beating == (min(expected) if expected else -1)


def test_sizes_that_do_not_fit_are_refused() -> None:
    with pytest.raises(ValueError, match="9 are needed"):
        _rule().first(np.ones((1, 8)), 0, np.zeros(3))


def test_the_printed_rule_can_fall_silent_for_good() -> None:
    """At rest off the reference, with nothing held: ``K |q| < epsilon delta |q|`` for every direction of q."""
    numbers = sections()[TRIGGER[0]][TRIGGER[1]]
    assert numbers["delta"] * numbers["epsilon"] == pytest.approx(63.8)
    gains = np.array(sections()[SM_LAW[0]][SM_LAW[1]]["attitude_gain_nm"])
    directions = np.random.default_rng(1).normal(size=(1000, 3))
    offsets = 0.008 * directions / np.linalg.norm(directions, axis=1, keepdims=True)
    rows = np.concatenate([-gains * offsets, np.zeros_like(offsets), offsets], axis=1)
    assert made(TRIGGER).first(rows, 1, np.zeros(3)) == -1
    assert made(TRIGGER, "heartbeat").first(rows, 1, np.zeros(3), 0) == 5 * TICKS_PER_SECOND - 1
