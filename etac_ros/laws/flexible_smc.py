"""Event-triggered sliding mode that the flexible paper compares with: its section V.C, after its reference [25].

Signal (6): ``[omega (3) [rad/s], s (3) [rad/s]]`` with the sliding surface ``s = omega + K p``. The law needs both,
so that a triggering instant costs twice what the proposed law sends. The trigger rule, which looks at ``omega``
alone, is :class:`etac_ros.triggers.one_norm.OneNormThreshold`.
"""

from __future__ import annotations

import numpy as np
from pydantic import NonNegativeFloat, PositiveFloat

from etac_ros.maths.compiled import kernel
from etac_ros.parameters import FloatArray, Parameters, PositiveVector3, vector
from etac_ros.plants.flexible import STATES


@kernel
def _rate_and_surface(states, slope):  # type: ignore[no-untyped-def]
    out = np.empty((states.shape[0], 6))
    for i in range(states.shape[0]):
        for j in range(3):
            out[i, j] = states[i, 3 + j]
            out[i, 3 + j] = states[i, 3 + j] + slope[j] * states[i, j]
    return out


@kernel
def _torque(signal, per_rate, constant, width):  # type: ignore[no-untyped-def]
    out = np.empty(3)
    one_norm = abs(signal[0]) + abs(signal[1]) + abs(signal[2])
    gain = per_rate * one_norm + constant
    for j in range(3):
        s = signal[3 + j]
        if abs(s) < width:
            out[j] = -gain * (s / width)
        else:
            out[j] = -gain if s > 0.0 else (gain if s < 0.0 else 0.0)
    return out


class RateAndSurfaceParameters(Parameters):
    """Parameters of :class:`RateAndSurface`."""

    slope_rad_s: PositiveVector3
    """Diagonal of ``K``."""


class RateAndSurface:
    """Angular velocity and sliding surface ``[omega, s]``, ``s = omega + K p`` [rad/s], of an MRP plant.

    Parameters
    ----------
    parameters
        The diagonal of ``K``.
    """

    Parameters = RateAndSurfaceParameters
    state_size = STATES
    size = 6
    label = "ω, s"
    unit = "rad/s"

    def __init__(self, parameters: RateAndSurfaceParameters, ticks_per_second: int) -> None:
        self._slope = vector(parameters.slope_rad_s)

    def evaluate(self, states: FloatArray) -> FloatArray:
        """``[omega, s]`` of each state ``[p (3), omega (3), ...]``, shape (n, 6)."""
        result: FloatArray = _rate_and_surface(states, self._slope)
        return result


class EventTriggeredSlidingModeParameters(Parameters):
    """Parameters of :class:`EventTriggeredSlidingMode`; symbols are the paper's."""

    inertia_bound_kg_m2: PositiveFloat
    """``J*``."""
    mu_1_s: PositiveFloat
    """``mu``."""
    disturbance_bound_nm: NonNegativeFloat
    """``d_max``."""
    alpha_1_nm: NonNegativeFloat
    """``alpha_1``."""
    beta_1_nms: NonNegativeFloat
    """``beta_1``."""
    boundary_layer_rad_s: NonNegativeFloat = 0.0
    """``phi``: ``sign(s)`` becomes ``sat(s / phi)``; 0 is the sign as printed."""


class EventTriggeredSlidingMode:
    """Control law ``u = -{J* mu |omega(t_i)|_1 + C} sign(s(t_i))``, ``C = d_max + alpha_1 + beta_1 |omega(t_i)|_1``.

    The paper demands ``C`` to be at least that; the smallest is taken. A component of ``s`` that is zero gets no
    torque. With the printed ``d_max`` no torque is below 1 N m, which the paper's own figures are: they look like
    those of a law with a boundary layer, within which the torque falls linearly with ``s``, as sliding modes usually
    have it and the paper does not say.

    Parameters
    ----------
    parameters
        Gains and bounds.
    """

    Parameters = EventTriggeredSlidingModeParameters
    signal_size = RateAndSurface.size
    command_size = 3

    def __init__(self, parameters: EventTriggeredSlidingModeParameters, ticks_per_second: int) -> None:
        self._per_rate = parameters.inertia_bound_kg_m2 * parameters.mu_1_s + parameters.beta_1_nms
        self._constant = parameters.disturbance_bound_nm + parameters.alpha_1_nm
        self._width = parameters.boundary_layer_rad_s

    def command(self, signal: FloatArray) -> FloatArray:
        """Torque [N m] in B for a received ``[omega, s]`` [rad/s].

        Raises
        ------
        ValueError
            If the signal has not six components.
        """
        # The kernel does not check bounds.
        if signal.shape != (self.signal_size,):
            raise ValueError(f"the sliding mode needs [omega (3), s (3)]; the signal has the shape {signal.shape}")
        result: FloatArray = _torque(np.ascontiguousarray(signal), self._per_rate, self._constant, self._width)
        return result
