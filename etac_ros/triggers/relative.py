"""Relative threshold: fires when ``|s(t_i) - s| >= alpha |s| + gamma`` (wu2018 eq. 8)."""

from __future__ import annotations

import math
from typing import Annotated

import numpy as np
from pydantic import Field

from etac_ros.maths.compiled import inlined, kernel
from etac_ros.parameters import FloatArray, Parameters, vector
from etac_ros.triggers.bound import Bound, Evidence


@inlined
def _error_and_threshold(signals, i, held, alpha, gamma):  # type: ignore[no-untyped-def]
    error = 0.0
    norm = 0.0
    for j in range(signals.shape[1]):
        difference = held[j] - signals[i, j]
        error += difference * difference
        norm += signals[i, j] * signals[i, j]
    return np.sqrt(error), alpha * np.sqrt(norm) + gamma


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
def _margin(signals, held, alpha, gamma):  # type: ignore[no-untyped-def]
    errors = np.empty(signals.shape[0])
    thresholds = np.empty(signals.shape[0])
    for i in range(signals.shape[0]):
        errors[i], thresholds[i] = _error_and_threshold(signals, i, held, alpha, gamma)
    return errors, thresholds


class RelativeThresholdParameters(Parameters):
    """Parameters of :class:`RelativeThreshold`."""

    alpha: Annotated[float, Field(gt=0.0, lt=1.0)]
    gamma: Annotated[float, Field(gt=0.0)]


class RelativeThreshold:
    """Fires when the distance to the transmitted value reaches ``alpha`` times the signal, plus ``gamma``.

    Parameters
    ----------
    parameters
        ``alpha`` in (0, 1) and ``gamma > 0`` in the signal's unit; ``gamma`` keeps the intervals from vanishing.
    """

    Parameters = RelativeThresholdParameters
    holds = staticmethod(_holds)

    def __init__(self, parameters: RelativeThresholdParameters, ticks_per_second: int) -> None:
        self.holds_parameters = vector([parameters.alpha, parameters.gamma])
        self._alpha = parameters.alpha
        self._gamma = parameters.gamma

    def first(self, signals: FloatArray, tick: int, held: FloatArray, held_tick: int | None = None) -> int:
        """Index of the first sample that fires, or -1."""
        return int(_first(signals, held, self.holds_parameters))

    def margin(self, signals: FloatArray, tick: int, held: FloatArray) -> tuple[FloatArray, FloatArray] | None:
        """``|s(t_i) - s|`` and ``alpha |s| + gamma`` of each sample."""
        errors, thresholds = _margin(signals, held, self._alpha, self._gamma)
        return errors, thresholds

    def interval_bound(self, evidence: Evidence) -> Bound | None:
        """The bound of the paper that uses this rule with the signal at hand."""
        source = getattr(evidence.signal, "interval_bound", None)
        if source is None or len(evidence.gains) != 1 or len(evidence.inertias_kg_m2) != 1:
            return None
        equation, constants = source
        (gain,), (inertia,) = evidence.gains, evidence.inertias_kg_m2
        largest = float(np.linalg.norm(evidence.signals(), axis=1).max())
        return Bound(
            equation,
            shortest_interval_s(self._gamma, gain, inertia, evidence.drift_nm(inertia), largest),
            f"the paper gives no value of {constants}; what is bounded by it, and the signal, are the largest of one "
            "undisturbed run with the point's values instead",
        )


def shortest_interval_s(
    gamma: float, gain_nms: float, inertia_kg_m2: FloatArray, drift_nm: float, signal: float
) -> float:
    """``ln(1 + k gamma / (D + k S)) / (k |J^-1|)`` [s] (wu2018 eq. 36, flexible eq. 73).

    Parameters
    ----------
    gamma
        Absolute part of the threshold [rad/s]; the paper of ``flexible`` calls it rho.
    gain_nms
        ``k``.
    inertia_kg_m2
        ``J``, shape (3, 3); the norm of its inverse is the spectral one.
    drift_nm
        ``D``: bound of ``|L|``, what acts on the signal beside the control torque [N m].
    signal
        ``S``: bound of the signal [rad/s].
    """
    norm = 1.0 / float(np.linalg.eigvalsh(inertia_kg_m2)[0])
    return math.log1p(gain_nms * gamma / (drift_nm + gain_nms * signal)) / (gain_nms * norm)
