"""Ticks and seconds: exact where seconds are whole ticks, refused where they are not."""

from __future__ import annotations

from fractions import Fraction

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from etac_ros.maths.ticks import seconds, whole_ticks

grids = st.sampled_from([1, 2, 5, 10, 20, 32, 50, 100, 125, 1000])
"""Grids whose tick is a short decimal fraction, among them those of the papers."""


@given(st.integers(0, 10**9), grids)
def test_ticks_to_seconds_and_back(tick: int, grid: int) -> None:
    assert whole_ticks(seconds(tick, grid), grid) == tick


@given(st.integers(0, 10**9), st.integers(1, 10**6))
def test_seconds_are_correctly_rounded(tick: int, grid: int) -> None:
    assert seconds(tick, grid) == float(Fraction(tick, grid))


@given(st.integers(0, 10**6), st.integers(1, 10**6))
def test_whole_seconds_are_exact(whole: int, grid: int) -> None:
    assert seconds(whole * grid, grid) == whole
    assert whole_ticks(float(whole), grid) == whole * grid


@given(st.integers(0, 10**9), st.integers(1, 10**6))
def test_later_ticks_are_later(tick: int, grid: int) -> None:
    assert seconds(tick, grid) < seconds(tick + 1, grid)


@given(st.lists(st.integers(0, 10**9), max_size=20), grids)
def test_an_array_gives_the_same_bits(ticks: list[int], grid: int) -> None:
    together = seconds(np.array(ticks, dtype=np.int64), grid)
    assert together.tolist() == [seconds(tick, grid) for tick in ticks]


@pytest.mark.parametrize(
    ("duration", "grid", "ticks"),
    [(0.05, 20, 1), (0.1, 10, 1), (0.3, 10, 3), (1e-3, 1000, 1), (1000.0, 32, 32000), (0.03125, 32, 1)],
)
def test_it_is_the_shortest_decimal_that_counts(duration: float, grid: int, ticks: int) -> None:
    assert whole_ticks(duration, grid) == ticks


@given(st.integers(0, 10**6), st.integers(1, 999), st.sampled_from([1, 2, 5, 10, 20, 50, 100]))
def test_a_part_of_a_tick_is_refused(tick: int, thousandths: int, grid: int) -> None:
    duration = float((tick + Fraction(thousandths, 1000)) / grid)
    with pytest.raises(ValueError, match=f"no whole number of ticks of 1/{grid} s"):
        whole_ticks(duration, grid)


def test_refusal_names_the_neighbours() -> None:
    with pytest.raises(ValueError, match=r"1\.01 s is no whole .* the nearest are 1 s and 1\.03125 s"):
        whole_ticks(1.01, 32)
    with pytest.raises(ValueError, match=r"0\.01 s is no whole .* one tick is 0\.03125 s"):
        whole_ticks(0.01, 32)
