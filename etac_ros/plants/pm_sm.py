"""Payload module (PM) and support module (SM) of a cableless formation (qi2022 eqs. 1-6).

The PM is rigid and floats without contact beside the SM, which carries CMGs and flexible solar panels. The
non-contact Lorentz actuator (NCLA) turns the PM and pushes back on the SM.

Frames
------
O
    Local orbital frame of the PM, the reference of its attitude.
P, S
    Body frames of PM and SM. ``C_sp`` of ``q_sp`` takes components in P to components in S (eq. 5), ``C_po``
    those in O to P.

State (20)
----------
========= ==================== ========================================================= ============
columns   symbol               meaning                                                   unit
========= ==================== ========================================================= ============
0-3       ``q_po``             PM relative to O, scalar first                            1
4-6       ``omega_po_P``       PM relative to O, in P                                    rad/s
7-10      ``q_sp``             SM relative to PM, scalar first                           1
11-13     ``omega_sp_S``       SM relative to PM, in S                                   rad/s
14-16     ``eta``              modal coordinates of the panels, mass-normalised          kg^1/2 m
17-19     ``eta_dot``          their rates                                               kg^1/2 m/s
========= ==================== ========================================================= ============

Inputs
------
``torque_pm`` (3)
    ``tau_p`` [N m] in P, which the NCLA puts on the PM. Its reaction on the SM is part of the dynamics.
``torque_sm`` (3)
    ``tau_s`` [N m] in S, of the CMGs.

Equations
---------
With ``omega_pi = omega_po + C_po omega_oi`` in P, ``omega_si = omega_sp + C_sp omega_pi`` in S, and the
NCLA's whole torque ``tau_n = tau_p + Delta_tau``::

    (2)  J_p omega_pi_dot = tau_n + tau_dp - omega_pi x J_p omega_pi
    (4)  J_s omega_si_dot + Delta eta_ddot = tau_s + tau_ds - C_sp tau_n - omega_si x (J_s omega_si + h_c)
    (6)  Delta' omega_si_dot + eta_ddot = -f,   f = 2 zeta Lambda eta_dot + Lambda^2 eta

Equations (4) and (6) hold together; putting the second into the first gives ::

    (J_s - Delta Delta') omega_si_dot = right side of (4) + Delta f

with the mass matrix ``M = J_s - Delta Delta'``, which has to be positive definite.

What the paper leaves open
--------------------------
- Two panels that each have the printed coupling matrix give ``M = J_s - 2 Delta Delta'``. It is indefinite:
  the uncontrolled SM would run away with a pole of +3.66 1/s. So the printed matrix is read as that of both
  panels together (``panels: 1``); ``panels: 2`` may be asked for, and is refused with that reason. Two equal
  panels that start alike move alike, so one set of modal coordinates is all that either reading needs.
- ``coupling_scale`` multiplies ``Delta Delta'``; 0.85 belongs to the reading whose trigger counts come
  closest to the paper's.
- ``continuous_feed_forward`` belongs to the same reading. There ``torque_sm`` is the held error feedback
  alone, and ``C_sp tau_n + omega_si x (J_s omega_si + h_c) - J_s (omega_sp x C_sp omega_pi) + J_s C_sp
  omega_pi_dot`` acts on the SM at every instant, as if its actuators knew the PM's motion without any
  message. It is an idealisation: sampled at 20 Hz, the same feed-forward gives other counts.
- Eq. (4) leaves the panels' momentum ``Delta eta_dot`` out of the gyroscopic term, so that the total angular
  momentum drifts by ``omega_si x Delta eta_dot``. ``gyroscopic_panels`` puts it in; off is the printed
  equation.
- The orbit is circular, so that ``omega_oi`` is constant in O and the terms with its rate vanish.
- The inertia matrices of Table 1 are not quite symmetric. They are taken as printed: a torque-free body of
  such an inertia conserves its angular momentum, not its energy.
"""

from __future__ import annotations

import math
from typing import Annotated, Literal

import numpy as np
from pydantic import AfterValidator, PositiveFloat, PositiveInt, model_validator

