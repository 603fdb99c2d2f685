"""Rigid spacecraft with modified Rodrigues parameters (xie2021 eqs. 1-3), and its error from a moving reference.

State ``[sigma (3), omega_BN_B (3) [rad/s]]``; input: control torque [N m] in B. With ``|sigma| > 1`` the state changes
to the shadow set of the same attitude (remark 1), once a tick at most.

The error is the paper's, eqs. (4)-(5): plain differences ``sigma - sigma_d`` and ``omega - omega_d``. They are the
error rotation and its rate to first order only, as ``omega_d`` is written in the reference's own frame; and beside the
switch ``sigma`` and ``-sigma`` are one attitude, but not one error.
"""

from __future__ import annotations

import math
from typing import Annotated

import numpy as np
from pydantic import AfterValidator, PositiveInt

from etac_ros.maths.compiled import inlined, kernel
from etac_ros.maths.mrp import (
    mrp_rate,
    mrp_rotation_angle,
    mrp_to_euler_321,
    mrp_to_quaternion,
    omega_of_mrp_rate,
    switch_shadow,
)
from etac_ros.maths.rk4 import propagator
from etac_ros.maths.scratch import scratch
from etac_ros.maths.ticks import seconds
from etac_ros.maths.vector import cross, multiply
from etac_ros.parameters import FloatArray, Inertia, Parameters, Vector3, square, vector
from etac_ros.plants.mrp_reference import MrpReference, mrp_reference

STATES = 6

# Layout of the kernel's parameter vector.
_J, _J_INVERSE = 0, 9


@inlined
def _derivative(t, state, torque, p, rate):  # type: ignore[no-untyped-def]
    omega_BN_B = state[3:6]
    momentum = scratch(3)
    total = scratch(3)
    multiply(p[_J : _J + 9], omega_BN_B, momentum)
    cross(momentum, omega_BN_B, total)
    for i in range(3):
        total[i] += torque[i]
    mrp_rate(state[0:3], omega_BN_B, rate[0:3])
    multiply(p[_J_INVERSE : _J_INVERSE + 9], total, rate[3:6])


@inlined
def _project(state):  # type: ignore[no-untyped-def]
    switch_shadow(state[0:3])


_propagate = propagator(_derivative, _project)


@kernel
def _errors(states, tick, reference, ticks_per_second):  # type: ignore[no-untyped-def]
    out = np.empty((states.shape[0], 6))
    sigma_d = np.empty(3)
    sigma_d_dot = np.empty(3)
    omega_d = np.empty(3)
    for k in range(states.shape[0]):
        mrp_reference(reference, seconds(tick + k, ticks_per_second), sigma_d, sigma_d_dot)
        omega_of_mrp_rate(sigma_d, sigma_d_dot, omega_d)
        for i in range(3):
            out[k, i] = states[k, i] - sigma_d[i]
            out[k, 3 + i] = states[k, 3 + i] - omega_d[i]
    return out


@kernel
def _perturbed(states, errors):  # type: ignore[no-untyped-def]
    """Attitudes turned by small rotation vectors in the body: the MRPs of ``product(q_BN, q_error)``."""
    out = np.empty_like(states)
    error = np.empty(3)
    turned = np.empty(3)
    for k in range(states.shape[0]):
        sigma = states[k, 0:3]
        half = 0.0
        for i in range(3):
            half += 0.25 * errors[k, i] * errors[k, i]
        # MRPs of the quaternion [1, rotation / 2], normalised: its vector part over one plus its scalar part.
        for i in range(3):
            error[i] = 0.5 * errors[k, i] / (1.0 + math.sqrt(1.0 + half))
        a = sigma[0] * sigma[0] + sigma[1] * sigma[1] + sigma[2] * sigma[2]
        b = error[0] * error[0] + error[1] * error[1] + error[2] * error[2]
        along = sigma[0] * error[0] + sigma[1] * error[1] + sigma[2] * error[2]
        cross(sigma, error, turned)
        for i in range(3):
            turned[i] = ((1.0 - a) * error[i] + (1.0 - b) * sigma[i] + 2.0 * turned[i]) / (1.0 + a * b - 2.0 * along)
        switch_shadow(turned)
        for i in range(3):
            out[k, i] = turned[i]
            out[k, 3 + i] = states[k, 3 + i] + errors[k, 3 + i]
    return out


