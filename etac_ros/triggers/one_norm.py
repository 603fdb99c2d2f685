"""Threshold in the 1-norm: ``|omega(t_i) - omega|_1 >= epsilon |omega(t_i)|_1 + r`` (flexible section V.C).

The rule looks at the first three columns of a signal, ``omega``; whatever else is transmitted with it does not
matter. The threshold depends on what was transmitted, and so is constant between triggering instants.
"""

from __future__ import annotations

import numpy as np
from pydantic import PositiveFloat

from etac_ros.maths.compiled import inlined, kernel
from etac_ros.parameters import FloatArray, Parameters, vector

_COLUMNS = 3


@inlined
def _error_and_threshold(signals, i, held, epsilon, r):  # type: ignore[no-untyped-def]
    error = 0.0
    norm = 0.0
    for j in range(3):
        error += abs(held[j] - signals[i, j])
        norm += abs(held[j])
    return error, epsilon * norm + r


@inlined
def _holds(signals, i, held, p):  # type: ignore[no-untyped-def]
    error, threshold = _error_and_threshold(signals, i, held, p[0], p[1])
    return error >= threshold


@kernel
def _first(signals, held, p):  # type: ignore[no-untyped-def]
    # What _holds does, which as a call within a call is compiled to four times the time.
    for i in range(signals.shape[0]):
        error, threshold = _error_and_threshold(signals, i, held, p[0], p[1])
        if error >= threshold:
            return i
    return -1


@kernel
def _margin(signals, held, epsilon, r):  # type: ignore[no-untyped-def]
    errors = np.empty(signals.shape[0])
    thresholds = np.empty(signals.shape[0])
    for i in range(signals.shape[0]):
        errors[i], thresholds[i] = _error_and_threshold(signals, i, held, epsilon, r)
    return errors, thresholds


class OneNormThresholdParameters(Parameters):
    """Parameters of :class:`OneNormThreshold`."""

    epsilon: PositiveFloat
    """Share of the transmitted rate."""
    r_rad_s: PositiveFloat
    """Smallest threshold; it keeps the intervals from vanishing."""


class OneNormThreshold:
    """Fires when ``omega`` is off the transmitted one by ``epsilon |omega(t_i)|_1 + r`` in the 1-norm.

    Parameters
    ----------
    parameters
        ``epsilon`` and ``r``.
    """

    Parameters = OneNormThresholdParameters
    holds = staticmethod(_holds)

    def __init__(self, parameters: OneNormThresholdParameters, ticks_per_second: int) -> None:
        self.holds_parameters = vector([parameters.epsilon, parameters.r_rad_s])
        self._epsilon = parameters.epsilon
        self._r = parameters.r_rad_s

    def first(self, signals: FloatArray, tick: int, held: FloatArray, held_tick: int | None = None) -> int:
        """Index of the first sample that fires, or -1.

        Parameters
        ----------
        signals
            Contiguous samples ``[omega (3), ...]`` [rad/s], shape (n, m) with m of at least 3.
        tick, held_tick
            Not used.
        held
            The value last transmitted, as it stood on the wire, shape (m,).

        Raises
        ------
        ValueError
            If there are fewer than three columns.
        """
        self._check(signals, held)
        return int(_first(signals, held, self.holds_parameters))

    def margin(self, signals: FloatArray, tick: int, held: FloatArray) -> tuple[FloatArray, FloatArray]:
        """``|omega(t_i) - omega|_1`` and ``epsilon |omega(t_i)|_1 + r`` of each sample, both of shape (n,)."""
        self._check(signals, held)
        errors, thresholds = _margin(signals, held, self._epsilon, self._r)
        return errors, thresholds

    def _check(self, signals: FloatArray, held: FloatArray) -> None:
        # The kernels do not check bounds.
        if signals.shape[1] < _COLUMNS or held.size < _COLUMNS:
            raise ValueError(
                f"this rule looks at omega in the first {_COLUMNS} columns; "
                f"the signals have {signals.shape[1]}, the transmitted value {held.size}"
            )
