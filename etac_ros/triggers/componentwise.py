"""Threshold on each component, falling with time: ``|tau_i - u_i| >= beta |u_i| + exp(-delta t)`` (shi2022 eq. 21).

The exponential begins at 1 N m as printed, or at another value. The condition before eq. (35) asks ``D_m`` to exceed
what the exponential leaves, so that with the printed ``D_m`` 1 N m is excluded by the paper's own proof.

The paper writes "for all i" beside the inequality. Read as "fires when all axes have reached their thresholds", an
axis whose torque hardly changes keeps the others from being updated, and the law leaves its performance bound within
seconds. Read as "each axis has to stay below its own", it fires when any axis reaches it, which is the default. Then
all axes are renewed, or each by itself, where the others keep what they hold.
"""

from __future__ import annotations

import math
from typing import Literal

import numpy as np
from pydantic import Field, PositiveFloat

from etac_ros.maths.compiled import inlined, kernel
from etac_ros.maths.ticks import seconds
from etac_ros.parameters import FloatArray, Parameters
from etac_ros.triggers.bound import Bound, Evidence


@inlined
def _decisive(tau, u, beta, floor, every):  # type: ignore[no-untyped-def]
    """Error and threshold of the axis that decides: the furthest where one is enough, the least far where all count."""
    error = 0.0
    threshold = 0.0
    chosen = 0.0
    for i in range(tau.size):
        e = abs(tau[i] - u[i])
        limit = beta * abs(u[i]) + floor
        # Long after the start the exponential underflows; 0 >= 0 fires.
        ratio = e / limit if limit > 0.0 else np.inf
        if i == 0 or (ratio < chosen if every else ratio > chosen):
            error = e
            threshold = limit
            chosen = ratio
    return error, threshold


@kernel
def _first(signals, tick, held, beta, absolute, delta, every, ticks_per_second):  # type: ignore[no-untyped-def]
    for k in range(signals.shape[0]):
        floor = absolute * math.exp(-delta * seconds(tick + k, ticks_per_second))
        error, threshold = _decisive(signals[k], held, beta, floor, every)
        if error >= threshold:
            return k
    return -1


@kernel
def _margin(signals, tick, held, beta, absolute, delta, every, ticks_per_second):  # type: ignore[no-untyped-def]
    errors = np.empty(signals.shape[0])
    thresholds = np.empty(signals.shape[0])
    for k in range(signals.shape[0]):
        floor = absolute * math.exp(-delta * seconds(tick + k, ticks_per_second))
        errors[k], thresholds[k] = _decisive(signals[k], held, beta, floor, every)
    return errors, thresholds


@kernel
def _renewed(value, tick, held, beta, absolute, delta, ticks_per_second):  # type: ignore[no-untyped-def]
    floor = absolute * math.exp(-delta * seconds(tick, ticks_per_second))
    out = held.copy()
    for i in range(value.size):
        if abs(value[i] - held[i]) >= beta * abs(held[i]) + floor:
            out[i] = value[i]
    return out


class ComponentThresholdParameters(Parameters):
    """Parameters of :class:`ComponentThreshold`."""

    beta: float = Field(gt=0.0, lt=1.0)
    """Part of the threshold that is relative to the held torque."""
    delta: PositiveFloat
    """Decay [1/s] of the absolute part; the same on all axes."""
    absolute_nm: PositiveFloat = 1.0
    """What the absolute part begins at [N m]; printed: 1."""
    axes: Literal["any", "all", "each"] = Field(
        default="any",
        description="any: one axis is enough to renew all; all: all of them at once; each: an axis renews itself alone",
    )


class ComponentThreshold:
    """Fires when the held torque is off the law's on an axis by a little of itself plus a decaying amount.

    Parameters
    ----------
    parameters
        ``beta``, ``delta``, and whether one axis is enough.
    ticks_per_second
        Rate of the tick grid [1/s].
    """

    Parameters = ComponentThresholdParameters

    def __init__(self, parameters: ComponentThresholdParameters, ticks_per_second: int) -> None:
        self._rule = (parameters.beta, parameters.absolute_nm, parameters.delta)
        self._every = parameters.axes == "all"
        self._alone = parameters.axes == "each"
        self._ticks_per_second = ticks_per_second

    def first(self, signals: FloatArray, tick: int, held: FloatArray, held_tick: int | None = None) -> int:
        """Index of the first sample that fires, or -1.

        Parameters
        ----------
        signals
            Contiguous torques ``tau`` [N m], shape (n, m).
        tick
            Tick of ``signals[0]``; the threshold belongs to the tick.
        held
            The torque ``u`` [N m] last transmitted, as it stood on the wire, shape (m,).
        held_tick
            Not used.

        Raises
        ------
        ValueError
            If sizes do not fit.
        """
        self._check(signals, held)
        return int(_first(signals, tick, held, *self._rule, self._every, self._ticks_per_second))

    def margin(self, signals: FloatArray, tick: int, held: FloatArray) -> tuple[FloatArray, FloatArray]:
        """``|tau_i - u_i|`` and its threshold [N m] at each sample, both of shape (n,), on the axis that decides.

        Where one axis is enough, that is the one with the largest error for its threshold; where all count, the
        one with the smallest.
        """
        self._check(signals, held)
        errors, thresholds = _margin(signals, tick, held, *self._rule, self._every, self._ticks_per_second)
        return errors, thresholds

    def renewed(self, value: FloatArray, tick: int, held: FloatArray) -> FloatArray:
        """What is transmitted at a triggering instant: all of the torque, or only the axes that fire."""
        if not self._alone:
            return value
        result: FloatArray = _renewed(value, tick, held, *self._rule, self._ticks_per_second)
        return result

    def _check(self, signals: FloatArray, held: FloatArray) -> None:
        # The kernels do not check bounds.
        if held.size == 0 or signals.shape[1] != held.size:
            raise ValueError(f"signals of {signals.shape[1]} columns do not fit a held torque of {held.size}")

    def interval_bound(self, evidence: Evidence) -> Bound:
        """shi2022 eq. (45), which cannot be evaluated."""
        return Bound(
            "shi2022 eq. (45)",
            None,
            "(3 beta |u| + 3 |Lambda|) / tau_m: the paper gives no tau_m, the bound of the torque's rate, and Lambda "
            "falls with exp(-delta t)",
        )
