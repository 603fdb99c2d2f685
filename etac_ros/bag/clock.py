"""Simulated time in a bag: ticks as nanoseconds, and steps as nanoseconds between log and publish time.

A bag knows two times of a message. ``log_time`` is the simulated time of the tick at which it was sent;
``publish_time`` is the same plus one nanosecond a step. So the steps of a tick stand in a bag without a byte
on the wire, and sorting by publish time gives the order of execution. Both are integers: nothing is lost.
"""

from __future__ import annotations

from etac_ros.maths.ticks import NANOSECONDS, tick_of
from etac_ros.maths.ticks import nanoseconds as log_time_ns

__all__ = ["MOST_STEPS", "NANOSECONDS", "log_time_ns", "publish_time_ns", "step_of", "tick_of"]

MOST_STEPS = 1000
"""Steps are smaller than this, so a message never reaches the next tick of any grid up to 1 MHz."""


def publish_time_ns(log_time_ns: int, step: int) -> int:
    """Add a nanosecond a step to the log time [ns].

    Raises
    ------
    ValueError
        If the step is too large to be told from the next tick.
    """
    if not 0 <= step < MOST_STEPS:
        raise ValueError(f"step {step} is not within 0 .. {MOST_STEPS - 1}")
    return log_time_ns + step


def step_of(log_time_ns: int, publish_time_ns: int) -> int:
    """Find the step within the tick: the inverse of :func:`publish_time_ns`.

    Raises
    ------
    ValueError
        If the two times are not those of one step.
    """
    step = publish_time_ns - log_time_ns
    if not 0 <= step < MOST_STEPS:
        raise ValueError(f"publish time {publish_time_ns} ns lies {step} ns after log time, which is no step")
    return step
