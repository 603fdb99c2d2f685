"""Distributed attitude coordination of a formation (xie2021 eqs. 4-14): what spacecraft i forms, and its torque.

With ``sigma_e = sigma_i - sigma_d`` and ``omega_e = omega_i - omega_d`` from the reference that all of them know, ::

    e   = sum_j a_ij (sigma_i - sigma_j) + sigma_e                            (6)
    chi = omega_e + r e                                                        (7)
    eta = omega_i x J omega_i + J omega_d_dot                                  (of 14)
    u   = -k chi(t_k) - r J e_dot(t_k) + eta(t_k),   k = k0 + r |J| + 1        (11)

The signal is ``[chi, e_dot, eta]``: all that eq. (11) takes, and all that the trigger of eq. (15) watches.

What spacecraft i knows of its neighbours
-----------------------------------------
Eqs. (6) and (7) take ``sigma_j(t)`` and ``sigma_j_dot(t)`` as known at every instant; a network brings them at instants
only. Each spacecraft broadcasts ``[sigma, sigma_dot]``, and a listener takes

``extrapolated``
    ``sigma_j + sigma_j_dot age`` with the rate as it was. Trigger counts come close to those with continuous knowledge.
``held``
    the values as they came. Every message makes ``e`` and ``chi`` of its listeners jump.

Spacecraft that fire at the same tick broadcast first, and form their signals with each other's new message (remark 3:
"broadcasts ... and obtains"). The counts depend on this: a signal formed before is out of date as it is sent.

A neighbour that has not been heard is left out of the sum, which is then that of a graph without this edge.

Readings of the paper
---------------------
- The text at hand has lost its minus signs. Those of eqs. (11) and (14) are the ones with which eq. (17) follows from
  eq. (8), ``J chi_dot = u - omega x J omega - J omega_d_dot + r J e_dot``.
- ``|J|`` is the spectral norm, as the Euclidean norm of a matrix.
- ``omega_d`` is not given; it is ``G(sigma_d)^-1 sigma_d_dot``, that of eq. (1) for the reference.

Near the shadow switch
----------------------
The differences are the paper's plain ones, and nothing switches sets for them. When ``|sigma_i|`` passes 1, ``sigma_i``
jumps across the unit ball, ``e`` by ``2 (1 + sum_j a_ij)`` and ``chi`` by r times that: spacecraft i fires, and each
listener when it hears the other set. Between two spacecraft on opposite sides of the switch the difference points the
long way round; theorem 1 does not hold while an attitude is near half a turn from N. An extrapolated ``sigma_j`` may
leave the unit ball, and stays on the side where it was until the next message. The paper's own run never comes near.
"""

from __future__ import annotations

from enum import StrEnum

import numpy as np
import numpy.typing as npt
from pydantic import Field, PositiveFloat

from etac_ros.laws.law import TickArray
from etac_ros.maths.compiled import kernel
from etac_ros.maths.mrp import mrp_rate, omega_of_mrp_rate
from etac_ros.maths.ticks import seconds
from etac_ros.maths.vector import cross, multiply
from etac_ros.parameters import FloatArray, Inertia, Parameters, square, vector
from etac_ros.plants.mrp_reference import (
    REFERENCE_SIZE,
    MrpReference,
    mrp_reference,
    mrp_reference_acceleration,
    omega_dot_of_mrp_acceleration,
)
from etac_ros.plants.rigid_mrp import STATES

SIGNAL_SIZE = 9
BROADCAST_SIZE = 6

# Layout of the parameter vector of the coordination error.
_J, _REFERENCE = 0, 9
_R = _REFERENCE + REFERENCE_SIZE


@kernel
def _broadcast(states):  # type: ignore[no-untyped-def]
    out = np.empty((states.shape[0], 6))
    for k in range(states.shape[0]):
        for i in range(3):
            out[k, i] = states[k, i]
        mrp_rate(states[k, 0:3], states[k, 3:6], out[k, 3:6])
    return out


