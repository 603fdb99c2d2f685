"""Ticks in real time: integers, exact for any rate, on any clock."""

from __future__ import annotations

from fractions import Fraction

from hypothesis import given
from hypothesis import strategies as st

from etac_ros.maths.ticks import NANOSECONDS
from etac_ros.maths.wall_clock import WallClock, rate_of

CLOCKS = st.builds(
    WallClock,
    st.integers(0, 2 * 10**18),
    st.integers(1, 2000),
    st.fractions(Fraction(1, 1000), Fraction(1000), max_denominator=1000),
)


@given(CLOCKS, st.integers(-(10**6), 10**9))
def test_the_instant_of_a_tick_lies_in_it(clock: WallClock, tick: int) -> None:
    assert clock.tick_at(clock.instant_ns(tick)) == tick
    assert clock.tick_at(clock.instant_ns(tick) - 1) == tick - 1


@given(CLOCKS, st.integers(0, 10**9))
def test_an_instant_is_exact_to_a_nanosecond_and_never_early(clock: WallClock, tick: int) -> None:
    exact = clock.start_ns + Fraction(tick * NANOSECONDS) / (clock.ticks_per_second * clock.rate)
    assert 0 <= clock.instant_ns(tick) - exact < 1


@given(CLOCKS, st.integers(-(10**18), 10**18), st.integers(0, 10**7))
def test_another_clock_has_the_same_ticks(clock: WallClock, ahead: int, tick: int) -> None:
    assert clock.on(ahead).instant_ns(tick) == clock.instant_ns(tick) + ahead


def test_a_rate_is_its_decimal_digits() -> None:
    assert rate_of(0.1) == Fraction(1, 10)
    assert rate_of(20) == 20
    assert WallClock(0, 32, rate_of(20)).tick_ns == 1_562_500
    assert WallClock(0, 20, rate_of(0.1)).ticks_in(3.0) == 6
