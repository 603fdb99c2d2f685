"""Laws of the cableless PM/SM formation (qi2022): LFPD of the PM (eq. 7) and of the SM (eqs. 12-13).

Symbols, frames and the state are those of :mod:`etac_ros.plants.pm_sm`. At a tick the PM's torque comes
first: it depends on the PM alone. The relative measurement of the same tick contains it, and the SM's torque
follows from that measurement. All laws work on arrays of samples, one row a tick; a single sample is an array
of one row and goes through the same compiled formula, so that windows never change a bit.

Signals
-------
An attitude is sent as the three numbers that the paper sends, the vector part of the quaternion of the
shortest rotation; the receiver finds the scalar part from the unit norm (near half a turn, with half the
digits).

PM feedback (6)
    ``[q_po (3), omega_po (3) [rad/s] in P]``: from the PM's star sensor and gyro to its controller.
Relative measurement (15)
    ``[q_sp (3), omega_sp (3) [rad/s] in S, tau_p (3) [N m] in P, omega_pi (3) [rad/s] in P, omega_pi_dot (3)
    [rad/s^2] in P]``: all that eq. (13) takes from the PM; 60 payload bytes.

Readings of the paper
---------------------
- Gains are positive here. Table 2 prints them negative, and eqs. (7) and (12) put another minus before them,
  which together would be positive feedback.
- Eq. (7) feeds ``+Delta_tau`` forward. To cancel the ``+Delta_tau`` of eq. (2), it has to be ``-Delta_tau``.
- ``tau_d`` in eq. (13) is the SM's ``tau_ds``. A law whose ``disturbance_sm`` is left out feeds none forward.
- The panels' ``Delta eta_ddot`` in eq. (13) is left out of the event-triggered law. With it, held between instants,
  the modules collide or the rule fires several times as often as the paper's (:mod:`etac_ros.laws.qi2022_panels`,
  variant ``panels``, docs/readings.md). The sliding-mode baseline (:mod:`etac_ros.laws.qi2022_smc`) is updated every
  step and has it.
- The orbit is circular: the terms with ``omega_oi_dot`` vanish.
- Each law has a model of its own (inertias, orbit, disturbances), because its knowledge need not be the
  truth.
"""

from __future__ import annotations

import math
from collections.abc import Callable
from typing import Annotated

import numpy as np
from pydantic import AfterValidator

from etac_ros.laws.law import TickArray
from etac_ros.maths.compiled import inlined, kernel
from etac_ros.maths.quaternion import dcm
from etac_ros.maths.scratch import scratch, scratch_matrix
from etac_ros.maths.ticks import seconds
from etac_ros.maths.vector import cross, multiply, turn
from etac_ros.parameters import FloatArray, Parameters, Vector3, square, vector
from etac_ros.plants.disturbance import SinusoidalTorque, sinusoid
from etac_ros.plants.pm_sm import STATES, PrintedInertia

FEEDBACK_SIZE = 6
MEASUREMENT_SIZE = 15

# Parameter vector of what a law knows of the PM, then the gains of the PM's law; matrices row by row.
_J_PM = 0  # 9: inertia of the PM in P [kg m^2]
_J_PM_INVERSE = 9  # 9: [1/(kg m^2)]
_ORBIT_RATE = 18  # 3: omega_oi in O [rad/s]
_NCLA_PM = 21  # 3: Delta_tau in P [N m]
_DISTURBANCE_PM = 24  # 12: tau_dp in P
_PM_ATTITUDE_GAIN = 36  # 3: K_pp [N m]
_PM_RATE_GAIN = 39  # 3: K_dp [N m s]

# Parameter vector of what a law knows of the SM, then of the SM's law.
INERTIA_SM = 0  # 9: inertia of the SM in S [kg m^2]
_CMG_MOMENTUM = 9  # 3: h_c in S [N m s]
_NCLA_SM = 12  # 3: Delta_tau in P [N m]
_DISTURBANCE_SM = 15  # 12: tau_ds in S
SM_MODEL_SIZE = 27
SM_ATTITUDE_GAIN = 27  # 3: K_ps [N m]
SM_RATE_GAIN = 30  # 3: K_ds [N m s]
_FEED_FORWARD = 33  # 1.0 with Delta_s, else 0.0