@kernel
def _coordination_error(  # type: ignore[no-untyped-def]
    states, tick, known, known_ticks, heard, weights, p, extrapolated, ticks_per_second
):
    out = np.empty((states.shape[0], 9))
    reference = p[_REFERENCE:_R]
    sigma_d = np.empty(3)
    sigma_d_dot = np.empty(3)
    sigma_d_ddot = np.empty(3)
    omega_d = np.empty(3)
    omega_d_dot = np.empty(3)
    sigma_dot = np.empty(3)
    a = np.empty(3)
    b = np.empty(3)
    for k in range(states.shape[0]):
        sigma = states[k, 0:3]
        omega_BN_B = states[k, 3:6]
        t = seconds(tick + k, ticks_per_second)
        mrp_reference(reference, t, sigma_d, sigma_d_dot)
        mrp_reference_acceleration(reference, t, sigma_d_ddot)
        omega_of_mrp_rate(sigma_d, sigma_d_dot, omega_d)
        omega_dot_of_mrp_acceleration(sigma_d, sigma_d_dot, sigma_d_ddot, omega_d, omega_d_dot)
        mrp_rate(sigma, omega_BN_B, sigma_dot)
        for i in range(3):
            e = sigma[i] - sigma_d[i]
            e_dot = sigma_dot[i] - sigma_d_dot[i]
            for j in range(weights.size):
                if heard[j] != 0.0:
                    sigma_j = known[j, i]
                    if extrapolated:
                        sigma_j += known[j, 3 + i] * seconds(tick + k - known_ticks[j], ticks_per_second)
                    e += weights[j] * (sigma[i] - sigma_j)
                    e_dot += weights[j] * (sigma_dot[i] - known[j, 3 + i])
            out[k, i] = omega_BN_B[i] - omega_d[i] + p[_R] * e
            out[k, 3 + i] = e_dot
        multiply(p[_J : _J + 9], omega_BN_B, b)
        cross(omega_BN_B, b, a)
        multiply(p[_J : _J + 9], omega_d_dot, b)
        for i in range(3):
            out[k, 6 + i] = a[i] + b[i]
    return out


@kernel
def _torque(signal, inertia, k, r):  # type: ignore[no-untyped-def]
    out = np.empty(3)
    multiply(inertia, signal[3:6], out)
    for i in range(3):
        out[i] = -k * signal[i] - r * out[i] + signal[6 + i]
    return out


class Knowledge(StrEnum):
    """What a spacecraft takes for its neighbours' attitudes between their messages."""

    EXTRAPOLATED = "extrapolated"
    """``sigma_j + sigma_j_dot age``."""
    HELD = "held"
    """``sigma_j`` as it came."""


class CoordinationErrorParameters(Parameters):
    """Parameters of :class:`CoordinationError`."""

    inertia_kg_m2: Inertia
    r: PositiveFloat
    """Weight of the attitude error beside the rate error, eq. (7) [rad/s]."""
    weights: tuple[PositiveFloat, ...] = ()
    """``a_ij`` of the neighbours that are heard, in the order of the inputs; empty where the reference alone leads."""
    reference: MrpReference = MrpReference()
    """``sigma_d``; at rest in N, unless given."""
    knowledge: Knowledge = Field(default=Knowledge.EXTRAPOLATED, description="extrapolated or held")


