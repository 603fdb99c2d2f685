"""Threshold relative to the state: ``|tau(t_k) - tau| >= epsilon |omega + delta q|`` (qi2022 eq. 11).

A signal's row is ``[tau (m), omega (3), q (3)]``: the value that is held, and the state that the threshold is
relative to.

The rule as printed has no smallest threshold, and none is added: where state and error vanish together it
fires (``0 >= 0``). It can also fall silent for good. At rest off the reference, with nothing held, the error
is ``K |q|`` and the threshold ``epsilon delta |q|``; Table 2 has ``epsilon delta = 63.8 N m`` beyond every
gain ``K_ps``, so that no offset ever fires. The key ``longest_silence_s``, which every rule has, is the way out: a
heartbeat.
"""

from __future__ import annotations

import numpy as np
from pydantic import PositiveFloat

from etac_ros.maths.compiled import inlined, kernel
from etac_ros.parameters import FloatArray, Parameters
from etac_ros.triggers.bound import Bound, Evidence

_STATE_COLUMNS = 6


@inlined
def _error_and_threshold(row, held, delta, epsilon):  # type: ignore[no-untyped-def]
    size = row.size - 6
    error = 0.0
    for j in range(size):
        difference = held[j] - row[j]
        error += difference * difference
    norm = 0.0
    for j in range(3):
        x = row[size + j] + delta * row[size + 3 + j]
        norm += x * x
    return np.sqrt(error), epsilon * np.sqrt(norm)


@kernel
def _first(signals, held, delta, epsilon):  # type: ignore[no-untyped-def]
    for i in range(signals.shape[0]):
        error, threshold = _error_and_threshold(signals[i], held, delta, epsilon)
        if error >= threshold:
            return i
    return -1


@kernel
def _margin(signals, held, delta, epsilon):  # type: ignore[no-untyped-def]
    errors = np.empty(signals.shape[0])
    thresholds = np.empty(signals.shape[0])
    for i in range(signals.shape[0]):
        errors[i], thresholds[i] = _error_and_threshold(signals[i], held, delta, epsilon)
    return errors, thresholds


class StateRelativeThresholdParameters(Parameters):
    """Parameters of :class:`StateRelativeThreshold`."""

    delta: PositiveFloat
    """Weight of the attitude beside the rate [1/s]."""
    epsilon: PositiveFloat
    """Threshold per unit of ``omega + delta q`` [N m s]."""


class StateRelativeThreshold:
    """Fires when the held torque is off the law's by ``epsilon |omega + delta q|``.

    Parameters
    ----------
    parameters
        ``delta`` and ``epsilon``.
    """

    Parameters = StateRelativeThresholdParameters

    def __init__(self, parameters: StateRelativeThresholdParameters, ticks_per_second: int) -> None:
        self._delta = parameters.delta
        self._epsilon = parameters.epsilon

    def first(self, signals: FloatArray, tick: int, held: FloatArray, held_tick: int | None = None) -> int:
        """Index of the first sample that fires, or -1.

        Parameters
        ----------
        signals
            Contiguous samples ``[tau (m), omega (3), q (3)]``, shape (n, m + 6).
        tick
            Tick of ``signals[0]``.
        held
            The torque last transmitted, as it stood on the wire, shape (m,).
        held_tick
            Not used.

        Raises
        ------
        ValueError
            If sizes do not fit.
        """
        self._check(signals, held)
        return int(_first(signals, held, self._delta, self._epsilon))

    def margin(self, signals: FloatArray, tick: int, held: FloatArray) -> tuple[FloatArray, FloatArray]:
        """``|tau(t_k) - tau|`` and ``epsilon |omega + delta q|`` of each sample, both of shape (n,)."""
        self._check(signals, held)
        errors, thresholds = _margin(signals, held, self._delta, self._epsilon)
        return errors, thresholds

    def _check(self, signals: FloatArray, held: FloatArray) -> None:
        # The kernels do not check bounds.
        if signals.shape[1] != held.size + _STATE_COLUMNS:
            raise ValueError(
                f"signals of {signals.shape[1]} columns do not fit a held value of {held.size}: "
                f"{held.size + _STATE_COLUMNS} are needed, [tau, omega (3), q (3)]"
            )

    def interval_bound(self, evidence: Evidence) -> Bound:
        """qi2022 eq. (18), which cannot be evaluated."""
        return Bound(
            "qi2022 eq. (18)",
            None,
            "|delta tau| / gamma: the paper gives no gamma, the bound of the torque's rate, and the threshold that "
            "delta tau reaches vanishes with the state, so that no value holds throughout",
        )
