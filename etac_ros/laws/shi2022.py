"""Adaptive law with prescribed performance of shi2022 (eqs. 7-20): a law with memory.

Sampled at tick k, with ``t = k / ticks_per_second``::

    s = omega + alpha q_e                                                             section 3.1
    rho_i = (rho_i0 - rho_inf) exp(-mu t) + rho_inf,  chi_i = s_i / rho_i             (8), (9)
    eps_i = log(exp(chi_i + a1) - 1) - log(exp(a2 - chi_i) - 1)                       (10)
    h_j = exp(-|x - xi_j|^2 / (2 b^2)) / sqrt(2 pi b),  x = [q_e, omega]              (13)
    tau_bar = K nabla_1^-1 eps + W' H                                                 (19)
    tau = -(1 + beta) (tau_bar tanh(eps' nabla_1 tau_bar / kappa)
                       + D_m tanh(eps' nabla_1 D_m / kappa))                          (18), clipped on each axis
    W += (Gamma H eps' nabla_1 - gamma Gamma W) / ticks_per_second                    (20), after the torque

Readings of the paper
---------------------
- ``rho_i0 = s_i(0) + margin`` takes ``s_i(0)`` with its sign, as section 4 prints it. An axis that starts with
  ``s_i(0) <= -margin / 2`` therefore starts outside its own bound (rows 1.5 and 1.8 of Table 1).
- ``nabla_1`` of eq. (11) is printed as ``dT_i / dchi_i``. The derivative of ``eps_i`` by ``s_i`` would have a
  ``1 / rho_i`` as well; ``gradient: rho`` puts it in.
- The arguments of tanh in eq. (18) are scalars, so both tanh multiply whole vectors.
- Eq. (20) is integrated by explicit Euler steps of one tick: the controller is sampled, too. With ``adaptation_at:
  events`` a step is made at triggering instants only, as abstract and third contribution say ("the control command and
  the adaptive law are synchronously updated once the trigger condition is satisfied").
- ``rho_i0 = |s_i(0)| + margin`` is the other reading, with which no start of Table 1 is outside; ``start: magnitude``.
- The torque that the trigger watches is the one clipped to what the actuator can give.

Memory
------
``[rho_10, rho_20, rho_30, W row by row (neurons x 3)]``: what the law has to keep between samples. It is handed in and
out, so that samples that are never committed leave no trace.
"""

from __future__ import annotations

import math
from typing import Annotated, Literal

import numpy as np
from pydantic import Field, FiniteFloat, PositiveFloat

from etac_ros.maths.compiled import inlined, kernel
from etac_ros.maths.ticks import seconds
from etac_ros.parameters import FloatArray, Parameters, Vector3, vector
from etac_ros.plants.rigid import STATES
from etac_ros.plants.watch import Watch

STATE_SIZE = 7
_AXES = ("x", "y", "z")
_NEAREST = 1.0 - 1e-12
"""Part of its bound at which ``chi`` is held where the run ends: any torque will do, if only it is a number."""

# Layout of the kernels' parameter vector.
_ALPHA = 0
_MU = 1
_RHO_INF = 2
_A1 = 3
_A2 = 4
_INSIDE = 5  # chi is held at this part of its bound
_K = 6
_KAPPA = 7
_ONE_PLUS_BETA = 8
_D_M = 9  # 3
_LIMIT = 12
_LEAKAGE = 13  # gamma
_ADAPTATION = 14  # Gamma
_WIDTH = 15
_OVER_RHO = 16  # 1.0 if nabla_1 has the factor 1 / rho, else 0.0
_AT_EVENTS = 17  # 1.0 if the weights are updated at triggering instants only, else 0.0


@inlined
def _performance_bound(tick, rho_0, p, ticks_per_second):  # type: ignore[no-untyped-def]
    """``rho_i`` [rad/s] of eq. (8) at a tick."""
    return (rho_0 - p[_RHO_INF]) * math.exp(-p[_MU] * seconds(tick, ticks_per_second)) + p[_RHO_INF]


@inlined
def _filtered_error(state, axis, p):  # type: ignore[no-untyped-def]
    """``s_i`` [rad/s]."""
    return state[4 + axis] + p[_ALPHA] * state[1 + axis]


