"""Disturbance torques that several plants have, and that their laws may know."""

from __future__ import annotations

import math

from etac_ros.maths.compiled import inlined
from etac_ros.maths.scratch import scratch
from etac_ros.parameters import FloatArray, Parameters, Vector3, vector


@inlined
def sinusoid(p, t, out):  # type: ignore[no-untyped-def]
    """Torque [N m] of a packed :class:`SinusoidalTorque` at ``t`` [s] into ``out``."""
    for i in range(3):
        angle = p[6 + i] + p[9 + i] * t
        out[i] = p[i] * math.sin(angle) + p[3 + i] * math.cos(angle)


@inlined
def sinusoidal_torque(p, t):  # type: ignore[no-untyped-def]
    """What :func:`sinusoid` gives, as three numbers."""
    torque = scratch(3)
    sinusoid(p, t, torque)
    return torque[0], torque[1], torque[2]


class SinusoidalTorque(Parameters):
    """Torque on axis i: ``sine_i sin(phase_i + frequency_i t) + cosine_i cos(phase_i + frequency_i t)``."""

    sine_nm: Vector3 = (0.0, 0.0, 0.0)
    cosine_nm: Vector3 = (0.0, 0.0, 0.0)
    phase_rad: Vector3 = (0.0, 0.0, 0.0)
    frequency_rad_s: Vector3 = (0.0, 0.0, 0.0)

    def packed(self) -> FloatArray:
        """The 12 numbers that :func:`sinusoid` takes: sine, cosine, phase, frequency."""
        return vector([*self.sine_nm, *self.cosine_nm, *self.phase_rad, *self.frequency_rad_s])
