"""Time-triggered baseline: fires at every multiple of a period, whatever the signal does."""

from __future__ import annotations

from pydantic import PositiveFloat

from etac_ros.maths.ticks import whole_ticks
from etac_ros.parameters import FloatArray, Parameters


class PeriodicParameters(Parameters):
    """Parameters of :class:`Periodic`."""

    period_s: PositiveFloat


class Periodic:
    """Fires at ticks that are multiples of the period.

    Parameters
    ----------
    parameters
        ``period_s`` [s], a whole number of ticks.
    ticks_per_second
        Rate of the tick grid [1/s].

    Raises
    ------
    ValueError
        If the period is no whole number of ticks.
    """

    Parameters = PeriodicParameters

    def __init__(self, parameters: PeriodicParameters, ticks_per_second: int) -> None:
        self.period = whole_ticks(parameters.period_s, ticks_per_second)
        """Ticks between two instants."""

    def first(self, signals: FloatArray, tick: int, held: FloatArray, held_tick: int | None = None) -> int:
        """Index of the first multiple of the period, or -1."""
        ahead = -tick % self.period
        return ahead if ahead < signals.shape[0] else -1

    def margin(self, signals: FloatArray, tick: int, held: FloatArray) -> tuple[FloatArray, FloatArray] | None:
        """None: time alone decides."""
        return None