@kernel
def _used(states, tick, memory, p, ticks_per_second):  # type: ignore[no-untyped-def]
    """Part of the bound that is used, ``chi_i / a2`` or ``chi_i / a1``: inside while its magnitude is below 1."""
    out = np.empty((states.shape[0], 3))
    for k in range(states.shape[0]):
        for i in range(3):
            chi = _filtered_error(states[k], i, p) / _performance_bound(tick + k, memory[i], p, ticks_per_second)
            out[k, i] = chi / (p[_A2] if chi > 0.0 else p[_A1])
    return out


@inlined
def _transformed(state, tick, rho_0, p, ticks_per_second, eps, nabla):  # type: ignore[no-untyped-def]
    """``eps`` (10) and the diagonal of ``nabla_1`` (11), written."""
    for i in range(3):
        rho = _performance_bound(tick, rho_0[i], p, ticks_per_second)
        chi = _filtered_error(state, i, p) / rho
        chi = min(max(chi, -p[_INSIDE] * p[_A1]), p[_INSIDE] * p[_A2])
        # log(exp(y) - 1) and its derivative, without the cancellation beside the bound.
        eps[i] = math.log(math.expm1(chi + p[_A1])) - math.log(math.expm1(p[_A2] - chi))
        nabla[i] = -1.0 / math.expm1(-(chi + p[_A1])) - 1.0 / math.expm1(-(p[_A2] - chi))
        if p[_OVER_RHO] != 0.0:
            nabla[i] /= rho


@inlined
def _activations(state, centres, p, activation):  # type: ignore[no-untyped-def]
    """``H`` (13), written."""
    for j in range(centres.size):
        square = 0.0
        for i in range(6):
            distance = state[1 + i] - centres[j]
            square += distance * distance
        scale = math.sqrt(2.0 * math.pi * p[_WIDTH])
        activation[j] = math.exp(-square / (2.0 * p[_WIDTH] * p[_WIDTH])) / scale


@inlined
def _learn(weights, eps, nabla, activation, p, ticks_per_second):  # type: ignore[no-untyped-def]
    """One Euler step of eq. (20)."""
    for j in range(activation.size):
        for i in range(3):
            slope = p[_ADAPTATION] * (activation[j] * eps[i] * nabla[i] - p[_LEAKAGE] * weights[3 * j + i])
            weights[3 * j + i] += slope / ticks_per_second


@kernel
def _after_event(state, tick, memory, centres, p, ticks_per_second):  # type: ignore[no-untyped-def]
    eps = np.empty(3)
    nabla = np.empty(3)
    activation = np.empty(centres.size)
    _transformed(state, tick, memory, p, ticks_per_second, eps, nabla)
    _activations(state, centres, p, activation)
    out = memory.copy()
    _learn(out[3:], eps, nabla, activation, p, ticks_per_second)
    return out


@kernel
def _fold(states, tick, memory, centres, p, ticks_per_second):  # type: ignore[no-untyped-def]
    count = states.shape[0]
    neurons = centres.size
    torques = np.empty((count, 3))
    memories = np.empty((count, memory.size))
    weights = memory[3:].copy()
    eps = np.empty(3)
    nabla = np.empty(3)
    activation = np.empty(neurons)
    tau_bar = np.empty(3)
    for k in range(count):
        _transformed(states[k], tick + k, memory, p, ticks_per_second, eps, nabla)
        _activations(states[k], centres, p, activation)
        along = 0.0
        along_d = 0.0
        for i in range(3):
            estimate = 0.0
            for j in range(neurons):
                estimate += weights[3 * j + i] * activation[j]
            tau_bar[i] = p[_K] * eps[i] / nabla[i] + estimate
            along += eps[i] * nabla[i] * tau_bar[i]
            along_d += eps[i] * nabla[i] * p[_D_M + i]
        share = math.tanh(along / p[_KAPPA])
        share_d = math.tanh(along_d / p[_KAPPA])
        for i in range(3):
            tau = -p[_ONE_PLUS_BETA] * (tau_bar[i] * share + p[_D_M + i] * share_d)
            torques[k, i] = min(max(tau, -p[_LIMIT]), p[_LIMIT])
        if p[_AT_EVENTS] == 0.0:
            _learn(weights, eps, nabla, activation, p, ticks_per_second)
        for i in range(3):
            memories[k, i] = memory[i]
        for i in range(3 * neurons):
            memories[k, 3 + i] = weights[i]
    return torques, memories


Share = Annotated[float, Field(gt=0.0, le=1.0)]


