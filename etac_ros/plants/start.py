"""The attitude at which a plant starts: one attitude, one result, whichever way it was written.

A unit quaternion and its negative are the same attitude, as are Euler angles a whole turn apart; but a law that
feeds back the vector part turns back along the way that the sign says, up to a whole turn ("unwinding").
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from enum import StrEnum

import numpy as np

from etac_ros.maths.quaternion import from_euler_321
from etac_ros.parameters import FloatArray

_HALF_TURN = 1e-12
"""Scalar parts below it are a rotation of half a turn, for which both ways are equally short."""


class Rotation(StrEnum):
    """Which of the two rotations to the start a plant begins with."""

    SHORTEST = "shortest"
    """At most half a turn: the quaternion whose scalar part is not negative."""
    AS_GIVEN = "as_given"
    """The sign that stands in the scenario or follows from its angles, and with it the long way round."""


def start_attitude(q: Sequence[float] | FloatArray, rotation: Rotation) -> FloatArray:
    """The quaternion of a start.

    Parameters
    ----------
    q
        Scalar first; its norm stays as it is.
    rotation
        Which of ``q`` and ``-q``.
    """
    start = np.array(q, dtype=np.float64)
    if rotation is Rotation.AS_GIVEN:
        return start
    return np.asarray((-start if _is_long(start) else start) + 0.0)  # no negative zeros, which are other bits


def start_of_euler_321(degrees: Sequence[float], rotation: Rotation) -> FloatArray:
    """The quaternion of a start at 3-2-1 Euler angles ``[roll, pitch, yaw]`` [deg].

    Taking the shortest rotation, angles a whole turn apart give the same bits.
    """
    # The remainder to the nearest turn is exact in floating point.
    angles = [math.remainder(angle, 360.0) + 0.0 for angle in degrees] if rotation is Rotation.SHORTEST else degrees
    return start_attitude(from_euler_321([math.radians(angle) for angle in angles]), rotation)


def note_on_start(q: FloatArray, rotation: Rotation, what: str) -> tuple[str, ...]:
    """What a user should know who gave this quaternion, or angles that lead to it; nothing where it is the short way.

    Parameters
    ----------
    q
        As given, scalar first.
    rotation
        What was asked for.
    what
        The key of the attitude.
    """
    if not _is_long(q):
        return ()
    angle = 2.0 * math.degrees(math.atan2(float(np.linalg.norm(q[1:])), float(q[0])))
    if rotation is Rotation.SHORTEST:
        return (
            f"{what} is a rotation of {angle:.4g} deg, started from as one of {360.0 - angle:.4g} deg, the same "
            f"attitude; 'rotation: {Rotation.AS_GIVEN}' keeps the long way round",
        )
    return (f"{what} is started from as a rotation of {angle:.4g} deg, the long way round, as asked for",)


def _is_long(q: FloatArray) -> bool:
    """Whether the negative quaternion is the shorter rotation; at half a turn, that with the first axis positive."""
    if abs(q[0]) > _HALF_TURN:
        return bool(q[0] < 0.0)
    axis = q[1:][np.abs(q[1:]) > _HALF_TURN]
    return bool(len(axis) and axis[0] < 0.0)