from etac_ros.maths.compiled import inlined, kernel
from etac_ros.maths.quaternion import (
    dcm,
    normalise,
    perturbed_attitudes,
    quaternion_rate,
    rotation_angle,
    to_euler_321,
)
from etac_ros.maths.rk4 import propagator
from etac_ros.maths.scratch import scratch, scratch_matrix
from etac_ros.maths.vector import cross, multiply, multiply_transposed, turn
from etac_ros.parameters import (
    FloatArray,
    Matrix3,
    Parameters,
    PositiveVector3,
    Vector3,
    Vector4,
    square,
    vector,
)
from etac_ros.plants.disturbance import SinusoidalTorque, sinusoidal_torque
from etac_ros.plants.plant import Body
from etac_ros.plants.start import Rotation, note_on_start, start_attitude
from etac_ros.plants.watch import Watch

PM_ATTITUDE = slice(0, 4)
PM_RATE = slice(4, 7)
RELATIVE_ATTITUDE = slice(7, 11)
RELATIVE_RATE = slice(11, 14)
MODES = slice(14, 17)
STATES = 20

# Layout of the kernel's parameter vector; matrices row by row.
_J_PM = 0  # 9: inertia of the PM in P [kg m^2]
_J_PM_INVERSE = 9  # 9: [1/(kg m^2)]
_J_SM = 18  # 9: inertia of the SM in S [kg m^2]
_MASS_INVERSE = 27  # 9: (J_s - Delta Delta')^-1 [1/(kg m^2)]
_COUPLING = 36  # 9: Delta, with sqrt(panels coupling_scale) in it [kg^1/2 m]
_STIFFNESS = 45  # 3: Lambda^2 [1/s^2]
_DAMPING = 48  # 3: 2 zeta Lambda [1/s]
_ORBIT_RATE = 51  # 3: omega_oi in O [rad/s]
_CMG_MOMENTUM = 54  # 3: h_c in S [N m s]
_NCLA_DISTURBANCE = 57  # 3: Delta_tau in P [N m]
_DISTURBANCE_PM = 60  # 12: tau_dp in P, see SinusoidalTorque.packed
_DISTURBANCE_SM = 72  # 12: tau_ds in S
_GYROSCOPIC_PANELS = 84  # 1.0 if the panels' momentum stands in the gyroscopic term, else 0.0
_FEED_FORWARD = 85  # 1.0 with continuous feed-forward, else 0.0


@kernel
def _rotation_vectors(attitudes):  # type: ignore[no-untyped-def]
    out = np.empty((attitudes.shape[0], 3))
    for k in range(attitudes.shape[0]):
        q = attitudes[k]
        norm = math.sqrt(q[1] * q[1] + q[2] * q[2] + q[3] * q[3])
        sign = -1.0 if q[0] < 0.0 else 1.0
        # The angle over the norm tends to 2 as both vanish.
        scale = sign * 2.0 if norm == 0.0 else sign * 2.0 * math.atan2(norm, abs(q[0])) / norm
        for i in range(3):
            out[k, i] = scale * q[1 + i]
    return out


@inlined
def _drive(t, p):  # type: ignore[no-untyped-def]
    on_pm = sinusoidal_torque(p[_DISTURBANCE_PM : _DISTURBANCE_PM + 12], t)
    return on_pm, sinusoidal_torque(p[_DISTURBANCE_SM : _DISTURBANCE_SM + 12], t)