@inlined
def _sent_attitude(q, out):  # type: ignore[no-untyped-def]
    """Vector part of the shortest rotation: q and -q are the same attitude."""
    sign = -1.0 if q[0] < 0.0 else 1.0
    for i in range(3):
        out[i] = sign * q[1 + i]


@inlined
def _received_attitude(v, q):  # type: ignore[no-untyped-def]
    """The quaternion whose vector part was received; rounding may have pushed ``|v|`` beyond 1."""
    q[0] = math.sqrt(max(0.0, 1.0 - (v[0] * v[0] + v[1] * v[1] + v[2] * v[2])))
    for i in range(3):
        q[1 + i] = v[i]


@kernel
def _pm_feedback(states):  # type: ignore[no-untyped-def]
    out = np.empty((states.shape[0], 6))
    for k in range(states.shape[0]):
        _sent_attitude(states[k, 0:4], out[k, 0:3])
        for i in range(3):
            out[k, 3 + i] = states[k, 4 + i]
    return out


@kernel
def _pm_torque(feedback, ticks, p, ticks_per_second):  # type: ignore[no-untyped-def]
    out = np.empty((feedback.shape[0], 3))
    q = np.empty(4)
    C_po = np.empty((3, 3))
    omega_oi_P = np.empty(3)
    omega_pi_P = np.empty(3)
    momentum = np.empty(3)
    gyroscopic = np.empty(3)
    disturbance = np.empty(3)
    frame = np.empty(3)  # J_p (omega_po x C_po omega_oi)
    for k in range(feedback.shape[0]):
        omega_po_P = feedback[k, 3:6]
        _received_attitude(feedback[k, 0:3], q)
        dcm(q, C_po)
        turn(C_po, p[_ORBIT_RATE : _ORBIT_RATE + 3], omega_oi_P)
        for i in range(3):
            omega_pi_P[i] = omega_po_P[i] + omega_oi_P[i]
        multiply(p[_J_PM : _J_PM + 9], omega_pi_P, momentum)
        cross(omega_pi_P, momentum, gyroscopic)
        sinusoid(p[_DISTURBANCE_PM : _DISTURBANCE_PM + 12], seconds(ticks[k], ticks_per_second), disturbance)
        cross(omega_po_P, omega_oi_P, momentum)
        multiply(p[_J_PM : _J_PM + 9], momentum, frame)
        for i in range(3):
            out[k, i] = (
                -p[_PM_ATTITUDE_GAIN + i] * q[1 + i]
                - p[_PM_RATE_GAIN + i] * omega_po_P[i]
                - disturbance[i]
                - p[_NCLA_PM + i]
                + gyroscopic[i]
                - frame[i]
            )
    return out


@kernel
def _measurement(states, torque_pm, ticks, p, ticks_per_second):  # type: ignore[no-untyped-def]
    out = np.empty((states.shape[0], 15))
    C_po = np.empty((3, 3))
    omega_pi_P = np.empty(3)
    momentum = np.empty(3)
    torque = np.empty(3)
    disturbance = np.empty(3)
    a = np.empty(3)
    for k in range(states.shape[0]):
        dcm(states[k, 0:4], C_po)
        turn(C_po, p[_ORBIT_RATE : _ORBIT_RATE + 3], a)
        for i in range(3):
            omega_pi_P[i] = states[k, 4 + i] + a[i]
        multiply(p[_J_PM : _J_PM + 9], omega_pi_P, momentum)
        cross(omega_pi_P, momentum, a)
        sinusoid(p[_DISTURBANCE_PM : _DISTURBANCE_PM + 12], seconds(ticks[k], ticks_per_second), disturbance)
        for i in range(3):
            torque[i] = torque_pm[k, i] + p[_NCLA_PM + i] + disturbance[i] - a[i]
        multiply(p[_J_PM_INVERSE : _J_PM_INVERSE + 9], torque, out[k, 12:15])
        _sent_attitude(states[k, 7:11], out[k, 0:3])
        for i in range(3):
            out[k, 3 + i] = states[k, 11 + i]
            out[k, 6 + i] = torque_pm[k, i]
            out[k, 9 + i] = omega_pi_P[i]
    return out