class CoordinationError:
    """The signal ``[chi (3) [rad/s], e_dot (3) [1/s], eta (3) [N m]]`` of one spacecraft (xie2021 eqs. 6-7, 14).

    Parameters
    ----------
    parameters
        Inertia, ``r``, the neighbours' weights, the reference, and what is made of the neighbours' messages.
    ticks_per_second
        Rate of the tick grid [1/s].
    """

    Parameters = CoordinationErrorParameters
    state_size = STATES
    size = SIGNAL_SIZE
    broadcast_size = BROADCAST_SIZE
    label = "[chi, e_dot, eta]"
    unit = "rad/s, 1/s, N m"

    def __init__(self, parameters: CoordinationErrorParameters, ticks_per_second: int) -> None:
        self._ticks_per_second = ticks_per_second
        self.r = parameters.r
        self._weights = vector(parameters.weights)
        self._extrapolated = parameters.knowledge is Knowledge.EXTRAPOLATED
        self._packed = np.concatenate([vector(parameters.inertia_kg_m2), parameters.reference.packed(), [parameters.r]])

    @property
    def neighbours(self) -> int:
        """How many neighbours are listened to."""
        return self._weights.size

    def broadcast(self, states: FloatArray) -> FloatArray:
        """What the neighbours are told: ``[sigma (3), sigma_dot (3) [1/s]]`` of each state, shape (n, 6)."""
        result: FloatArray = _broadcast(states)
        return result

    def evaluate(
        self,
        states: FloatArray,
        tick: int,
        known: FloatArray,
        known_ticks: TickArray,
        heard: npt.NDArray[np.bool_] | FloatArray,
    ) -> FloatArray:
        """Signal of each state, shape (n, 9).

        Parameters
        ----------
        states
            States ``[sigma, omega]`` at consecutive ticks, shape (n, 6), contiguous.
        tick
            Tick of ``states[0]``.
        known
            The neighbours' last broadcasts, in the order of the weights, shape (m, 6).
        known_ticks
            Tick at which each was sent, shape (m,); ages count from there.
        heard
            Which neighbours have been heard at all, shape (m,). The others' rows may hold anything.

        Raises
        ------
        ValueError
            If sizes do not fit.
        """
        m = self.neighbours
        # The kernel does not check bounds.
        if states.shape[1] != BROADCAST_SIZE or known.shape != (m, BROADCAST_SIZE):
            raise ValueError(
                f"states of 6 columns and broadcasts of shape {(m, BROADCAST_SIZE)}, a row for each weight, are "
                f"needed; found {states.shape[1]} columns and {known.shape}"
            )
        if known_ticks.shape != (m,) or heard.shape != (m,):
            raise ValueError(
                f"ticks and marks of {m} neighbours are needed; found {known_ticks.shape} and {heard.shape}"
            )
        result: FloatArray = _coordination_error(
            states,
            tick,
            known,
            known_ticks,
            heard.astype(np.float64),
            self._weights,
            self._packed,
            self._extrapolated,
            self._ticks_per_second,
        )
        return result


class CoordinationTorqueParameters(Parameters):
    """Parameters of :class:`CoordinationTorque`."""

    inertia_kg_m2: Inertia
    r: PositiveFloat
    """As in :class:`CoordinationErrorParameters` [rad/s]."""
    k0: PositiveFloat
    """What ``k`` exceeds ``r |J| + 1`` by."""

    @property
    def k(self) -> float:
        """``k = k0 + r |J| + 1``, with the spectral norm of ``J``."""
        return self.k0 + self.r * float(np.linalg.norm(square(self.inertia_kg_m2), 2)) + 1.0


class CoordinationTorque:
    """Control law ``u = -k chi - r J e_dot + eta`` of a received signal (xie2021 eq. 11).

    Parameters
    ----------
    parameters
        Inertia, ``r`` and ``k0``.
    ticks_per_second
        Not used.
    """

    Parameters = CoordinationTorqueParameters
    signal_size = SIGNAL_SIZE
    command_size = 3

    def __init__(self, parameters: CoordinationTorqueParameters, ticks_per_second: int) -> None:
        self._inertia = vector(parameters.inertia_kg_m2)
        self._k = parameters.k
        self._r = parameters.r

    def command(self, signal: FloatArray) -> FloatArray:
        """Torque [N m] in B for a received ``[chi, e_dot, eta]``, before any limit, shape (3,)."""
        result: FloatArray = _torque(signal, self._inertia, self._k, self._r)
        return result
