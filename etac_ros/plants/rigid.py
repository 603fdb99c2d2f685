"""Rigid spacecraft with a unit quaternion (wu2018 eqs. 1-3).

State ``[q_BN (4, scalar first), omega_BN_B (3) [rad/s]]``; input: control torque [N m] in B.
"""

from __future__ import annotations

import numpy as np
from pydantic import Field, FiniteFloat, PositiveInt, model_validator

from etac_ros.maths.compiled import inlined
from etac_ros.maths.quaternion import (
    normalise,
    perturbed_attitudes,
    quaternion_rate,
    rotation_angle,
    to_euler_321,
)
from etac_ros.maths.rk4 import Stop, propagator
from etac_ros.parameters import (
    FloatArray,
    Inertia,
    Parameters,
    UnitQuaternion,
    Vector3,
    exactly_one,
    square,
    vector,
)
from etac_ros.plants.start import Rotation, note_on_start, start_attitude, start_of_euler_321

STATES = 7

# Layout of the kernel's parameter vector.
_J, _J_INVERSE, _CONSTANT, _SINE, _COSINE, _FREQUENCY = 0, 9, 18, 21, 24, 27


@inlined
def _drive(t, p):  # type: ignore[no-untyped-def]
    return np.sin(p[_FREQUENCY] * t), np.cos(p[_FREQUENCY] * t)


@inlined
def _derivative(drive, state, torque, p, rate):  # type: ignore[no-untyped-def]
    w0, w1, w2 = state[4], state[5], state[6]
    sine, cosine = drive
    h0 = p[_J + 0] * w0 + p[_J + 1] * w1 + p[_J + 2] * w2
    h1 = p[_J + 3] * w0 + p[_J + 4] * w1 + p[_J + 5] * w2
    h2 = p[_J + 6] * w0 + p[_J + 7] * w1 + p[_J + 8] * w2
    m0 = w2 * h1 - w1 * h2 + torque[0] + p[_CONSTANT + 0] + p[_SINE + 0] * sine + p[_COSINE + 0] * cosine
    m1 = w0 * h2 - w2 * h0 + torque[1] + p[_CONSTANT + 1] + p[_SINE + 1] * sine + p[_COSINE + 1] * cosine
    m2 = w1 * h0 - w0 * h1 + torque[2] + p[_CONSTANT + 2] + p[_SINE + 2] * sine + p[_COSINE + 2] * cosine
    quaternion_rate(state[0:4], state[4:7], rate[0:4])
    rate[4] = p[_J_INVERSE + 0] * m0 + p[_J_INVERSE + 1] * m1 + p[_J_INVERSE + 2] * m2
    rate[5] = p[_J_INVERSE + 3] * m0 + p[_J_INVERSE + 4] * m1 + p[_J_INVERSE + 5] * m2
    rate[6] = p[_J_INVERSE + 6] * m0 + p[_J_INVERSE + 7] * m1 + p[_J_INVERSE + 8] * m2


@inlined
def _project(state):  # type: ignore[no-untyped-def]
    normalise(state[0:4])


_propagate = propagator(_derivative, _project, _drive)


class Disturbance(Parameters):
    """External torque ``d(t) = constant + sine sin(frequency t) + cosine cos(frequency t)`` [N m]."""

    constant_nm: Vector3 = (0.0, 0.0, 0.0)
    sine_nm: Vector3 = (0.0, 0.0, 0.0)
    cosine_nm: Vector3 = (0.0, 0.0, 0.0)
    frequency_rad_s: FiniteFloat = 0.0


class RigidBodyParameters(Parameters):
    """Parameters of :class:`RigidBody`."""

    inertia_kg_m2: Inertia
    attitude_q: UnitQuaternion | None = None
    attitude_euler_deg: Vector3 | None = Field(default=None, description="[roll, pitch, yaw], 3-2-1")
    rotation: Rotation = Field(default=Rotation.SHORTEST, description="shortest, or as_given: the quaternion's sign")
    rate_deg_s: Vector3 = (0.0, 0.0, 0.0)
    disturbance: Disturbance = Disturbance()
    substeps: PositiveInt = 1

    @model_validator(mode="after")
    def _one_attitude(self) -> RigidBodyParameters:
        exactly_one(self, "attitude_q", "attitude_euler_deg")
        return self


class RigidBody:
    """A rigid body in torque-driven rotation.

    Parameters
    ----------
    parameters
        Inertia, start and disturbance.
    ticks_per_second
        Rate of the tick grid [1/s].
    """

    Parameters = RigidBodyParameters
    labels = ("q0", "q1", "q2", "q3", "omega_x [rad/s]", "omega_y [rad/s]", "omega_z [rad/s]")
    inputs = {"torque": 3}
    noise_width = 6
    attitude_slice = slice(0, 4)
    rate_slice = slice(4, 7)

    def __init__(self, parameters: RigidBodyParameters, ticks_per_second: int) -> None:
        self._parameters = parameters
        self._ticks_per_second = ticks_per_second
        inertia = square(parameters.inertia_kg_m2)
        disturbance = parameters.disturbance
        self._packed = np.concatenate(
            [
                inertia.ravel(),
                np.linalg.inv(inertia).ravel(),
                vector(disturbance.constant_nm),
                vector(disturbance.sine_nm),
                vector(disturbance.cosine_nm),
                [disturbance.frequency_rad_s],
            ]
        )

    def initial_state(self) -> FloatArray:
        """State at tick 0; the quaternion is normalised, and that of the rotation which is asked for."""
        attitude = self._start(self._parameters.rotation)
        normalise(attitude)
        return np.concatenate([attitude, np.radians(self._parameters.rate_deg_s)])

    @property
    def notes(self) -> tuple[str, ...]:
        """Whether the start was given as the long way round."""
        parameters = self._parameters
        key = "attitude_q" if parameters.attitude_q is not None else "attitude_euler_deg"
        return note_on_start(self._start(Rotation.AS_GIVEN), parameters.rotation, key)

    def _start(self, rotation: Rotation) -> FloatArray:
        if self._parameters.attitude_q is not None:
            return start_attitude(self._parameters.attitude_q, rotation)
        assert self._parameters.attitude_euler_deg is not None
        return start_of_euler_321(self._parameters.attitude_euler_deg, rotation)

    def propagate(self, state: FloatArray, tick: int, count: int, held: FloatArray) -> FloatArray:
        """States at ``tick + 1 .. tick + count`` under the held torque [N m], shape (count, 7)."""
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
        """States as seen with attitude errors ``errors[:, :3]`` [rad] and rate errors ``errors[:, 3:]`` [rad/s]."""
        seen = np.empty_like(states)
        seen[:, 0:4] = perturbed_attitudes(states[:, 0:4], errors[:, 0:3])
        seen[:, 4:7] = states[:, 4:7] + errors[:, 3:6]
        return seen

    def quaternions(self, states: FloatArray) -> FloatArray:
        """Attitude as unit quaternions, scalar first, shape (n, 4)."""
        return states[:, 0:4]

    def euler_angles(self, states: FloatArray) -> FloatArray:
        """3-2-1 Euler angles ``[roll, pitch, yaw]`` [rad], shape (n, 3)."""
        return to_euler_321(states[:, 0:4])

    def attitude_angle(self, states: FloatArray) -> FloatArray:
        """Rotation angle from the reference [rad], shape (n,)."""
        return rotation_angle(states[:, 0:4])