@inlined
def feed_forward(m, t, p, omega_pi_S_dot, out):  # type: ignore[no-untyped-def]
    """``Delta_s`` [N m] of eq. (13) without the panels, into ``out``.

    Parameters
    ----------
    m : ndarray, shape (15,)
        Relative measurement.
    t : float
        [s].
    p : ndarray
        What the law knows of the SM: :meth:`SmModelParameters.packed`.
    omega_pi_S_dot : ndarray, shape (3,)
        Written as well: ``C_sp omega_pi_dot - omega_sp x C_sp omega_pi`` [rad/s^2], the acceleration that an
        SM at rest relative to the PM would need.
    out : ndarray, shape (3,)
        Written.
    """
    q = scratch(4)
    C_sp = scratch_matrix(3, 3)
    ncla = scratch(3)
    omega_si_S = scratch(3)
    a = scratch(3)
    b = scratch(3)
    _received_attitude(m[0:3], q)
    dcm(q, C_sp)
    turn(C_sp, m[9:12], omega_si_S)
    cross(m[3:6], omega_si_S, a)
    turn(C_sp, m[12:15], omega_pi_S_dot)
    for i in range(3):
        omega_pi_S_dot[i] -= a[i]
        omega_si_S[i] += m[3 + i]
        ncla[i] = m[6 + i] + p[_NCLA_SM + i]
    turn(C_sp, ncla, out)
    multiply(p[INERTIA_SM : INERTIA_SM + 9], omega_si_S, a)
    for i in range(3):
        a[i] += p[_CMG_MOMENTUM + i]
    cross(omega_si_S, a, b)
    multiply(p[INERTIA_SM : INERTIA_SM + 9], omega_pi_S_dot, a)
    for i in range(3):
        out[i] += b[i] + a[i]
    sinusoid(p[_DISTURBANCE_SM : _DISTURBANCE_SM + 12], t, a)
    for i in range(3):
        out[i] -= a[i]


@kernel
def _tracking(measurements, ticks, p, ticks_per_second):  # type: ignore[no-untyped-def]
    out = np.empty((measurements.shape[0], 3))
    forward = np.empty(3)
    unused = np.empty(3)
    for k in range(measurements.shape[0]):
        m = measurements[k]
        feed_forward(m, seconds(ticks[k], ticks_per_second), p, unused, forward)
        for i in range(3):
            error = -p[SM_ATTITUDE_GAIN + i] * m[i] - p[SM_RATE_GAIN + i] * m[3 + i]
            out[k, i] = error + p[_FEED_FORWARD] * forward[i]
    return out


def _magnitudes(values: tuple[float, ...]) -> tuple[float, ...]:
    if min(values) <= 0.0:
        raise ValueError(
            "gains are magnitudes here, all greater than 0: with the minus of eqs. (7) and (12), "
            "the negative ones of qi2022's Table 2 would be positive feedback"
        )
    return values


Magnitudes = Annotated[Vector3, AfterValidator(_magnitudes)]
"""Positive gains on the three axes."""


class PmModelParameters(Parameters):
    """What a law knows of the PM and its orbit."""

    inertia_pm_kg_m2: PrintedInertia
    """``J_p`` in P."""
    orbit_rate_rad_s: Vector3
    """``omega_oi`` in O, constant."""
    ncla_disturbance_nm: Vector3 = (0.0, 0.0, 0.0)
    """``Delta_tau`` in P, on the PM."""
    disturbance_pm: SinusoidalTorque = SinusoidalTorque()
    """``tau_dp`` in P; none, unless given."""

    def packed(self) -> FloatArray:
        """The parameter vector of the kernels."""
        inertia = square(self.inertia_pm_kg_m2)
        return np.concatenate(
            [
                inertia.ravel(),
                np.linalg.inv(inertia).ravel(),
                vector(self.orbit_rate_rad_s),
                vector(self.ncla_disturbance_nm),
                self.disturbance_pm.packed(),
            ]
        )


