"""The time-triggered baseline: it fires at multiples of its period, and never looks at the signal."""

from __future__ import annotations

from itertools import pairwise

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from etac_ros.triggers.periodic import Periodic, PeriodicParameters

GRID = 32
HELD = np.zeros(3)


def rule(period_s: float, grid: int = GRID) -> Periodic:
    return Periodic(PeriodicParameters(period_s=period_s), grid)


@given(st.integers(1, 100), st.integers(0, 10**6), st.integers(0, 300))
def test_names_the_first_multiple_of_the_period(period: int, tick: int, count: int) -> None:
    multiples = [i for i in range(count) if (tick + i) % period == 0]
    index = rule(period / GRID).first(np.zeros((count, 3)), tick, HELD)
    assert index == (multiples[0] if multiples else -1)


@given(st.integers(1, 50), st.lists(st.integers(0, 200), max_size=8))
def test_windows_of_any_cut_give_the_same_instants(period: int, cuts: list[int]) -> None:
    trigger = rule(period / GRID)
    fired = []
    edges = sorted({0, 200, *cuts})
    for start, end in pairwise(edges):
        tick = start
        while (index := trigger.first(np.zeros((end - tick, 3)), tick, HELD)) >= 0:
            fired.append(tick + index)
            tick += index + 1
    assert fired == list(range(0, 200, period))


def test_signal_does_not_matter() -> None:
    wild = np.random.default_rng(1).normal(size=(100, 3))
    assert rule(1.0).first(wild, 1, HELD) == rule(1.0).first(np.zeros((100, 3)), 1, HELD) == 31


def test_has_no_margin() -> None:
    assert rule(1.0).margin(np.zeros((10, 3)), 0, HELD) is None


def test_period_is_a_whole_number_of_ticks() -> None:
    assert rule(0.3, 10).first(np.zeros((9, 3)), 1, HELD) == 2
    with pytest.raises(ValueError, match=r"1\.01 s is no whole number of ticks"):
        rule(1.01)


@pytest.mark.parametrize("period", [0.0, -1.0, float("nan"), float("inf")])
def test_period_is_positive(period: float) -> None:
    with pytest.raises(ValueError, match="period_s"):
        rule(period)
