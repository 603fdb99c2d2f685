"""Event-triggered attitude regulation of a flexible spacecraft: ``sigma = omega + alpha (1 + p'p) p``.

The law ``u = -k sigma(t_i)`` (flexible eq. 26) is :class:`etac_ros.laws.wu2018.Proportional`, the trigger rule
(28) :class:`etac_ros.triggers.relative.RelativeThreshold`, whose ``alpha`` is the paper's ``beta`` and whose
``gamma`` is its ``rho``.
"""

from __future__ import annotations

import numpy as np
from pydantic import PositiveFloat

from etac_ros.maths.compiled import inlined, kernel
from etac_ros.parameters import FloatArray, Parameters, vector
from etac_ros.plants.flexible import STATES


@inlined
def _form(state, p, out):  # type: ignore[no-untyped-def]
    square = state[0] * state[0] + state[1] * state[1] + state[2] * state[2]
    for j in range(3):
        out[j] = state[3 + j] + p[0] * (1.0 + square) * state[j]


@kernel
def _feedback(states, p):  # type: ignore[no-untyped-def]
    out = np.empty((states.shape[0], 3))
    for i in range(states.shape[0]):
        _form(states[i], p, out[i])
    return out


class FeedbackVectorParameters(Parameters):
    """Parameters of :class:`FeedbackVector`."""

    alpha: PositiveFloat


class FeedbackVector:
    """Single feedback vector ``sigma = omega + alpha p + alpha (p'p) p`` [rad/s] of an MRP plant (flexible eq. 25).

    Where the shadow set takes over, ``sigma`` jumps: from ``|p| = 1`` outwards it would lead the long way round.

    Parameters
    ----------
    parameters
        ``alpha`` [rad/s].
    """

    Parameters = FeedbackVectorParameters
    state_size = STATES
    size = 3
    label = "σ"
    unit = "rad/s"
    interval_bound = ("flexible eq. (73)", "its bound Gamma of eq. (64)")
    """Where the paper bounds the inter-event times, and the constant in it that has no value."""

    form = staticmethod(_form)

    def __init__(self, parameters: FeedbackVectorParameters, ticks_per_second: int) -> None:
        self.form_parameters = vector([parameters.alpha])

    def evaluate(self, states: FloatArray) -> FloatArray:
        """``sigma`` of each state ``[p (3), omega (3), ...]``, shape (n, 3)."""
        result: FloatArray = _feedback(states, self.form_parameters)
        return result
