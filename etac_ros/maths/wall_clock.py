"""Ticks in real time: which instant of a clock a tick has, and which tick an instant lies in. Integers throughout."""

from __future__ import annotations

from dataclasses import dataclass
from fractions import Fraction

from etac_ros.maths.ticks import NANOSECONDS


@dataclass(frozen=True, slots=True)
class WallClock:
    """Tick k is at ``start_ns`` + k / (ticks_per_second rate), rounded up to a nanosecond.

    Parameters
    ----------
    start_ns
        The instant of tick 0 on some clock that counts nanoseconds.
    ticks_per_second
        Rate of the tick grid [1/s of simulated time].
    rate
        Simulated seconds a second of that clock.
    """

    start_ns: int
    ticks_per_second: int
    rate: Fraction

    def instant_ns(self, tick: int) -> int:
        """The instant of a tick [ns]."""
        ticks = self.ticks_per_second * self.rate
        return self.start_ns - (-tick * NANOSECONDS * ticks.denominator // ticks.numerator)

    def tick_at(self, time_ns: int) -> int:
        """The newest tick whose instant is not after a time: k at ``instant_ns(k)``; negative before tick 0."""
        ticks = self.ticks_per_second * self.rate
        return (time_ns - self.start_ns) * ticks.numerator // (NANOSECONDS * ticks.denominator)

    @property
    def tick_ns(self) -> int:
        """How long a tick lasts [ns], rounded up."""
        return self.instant_ns(1) - self.start_ns

    def ticks_in(self, duration_s: float) -> int:
        """Whole ticks in a time of that clock [s]."""
        return int(duration_s * self.ticks_per_second * self.rate)

    def on(self, offset_ns: int) -> WallClock:
        """The same ticks on a clock that shows so much more [ns]."""
        return WallClock(self.start_ns + offset_ns, self.ticks_per_second, self.rate)


def rate_of(value: float) -> Fraction:
    """A rate as the exact fraction of its shortest decimal form, so that 0.1 is a tenth."""
    return Fraction(repr(float(value)))
