"""The flexible panels in qi2022 eq. (13), ``Delta eta_ddot``, and the tracking law that feeds them forward.

The default law (:mod:`etac_ros.laws.qi2022`) leaves that term out. Whoever has it takes the panels' modes as known.
"""

from __future__ import annotations

import math
from typing import Literal

import numpy as np
from pydantic import PositiveFloat

from etac_ros.laws.law import TickArray
from etac_ros.laws.qi2022 import (
    MEASUREMENT_SIZE,
    SM_ATTITUDE_GAIN,
    SM_MODEL_SIZE,
    SM_RATE_GAIN,
    PmModelParameters,
    RelativeMeasurement,
    SmLfpd,
    SmLfpdParameters,
    SmModelParameters,
    feed_forward,
)
from etac_ros.maths.compiled import inlined, kernel
from etac_ros.maths.scratch import scratch
from etac_ros.maths.ticks import seconds
from etac_ros.maths.vector import multiply, multiply_transposed
from etac_ros.parameters import FloatArray, Matrix3, PositiveVector3, square, vector
from etac_ros.plants.pm_sm import MODES, STATES

MODES_SIZE = 6

# Parameter vector of what a law knows of the panels; matrices row by row.
_J_SM_INVERSE = 0  # 9: [1/(kg m^2)]
_COUPLING = 9  # 9: Delta [kg^1/2 m]
_STIFFNESS = 18  # 3: Lambda^2 [1/s^2]
_DAMPING = 21  # 3: 2 zeta Lambda [1/s]
PANELS_SIZE = 24

_PANELS = SM_MODEL_SIZE + 6  # of the tracking law: behind its gains


@inlined
def panels_torque(feedback, omega_pi_S_dot, modes, p, out):  # type: ignore[no-untyped-def]
    """``Delta eta_ddot`` [N m] of eq. (13), into ``out``, where the whole of eq. (13) is fed forward.

    That acceleration depends on the torque itself. Since the feed-forward cancels it, ``J_s omega_sp_dot = feedback``
    remains, and gives it in closed form::

        omega_si_dot = J_s^-1 feedback - omega_sp x C_sp omega_pi + C_sp omega_pi_dot
        eta_ddot = -(2 zeta Lambda eta_dot + Lambda^2 eta + Delta' omega_si_dot)

    Parameters
    ----------
    feedback : ndarray, shape (3,)
        The torque without its feed-forward [N m].
    omega_pi_S_dot : ndarray, shape (3,)
        ``C_sp omega_pi_dot - omega_sp x C_sp omega_pi`` [rad/s^2].
    modes : ndarray, shape (6,)
        ``[eta, eta_dot]``.
    p : ndarray, shape (24,)
        What the law knows of the panels: :meth:`PanelsModelParameters.packed_panels`.
    out : ndarray, shape (3,)
        Written.
    """
    omega_si_S_dot = scratch(3)
    force = scratch(3)
    multiply(p[_J_SM_INVERSE : _J_SM_INVERSE + 9], feedback, omega_si_S_dot)
    for i in range(3):
        omega_si_S_dot[i] += omega_pi_S_dot[i]
    multiply_transposed(p[_COUPLING : _COUPLING + 9], omega_si_S_dot, out)
    for i in range(3):
        force[i] = -(p[_DAMPING + i] * modes[3 + i] + p[_STIFFNESS + i] * modes[i]) - out[i]
    multiply(p[_COUPLING : _COUPLING + 9], force, out)


@kernel
def _tracking(measurements, ticks, p, ticks_per_second):  # type: ignore[no-untyped-def]
    out = np.empty((measurements.shape[0], 3))
    feedback = np.empty(3)
    forward = np.empty(3)
    omega_pi_S_dot = np.empty(3)
    panels = np.empty(3)
    for k in range(measurements.shape[0]):
        m = measurements[k]
        feed_forward(m[0:MEASUREMENT_SIZE], seconds(ticks[k], ticks_per_second), p, omega_pi_S_dot, forward)
        for i in range(3):
            feedback[i] = -p[SM_ATTITUDE_GAIN + i] * m[i] - p[SM_RATE_GAIN + i] * m[3 + i]
        panels_torque(feedback, omega_pi_S_dot, m[MEASUREMENT_SIZE:], p[_PANELS : _PANELS + PANELS_SIZE], panels)
        for i in range(3):
            out[k, i] = feedback[i] + forward[i] + panels[i]
    return out


class PanelsModelParameters(SmModelParameters):
    """What a law knows of the SM and its panels; as in :class:`~etac_ros.plants.pm_sm.PmSmParameters`."""

    coupling_sqrt_kg_m: Matrix3
    """``Delta_a`` of all panels together [kg^1/2 m]."""
    coupling_scale: PositiveFloat = 1.0
    """Factor on ``Delta Delta'``."""
    modal_frequency_rad_s: PositiveVector3
    """Diagonal of ``Lambda_a``."""
    modal_damping: PositiveVector3
    """Diagonal of ``zeta_a``, a ratio."""

    def packed_panels(self) -> FloatArray:
        """The part of the kernels' parameter vectors that is about the panels, shape (24,)."""
        frequency = vector(self.modal_frequency_rad_s)
        return np.concatenate(
            [
                np.linalg.inv(square(self.inertia_sm_kg_m2)).ravel(),
                vector(self.coupling_sqrt_kg_m) * math.sqrt(self.coupling_scale),
                frequency**2,
                2.0 * vector(self.modal_damping) * frequency,
            ]
        )


class MeasurementWithModes:
    """What the PM measures and knows, and the panels' modes behind it: ``[measurement (15), eta (3), eta_dot (3)]``.

    Parameters
    ----------
    parameters
        As for :class:`~etac_ros.laws.qi2022.RelativeMeasurement`.
    ticks_per_second
        Rate of the tick grid [1/s].
    """

    Parameters = PmModelParameters
    state_size = STATES
    size = MEASUREMENT_SIZE + MODES_SIZE
    label = f"{RelativeMeasurement.label[:-1]}, eta, eta_dot]"

    def __init__(self, parameters: PmModelParameters, ticks_per_second: int) -> None:
        self._measurement = RelativeMeasurement(parameters, ticks_per_second)

    def evaluate(self, states: FloatArray, torque_pm: FloatArray, ticks: TickArray) -> FloatArray:
        """Measurement and modes of each sample, shape (n, 21)."""
        measured = self._measurement.evaluate(states, torque_pm, ticks)
        return np.concatenate([measured, states[:, MODES.start : MODES.start + MODES_SIZE]], axis=1)


class SmLfpdWithPanelsParameters(PanelsModelParameters, SmLfpdParameters):
    """Parameters of :class:`SmLfpdWithPanels`; its feed-forward is whole."""

    feed_forward: Literal[True] = True


class SmLfpdWithPanels(SmLfpd):
    """Tracking law of the SM, ``tau_cons = -K_ps q_sp - K_ds omega_sp + Delta_s``, with the whole of eq. (13).

    It takes what :class:`MeasurementWithModes` sends.

    Parameters
    ----------
    parameters
        Gains, panels, and what the law knows of the SM.
    ticks_per_second
        Rate of the tick grid [1/s].
    """

    Parameters = SmLfpdWithPanelsParameters
    signal_size = MEASUREMENT_SIZE + MODES_SIZE
    _kernel = staticmethod(_tracking)

    def __init__(self, parameters: SmLfpdWithPanelsParameters, ticks_per_second: int) -> None:
        super().__init__(parameters, ticks_per_second)
        self._packed = np.concatenate([self._packed[:_PANELS], parameters.packed_panels()])
