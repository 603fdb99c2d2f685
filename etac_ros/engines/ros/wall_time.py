"""The clocks of a process: its monotonic one, and how far that is from the wall clock, looked up once."""

from __future__ import annotations

import ctypes
import time

from etac_ros.maths.ticks import NANOSECONDS
from etac_ros.maths.wall_clock import WallClock

_TRIES = 16
_PR_SET_TIMERSLACK = 29


class Tie:
    """How far the wall clock of this machine is ahead of its monotonic one, as it was when this was made.

    The monotonic clock drives the run: nobody sets it. The wall clock is what other processes and machines, and the
    timestamps of messages, have in common with it; both follow the same corrections by NTP, but for steps.

    Attributes
    ----------
    ahead_ns
        Wall clock less monotonic clock [ns], to within the time that it takes to look at one.
    """

    def __init__(self) -> None:
        self.ahead_ns = _ahead_ns()

    def monotonic(self, wall: WallClock) -> WallClock:
        """Ticks of the wall clock on the monotonic clock."""
        return wall.on(-self.ahead_ns)

    def stepped_s(self) -> float:
        """How far somebody has set the wall clock since then [s]."""
        return (_ahead_ns() - self.ahead_ns) / NANOSECONDS


def _ahead_ns() -> int:
    """The difference between two looks at one clock is the error; the best of some tries counts."""
    found = []
    for _ in range(_TRIES):
        before = time.monotonic_ns()
        wall = time.time_ns()
        after = time.monotonic_ns()
        found.append((after - before, wall - (before + after) // 2))
    return min(found)[1]


def be_punctual() -> None:
    """Ask the kernel to wake this thread when it is due, not within the 50 us that it may add by default."""
    ctypes.CDLL(None).prctl(_PR_SET_TIMERSLACK, 1, 0, 0, 0)