class AdaptivePrescribedPerformanceParameters(Parameters):
    """Parameters of :class:`AdaptivePrescribedPerformance`; symbols are shi2022's."""

    alpha: PositiveFloat
    """Slope of ``s = omega + alpha q_e`` [1/s]."""
    margin_rad_s: PositiveFloat
    """``rho_i0 - s_i(0)``."""
    start: Literal["signed", "magnitude"] = "signed"
    """Whether ``rho_i0`` takes ``s_i(0)`` as printed, or ``|s_i(0)|``."""
    rho_infinity_rad_s: PositiveFloat
    """Where the performance bound ends."""
    mu: PositiveFloat
    """Decay of the performance bound [1/s]."""
    a1: Share = 1.0
    """Lower bound of ``s_i / rho_i``, as a magnitude."""
    a2: Share = 1.0
    """Upper bound of ``s_i / rho_i``."""
    beta: float = Field(gt=0.0, lt=1.0)
    """That of the trigger (21): the law gives so much more, to make up for what the trigger leaves."""
    gain_nm: PositiveFloat
    """``K``."""
    kappa: PositiveFloat
    """Smooths the sign in eq. (18)."""
    robust_nm: Vector3
    """``D_m``."""
    leakage: PositiveFloat
    """``gamma``."""
    adaptation: PositiveFloat
    """``Gamma`` is this times the unit matrix."""
    adaptation_at: Literal["samples", "events"] = "samples"
    """Whether the weights make a step at each sample, or at triggering instants only."""
    centres: tuple[FiniteFloat, ...] = Field(min_length=1)
    """``xi_j`` is this times a vector of ones; as many as there are neurons."""
    width: PositiveFloat
    """``b_j`` of all neurons."""
    limit_nm: PositiveFloat | None = None
    """Largest torque on an axis; None is unlimited."""
    gradient: Literal["plain", "rho"] = "plain"
    """``nabla_1``: ``dT/dchi`` as printed, or with ``1/rho`` as the chain rule has it."""
    start_outside: Literal["refuse", "saturate"] = "refuse"
    """What becomes of ``|s_i| >= rho_i``, at the start and later: the run is refused or ends, or ``chi`` is held
    inside."""
    inside: float = Field(default=0.99, gt=0.0, lt=1.0)
    """Part of its bound beyond which ``chi`` is held with ``start_outside: saturate``. Near the bound the feedback
    ``K eps / nabla`` vanishes and the weights pull back, growing with ``1 / (1 - inside)``: at 0.99 they soon ask for
    all that the actuator gives; much closer to 1 they chatter."""