@inlined
def _derivative(disturbances, state, held, p, rate):  # type: ignore[no-untyped-def]
    disturbance_pm, disturbance_sm = disturbances
    omega_po_P = state[4:7]
    omega_sp_S = state[11:14]
    C = scratch_matrix(3, 3)
    omega_oi_P = scratch(3)
    omega_pi_P = scratch(3)
    omega_pi_S = scratch(3)
    omega_si_S = scratch(3)
    ncla = scratch(3)
    momentum = scratch(3)
    torque = scratch(3)
    omega_pi_P_dot = scratch(3)
    omega_pi_S_dot = scratch(3)  # C_sp omega_pi_P_dot - omega_sp x C_sp omega_pi
    omega_si_S_dot = scratch(3)
    force = scratch(3)
    a = scratch(3)
    b = scratch(3)

    # PM, eqs. (1)-(2)
    dcm(state[0:4], C)
    turn(C, p[_ORBIT_RATE : _ORBIT_RATE + 3], omega_oi_P)
    for i in range(3):
        omega_pi_P[i] = omega_po_P[i] + omega_oi_P[i]
        ncla[i] = held[i] + p[_NCLA_DISTURBANCE + i]
    multiply(p[_J_PM : _J_PM + 9], omega_pi_P, momentum)
    cross(omega_pi_P, momentum, a)
    for i in range(3):
        torque[i] = ncla[i] + disturbance_pm[i] - a[i]
    multiply(p[_J_PM_INVERSE : _J_PM_INVERSE + 9], torque, omega_pi_P_dot)
    quaternion_rate(state[0:4], omega_po_P, rate[0:4])
    cross(omega_po_P, omega_oi_P, a)
    for i in range(3):
        rate[4 + i] = omega_pi_P_dot[i] + a[i]

    # SM and its panels, eqs. (3)-(6)
    dcm(state[7:11], C)
    turn(C, omega_pi_P, omega_pi_S)
    for i in range(3):
        omega_si_S[i] = omega_sp_S[i] + omega_pi_S[i]
        force[i] = p[_DAMPING + i] * state[17 + i] + p[_STIFFNESS + i] * state[14 + i]
    cross(omega_sp_S, omega_pi_S, a)
    turn(C, omega_pi_P_dot, omega_pi_S_dot)
    for i in range(3):
        omega_pi_S_dot[i] -= a[i]
    multiply(p[_J_SM : _J_SM + 9], omega_si_S, momentum)
    for i in range(3):
        momentum[i] += p[_CMG_MOMENTUM + i]
    turn(C, ncla, torque)
    cross(omega_si_S, momentum, a)
    multiply(p[_J_SM : _J_SM + 9], omega_pi_S_dot, b)
    for i in range(3):
        # What the motion costs, against what cancels it in the reading with continuous feed-forward (eq. 13).
        torque[i] = p[_FEED_FORWARD] * (torque[i] + a[i] + b[i]) - torque[i] - a[i]
    multiply(p[_COUPLING : _COUPLING + 9], state[17:20], momentum)
    cross(omega_si_S, momentum, a)
    multiply(p[_COUPLING : _COUPLING + 9], force, b)
    for i in range(3):
        torque[i] += b[i] - p[_GYROSCOPIC_PANELS] * a[i]
    for i in range(3):
        torque[i] += held[3 + i] + disturbance_sm[i]
    multiply(p[_MASS_INVERSE : _MASS_INVERSE + 9], torque, omega_si_S_dot)
    quaternion_rate(state[7:11], omega_sp_S, rate[7:11])
    for i in range(3):
        rate[11 + i] = omega_si_S_dot[i] - omega_pi_S_dot[i]
    multiply_transposed(p[_COUPLING : _COUPLING + 9], omega_si_S_dot, a)
    for i in range(3):
        rate[14 + i] = state[17 + i]
        rate[17 + i] = -force[i] - a[i]


@inlined
def _project(state):  # type: ignore[no-untyped-def]
    normalise(state[0:4])
    normalise(state[7:11])


_propagate = propagator(_derivative, _project, _drive)


def _positive_definite(values: tuple[float, ...]) -> tuple[float, ...]:
    matrix = square(values)
    smallest = float(np.linalg.eigvalsh(0.5 * (matrix + matrix.T))[0])
    if smallest <= 0.0:
        raise ValueError(
            f"the symmetric part of an inertia matrix must be positive definite (smallest eigenvalue {smallest:.6g})"
        )
    return values


_PRINTED_ROUNDING = 1e-3


def _nearly_unit(values: tuple[float, ...]) -> tuple[float, ...]:
    norm = float(np.linalg.norm(values))
    if abs(norm - 1.0) > _PRINTED_ROUNDING:
        raise ValueError(
            f"a quaternion of norm 1 within {_PRINTED_ROUNDING} is needed, scalar first (found {norm:.6g})"
        )
    return values


