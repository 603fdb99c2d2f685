"""The clocks of a process: its monotonic one, and how far that is from the wall clock, looked up once."""

from __future__ import annotations

import contextlib
import ctypes
import os
import time

from etac_ros.errors import ScenarioError
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


def be_punctual(priority: int = 0) -> None:
    """Ask the kernel to wake this process when it is due.

    Not within the 50 us that it may add by default; and with a priority, before all that have none. Only now, when the
    run begins: a process that computes for long with one is held up by the kernel (``sched_rt_runtime_us``).
    """
    ctypes.CDLL(None).prctl(_PR_SET_TIMERSLACK, 1, 0, 0, 0)
    if priority:
        for thread in os.listdir("/proc/self/task"):  # those of DDS carry the messages
            with contextlib.suppress(ProcessLookupError):  # one that has just ended
                os.sched_setscheduler(int(thread), os.SCHED_FIFO, os.sched_param(priority))


def check_priority(priority: int) -> None:
    """Make sure that this user may have a real-time priority.

    Raises
    ------
    ScenarioError
        If not, or if it is none.
    """
    if not priority:
        return
    where, expected = f"--priority {priority}", "0 for an ordinary one, or 1 to 99"
    if not 1 <= priority <= os.sched_get_priority_max(os.SCHED_FIFO):
        raise ScenarioError(where, "is no real-time priority", expected)
    policy, parameters = os.sched_getscheduler(0), os.sched_getparam(0)
    try:
        os.sched_setscheduler(0, os.SCHED_FIFO, os.sched_param(priority))
    except PermissionError:
        remedy = "let the user have it (rtprio in limits.conf, ulimit -r), or run without"
        raise ScenarioError(where, "is not allowed to this user", expected, remedy) from None
    os.sched_setscheduler(0, policy, parameters)
