"""Sliding-mode baseline of the cableless PM/SM formation (qi2022 eq. 19), updated at every step."""

from __future__ import annotations

import math
from typing import Annotated

import numpy as np
from pydantic import Field, PositiveFloat

from etac_ros.laws.law import TickArray
from etac_ros.laws.qi2022 import INERTIA_SM, MEASUREMENT_SIZE, SM_MODEL_SIZE, feed_forward
from etac_ros.laws.qi2022_panels import PANELS_SIZE, PanelsModelParameters, panels_torque
from etac_ros.maths.compiled import kernel
from etac_ros.maths.ticks import seconds
from etac_ros.maths.vector import multiply
from etac_ros.parameters import FloatArray

# Parameter vector of the kernel: what the law knows of the SM, of its panels, and then
_PANELS = SM_MODEL_SIZE  # 24
_SLOPE = _PANELS + PANELS_SIZE  # c [1/s]
_ALPHA = _SLOPE + 1
_BETA = _SLOPE + 2  # [N m s]
_EXPONENT = _SLOPE + 3  # gamma


@kernel
def _sliding(measurements, modes, ticks, p, ticks_per_second):  # type: ignore[no-untyped-def]
    out = np.empty((measurements.shape[0], 3))
    feedback = np.empty(3)
    forward = np.empty(3)
    omega_pi_S_dot = np.empty(3)
    a = np.empty(3)
    for k in range(measurements.shape[0]):
        m = measurements[k]
        feed_forward(m, seconds(ticks[k], ticks_per_second), p, omega_pi_S_dot, forward)
        multiply(p[INERTIA_SM : INERTIA_SM + 9], m[3:6], a)
        for i in range(3):
            s = m[3 + i] + p[_SLOPE] * m[i]
            power = math.copysign(abs(s) ** p[_EXPONENT], s)
            feedback[i] = -p[_ALPHA] * power - p[_BETA] * s - p[_SLOPE] * a[i]
        panels_torque(feedback, omega_pi_S_dot, modes[k], p[_PANELS : _PANELS + PANELS_SIZE], a)
        for i in range(3):
            out[k, i] = feedback[i] + forward[i] + a[i]
    return out


class SmSlidingModeParameters(PanelsModelParameters):
    """Parameters of :class:`SmSlidingMode` beside what the law knows of the SM and its panels."""

    slope_1_s: PositiveFloat
    """``c``."""
    alpha: PositiveFloat
    """``alpha`` [N m (s/rad)^gamma]."""
    beta_nms: PositiveFloat
    """``beta``."""
    exponent: Annotated[float, Field(gt=0.0, lt=1.0)]
    """``gamma``."""


class SmSlidingMode:
    """Sliding mode, ``tau_s = -alpha |s|^gamma sgn s - beta s - c J_s omega_sp + Delta_s`` (qi2022 eq. 19).

    ``s = omega_sp + c q_sp``; powers and signs are taken axis by axis. ``Delta_s`` is the whole of eq. (13),
    with the panels' ``Delta eta_ddot`` (:func:`~etac_ros.laws.qi2022_panels.panels_torque`).

    Parameters
    ----------
    parameters
        Law, panels, and what the law knows of the SM.
    ticks_per_second
        Rate of the tick grid [1/s].
    """

    Parameters = SmSlidingModeParameters
    signal_size = MEASUREMENT_SIZE
    command_size = 3

    def __init__(self, parameters: SmSlidingModeParameters, ticks_per_second: int) -> None:
        self._ticks_per_second = ticks_per_second
        self._packed = np.concatenate(
            [
                parameters.packed(),
                parameters.packed_panels(),
                [parameters.slope_1_s, parameters.alpha, parameters.beta_nms, parameters.exponent],
            ]
        )

    def command(self, signal: FloatArray, tick: int, state: FloatArray) -> FloatArray:
        """:meth:`torque` for one measurement at a tick; ``state`` are the panels' modes, shape (3,)."""
        measurement, modes = (np.ascontiguousarray(row[np.newaxis]) for row in (signal, state))
        torque: FloatArray = self.torque(measurement, modes, np.array([tick], dtype=np.int64))[0]
        return torque

    def torque(self, measurements: FloatArray, modes: FloatArray, ticks: TickArray) -> FloatArray:
        """CMG torque ``tau_s`` [N m] in S, shape (n, 3).

        Parameters
        ----------
        measurements
            From :class:`RelativeMeasurement`, shape (n, 15).
        modes
            ``[eta (3), eta_dot (3)]`` of the panels, which the baseline takes as known, shape (n, 6).
        ticks
            Tick of each row, shape (n,).
        """
        result: FloatArray = _sliding(measurements, modes, ticks, self._packed, self._ticks_per_second)
        return result