class AdaptivePrescribedPerformance:
    """``tau(t)`` of shi2022: prescribed performance on ``s``, an RBF network for what the model does not know.

    Parameters
    ----------
    parameters
        Gains, performance bound and network.
    ticks_per_second
        Rate of the tick grid [1/s], at which the weights are updated.

    Raises
    ------
    ValueError
        If the weights could not be integrated at this rate.
    """

    Parameters = AdaptivePrescribedPerformanceParameters
    command_size = 3
    state_size = STATES
    label = "τ"
    unit = "N m"

    def __init__(self, parameters: AdaptivePrescribedPerformanceParameters, ticks_per_second: int) -> None:
        self._parameters = parameters
        self._ticks_per_second = ticks_per_second
        decay = parameters.leakage * parameters.adaptation
        if decay >= 2.0 * ticks_per_second:
            raise ValueError(
                f"the weights decay with leakage x adaptation = {decay:g} 1/s, which Euler steps of "
                f"1/{ticks_per_second} s cannot follow: less than {2 * ticks_per_second} 1/s is needed"
            )
        self._centres = vector(parameters.centres)
        self.memory_size = 3 + 3 * self._centres.size
        self._packed = vector(
            [
                parameters.alpha,
                parameters.mu,
                parameters.rho_infinity_rad_s,
                parameters.a1,
                parameters.a2,
                parameters.inside if parameters.start_outside == "saturate" else _NEAREST,
                parameters.gain_nm,
                parameters.kappa,
                1.0 + parameters.beta,
                *parameters.robust_nm,
                math.inf if parameters.limit_nm is None else parameters.limit_nm,
                parameters.leakage,
                parameters.adaptation,
                parameters.width,
                float(parameters.gradient == "rho"),
                float(parameters.adaptation_at == "events"),
            ]
        )

    def initial_memory(self, state: FloatArray) -> FloatArray:
        """Memory before the first sample, shape (memory_size,): the bound fitted to the start, weights zero.

        Parameters
        ----------
        state
            State at tick 0, ``[q_e (4), omega (3)]``.

        Raises
        ------
        ValueError
            If the start has no performance bound that falls, or lies outside it and that is not allowed.
        """
        parameters = self._parameters
        error = state[4:7] + parameters.alpha * state[1:4]
        memory = np.zeros(self.memory_size)
        begins = np.abs(error) if parameters.start == "magnitude" else error
        memory[0:3] = begins + parameters.margin_rad_s
        remedy = "start with a smaller rate on this axis, or with a larger margin_rad_s"
        for axis, s, rho in zip(_AXES, error, memory[0:3], strict=True):
            if rho <= parameters.rho_infinity_rad_s:
                raise ValueError(
                    f"the performance bound about {axis} cannot fall: with s(0) = {s:.6g} rad/s it would begin at "
                    f"rho(0) = s(0) + margin_rad_s = {rho:.6g} rad/s and end at rho_infinity_rad_s = "
                    f"{parameters.rho_infinity_rad_s:g} rad/s; {remedy}"
                )
            if parameters.start_outside == "refuse" and not -parameters.a1 * rho < s < parameters.a2 * rho:
                raise ValueError(
                    f"the start lies outside the performance bound about {axis}: s(0) = {s:.6g} rad/s, and "
                    f"rho(0) = s(0) + margin_rad_s = {rho:.6g} rad/s allows {-parameters.a1 * rho:.6g} to "
                    f"{parameters.a2 * rho:.6g} rad/s (eq. 7), beyond which the law has no value; {remedy}, "
                    "or start_outside: saturate to hold chi just inside"
                )
        return memory

    def fold(self, states: FloatArray, tick: int, memory: FloatArray) -> tuple[FloatArray, FloatArray]:
        """Torque at each sample, and the memory after it.

        Parameters
        ----------
        states
            Contiguous states ``[q_e (4), omega (3)]`` at ``tick, tick + 1, ...``, shape (n, 7).
        tick
            Tick of ``states[0]``.
        memory
            Memory before that sample; it is not changed.

        Returns
        -------
        torques : ndarray, shape (n, 3)
            ``tau`` [N m] in B. Where ``chi`` is outside its bound, that of ``chi`` held just inside.
        memories : ndarray, shape (n, memory_size)
            ``memories[k]`` is what the samples from ``tick + k + 1`` on need.

        Raises
        ------
        ValueError
            If sizes do not fit.
        """
        self._check(states, memory)
        torques, memories = _fold(states, tick, memory, self._centres, self._packed, self._ticks_per_second)
        return torques, memories

    def after_event(self, state: FloatArray, tick: int, memory: FloatArray) -> FloatArray:
        """Memory after a triggering instant: a step of the weights, if they make their steps at events only.

        Parameters
        ----------
        state
            State at the triggering instant, shape (7,), contiguous.
        tick
            Its tick.
        memory
            Memory after the sample of this tick; it is not changed.

        Raises
        ------
        ValueError
            If sizes do not fit.
        """
        if self._parameters.adaptation_at == "samples":
            return memory
        self._check(state[np.newaxis, :], memory)
        result: FloatArray = _after_event(state, tick, memory, self._centres, self._packed, self._ticks_per_second)
        return result

    def watches(self, states: FloatArray, tick: int, memory: FloatArray) -> tuple[Watch, ...]:
        """The performance variable ``chi_i = s_i / rho_i`` at each sample; its bound is that of the law itself.

        It is shown as the part of the bound that is used: ``chi_i / a2``, or ``chi_i / a1`` where it is negative.

        Parameters
        ----------
        states
            Contiguous states at ``tick, tick + 1, ...``, shape (n, 7).
        tick
            Tick of ``states[0]``.
        memory
            Memory before that sample, or any later one of the same run.

        Raises
        ------
        ValueError
            If sizes do not fit.
        """
        self._check(states, memory)
        refuses = self._parameters.start_outside == "refuse"
        return (
            Watch(
                name="performance variable chi",
                unit="",
                values=_used(states, tick, memory, self._packed, self._ticks_per_second),
                axes=_AXES,
                bound=1.0 if refuses else None,
                notice=None if refuses else 1.0,
            ),
        )

    def _check(self, states: FloatArray, memory: FloatArray) -> None:
        # The kernels do not check bounds.
        if states.ndim != 2 or states.shape[1] != STATE_SIZE:
            raise ValueError(f"states of shape {states.shape}: {STATE_SIZE} columns are needed, [q_e (4), omega (3)]")
        if memory.shape != (self.memory_size,):
            raise ValueError(f"a memory of shape {memory.shape}: {self.memory_size} numbers are needed")
