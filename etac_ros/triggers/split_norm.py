"""Three norms against one threshold that shrinks with time (xie2021 eq. 15).

A signal's row is ``[chi (3), e_dot (3), eta (3)]``. With ``x~ = x(t_k) - x(t)`` of each block, the rule fires when ::

    |chi~| + |e_dot~| + |eta~| >= sqrt(2) / 2 |chi(t_k)| + c1 exp(-c2 tanh t)

The norms are added as numbers, whatever their units, as the paper does. The first part of the threshold is of the held
value, so it is constant between triggering instants; the second falls from c1 to ``c1 exp(-c2)`` within seconds.
"""

from __future__ import annotations

import math

import numpy as np
from pydantic import PositiveFloat

from etac_ros.maths.compiled import inlined, kernel
from etac_ros.maths.ticks import seconds
from etac_ros.parameters import FloatArray, Parameters
from etac_ros.triggers.bound import Bound, Evidence

_SIZE = 9
_RELATIVE = math.sqrt(2.0) / 2.0  # no parameter: the proof of theorem 1 takes this factor


@inlined
def _distance(row, held, start):  # type: ignore[no-untyped-def]
    x = held[start] - row[start]
    y = held[start + 1] - row[start + 1]
    z = held[start + 2] - row[start + 2]
    return math.sqrt(x * x + y * y + z * z)


@inlined
def _error_and_threshold(row, t, held, c1, c2):  # type: ignore[no-untyped-def]
    error = _distance(row, held, 0) + _distance(row, held, 3) + _distance(row, held, 6)
    norm = math.sqrt(held[0] * held[0] + held[1] * held[1] + held[2] * held[2])
    return error, _RELATIVE * norm + c1 * math.exp(-c2 * math.tanh(t))


@kernel
def _first(signals, tick, held, c1, c2, ticks_per_second):  # type: ignore[no-untyped-def]
    for i in range(signals.shape[0]):
        error, threshold = _error_and_threshold(signals[i], seconds(tick + i, ticks_per_second), held, c1, c2)
        if error >= threshold:
            return i
    return -1


@kernel
def _margin(signals, tick, held, c1, c2, ticks_per_second):  # type: ignore[no-untyped-def]
    errors = np.empty(signals.shape[0])
    thresholds = np.empty(signals.shape[0])
    for i in range(signals.shape[0]):
        errors[i], thresholds[i] = _error_and_threshold(signals[i], seconds(tick + i, ticks_per_second), held, c1, c2)
    return errors, thresholds


class SplitNormThresholdParameters(Parameters):
    """Parameters of :class:`SplitNormThreshold`."""

    c1: PositiveFloat
    """Threshold of a vanishing signal at t = 0; it keeps the intervals from vanishing (theorem 2)."""
    c2: PositiveFloat
    """How far it falls: to ``c1 exp(-c2)``."""


class SplitNormThreshold:
    """Fires when the three estimation errors together reach the threshold of eq. (15).

    Parameters
    ----------
    parameters
        ``c1`` and ``c2``.
    ticks_per_second
        Rate of the tick grid [1/s].
    """

    Parameters = SplitNormThresholdParameters

    def __init__(self, parameters: SplitNormThresholdParameters, ticks_per_second: int) -> None:
        self._c1 = parameters.c1
        self._c2 = parameters.c2
        self._ticks_per_second = ticks_per_second

    def first(self, signals: FloatArray, tick: int, held: FloatArray, held_tick: int | None = None) -> int:
        """Index of the first sample that fires, or -1.

        Parameters
        ----------
        signals
            Contiguous samples ``[chi (3), e_dot (3), eta (3)]``, shape (n, 9).
        tick
            Tick of ``signals[0]``; the threshold depends on it.
        held
            The value last transmitted, as it stood on the wire, shape (9,).
        held_tick
            Not used.

        Raises
        ------
        ValueError
            If sizes do not fit.
        """
        self._check(signals, held)
        return int(_first(signals, tick, held, self._c1, self._c2, self._ticks_per_second))

    def margin(self, signals: FloatArray, tick: int, held: FloatArray) -> tuple[FloatArray, FloatArray]:
        """Both sides of eq. (15) at each sample from ``tick`` on, both of shape (n,)."""
        self._check(signals, held)
        errors, thresholds = _margin(signals, tick, held, self._c1, self._c2, self._ticks_per_second)
        return errors, thresholds

    def _check(self, signals: FloatArray, held: FloatArray) -> None:
        # The kernels do not check bounds.
        if signals.shape[1] != _SIZE or held.size != _SIZE:
            raise ValueError(
                f"this trigger rule takes rows of {_SIZE} numbers, [chi (3), e_dot (3), eta (3)]: "
                f"the signals have {signals.shape[1]} columns, the held value has {held.size}"
            )

    def interval_bound(self, evidence: Evidence) -> Bound | None:
        """xie2021 eq. (35); None where the signal has no ``r``."""
        r = getattr(evidence.signal, "r", None)
        if r is None:
            return None
        norms = [float(np.linalg.norm(inertia, 2)) for inertia in evidence.inertias_kg_m2]
        return Bound(
            "xie2021 eq. (35)",
            shortest_interval_s(self._c1, self._c2, evidence.sensors, float(r), evidence.motion(), max(norms)),
            "the paper gives no value of delta_1 to delta_3; in their place stands the largest of one undisturbed run "
            "with the point's values. The proof takes neighbours as known at every instant: where they are known by "
            "broadcasts, each arrival moves the error at once, which the bound does not cover",
        )


def shortest_interval_s(
    c1: float, c2: float, spacecraft: int, r: float, motion: tuple[float, float, float], inertia_kg_m2: float
) -> float:
    """``c1 exp(-c2 pi / 2) / psi`` [s] (xie2021 eq. 35), with the psi of eq. (32).

    Parameters
    ----------
    c1, c2
        Of the threshold.
    spacecraft
        ``n``.
    r
        Of the law.
    motion
        ``delta_1 .. delta_3``: bounds of rates, accelerations and of the reference's jerk (assumptions 2 to 4).
    inertia_kg_m2
        Largest norm of an inertia matrix.
    """
    delta1, delta2, delta3 = motion
    psi = (
        2.0 * (spacecraft + 1) * r * delta1
        + 2.0 * (spacecraft + 2) * delta2
        + (2.0 * delta1 * delta2 + delta3) * inertia_kg_m2
    )
    return c1 * math.exp(-c2 * math.pi / 2.0) / psi
