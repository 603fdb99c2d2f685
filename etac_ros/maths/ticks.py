"""Ticks and seconds: the one place where they meet."""

from __future__ import annotations

from fractions import Fraction

from etac_ros.maths.compiled import inlined

NANOSECONDS = 10**9


@inlined
def seconds(tick, ticks_per_second):  # type: ignore[no-untyped-def]  # compiled for scalars and arrays alike
    """Simulated time of a tick [s]; correctly rounded, so the same bits everywhere.

    Parameters
    ----------
    tick
        Integer tick, or an integer array of ticks.
    ticks_per_second
        Integer rate of the trigger grid [1/s].
    """
    return tick / ticks_per_second


def whole_ticks(duration_s: float, ticks_per_second: int) -> int:
    """The number of ticks in a duration, which must be a whole one.

    Parameters
    ----------
    duration_s
        A duration [s]. Its shortest decimal form is what counts, so 0.05 s on a 20 Hz grid is one tick.
    ticks_per_second
        Rate of the grid [1/s].

    Raises
    ------
    ValueError
        If the duration is no whole number of ticks: nothing is rounded.
    """
    ticks = ticks_in(duration_s, ticks_per_second)
    if ticks.denominator != 1:
        below = int(ticks) / ticks_per_second
        above = (int(ticks) + 1) / ticks_per_second
        nearest = f"the nearest are {below:.9g} s and {above:.9g} s" if below else f"one tick is {above:.9g} s"
        raise ValueError(f"{duration_s} s is no whole number of ticks of 1/{ticks_per_second} s; {nearest}")
    return int(ticks)


def ticks_in(duration_s: float, ticks_per_second: int) -> Fraction:
    """Exact number of ticks in a duration [s], whole or not; its shortest decimal form is what counts."""
    return Fraction(repr(float(duration_s))) * ticks_per_second


def nanoseconds(tick: int, ticks_per_second: int) -> int:
    """The simulated time of a tick, rounded down to a nanosecond [ns].

    Parameters
    ----------
    tick
        Tick of the trigger grid.
    ticks_per_second
        Rate of the grid [1/s].
    """
    return tick * NANOSECONDS // ticks_per_second


def tick_of(time_ns: int, ticks_per_second: int) -> int:
    """Find the tick that has this time: the inverse of :func:`nanoseconds`.

    Raises
    ------
    ValueError
        If no tick of this grid has that time.
    """
    # The time was rounded down by less than a nanosecond, which is less than a tick: rounding up undoes it.
    tick = -(-time_ns * ticks_per_second // NANOSECONDS)
    if tick * NANOSECONDS // ticks_per_second != time_ns:
        raise ValueError(f"no tick of a grid of {ticks_per_second} a second lies at {time_ns} ns")
    return tick
