"""Flexible spacecraft with modified Rodrigues parameters (flexible eqs. 5-9 and 15).

A rigid hub with appendages that swing in four modes. The attitude is that of the body frame B relative to the
reference N.

State (14)
----------
======= ============ ==================================================== ============
columns symbol       meaning                                              unit
======= ============ ==================================================== ============
0-2     ``p``        MRPs of B relative to N, ``|p| <= 1`` at every tick  1
3-5     ``omega``    B relative to N, in B                                rad/s
6-9     ``eta``      modal coordinates, mass-normalised                   kg^1/2 m
10-13   ``eta_dot``  their rates                                          kg^1/2 m/s
======= ============ ==================================================== ============

Input: control torque ``u`` [N m] in B.

Equations
---------
::

    (5)  p_dot = 1/4 {(1 - p'p) I + 2 p^x + 2 p p'} omega
    (7)  J omega_dot + delta' eta_ddot = -omega x (J omega + delta' eta_dot) + u + d0
    (8)  eta_ddot + C eta_dot + K eta = -delta omega_dot

Equations (7) and (8) hold together; putting the second into the first gives eq. (15), written here with
``eta_dot`` in place of the paper's auxiliary variable ``delta omega + eta_dot``::

    (J - delta' delta) omega_dot = -omega x (J omega + delta' eta_dot) + delta' (C eta_dot + K eta) + u + d0

``J = J0 + dJ`` is nominal inertia and uncertainty. The mass matrix ``J - delta' delta`` has to be positive
definite. Where ``|p| > 1`` at a tick, the shadow set takes over (eqs. 2-4): the same attitude, so neither
``omega`` nor the modes know of it.

The paper prints the unit of ``delta`` as kg^1/2 m/s^2. For eqs. (7) and (8) to have units at all it is kg^1/2 m.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Mapping, Sequence
from typing import Annotated

import numpy as np
from pydantic import AfterValidator, Field, FiniteFloat, NonNegativeFloat, PositiveFloat, PositiveInt, model_validator

from etac_ros.maths.compiled import inlined, kernel
from etac_ros.maths.mrp import (
    mrp_rate,
    mrp_rotation_angle,
    mrp_to_euler_321,
    mrp_to_quaternion,
    switch_shadow,
)
from etac_ros.maths.rk4 import Stop, propagator
from etac_ros.maths.scratch import scratch
from etac_ros.maths.ticks import seconds
from etac_ros.maths.vector import cross, multiply
from etac_ros.parameters import (
    FloatArray,
    Inertia,
    Matrix3,
    Parameters,
    Vector3,
    Vector4,
    exactly_one,
    square,
    vector,
)
from etac_ros.plants.rigid import Disturbance
from etac_ros.plants.start import Rotation, start_of_euler_321
from etac_ros.plants.watch import Watch

ATTITUDE = slice(0, 3)
RATE = slice(3, 6)
MODES = slice(6, 10)
MODAL_RATES = slice(10, 14)
STATES = 14
_MODE_COUNT = 4

# Layout of the kernel's parameter vector; matrices row by row.
_J = 0  # 9: J0 + dJ [kg m^2]
_MASS_INVERSE = 9  # 9: (J - delta' delta)^-1 [1/(kg m^2)]
_COUPLING = 18  # 12: delta, 4x3 [kg^1/2 m]
_STIFFNESS = 30  # 4: diagonal of K [1/s^2]
_DAMPING = 34  # 4: diagonal of C [1/s]
_CONSTANT, _SINE, _COSINE = 38, 41, 44  # 3 each: d0 [N m]
_FREQUENCY = 47  # [rad/s]


@inlined
def _drive(t, p):  # type: ignore[no-untyped-def]
    return math.sin(p[_FREQUENCY] * t), math.cos(p[_FREQUENCY] * t)


@inlined
def _derivative(drive, state, torque, p, rate):  # type: ignore[no-untyped-def]
    omega = state[3:6]
    momentum = scratch(3)
    reaction = scratch(3)  # delta' (C eta_dot + K eta): what the modes do to the hub
    a = scratch(3)
    multiply(p[_J : _J + 9], omega, momentum)
    for i in range(3):
        reaction[i] = 0.0
    for m in range(4):
        force = p[_DAMPING + m] * state[10 + m] + p[_STIFFNESS + m] * state[6 + m]
        for i in range(3):
            momentum[i] += p[_COUPLING + 3 * m + i] * state[10 + m]
            reaction[i] += p[_COUPLING + 3 * m + i] * force
    cross(omega, momentum, a)
    sine, cosine = drive
    for i in range(3):
        disturbance = p[_CONSTANT + i] + p[_SINE + i] * sine + p[_COSINE + i] * cosine
        momentum[i] = reaction[i] - a[i] + torque[i] + disturbance
    mrp_rate(state[0:3], omega, rate[0:3])
    multiply(p[_MASS_INVERSE : _MASS_INVERSE + 9], momentum, rate[3:6])
    for m in range(4):
        force = p[_DAMPING + m] * state[10 + m] + p[_STIFFNESS + m] * state[6 + m]
        inertial = 0.0
        for i in range(3):
            inertial += p[_COUPLING + 3 * m + i] * rate[3 + i]
        rate[6 + m] = state[10 + m]
        rate[10 + m] = -force - inertial


@inlined
def _project(state):  # type: ignore[no-untyped-def]
    switch_shadow(state[0:3])


_propagate = propagator(_derivative, _project, _drive)


@inlined
def _mrp_product(a, b, out):  # type: ignore[no-untyped-def]
    """MRPs of ``a`` followed in the body by ``b``, into ``out``; not for pairs that make a full turn."""
    aa = a[0] * a[0] + a[1] * a[1] + a[2] * a[2]
    bb = b[0] * b[0] + b[1] * b[1] + b[2] * b[2]
    ab = a[0] * b[0] + a[1] * b[1] + a[2] * b[2]
    cross(a, b, out)
    for i in range(3):
        out[i] = ((1.0 - aa) * b[i] + (1.0 - bb) * a[i] + 2.0 * out[i]) / (1.0 + aa * bb - 2.0 * ab)


@kernel
def _perturbed(mrps, rotations):  # type: ignore[no-untyped-def]
    out = np.empty_like(mrps)
    error = np.empty(3)
    for i in range(mrps.shape[0]):
        for j in range(3):
            error[j] = 0.25 * rotations[i, j]
        _mrp_product(mrps[i], error, out[i])
        switch_shadow(out[i])
    return out


@kernel
def _overall_disturbance(states, tick, torques, p, nominal, ticks_per_second):  # type: ignore[no-untyped-def]
    """``d`` of eq. (22): what a rigid body of the nominal inertia would have to feel to move as this one does."""
    out = np.empty((states.shape[0], 3))
    rate = np.empty(14)
    momentum = np.empty(3)
    gyroscopic = np.empty(3)
    inertial = np.empty(3)
    for k in range(states.shape[0]):
        _derivative(_drive(seconds(tick + k, ticks_per_second), p), states[k], torques[k], p, rate)
        multiply(nominal, states[k, 3:6], momentum)
        cross(states[k, 3:6], momentum, gyroscopic)
        multiply(nominal, rate[3:6], inertial)
        for i in range(3):
            out[k, i] = inertial[i] + gyroscopic[i] - torques[k, i]
    return out


@kernel
def _turned(values, matrix):  # type: ignore[no-untyped-def]
    out = np.empty_like(values)
    for k in range(values.shape[0]):
        multiply(matrix, values[k], out[k])
    return out


@kernel
def _norms(values):  # type: ignore[no-untyped-def]
    out = np.empty((values.shape[0], 1))
    for i in range(values.shape[0]):
        total = 0.0
        for j in range(values.shape[1]):
            total += values[i, j] * values[i, j]
        out[i, 0] = math.sqrt(total)
    return out


def _symmetric(values: tuple[float, ...]) -> tuple[float, ...]:
    matrix = square(values)
    if not np.allclose(matrix, matrix.T, rtol=0.0, atol=1e-9 * np.abs(matrix).max()):
        raise ValueError("a symmetric matrix")
    return values


SymmetricMatrix3 = Annotated[Matrix3, AfterValidator(_symmetric)]
Coupling = Annotated[tuple[FiniteFloat, ...], Field(min_length=3 * _MODE_COUNT, max_length=3 * _MODE_COUNT)]
PositiveVector4 = tuple[PositiveFloat, PositiveFloat, PositiveFloat, PositiveFloat]
NonNegativeVector4 = tuple[NonNegativeFloat, NonNegativeFloat, NonNegativeFloat, NonNegativeFloat]


class FlexibleParameters(Parameters):
    """Parameters of :class:`Flexible`. Matrices are row-major; symbols are the paper's."""

    inertia_kg_m2: Inertia
    """``J0`` in B, nominal."""
    inertia_uncertainty_kg_m2: SymmetricMatrix3 = (0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0)
    """``dJ`` in B."""
    coupling_sqrt_kg_m: Coupling
    """``delta`` [kg^1/2 m], 4x3: rows are modes, columns the axes of B."""
    modal_frequency_rad_s: PositiveVector4
    """Natural frequencies ``w_i`` of the clamped appendages (eq. 9)."""
    modal_damping: NonNegativeVector4
    """Damping ratios ``zeta_i`` (eq. 9)."""
    attitude_mrp: Vector3 | None = None
    """Initial ``p``; beyond ``|p| = 1`` its shadow set is the start."""
    attitude_euler_deg: Vector3 | None = Field(default=None, description="[roll, pitch, yaw], 3-2-1")
    rate_rad_s: Vector3 = (0.0, 0.0, 0.0)
    """Initial ``omega`` in B."""
    modal_coordinates_sqrt_kg_m: Vector4 = (0.0, 0.0, 0.0, 0.0)
    """Initial ``eta``."""
    modal_rates_sqrt_kg_m_s: Vector4 = (0.0, 0.0, 0.0, 0.0)
    """Initial ``eta_dot``."""
    disturbance: Disturbance = Disturbance()
    """``d0`` in B (eq. 76)."""
    substeps: PositiveInt = 1
    """RK4 steps a tick."""

    @model_validator(mode="after")
    def _one_attitude(self) -> FlexibleParameters:
        exactly_one(self, "attitude_mrp", "attitude_euler_deg")
        return self

    @model_validator(mode="after")
    def _definite(self) -> FlexibleParameters:
        smallest = float(np.linalg.eigvalsh(self.true_inertia_kg_m2)[0])
        if smallest <= 0.0:
            raise ValueError(
                "an inertia J = J0 + dJ that is positive definite: inertia_uncertainty_kg_m2 takes more from "
                f"inertia_kg_m2 than there is (smallest eigenvalue {smallest:.6g} kg m^2)"
            )
        smallest = float(np.linalg.eigvalsh(self.mass_matrix_kg_m2)[0])
        if smallest <= 0.0:
            raise ValueError(
                "appendages that carry less inertia than the whole spacecraft has: J - delta' delta must be "
                f"positive definite (smallest eigenvalue {smallest:.6g} kg m^2), else the hub would run away"
            )
        return self

    @property
    def true_inertia_kg_m2(self) -> FloatArray:
        """``J = J0 + dJ`` [kg m^2], shape (3, 3)."""
        return square(self.inertia_kg_m2) + square(self.inertia_uncertainty_kg_m2)

    @property
    def coupling_matrix(self) -> FloatArray:
        """``delta`` [kg^1/2 m], shape (4, 3)."""
        return vector(self.coupling_sqrt_kg_m).reshape(_MODE_COUNT, 3)

    @property
    def mass_matrix_kg_m2(self) -> FloatArray:
        """``J - delta' delta`` [kg m^2], shape (3, 3)."""
        return self.true_inertia_kg_m2 - self.coupling_matrix.T @ self.coupling_matrix

    @property
    def nominal_mass_matrix_kg_m2(self) -> FloatArray:
        """``J0 - delta' delta`` [kg m^2] of eqs. (18) to (22), shape (3, 3): what the paper's law takes for known."""
        return square(self.inertia_kg_m2) - self.coupling_matrix.T @ self.coupling_matrix


