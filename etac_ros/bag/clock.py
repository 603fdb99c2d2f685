"""Simulated time in a bag: ticks as nanoseconds, and steps as nanoseconds between publish and log time.

A bag knows two times of a message. ``publish_time`` is the simulated time of the tick at which it was sent;
``log_time`` is the same plus one nanosecond a step. So the steps of a tick stand in a bag without a byte on the
wire, readers, which sort by log time, see the messages in the order of execution, and nothing is published after it
was logged. Both are integers: nothing is lost.

Bags of before had the two the other way round. Their difference and the smaller of them say the same in both.
"""

from __future__ import annotations

from etac_ros.maths.ticks import NANOSECONDS, tick_of
from etac_ros.maths.ticks import nanoseconds as tick_time_ns

__all__ = [
    "AFTER_ALL_STEPS",
    "MOST_STEPS",
    "NANOSECONDS",
    "log_time_ns",
    "published_ns",
    "step_of",
    "tick_of",
    "tick_time_ns",
]

MOST_STEPS = 1000
"""Steps are smaller than this, so a message never reaches the next tick of any grid up to 1 MHz."""
AFTER_ALL_STEPS = MOST_STEPS - 1
"""Where truth stands within its last tick: it is committed when all has been delivered."""


def log_time_ns(tick_ns: int, step: int) -> int:
    """Add a nanosecond a step to the time of the tick [ns].

    Raises
    ------
    ValueError
        If the step is too large to be told from the next tick.
    """
    if not 0 <= step < MOST_STEPS:
        raise ValueError(f"step {step} is not within 0 .. {MOST_STEPS - 1}")
    return tick_ns + step


def published_ns(log_time_ns: int, publish_time_ns: int) -> int:
    """The time of the tick [ns]: the inverse of :func:`log_time_ns`, for bags of before as well."""
    return min(log_time_ns, publish_time_ns)


def step_of(log_time_ns: int, publish_time_ns: int) -> int:
    """Find the step within the tick: the inverse of :func:`log_time_ns`, for bags of before as well.

    Raises
    ------
    ValueError
        If the two times are not those of one step.
    """
    step = abs(log_time_ns - publish_time_ns)
    if step >= MOST_STEPS:
        raise ValueError(f"log time {log_time_ns} ns lies {step} ns from publish time {publish_time_ns} ns, no step")
    return step
