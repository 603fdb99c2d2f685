"""Sliding-mode baseline of the cableless PM/SM formation (qi2022 eq. 19), updated at every step."""

from __future__ import annotations

import math
from typing import Annotated

import numpy as np
from pydantic import Field, PositiveFloat

from etac_ros.laws.law import TickArray
from etac_ros.laws.qi2022 import (
    INERTIA_SM,
    MEASUREMENT_SIZE,
    SM_MODEL_SIZE,
    SmModelParameters,
    feed_forward,
)
from etac_ros.maths.compiled import kernel
from etac_ros.maths.ticks import seconds
from etac_ros.maths.vector import multiply, multiply_transposed
from etac_ros.parameters import FloatArray, Matrix3, PositiveVector3, square, vector

MODES_SIZE = 6

# Parameter vector of the kernel: what the law knows of the SM, and then
_J_SM_INVERSE = SM_MODEL_SIZE  # 9: [1/(kg m^2)]
_COUPLING = SM_MODEL_SIZE + 9  # 9: Delta [kg^1/2 m]
_STIFFNESS = SM_MODEL_SIZE + 18  # 3: Lambda^2 [1/s^2]
_DAMPING = SM_MODEL_SIZE + 21  # 3: 2 zeta Lambda [1/s]
_SLOPE = SM_MODEL_SIZE + 24  # c [1/s]
_ALPHA = SM_MODEL_SIZE + 25
_BETA = SM_MODEL_SIZE + 26  # [N m s]
_EXPONENT = SM_MODEL_SIZE + 27  # gamma


@kernel
def _sliding(measurements, modes, ticks, p, ticks_per_second):  # type: ignore[no-untyped-def]
    out = np.empty((measurements.shape[0], 3))
    force = np.empty(3)
    feedback = np.empty(3)
    forward = np.empty(3)
    omega_pi_S_dot = np.empty(3)
    omega_si_S_dot = np.empty(3)
    a = np.empty(3)
    for k in range(measurements.shape[0]):
        m = measurements[k]
        feed_forward(m, seconds(ticks[k], ticks_per_second), p, omega_pi_S_dot, forward)
        multiply(p[INERTIA_SM : INERTIA_SM + 9], m[3:6], a)
        for i in range(3):
            s = m[3 + i] + p[_SLOPE] * m[i]
            power = math.copysign(abs(s) ** p[_EXPONENT], s)
            feedback[i] = -p[_ALPHA] * power - p[_BETA] * s - p[_SLOPE] * a[i]
        # With eta_ddot fed forward exactly, J_s omega_sp_dot = feedback; that settles eta_ddot.
        multiply(p[_J_SM_INVERSE : _J_SM_INVERSE + 9], feedback, omega_si_S_dot)
        for i in range(3):
            omega_si_S_dot[i] += omega_pi_S_dot[i]
        multiply_transposed(p[_COUPLING : _COUPLING + 9], omega_si_S_dot, a)
        for i in range(3):
            force[i] = -(p[_DAMPING + i] * modes[k, 3 + i] + p[_STIFFNESS + i] * modes[k, i]) - a[i]
        multiply(p[_COUPLING : _COUPLING + 9], force, a)
        for i in range(3):
            out[k, i] = feedback[i] + forward[i] + a[i]
    return out


class SmSlidingModeParameters(SmModelParameters):
    """Parameters of :class:`SmSlidingMode`; panels as in :class:`~etac_ros.plants.pm_sm.PmSmParameters`."""

    coupling_sqrt_kg_m: Matrix3
    """``Delta_a`` of all panels together [kg^1/2 m]."""
    coupling_scale: PositiveFloat = 1.0
    """Factor on ``Delta Delta'``."""
    modal_frequency_rad_s: PositiveVector3
    """Diagonal of ``Lambda_a``."""
    modal_damping: PositiveVector3
    """Diagonal of ``zeta_a``, a ratio."""
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
    with the panels' ``Delta eta_ddot``. That acceleration depends on ``tau_s`` itself. Since the feed-forward
    cancels it, the error equation ``J_s omega_sp_dot = tau_s - Delta_s`` remains, and gives it in closed
    form::

        omega_si_dot = J_s^-1 (tau_s - Delta_s) - omega_sp x C_sp omega_pi + C_sp omega_pi_dot
        eta_ddot = -(2 zeta Lambda eta_dot + Lambda^2 eta + Delta' omega_si_dot)

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
        frequency = vector(parameters.modal_frequency_rad_s)
        self._packed = np.concatenate(
            [
                parameters.packed(),
                np.linalg.inv(square(parameters.inertia_sm_kg_m2)).ravel(),
                vector(parameters.coupling_sqrt_kg_m) * math.sqrt(parameters.coupling_scale),
                frequency**2,
                2.0 * vector(parameters.modal_damping) * frequency,
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