class SmModelParameters(Parameters):
    """What a law knows of the SM."""

    inertia_sm_kg_m2: PrintedInertia
    """``J_s`` in S."""
    cmg_momentum_nms: Vector3 = (0.0, 0.0, 0.0)
    """``h_c`` in S."""
    ncla_disturbance_nm: Vector3 = (0.0, 0.0, 0.0)
    """``Delta_tau`` in P, on the PM."""
    disturbance_sm: SinusoidalTorque = SinusoidalTorque()
    """``tau_ds`` in S; none, unless given."""

    def packed(self) -> FloatArray:
        """The parameter vector of the kernels."""
        return np.concatenate(
            [
                vector(self.inertia_sm_kg_m2),
                vector(self.cmg_momentum_nms),
                vector(self.ncla_disturbance_nm),
                self.disturbance_sm.packed(),
            ]
        )


class PmFeedbackParameters(Parameters):
    """The PM's feedback has no parameters."""


class PmFeedback:
    """What star sensor and gyro tell the PM's controller: ``[q_po (3), omega_po (3) [rad/s] in P]``.

    Parameters
    ----------
    parameters
        None.
    ticks_per_second
        Not used.
    """

    Parameters = PmFeedbackParameters
    state_size = STATES
    size = FEEDBACK_SIZE
    label = "[q_po, omega_po]"

    def __init__(self, parameters: PmFeedbackParameters, ticks_per_second: int) -> None:
        pass

    def evaluate(self, states: FloatArray) -> FloatArray:
        """Feedback of each state of :class:`~etac_ros.plants.pm_sm.PmSm`, shape (n, 6)."""
        result: FloatArray = _pm_feedback(states)
        return result


class PmLfpdParameters(PmModelParameters):
    """Parameters of :class:`PmLfpd`."""

    attitude_gain_nm: Magnitudes
    """Magnitude of the diagonal of ``K_pp``."""
    rate_gain_nms: Magnitudes
    """Magnitude of the diagonal of ``K_dp``."""


class PmLfpd:
    """Time-triggered law of the PM, ``tau_p = -K_pp q_po - K_dp omega_po + Delta_p`` (qi2022 eq. 7).

    The feed-forward linearises eq. (2) exactly::

        Delta_p = -tau_dp - Delta_tau + omega_pi x J_p omega_pi - J_p (omega_po x C_po omega_oi)

    Parameters
    ----------
    parameters
        Gains, and what the law knows of the PM.
    ticks_per_second
        Rate of the tick grid [1/s].
    """

    Parameters = PmLfpdParameters
    signal_size = FEEDBACK_SIZE
    command_size = 3

    def __init__(self, parameters: PmLfpdParameters, ticks_per_second: int) -> None:
        self._ticks_per_second = ticks_per_second
        self._packed = np.concatenate([parameters.packed(), parameters.attitude_gain_nm, parameters.rate_gain_nms])

    def command(self, signal: FloatArray, tick: int) -> FloatArray:
        """:meth:`torque` for one feedback at a tick, shape (3,)."""
        torque: FloatArray = self.torque(np.ascontiguousarray(signal[np.newaxis]), np.array([tick], dtype=np.int64))[0]
        return torque

    def torque(self, feedback: FloatArray, ticks: TickArray) -> FloatArray:
        """NCLA torque ``tau_p`` [N m] in P, shape (n, 3).

        Parameters
        ----------
        feedback
            From :class:`PmFeedback`, shape (n, 6).
        ticks
            Tick of each row, shape (n,).
        """
        result: FloatArray = _pm_torque(feedback, ticks, self._packed, self._ticks_per_second)
        return result