PrintedInertia = Annotated[Matrix3, AfterValidator(_positive_definite)]
"""An inertia matrix as printed in qi2022's Table 1: its symmetric part is positive definite."""
PrintedQuaternion = Annotated[Vector4, AfterValidator(_nearly_unit)]
"""A quaternion as printed, with four decimals; it is normalised where it is used."""


class PmSmParameters(Parameters):
    """Parameters of :class:`PmSm`. Matrices are row-major; symbols and tables are qi2022's."""

    inertia_pm_kg_m2: PrintedInertia
    """``J_p`` in P."""
    inertia_sm_kg_m2: PrintedInertia
    """``J_s`` in S."""
    coupling_sqrt_kg_m: Matrix3
    """``Delta_a`` [kg^1/2 m], rows along the axes of S, columns along the modes."""
    coupling_scale: PositiveFloat = 1.0
    """Factor on ``Delta Delta'``."""
    panels: Literal[1, 2] = 1
    """How many panels the coupling matrix stands for; 1 takes it as that of both together."""
    modal_frequency_rad_s: PositiveVector3
    """Diagonal of ``Lambda_a``."""
    modal_damping: PositiveVector3
    """Diagonal of ``zeta_a``, a ratio."""
    gyroscopic_panels: bool = False
    """Whether ``Delta eta_dot`` stands in the gyroscopic term; the paper leaves it out."""
    continuous_feed_forward: bool = False
    """Whether eq. (13) without ``tau_ds`` and panels acts on the SM at all times, beside ``torque_sm``."""
    orbit_rate_rad_s: Vector3
    """``omega_oi`` in O, constant."""
    cmg_momentum_nms: Vector3 = (0.0, 0.0, 0.0)
    """``h_c`` in S."""
    ncla_disturbance_nm: Vector3 = (0.0, 0.0, 0.0)
    """``Delta_tau`` in P, on the PM."""
    disturbance_pm: SinusoidalTorque = SinusoidalTorque()
    """``tau_dp`` in P."""
    disturbance_sm: SinusoidalTorque = SinusoidalTorque()
    """``tau_ds`` in S."""
    attitude_pm_q: PrintedQuaternion
    """Initial ``q_po``, scalar first."""
    rate_pm_deg_s: Vector3
    """Initial ``omega_po_P``."""
    attitude_sm_q: PrintedQuaternion
    """Initial ``q_sp``, scalar first."""
    rotation: Rotation = Rotation.SHORTEST
    """Which rotations both stand for: shortest, or as_given by their signs."""
    rate_sm_deg_s: Vector3
    """Initial ``omega_sp_S``."""
    modal_coordinates_sqrt_kg_m: Vector3 = (0.0, 0.0, 0.0)
    """Initial ``eta``."""
    modal_rates_sqrt_kg_m_s: Vector3 = (0.0, 0.0, 0.0)
    """Initial ``eta_dot``."""
    air_clearance_deg: PositiveFloat | None = None
    """Angle about an axis at which the modules touch (Table 1); None watches nothing."""
    linear_range_deg: PositiveFloat | None = None
    """Angle up to which the NCLA is linear (Table 1); it is reported, and ends nothing."""
    substeps: PositiveInt = 1
    """RK4 steps a tick."""

    @model_validator(mode="after")
    def _definite_mass(self) -> PmSmParameters:
        mass = self.mass_matrix_kg_m2
        smallest = float(np.linalg.eigvalsh(0.5 * (mass + mass.T))[0])
        if smallest > 0.0:
            return self
        reason = (
            "the panels would carry more inertia than the SM has: "
            "M = J_s - panels coupling_scale Delta Delta' is not positive definite "
            f"(smallest eigenvalue {smallest:.4g} kg m^2), so the uncontrolled SM would run away "
            f"with a pole of {self._fastest_growth_1_s():+.3g} 1/s"
        )
        if self.panels == 2:
            reason += (
                "; the printed coupling matrix cannot belong to each of two panels: "
                "panels: 1 takes it as that of both together"
            )
        raise ValueError(reason)

    @property
    def coupling_matrix(self) -> FloatArray:
        """``Delta`` [kg^1/2 m] of all panels together, with ``coupling_scale`` in it, shape (3, 3)."""
        return square(self.coupling_sqrt_kg_m) * math.sqrt(self.panels * self.coupling_scale)

    @property
    def mass_matrix_kg_m2(self) -> FloatArray:
        """``M = J_s - Delta Delta'`` [kg m^2], shape (3, 3)."""
        coupling = self.coupling_matrix
        return square(self.inertia_sm_kg_m2) - coupling @ coupling.T

    def _fastest_growth_1_s(self) -> float:
        """Largest real part of the poles of the uncontrolled SM about rest [1/s]."""
        coupling = self.coupling_matrix
        stacked = np.block([[square(self.inertia_sm_kg_m2), coupling], [coupling.T, np.eye(3)]])
        frequency = vector(self.modal_frequency_rad_s)
        forces = np.zeros((6, 9))  # of omega, eta, eta_dot
        forces[3:, 3:6] = -np.diag(frequency**2)
        forces[3:, 6:] = -np.diag(2.0 * vector(self.modal_damping) * frequency)
        accelerations = np.linalg.solve(stacked, forces)
        shift = np.zeros((3, 9))
        shift[:, 6:] = np.eye(3)
        system = np.concatenate([accelerations[:3], shift, accelerations[3:]])
        return float(np.linalg.eigvals(system).real.max())


