"""Modified Rodrigues parameters ``p = e tan(angle / 4)``, in the conventions of :mod:`etac_ros.maths`.

Their kinematics are ``p_dot = G(p) omega`` with ``G = ((1 - |p|^2) / 2 I + p^x + p p') / 2`` (xie2021 eqs. 1-2,
flexible eq. 5). They are singular at a full turn; the shadow set ``-p / |p|^2`` is the same attitude, and is
switched to where ``|p| > 1``, so that the angle that they describe never exceeds half a turn.
"""

from __future__ import annotations

import numpy as np

from etac_ros.maths.compiled import inlined
from etac_ros.maths.quaternion import to_euler_321
from etac_ros.parameters import FloatArray


@inlined
def mrp_rate(p, omega_BN_B, dp):  # type: ignore[no-untyped-def]
    """Kinematics ``p_dot = G(p) omega`` [1/s] into ``dp``, which must be neither of them."""
    square = p[0] * p[0] + p[1] * p[1] + p[2] * p[2]
    along = p[0] * omega_BN_B[0] + p[1] * omega_BN_B[1] + p[2] * omega_BN_B[2]
    half = 0.5 * (1.0 - square)
    dp[0] = 0.5 * (half * omega_BN_B[0] + p[1] * omega_BN_B[2] - p[2] * omega_BN_B[1] + p[0] * along)
    dp[1] = 0.5 * (half * omega_BN_B[1] + p[2] * omega_BN_B[0] - p[0] * omega_BN_B[2] + p[1] * along)
    dp[2] = 0.5 * (half * omega_BN_B[2] + p[0] * omega_BN_B[1] - p[1] * omega_BN_B[0] + p[2] * along)


@inlined
def omega_of_mrp_rate(p, dp, omega_BN_B):  # type: ignore[no-untyped-def]
    """Angular velocity ``omega = G(p)^-1 p_dot`` [rad/s] into ``omega_BN_B``, which must be neither of them.

    ``G(p) G(p)' = ((1 + |p|^2) / 4)^2 I``, so the inverse is a scaled transpose.
    """
    square = p[0] * p[0] + p[1] * p[1] + p[2] * p[2]
    along = p[0] * dp[0] + p[1] * dp[1] + p[2] * dp[2]
    half = 0.5 * (1.0 - square)
    scale = 8.0 / ((1.0 + square) * (1.0 + square))
    omega_BN_B[0] = scale * (half * dp[0] - p[1] * dp[2] + p[2] * dp[1] + p[0] * along)
    omega_BN_B[1] = scale * (half * dp[1] - p[2] * dp[0] + p[0] * dp[2] + p[1] * along)
    omega_BN_B[2] = scale * (half * dp[2] - p[0] * dp[1] + p[1] * dp[0] + p[2] * along)


@inlined
def switch_shadow(p):  # type: ignore[no-untyped-def]
    """Replace ``p`` in place by its shadow set where ``|p| > 1``."""
    square = p[0] * p[0] + p[1] * p[1] + p[2] * p[2]
    if square > 1.0:
        for i in range(3):
            p[i] = -p[i] / square


def mrp_to_quaternion(p: FloatArray) -> FloatArray:
    """Unit quaternions, scalar first, of MRPs.

    Parameters
    ----------
    p
        Shape (3,) or (n, 3).

    Returns
    -------
    ndarray, shape (4,) or (n, 4)
    """
    p = np.asarray(p, dtype=np.float64)
    square = np.sum(p * p, axis=-1, keepdims=True)
    return np.asarray(np.concatenate([1.0 - square, 2.0 * p], axis=-1) / (1.0 + square))


def mrp_to_euler_321(p: FloatArray) -> FloatArray:
    """3-2-1 Euler angles ``[roll, pitch, yaw]`` [rad] of MRPs of shape (3,) or (n, 3)."""
    return to_euler_321(mrp_to_quaternion(p))


def mrp_rotation_angle(p: FloatArray) -> FloatArray:
    """Angle of the shortest rotation [rad] of MRPs of shape (..., 3)."""
    norm = np.linalg.norm(np.asarray(p, dtype=np.float64), axis=-1)
    with np.errstate(divide="ignore"):
        return np.asarray(4.0 * np.arctan(np.minimum(norm, 1.0 / norm)))
