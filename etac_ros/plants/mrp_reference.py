"""A reference attitude that moves with time, as MRPs: what a formation of spacecraft tracks (xie2021 section 4).

On each axis ``sigma_d = constant + sine sin(frequency t) + cosine cos(frequency t)``. Its derivatives are written
out, and so are the angular velocity and acceleration of a body that follows it: nothing is differenced.

Plants report their error against a reference, and laws feed it forward; each has one of its own, because what a law
knows need not be what is asked for.
"""

from __future__ import annotations

import math

from pydantic import model_validator

from etac_ros.maths.compiled import inlined
from etac_ros.maths.mrp import omega_of_mrp_rate
from etac_ros.parameters import FloatArray, Parameters, Vector3, vector

REFERENCE_SIZE = 12
"""Numbers of a packed :class:`MrpReference`."""


@inlined
def mrp_reference(p, t, sigma_d, sigma_d_dot):  # type: ignore[no-untyped-def]
    """``sigma_d`` and ``sigma_d_dot`` [1/s] of a packed :class:`MrpReference` at ``t`` [s], into the last two."""
    for i in range(3):
        sine = math.sin(p[9 + i] * t)
        cosine = math.cos(p[9 + i] * t)
        sigma_d[i] = p[i] + p[3 + i] * sine + p[6 + i] * cosine
        sigma_d_dot[i] = p[9 + i] * (p[3 + i] * cosine - p[6 + i] * sine)


@inlined
def mrp_reference_acceleration(p, t, sigma_d_ddot):  # type: ignore[no-untyped-def]
    """``sigma_d_ddot`` [1/s^2] of a packed :class:`MrpReference` at ``t`` [s], into the last."""
    for i in range(3):
        angle = p[9 + i] * t
        sigma_d_ddot[i] = -p[9 + i] * p[9 + i] * (p[3 + i] * math.sin(angle) + p[6 + i] * math.cos(angle))


@inlined
def omega_dot_of_mrp_acceleration(p, dp, ddp, omega_BN_B, omega_BN_B_dot):  # type: ignore[no-untyped-def]
    """Angular acceleration [rad/s^2] of a motion in MRPs, into ``omega_BN_B_dot``.

    ``omega = G(p)^-1 p_dot``, differentiated exactly. With ``G^-1 v = c ((1 - |p|^2) / 2 v - p x v + p (p . v))`` and
    ``c = 8 / (1 + |p|^2)^2``, what comes from the bracket's own rate is ``c p |p_dot|^2``: its other terms cancel.
    What comes from c is ``-4 (p . p_dot) / (1 + |p|^2) omega``.

    Parameters
    ----------
    p, dp, ddp : ndarray, shape (3,)
        MRPs, their rate [1/s] and acceleration [1/s^2].
    omega_BN_B : ndarray, shape (3,)
        ``G(p)^-1 dp`` [rad/s].
    omega_BN_B_dot : ndarray, shape (3,)
        Written; none of the others.
    """
    omega_of_mrp_rate(p, ddp, omega_BN_B_dot)
    square = p[0] * p[0] + p[1] * p[1] + p[2] * p[2]
    along = p[0] * dp[0] + p[1] * dp[1] + p[2] * dp[2]
    speed = dp[0] * dp[0] + dp[1] * dp[1] + dp[2] * dp[2]
    scale = 8.0 / ((1.0 + square) * (1.0 + square))
    for i in range(3):
        omega_BN_B_dot[i] += scale * speed * p[i] - 4.0 * along / (1.0 + square) * omega_BN_B[i]


class MrpReference(Parameters):
    """Reference on axis i: ``constant_i + sine_i sin(frequency_i t) + cosine_i cos(frequency_i t)``."""

    constant_mrp: Vector3 = (0.0, 0.0, 0.0)
    sine_mrp: Vector3 = (0.0, 0.0, 0.0)
    cosine_mrp: Vector3 = (0.0, 0.0, 0.0)
    frequency_rad_s: Vector3 = (0.0, 0.0, 0.0)

    @model_validator(mode="after")
    def _below_half_a_turn(self) -> MrpReference:
        axes = zip(self.constant_mrp, self.sine_mrp, self.cosine_mrp, strict=True)
        bound = math.hypot(*(abs(constant) + math.hypot(sine, cosine) for constant, sine, cosine in axes))
        if bound > 1.0:
            raise ValueError(
                "a reference attitude of at most half a turn, |sigma_d| <= 1, because it does not switch to its shadow "
                f"set; constant, sine and cosine reach up to {bound:.6g} together"
            )
        return self

    def packed(self) -> FloatArray:
        """The 12 numbers that the kernels take: constant, sine, cosine, frequency."""
        return vector([*self.constant_mrp, *self.sine_mrp, *self.cosine_mrp, *self.frequency_rad_s])