class Flexible:
    """A rigid hub with four elastic modes, turned by a torque.

    Parameters
    ----------
    parameters
        Inertia, modes, start and disturbance.
    ticks_per_second
        Rate of the tick grid [1/s].
    """

    Parameters = FlexibleParameters
    labels = (
        "p1", "p2", "p3",
        "omega_x [rad/s]", "omega_y [rad/s]", "omega_z [rad/s]",
        "eta1 [kg^1/2 m]", "eta2 [kg^1/2 m]", "eta3 [kg^1/2 m]", "eta4 [kg^1/2 m]",
        "eta_dot1 [kg^1/2 m/s]", "eta_dot2 [kg^1/2 m/s]", "eta_dot3 [kg^1/2 m/s]", "eta_dot4 [kg^1/2 m/s]",
    )  # fmt: skip
    inputs = {"torque": 3}
    noise_width = 6
    attitude_slice = ATTITUDE
    rate_slice = RATE
    modes_slice = MODES

    def __init__(self, parameters: FlexibleParameters, ticks_per_second: int) -> None:
        self._parameters = parameters
        self._ticks_per_second = ticks_per_second
        frequency = vector(parameters.modal_frequency_rad_s)
        disturbance = parameters.disturbance
        self._packed = np.concatenate(
            [
                parameters.true_inertia_kg_m2.ravel(),
                np.linalg.inv(parameters.mass_matrix_kg_m2).ravel(),
                parameters.coupling_matrix.ravel(),
                frequency**2,
                2.0 * vector(parameters.modal_damping) * frequency,
                vector(disturbance.constant_nm),
                vector(disturbance.sine_nm),
                vector(disturbance.cosine_nm),
                [disturbance.frequency_rad_s],
            ]
        )

    def initial_state(self) -> FloatArray:
        """State at tick 0, shape (14,)."""
        parameters = self._parameters
        if parameters.attitude_mrp is not None:
            attitude = vector(parameters.attitude_mrp)
        else:
            assert parameters.attitude_euler_deg is not None
            attitude = _mrp_of_euler_321(parameters.attitude_euler_deg)
        state = np.concatenate(
            [
                attitude,
                parameters.rate_rad_s,
                parameters.modal_coordinates_sqrt_kg_m,
                parameters.modal_rates_sqrt_kg_m_s,
            ]
        )
        _project(state)
        return state

    def propagate(self, state: FloatArray, tick: int, count: int, held: FloatArray) -> FloatArray:
        """States at ``tick + 1 .. tick + count`` under the held torque [N m] in B, shape (count, 14)."""
        result: FloatArray = _propagate(
            state, tick, count, held, self._packed, self._ticks_per_second, self._parameters.substeps
        )
        return result

    def propagate_until(self, stop: Stop, state: FloatArray, tick: int, count: int, held: FloatArray) -> FloatArray:
        """As :meth:`propagate`, but no further than the first state at which to stop."""
        return _propagate.until(
            stop, state, tick, count, held, self._packed, self._ticks_per_second, self._parameters.substeps
        )

    def measured(self, states: FloatArray, errors: FloatArray) -> FloatArray:
        """States as sensors see them, shape (n, 14).

        Parameters
        ----------
        states
            True states, shape (n, 14).
        errors
            Shape (n, 6): attitude errors as small body-fixed rotations [rad], then rate errors [rad/s]. Nothing
            measures the modes, which stay true.
        """
        seen = states.copy()
        seen[:, ATTITUDE] = _perturbed(np.ascontiguousarray(states[:, ATTITUDE]), np.ascontiguousarray(errors[:, 0:3]))
        seen[:, RATE] += errors[:, 3:6]
        return seen

    def watches(self, states: FloatArray) -> tuple[Watch, ...]:
        """The norms that Tables 3 to 5 are about; they are reported only."""
        return (
            _norm_of("attitude MRP", "1", states[:, ATTITUDE]),
            _norm_of("angular velocity", "rad/s", states[:, RATE]),
            _norm_of("modal coordinates", "kg^1/2 m", states[:, MODES]),
        )

    def driven(self, states: FloatArray, tick: int) -> Mapping[str, Callable[[FloatArray], FloatArray]]:
        """The overall disturbance ``d`` [N m] of eqs. (22) and (23), and the acceleration that it makes [rad/s^2]."""
        nominal = self._parameters.nominal_mass_matrix_kg_m2
        seen = np.ascontiguousarray(states)

        def disturbance(torques: FloatArray) -> FloatArray:
            given = np.ascontiguousarray(torques)
            result: FloatArray = _overall_disturbance(
                seen, tick, given, self._packed, nominal.ravel(), self._ticks_per_second
            )
            return result

        def acceleration(torques: FloatArray) -> FloatArray:
            result: FloatArray = _turned(disturbance(torques), np.linalg.inv(nominal).ravel())
            return result

        return {"overall disturbance": disturbance, "overall disturbance as acceleration": acceleration}

    def quaternions(self, states: FloatArray) -> FloatArray:
        """Attitude as unit quaternions, scalar first, shape (n, 4)."""
        return mrp_to_quaternion(states[:, ATTITUDE])

    def euler_angles(self, states: FloatArray) -> FloatArray:
        """3-2-1 Euler angles ``[roll, pitch, yaw]`` [rad], shape (n, 3)."""
        return mrp_to_euler_321(states[:, ATTITUDE])

    def attitude_angle(self, states: FloatArray) -> FloatArray:
        """Rotation angle from the reference [rad], shape (n,)."""
        return mrp_rotation_angle(states[:, ATTITUDE])


def _norm_of(name: str, unit: str, values: FloatArray) -> Watch:
    return Watch(name=name, unit=unit, values=_norms(np.ascontiguousarray(values)), axes=("norm",), bound=None)


def _mrp_of_euler_321(roll_pitch_yaw_deg: Sequence[float]) -> FloatArray:
    """MRPs, ``|p| <= 1``, of 3-2-1 Euler angles [deg]."""
    q = start_of_euler_321(roll_pitch_yaw_deg, Rotation.SHORTEST)
    return np.asarray(q[1:] / (1.0 + q[0]))