class PmSm:
    """The coupled attitude dynamics of PM and SM.

    Parameters
    ----------
    parameters
        Inertias, panels, orbit, disturbances and start.
    ticks_per_second
        Rate of the tick grid [1/s].
    """

    Parameters = PmSmParameters
    labels = (
        "q_po0", "q_po1", "q_po2", "q_po3",
        "omega_po_x [rad/s]", "omega_po_y [rad/s]", "omega_po_z [rad/s]",
        "q_sp0", "q_sp1", "q_sp2", "q_sp3",
        "omega_sp_x [rad/s]", "omega_sp_y [rad/s]", "omega_sp_z [rad/s]",
        "eta1 [kg^1/2 m]", "eta2 [kg^1/2 m]", "eta3 [kg^1/2 m]",
        "eta_dot1 [kg^1/2 m/s]", "eta_dot2 [kg^1/2 m/s]", "eta_dot3 [kg^1/2 m/s]",
    )  # fmt: skip
    inputs = {"torque_pm": 3, "torque_sm": 3}
    noise_width = 12
    attitude_slice = RELATIVE_ATTITUDE
    rate_slice = RELATIVE_RATE
    modes_slice = MODES

    def __init__(self, parameters: PmSmParameters, ticks_per_second: int) -> None:
        self._parameters = parameters
        self._ticks_per_second = ticks_per_second
        inertia_pm = square(parameters.inertia_pm_kg_m2)
        frequency = vector(parameters.modal_frequency_rad_s)
        self._packed = np.concatenate(
            [
                inertia_pm.ravel(),
                np.linalg.inv(inertia_pm).ravel(),
                vector(parameters.inertia_sm_kg_m2),
                np.linalg.inv(parameters.mass_matrix_kg_m2).ravel(),
                parameters.coupling_matrix.ravel(),
                frequency**2,
                2.0 * vector(parameters.modal_damping) * frequency,
                vector(parameters.orbit_rate_rad_s),
                vector(parameters.cmg_momentum_nms),
                vector(parameters.ncla_disturbance_nm),
                parameters.disturbance_pm.packed(),
                parameters.disturbance_sm.packed(),
                [float(parameters.gyroscopic_panels), float(parameters.continuous_feed_forward)],
            ]
        )

    def initial_state(self) -> FloatArray:
        """State at tick 0, shape (20,); both quaternions are normalised."""
        parameters = self._parameters
        state = np.concatenate(
            [
                start_attitude(parameters.attitude_pm_q, parameters.rotation),
                np.radians(parameters.rate_pm_deg_s),
                start_attitude(parameters.attitude_sm_q, parameters.rotation),
                np.radians(parameters.rate_sm_deg_s),
                parameters.modal_coordinates_sqrt_kg_m,
                parameters.modal_rates_sqrt_kg_m_s,
            ]
        )
        _project(state)
        return state

    @property
    def notes(self) -> tuple[str, ...]:
        """Whether a start was given as the long way round."""
        parameters = self._parameters
        starts = {"attitude_pm_q": parameters.attitude_pm_q, "attitude_sm_q": parameters.attitude_sm_q}
        return tuple(note for key, q in starts.items() for note in note_on_start(vector(q), parameters.rotation, key))

    def propagate(self, state: FloatArray, tick: int, count: int, held: FloatArray) -> FloatArray:
        """States at ``tick + 1 .. tick + count`` under held torques, shape (count, 20).

        Parameters
        ----------
        state
            State at ``tick``, shape (20,).
        tick, count
            Start and number of ticks.
        held
            ``[torque_pm (3) in P, torque_sm (3) in S]`` [N m].
        """
        result: FloatArray = _propagate(
            state, tick, count, held, self._packed, self._ticks_per_second, self._parameters.substeps
        )
        return result

    def measured(self, states: FloatArray, errors: FloatArray) -> FloatArray:
        """States as sensors see them, shape (n, 20).

        Parameters
        ----------
        states
            True states, shape (n, 20).
        errors
            Shape (n, 12): of the non-contact sensor, relative attitude [rad] and rate [rad/s] in S; then of
            the PM's star sensor and gyro, attitude [rad] and rate [rad/s] in P. The panels stay true: only
            the sliding-mode baseline looks at them, and takes them as known.
        """
        seen = states.copy()
        seen[:, RELATIVE_ATTITUDE] = _turned(states[:, RELATIVE_ATTITUDE], errors[:, 0:3])
        seen[:, RELATIVE_RATE] += errors[:, 3:6]
        seen[:, PM_ATTITUDE] = _turned(states[:, PM_ATTITUDE], errors[:, 6:9])
        seen[:, PM_RATE] += errors[:, 9:12]
        return seen

    def bodies(self) -> tuple[Body, ...]:
        """The SM relative to the PM, and the PM relative to its orbital frame."""
        return (
            Body(
                "SM to PM",
                self.euler_angles,
                lambda states: states[:, RELATIVE_RATE],
                lambda states: states[:, RELATIVE_ATTITUDE],
                frame="sm",
                parent="pm",
                port="torque_sm",
            ),
            Body(
                "PM to orbit",
                lambda states: to_euler_321(states[:, PM_ATTITUDE]),
                lambda states: states[:, PM_RATE],
                lambda states: states[:, PM_ATTITUDE],
                frame="pm",
                parent="orbit",
                port="torque_pm",
            ),
        )

    def watches(self, states: FloatArray) -> tuple[Watch, ...]:
        """The angle between the modules: leaving the air clearance is a collision."""
        return (
            Watch(
                name="angle between the modules",
                unit="deg",
                values=np.degrees(self.gap_angles(states)),
                axes=("x", "y", "z"),
                bound=self._parameters.air_clearance_deg,
                notice=self._parameters.linear_range_deg,
            ),
        )

    def euler_angles(self, states: FloatArray) -> FloatArray:
        """3-2-1 Euler angles ``[roll, pitch, yaw]`` [rad] of the SM relative to the PM, shape (n, 3)."""
        return to_euler_321(states[:, RELATIVE_ATTITUDE])

    def attitude_angle(self, states: FloatArray) -> FloatArray:
        """Rotation angle of the SM relative to the PM [rad], shape (n,)."""
        return rotation_angle(states[:, RELATIVE_ATTITUDE])

    def gap_angles(self, states: FloatArray) -> FloatArray:
        """Angle about each axis of S by which the SM is turned against the PM [rad], shape (n, 3).

        The components of the rotation vector: what air clearance and linear range of the NCLA limit.
        Compiled, one row at a time, so that a watch finds the same tick whatever the windows are.
        """
        result: FloatArray = _rotation_vectors(np.ascontiguousarray(states[:, RELATIVE_ATTITUDE]))
        return result


def _turned(attitudes: FloatArray, rotations: FloatArray) -> FloatArray:
    result: FloatArray = perturbed_attitudes(np.ascontiguousarray(attitudes), np.ascontiguousarray(rotations))
    return result
