"""What a periodic loop needs for the same: interpolation in log-log, and the sentences."""

from __future__ import annotations

import math

import pytest
from hypothesis import given
from hypothesis import strategies as st

from etac_ros.tradeoff.answer import PeriodicCurve, answer, periodic_curve, times

FACTOR = st.floats(0.01, 100.0)
CURVES = st.lists(
    st.tuples(st.floats(1.0, 1e6), st.floats(1e-3, 1e3)), min_size=2, max_size=8, unique_by=lambda point: point[0]
)


def curve(*points: tuple[float, float]) -> PeriodicCurve:
    found = periodic_curve(points)
    assert found is not None
    return found


LINE = curve((100.0, 10.0), (1000.0, 1.0), (10000.0, 0.1))
FLAT = curve((100.0, 7.0), (10000.0, 0.7))


@given(CURVES)
def test_the_curve_goes_through_its_points(points: list[tuple[float, float]]) -> None:
    found = curve(*points)
    for payload_bytes, value in points:
        assert found.value_at(payload_bytes) == value


@given(st.floats(100.0, 10000.0))
def test_a_power_law_is_met_between_its_points(payload_bytes: float) -> None:
    value = LINE.value_at(payload_bytes)
    assert value == pytest.approx(1000.0 / payload_bytes, rel=1e-9)
    assert LINE.bytes_for(1000.0 / payload_bytes) == pytest.approx(payload_bytes, rel=1e-9)


@given(CURVES, st.floats(1e-3, 1e3))
def test_the_bytes_for_a_value_are_the_fewest_that_get_it(points: list[tuple[float, float]], value: float) -> None:
    found = curve(*points)
    needed = found.bytes_for(value)
    if needed is None:
        assert min(found.values) > value or found.values[0] < value
        return
    assert found.value_at(needed) == pytest.approx(value, rel=1e-6)
    for payload_bytes, own in zip(found.payload_bytes, found.values, strict=True):
        assert own >= value or payload_bytes >= needed


@given(CURVES, st.floats(1.0, 1e6), st.floats(1e-3, 1e3), FACTOR, FACTOR)
def test_units_do_not_matter(
    points: list[tuple[float, float]], payload_bytes: float, error: float, more: float, other: float
) -> None:
    scaled = curve(*((more * x, other * y) for x, y in points))
    one = answer(payload_bytes, error, 1.0, curve(*points), FLAT)
    same = answer(more * payload_bytes, other * error, 1.0, scaled, FLAT)
    for mine, its in ((one.bytes_at_error, same.bytes_at_error), (one.error_at_bytes, same.error_at_bytes)):
        # At the very end of a curve rounding decides whether a point lies within.
        if mine is not None and its is not None:
            assert its == pytest.approx(mine, rel=1e-6)


def test_of_a_curve_that_rises_and_falls_the_fewest_bytes_count() -> None:
    wavy = curve((100.0, 4.0), (200.0, 1.0), (400.0, 3.0), (800.0, 0.5))
    assert wavy.bytes_for(2.0) == pytest.approx(100.0 * math.sqrt(2.0))
    assert wavy.bytes_for(1.0) == 200.0


def test_outside_its_ends_a_curve_says_nothing() -> None:
    assert LINE.value_at(99.0) is None
    assert LINE.value_at(10001.0) is None
    assert LINE.bytes_for(11.0) is None
    assert LINE.bytes_for(0.09) is None
    assert LINE.value_at(100.0) == LINE.bytes_for(0.1) / 1000.0 == 10.0  # type: ignore[operator]


def test_twins_and_zeros_make_no_curve() -> None:
    assert periodic_curve([(100.0, 3.0), (100.0, 2.0)]) is None
    assert periodic_curve([(100.0, 3.0), (0.0, 2.0), (200.0, 0.0)]) is None
    assert curve((200.0, 1.0), (100.0, 3.0), (100.0, 2.0)) == PeriodicCurve((100.0, 200.0), (2.0, 1.0))


def test_the_sentence_within_the_curve() -> None:
    found = answer(200.0, 0.5, 0.7, LINE, FLAT)
    assert found.bytes_at_error == pytest.approx(10.0)
    assert found.error_at_bytes == pytest.approx(10.0)
    assert found.bytes_at_energy == pytest.approx(50.0)
    assert found.energy_at_bytes == pytest.approx(10.0 / math.sqrt(2.0))
    assert found.energy_at_error == pytest.approx(math.sqrt(5.0))
    assert found.words == (
        "At its error, periodic needs 10 times the bytes (2,000) and 2.24 times the energy; at its energy, periodic "
        "needs 50 times the bytes (10,000); at its bytes, periodic's error is 10 times as large, its energy 7.07 times."
    )


@pytest.mark.parametrize(
    ("payload_bytes", "error", "said"),
    [
        (50.0, 1.0, ["20 times the bytes (1,000)", "its curve, which begins at 2.00 times these bytes"]),
        (20000.0, 1.0, ["0.05 times the bytes (1,000)", "its curve, which ends at 0.50 times these bytes"]),
        (200.0, 0.05, ["At its error, periodic has no answer", "smallest error is 2.00 times as large, with 50 times"]),
        (200.0, 20.0, ["at most 0.50 times the bytes", "begins with a smaller error at 100"]),
    ],
)
def test_the_sentence_says_where_the_curve_does_not_reach(payload_bytes: float, error: float, said: list[str]) -> None:
    found = answer(payload_bytes, error, 1.0, LINE, FLAT)
    for words in (*said, "outside its curve"):
        assert words in found.words
    assert None in (found.bytes_at_error, found.error_at_bytes)


@pytest.mark.parametrize(
    ("factor", "words"),
    [(1234.4, "1,234 times"), (12.34, "12 times"), (1.5, "1.50 times"), (0.0123, "0.012 times"), (0.1, "0.10 times")],
)
def test_factors_in_words(factor: float, words: str) -> None:
    assert times(factor) == words
