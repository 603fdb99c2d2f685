"""Unit quaternions, scalar first, in the conventions of :mod:`etac_ros.maths`."""

from __future__ import annotations

import math
from collections.abc import Sequence

import numpy as np

from etac_ros.maths.compiled import inlined, kernel
from etac_ros.maths.norms import row_norms
from etac_ros.parameters import FloatArray


@inlined
def quaternion_rate(q, omega_BN_B, dq):  # type: ignore[no-untyped-def]
    """Kinematics ``q_dot`` [1/s] into ``dq`` (wu2018 eqs. 2-3)."""
    dq[0] = -0.5 * (q[1] * omega_BN_B[0] + q[2] * omega_BN_B[1] + q[3] * omega_BN_B[2])
    dq[1] = 0.5 * (q[0] * omega_BN_B[0] + q[2] * omega_BN_B[2] - q[3] * omega_BN_B[1])
    dq[2] = 0.5 * (q[0] * omega_BN_B[1] + q[3] * omega_BN_B[0] - q[1] * omega_BN_B[2])
    dq[3] = 0.5 * (q[0] * omega_BN_B[2] + q[1] * omega_BN_B[1] - q[2] * omega_BN_B[0])


@inlined
def normalise(q):  # type: ignore[no-untyped-def]
    """Scale ``q`` to unit norm, in place."""
    scale = 1.0 / math.sqrt(q[0] * q[0] + q[1] * q[1] + q[2] * q[2] + q[3] * q[3])
    for i in range(4):
        q[i] *= scale


@inlined
def product(a, b, out):  # type: ignore[no-untyped-def]
    """``a`` followed in the body by ``b``: ``q_CN = product(q_BN, q_CB)``, into ``out``."""
    out[0] = a[0] * b[0] - a[1] * b[1] - a[2] * b[2] - a[3] * b[3]
    out[1] = a[0] * b[1] + a[1] * b[0] + a[2] * b[3] - a[3] * b[2]
    out[2] = a[0] * b[2] - a[1] * b[3] + a[2] * b[0] + a[3] * b[1]
    out[3] = a[0] * b[3] + a[1] * b[2] - a[2] * b[1] + a[3] * b[0]


@inlined
def dcm(q, C):  # type: ignore[no-untyped-def]
    """Direction cosine matrix ``dcm_BN`` of ``q_BN`` into ``C``: components in N to components in B."""
    q0, q1, q2, q3 = q[0], q[1], q[2], q[3]
    C[0, 0] = q0 * q0 + q1 * q1 - q2 * q2 - q3 * q3
    C[0, 1] = 2.0 * (q1 * q2 + q0 * q3)
    C[0, 2] = 2.0 * (q1 * q3 - q0 * q2)
    C[1, 0] = 2.0 * (q1 * q2 - q0 * q3)
    C[1, 1] = q0 * q0 - q1 * q1 + q2 * q2 - q3 * q3
    C[1, 2] = 2.0 * (q2 * q3 + q0 * q1)
    C[2, 0] = 2.0 * (q1 * q3 + q0 * q2)
    C[2, 1] = 2.0 * (q2 * q3 - q0 * q1)
    C[2, 2] = q0 * q0 - q1 * q1 - q2 * q2 + q3 * q3


def from_euler_321(roll_pitch_yaw: Sequence[float]) -> FloatArray:
    """Quaternion ``q_BN`` of 3-2-1 Euler angles.

    Parameters
    ----------
    roll_pitch_yaw
        ``[roll, pitch, yaw]`` [rad].

    Returns
    -------
    ndarray, shape (4,)
        Unit quaternion, scalar first.
    """
    cr, cp, cy = (math.cos(angle / 2.0) for angle in roll_pitch_yaw)
    sr, sp, sy = (math.sin(angle / 2.0) for angle in roll_pitch_yaw)
    return np.array(
        [
            cr * cp * cy + sr * sp * sy,
            sr * cp * cy - cr * sp * sy,
            cr * sp * cy + sr * cp * sy,
            cr * cp * sy - sr * sp * cy,
        ]
    )


def to_euler_321(q: FloatArray) -> FloatArray:
    """3-2-1 Euler angles ``[roll, pitch, yaw]`` [rad] of quaternions ``q_BN``.

    Parameters
    ----------
    q
        Unit quaternions, shape (4,) or (n, 4).

    Returns
    -------
    ndarray, shape (3,) or (n, 3)
    """
    q0, q1, q2, q3 = np.moveaxis(np.asarray(q, dtype=np.float64), -1, 0)
    roll = np.arctan2(2.0 * (q0 * q1 + q2 * q3), 1.0 - 2.0 * (q1 * q1 + q2 * q2))
    pitch = np.arcsin(np.clip(2.0 * (q0 * q2 - q3 * q1), -1.0, 1.0))
    yaw = np.arctan2(2.0 * (q0 * q3 + q1 * q2), 1.0 - 2.0 * (q2 * q2 + q3 * q3))
    return np.stack([roll, pitch, yaw], axis=-1)


def rotation_angle(q: FloatArray) -> FloatArray:
    """Angle of the shortest rotation [rad] of unit quaternions of shape (..., 4)."""
    q = np.asarray(q, dtype=np.float64)
    return np.asarray(2.0 * np.arctan2(row_norms(q[..., 1:]), np.abs(q[..., 0])))


@kernel
def perturbed_attitudes(q, rotations):  # type: ignore[no-untyped-def]
    """Attitudes turned by small body-fixed rotation vectors.

    Parameters
    ----------
    q : ndarray, shape (n, 4)
        True attitudes.
    rotations : ndarray, shape (n, 3)
        Rotation vectors [rad] in the body frame: the attitude error of a sensor.

    Returns
    -------
    ndarray, shape (n, 4)
    """
    out = np.empty_like(q)
    error = np.empty(4)
    for i in range(q.shape[0]):
        error[0] = 1.0
        for j in range(3):
            error[1 + j] = 0.5 * rotations[i, j]
        normalise(error)
        product(q[i], error, out[i])
    return out
