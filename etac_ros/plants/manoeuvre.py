"""Rigid spacecraft on its way to a constant attitude: quaternion error dynamics (shi2022 eqs. 1-4).

State ``[q_e (4, scalar first), omega_BN_B (3) [rad/s]]``; input: control torque [N m] in B. The desired attitude
``Q_d`` does not move, so that ``omega_e = omega`` and eq. (4) is eq. (1)-(2) written in ``Q_e = Q_d* Q``: the attitude
of the body relative to the desired one.
"""

from __future__ import annotations

import numpy as np
from pydantic import PositiveFloat, PositiveInt

from etac_ros.maths.compiled import inlined
from etac_ros.maths.quaternion import (
    normalise,
    perturbed_attitudes,
    product,
    quaternion_rate,
    rotation_angle,
    to_euler_321,
)
from etac_ros.maths.rk4 import propagator
from etac_ros.maths.scratch import scratch
from etac_ros.maths.vector import cross, multiply
from etac_ros.parameters import FloatArray, Inertia, Parameters, UnitQuaternion, Vector3, square, vector
from etac_ros.plants.disturbance import SinusoidalTorque, sinusoidal_torque
from etac_ros.plants.start import Rotation, note_on_start, start_attitude
from etac_ros.plants.watch import Watch

ATTITUDE = slice(0, 4)
RATE = slice(4, 7)

# Layout of the kernel's parameter vector.
_J, _J_INVERSE, _DISTURBANCE = 0, 9, 18


@inlined
def _drive(t, p):  # type: ignore[no-untyped-def]
    return sinusoidal_torque(p[_DISTURBANCE : _DISTURBANCE + 12], t)


@inlined
def _derivative(disturbance, state, torque, p, rate):  # type: ignore[no-untyped-def]
    omega_BN_B = state[4:7]
    momentum = scratch(3)
    gyroscopic = scratch(3)
    total = scratch(3)
    multiply(p[_J : _J + 9], omega_BN_B, momentum)
    cross(omega_BN_B, momentum, gyroscopic)
    for i in range(3):
        total[i] = disturbance[i] + (torque[i] - gyroscopic[i])
    quaternion_rate(state[0:4], omega_BN_B, rate[0:4])
    multiply(p[_J_INVERSE : _J_INVERSE + 9], total, rate[4:7])


@inlined
def _project(state):  # type: ignore[no-untyped-def]
    normalise(state[0:4])


_propagate = propagator(_derivative, _project, _drive)


def attitude_error(desired_q: FloatArray, attitude_q: FloatArray) -> FloatArray:
    """``Q_e = Q_d* Q`` of unit quaternions, scalar first, shape (4,); normalised."""
    conjugate = desired_q * np.array([1.0, -1.0, -1.0, -1.0])
    error = np.empty(4)
    product(conjugate, attitude_q, error)
    normalise(error)
    return error


class ManoeuvreParameters(Parameters):
    """Parameters of :class:`Manoeuvre`; symbols are shi2022's."""

    inertia_kg_m2: Inertia
    """``J``, row by row."""
    attitude_q: UnitQuaternion
    """``Q(0)``, scalar first; normalised when used."""
    desired_attitude_q: UnitQuaternion
    """``Q_d``, scalar first, constant; normalised when used."""
    rotation: Rotation = Rotation.SHORTEST
    """Which rotation from ``Q_d`` to ``Q(0)``: shortest, or as_given by the signs of both."""
    rate_rad_s: Vector3 = (0.0, 0.0, 0.0)
    """``omega(0)`` in B."""
    disturbance: SinusoidalTorque = SinusoidalTorque()
    """``d`` in B."""
    rate_limit_rad_s: PositiveFloat | None = None
    """``omega_max`` of eq. (6), an axis: beyond it the run ends; None watches without a bound."""
    substeps: PositiveInt = 1
    """RK4 steps a tick."""


class Manoeuvre:
    """A rigid body that turns towards a constant attitude, its angular velocity limited on each axis.

    Parameters
    ----------
    parameters
        Inertia, start, destination, disturbance and the limit of the rate.
    ticks_per_second
        Rate of the tick grid [1/s].
    """

    Parameters = ManoeuvreParameters
    labels = ("q_e0", "q_e1", "q_e2", "q_e3", "omega_x [rad/s]", "omega_y [rad/s]", "omega_z [rad/s]")
    inputs = {"torque": 3}
    noise_width = 6
    attitude_slice = ATTITUDE
    rate_slice = RATE

    def __init__(self, parameters: ManoeuvreParameters, ticks_per_second: int) -> None:
        self._parameters = parameters
        self._ticks_per_second = ticks_per_second
        inertia = square(parameters.inertia_kg_m2)
        self._packed = np.concatenate(
            [inertia.ravel(), np.linalg.inv(inertia).ravel(), parameters.disturbance.packed()]
        )

    def initial_state(self) -> FloatArray:
        """State at tick 0, shape (7,): ``Q_d* Q(0)`` and ``omega(0)``."""
        parameters = self._parameters
        return np.concatenate([start_attitude(self._error(), parameters.rotation), parameters.rate_rad_s])

    @property
    def notes(self) -> tuple[str, ...]:
        """Whether the manoeuvre was given as the long way round."""
        return note_on_start(self._error(), self._parameters.rotation, "attitude_q from desired_attitude_q")

    def _error(self) -> FloatArray:
        return attitude_error(vector(self._parameters.desired_attitude_q), vector(self._parameters.attitude_q))

    def propagate(self, state: FloatArray, tick: int, count: int, held: FloatArray) -> FloatArray:
        """States at ``tick + 1 .. tick + count`` under the held torque [N m], shape (count, 7)."""
        result: FloatArray = _propagate(
            state, tick, count, held, self._packed, self._ticks_per_second, self._parameters.substeps
        )
        return result

    def measured(self, states: FloatArray, errors: FloatArray) -> FloatArray:
        """States as seen with attitude errors ``errors[:, :3]`` [rad] and rate errors ``errors[:, 3:]`` [rad/s]."""
        seen = np.empty_like(states)
        seen[:, ATTITUDE] = perturbed_attitudes(
            np.ascontiguousarray(states[:, ATTITUDE]), np.ascontiguousarray(errors[:, 0:3])
        )
        seen[:, RATE] = states[:, RATE] + errors[:, 3:6]
        return seen

    def watches(self, states: FloatArray) -> tuple[Watch, ...]:
        """The vector part of q_e, and the angular velocity, whose limit ends the run (eq. 6)."""
        return (
            Watch(name="attitude q_v", unit="1", values=states[:, 1:4], axes=("x", "y", "z"), bound=None),
            Watch(
                name="angular velocity",
                unit="rad/s",
                values=states[:, RATE],
                axes=("x", "y", "z"),
                bound=self._parameters.rate_limit_rad_s,
            ),
        )

    def quaternions(self, states: FloatArray) -> FloatArray:
        """Attitude as unit quaternions, scalar first, shape (n, 4)."""
        return states[:, ATTITUDE]

    def euler_angles(self, states: FloatArray) -> FloatArray:
        """3-2-1 Euler angles ``[roll, pitch, yaw]`` [rad] from the desired attitude, shape (n, 3)."""
        return to_euler_321(states[:, ATTITUDE])

    def attitude_angle(self, states: FloatArray) -> FloatArray:
        """Rotation angle from the desired attitude [rad], shape (n,)."""
        return rotation_angle(states[:, ATTITUDE])