class RelativeMeasurement:
    """What the PM measures and knows and eq. (13) needs: the relative motion, and the PM's own.

    Parameters
    ----------
    parameters
        What the PM knows of itself; it finds ``omega_pi_dot`` from eq. (2).
    ticks_per_second
        Rate of the tick grid [1/s].
    """

    Parameters = PmModelParameters
    state_size = STATES
    size = MEASUREMENT_SIZE
    label = "[q_sp, omega_sp, tau_p, omega_pi, omega_pi_dot]"

    def __init__(self, parameters: PmModelParameters, ticks_per_second: int) -> None:
        self._ticks_per_second = ticks_per_second
        self._packed = parameters.packed()

    def evaluate(self, states: FloatArray, torque_pm: FloatArray, ticks: TickArray) -> FloatArray:
        """Measurement of each sample, shape (n, 15).

        Parameters
        ----------
        states
            States of :class:`~etac_ros.plants.pm_sm.PmSm`, shape (n, 20).
        torque_pm
            ``tau_p`` [N m] that acts from each sample on, shape (n, 3).
        ticks
            Tick of each row, shape (n,).
        """
        result: FloatArray = _measurement(states, torque_pm, ticks, self._packed, self._ticks_per_second)
        return result


class SmLfpdParameters(SmModelParameters):
    """Parameters of :class:`SmLfpd`."""

    attitude_gain_nm: Magnitudes
    """Magnitude of the diagonal of ``K_ps``."""
    rate_gain_nms: Magnitudes
    """Magnitude of the diagonal of ``K_ds``."""
    feed_forward: bool = True
    """Whether ``Delta_s`` is part of the torque; without it, only ``-K_ps q_sp - K_ds omega_sp`` is."""


class SmLfpd:
    """Tracking law of the SM, ``tau_cons = -K_ps q_sp - K_ds omega_sp + Delta_s`` (qi2022 eqs. 12-13).

    Without the panels' ``Delta eta_ddot``, the feed-forward is ::

        Delta_s = -tau_ds + C_sp (tau_p + Delta_tau) + omega_si x (J_s omega_si + h_c)
                  - J_s (omega_sp x C_sp omega_pi) + J_s C_sp omega_pi_dot

    All of ``tau_cons`` is held between triggering instants (eq. 8). The reading that holds the error feedback
    alone has ``feed_forward`` off here and ``continuous_feed_forward`` on in the plant.

    Parameters
    ----------
    parameters
        Gains, and what the law knows of the SM.
    ticks_per_second
        Rate of the tick grid [1/s].
    """

    Parameters: type[SmLfpdParameters] = SmLfpdParameters
    signal_size = MEASUREMENT_SIZE
    command_size = 3
    _kernel: Callable[..., FloatArray] = staticmethod(_tracking)

    def __init__(self, parameters: SmLfpdParameters, ticks_per_second: int) -> None:
        self._ticks_per_second = ticks_per_second
        self._packed = np.concatenate(
            [
                parameters.packed(),
                parameters.attitude_gain_nm,
                parameters.rate_gain_nms,
                [float(parameters.feed_forward)],
            ]
        )

    def command(self, signal: FloatArray, tick: int) -> FloatArray:
        """:meth:`torque` for one measurement at a tick, shape (3,)."""
        torque: FloatArray = self.torque(np.ascontiguousarray(signal[np.newaxis]), np.array([tick], dtype=np.int64))[0]
        return torque

    def torque(self, measurements: FloatArray, ticks: TickArray) -> FloatArray:
        """``tau_cons`` [N m] in S of each measurement, shape (n, 3).

        Parameters
        ----------
        measurements
            From :class:`RelativeMeasurement`, shape (n, 15).
        ticks
            Tick of each row, shape (n,).
        """
        result: FloatArray = self._kernel(measurements, ticks, self._packed, self._ticks_per_second)
        return result

    def watched(self, measurements: FloatArray, ticks: TickArray) -> FloatArray:
        """What the rule of eq. (11) looks at: ``[tau_cons (3), omega_sp (3), q_sp (3)]``, shape (n, 9)."""
        torque = self.torque(measurements, ticks)
        return np.concatenate([torque, measurements[:, 3:6], measurements[:, 0:3]], axis=1)
