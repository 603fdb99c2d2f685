"""Event-triggered attitude stabilisation of wu2018: ``s = omega + beta q_v`` and ``u = -k s(t_i)``."""

from __future__ import annotations

import numpy as np
from pydantic import PositiveFloat

from etac_ros.maths.compiled import inlined, kernel
from etac_ros.parameters import FloatArray, Parameters, vector
from etac_ros.plants.rigid import STATES


@inlined
def _form(state, p, out):  # type: ignore[no-untyped-def]
    for j in range(3):
        out[j] = state[4 + j] + p[0] * state[1 + j]


@kernel
def _filtered_error(states, p):  # type: ignore[no-untyped-def]
    out = np.empty((states.shape[0], 3))
    for i in range(states.shape[0]):
        _form(states[i], p, out[i])
    return out


class FilteredErrorParameters(Parameters):
    """Parameters of :class:`FilteredError`."""

    beta: PositiveFloat


class FilteredError:
    """Filtered error ``s = omega + beta q_v`` [rad/s] of a quaternion plant (wu2018 eq. 5).

    Parameters
    ----------
    parameters
        ``beta`` [1/s].
    """

    Parameters = FilteredErrorParameters
    state_size = STATES
    size = 3
    label = "s"
    unit = "rad/s"
    interval_bound = ("wu2018 eq. (36)", "the constant b of its eq. (27)")
    """Where the paper bounds the inter-event times, and the constant in it that has no value."""
    form = staticmethod(_form)

    def __init__(self, parameters: FilteredErrorParameters, ticks_per_second: int) -> None:
        self.form_parameters = vector([parameters.beta])

    def evaluate(self, states: FloatArray) -> FloatArray:
        """``s`` of each state ``[q (4), omega (3)]``, shape (n, 3)."""
        result: FloatArray = _filtered_error(states, self.form_parameters)
        return result


@inlined
def _command(signal, p, out):  # type: ignore[no-untyped-def]
    for j in range(3):
        out[j] = p[0] * signal[j]


class ProportionalParameters(Parameters):
    """Parameters of :class:`Proportional`."""

    k: PositiveFloat


class Proportional:
    """Control law ``u = -k s`` (wu2018 eq. 6).

    Parameters
    ----------
    parameters
        Gain ``k`` [N m s].
    """

    Parameters = ProportionalParameters
    signal_size = 3
    command_size = 3
    command_form = staticmethod(_command)

    def __init__(self, parameters: ProportionalParameters, ticks_per_second: int) -> None:
        self._k = parameters.k
        self.command_parameters = vector([-parameters.k])

    def command(self, signal: FloatArray) -> FloatArray:
        """Torque [N m] for a received ``s`` [rad/s]."""
        return -self._k * signal