def _short_way(values: tuple[float, ...]) -> tuple[float, ...]:
    norm = math.hypot(*values)
    if norm > 1.0:
        shadow = ", ".join(f"{0.0 - value / norm**2:.9g}" for value in values)
        raise ValueError(f"MRPs of norm at most 1 (found {norm:.9g}); the same attitude is [{shadow}], its shadow set")
    return values


Mrp = Annotated[Vector3, AfterValidator(_short_way)]
"""MRPs of a rotation of at most half a turn."""


class RigidMrpParameters(Parameters):
    """Parameters of :class:`RigidMrp`."""

    inertia_kg_m2: Inertia
    attitude_mrp: Mrp
    """Initial ``sigma_BN``."""
    rate_rad_s: Vector3 = (0.0, 0.0, 0.0)
    """Initial ``omega_BN_B``."""
    reference: MrpReference = MrpReference()
    """What the error is counted from; at rest in N, unless given."""
    substeps: PositiveInt = 1
    """RK4 steps a tick."""


class RigidMrp:
    """A rigid body in torque-driven rotation, in MRPs.

    Parameters
    ----------
    parameters
        Inertia, start and reference.
    ticks_per_second
        Rate of the tick grid [1/s].
    """

    Parameters = RigidMrpParameters
    labels = ("sigma1", "sigma2", "sigma3", "omega_x [rad/s]", "omega_y [rad/s]", "omega_z [rad/s]")
    inputs = {"torque": 3}
    noise_width = 6
    attitude_slice = slice(0, 3)
    rate_slice = slice(3, 6)

    def __init__(self, parameters: RigidMrpParameters, ticks_per_second: int) -> None:
        self._parameters = parameters
        self._ticks_per_second = ticks_per_second
        inertia = square(parameters.inertia_kg_m2)
        self._packed = np.concatenate([inertia.ravel(), np.linalg.inv(inertia).ravel()])
        self._reference = parameters.reference.packed()

    def initial_state(self) -> FloatArray:
        """State at tick 0, shape (6,)."""
        return vector([*self._parameters.attitude_mrp, *self._parameters.rate_rad_s])

    def propagate(self, state: FloatArray, tick: int, count: int, held: FloatArray) -> FloatArray:
        """States at ``tick + 1 .. tick + count`` under the held torque [N m], shape (count, 6)."""
        result: FloatArray = _propagate(
            state, tick, count, held, self._packed, self._ticks_per_second, self._parameters.substeps
        )
        return result

    def measured(self, states: FloatArray, errors: FloatArray) -> FloatArray:
        """States as seen with attitude errors ``errors[:, :3]`` [rad] and rate errors ``errors[:, 3:]`` [rad/s]."""
        result: FloatArray = _perturbed(np.ascontiguousarray(states), np.ascontiguousarray(errors))
        return result

    def errors(self, states: FloatArray, tick: int) -> FloatArray:
        """States relative to the reference, ``[sigma_e (3), omega_e (3) [rad/s]]`` (xie2021 eqs. 4-5), shape (n, 6).

        Parameters
        ----------
        states
            States at consecutive ticks, shape (n, 6).
        tick
            Tick of ``states[0]``.
        """
        result: FloatArray = _errors(np.ascontiguousarray(states), tick, self._reference, self._ticks_per_second)
        return result

    def quaternions(self, states: FloatArray) -> FloatArray:
        """Attitude as unit quaternions, scalar first, shape (n, 4)."""
        return mrp_to_quaternion(states[:, self.attitude_slice])

    def euler_angles(self, states: FloatArray) -> FloatArray:
        """3-2-1 Euler angles ``[roll, pitch, yaw]`` [rad] of states or of :meth:`errors`, shape (n, 3)."""
        return mrp_to_euler_321(states[:, self.attitude_slice])

    def attitude_angle(self, states: FloatArray) -> FloatArray:
        """Rotation angle [rad] of states or of :meth:`errors`, shape (n,)."""
        return mrp_rotation_angle(states[:, self.attitude_slice])
