"""The parts of wu2018 as a user writes them, in plain numpy: what they cost beside the compiled ones.

Named in a scenario as ``plain_numpy:Body``; the bench ``inprocess`` does so.
"""

from __future__ import annotations

from typing import Any

import numpy as np
from pydantic import PositiveFloat

from etac_ros.parameters import FloatArray, Parameters
from etac_ros.plants.rigid import RigidBody, RigidBodyParameters


class Body(RigidBody):
    """The rigid body, integrated step by step with matrices."""

    def __init__(self, parameters: RigidBodyParameters, ticks_per_second: int) -> None:
        super().__init__(parameters, ticks_per_second)
        self._inertia = np.array(parameters.inertia_kg_m2).reshape(3, 3)
        self._inverse = np.linalg.inv(self._inertia)
        self._disturbance = parameters.disturbance
        self._step = 1.0 / ticks_per_second

    def _rate(self, t: float, state: FloatArray, torque: FloatArray) -> FloatArray:
        q, omega, d = state[:4], state[4:], self._disturbance
        angle = d.frequency_rad_s * t
        sines = np.array(d.sine_nm) * np.sin(angle) + np.array(d.cosine_nm) * np.cos(angle)
        total = torque + np.array(d.constant_nm) + sines - np.cross(omega, self._inertia @ omega)
        turning = 0.5 * (q[0] * omega + np.cross(q[1:], omega))
        return np.concatenate([[-0.5 * (q[1:] @ omega)], turning, self._inverse @ total])

    def propagate(self, state: FloatArray, tick: int, count: int, held: FloatArray) -> FloatArray:
        """States at ``tick + 1 .. tick + count``."""
        states, h = np.empty((count, state.size)), self._step
        for i in range(count):
            t = (tick + i) * h
            k1 = self._rate(t, state, held)
            k2 = self._rate(t + h / 2.0, state + h / 2.0 * k1, held)
            k3 = self._rate(t + h / 2.0, state + h / 2.0 * k2, held)
            k4 = self._rate(t + h, state + h * k3, held)
            state = state + h / 6.0 * (k1 + 2.0 * k2 + 2.0 * k3 + k4)
            state[:4] /= np.linalg.norm(state[:4])
            states[i] = state
        return states


class SignalParameters(Parameters):
    """Parameters of :class:`Signal`."""

    beta: PositiveFloat


class Signal:
    """``omega + beta q_v``."""

    Parameters = SignalParameters
    size = 3
    label = "s"

    def __init__(self, parameters: SignalParameters, ticks_per_second: int) -> None:
        self._beta = parameters.beta

    def evaluate(self, states: FloatArray) -> FloatArray:
        """Of each state."""
        return states[:, 4:7] + self._beta * states[:, 1:4]


class RuleParameters(Parameters):
    """Parameters of :class:`Rule`."""

    alpha: PositiveFloat
    gamma: PositiveFloat


class Rule:
    """``|s(t_i) - s| >= alpha |s| + gamma``."""

    Parameters = RuleParameters

    def __init__(self, parameters: RuleParameters, ticks_per_second: int) -> None:
        self._alpha, self._gamma = parameters.alpha, parameters.gamma

    def margin(self, signals: FloatArray, tick: int, held: FloatArray) -> tuple[FloatArray, FloatArray]:
        """Error and threshold."""
        threshold = self._alpha * np.linalg.norm(signals, axis=1) + self._gamma
        return np.linalg.norm(held - signals, axis=1), threshold

    def first(self, signals: FloatArray, tick: int, held: FloatArray, held_tick: int | None = None) -> int:
        """Index of the first sample that fires, or -1."""
        errors, thresholds = self.margin(signals, tick, held)
        fires = errors >= thresholds
        return int(np.argmax(fires)) if fires.any() else -1


class LawParameters(Parameters):
    """Parameters of :class:`Law`."""

    k: PositiveFloat


class Law:
    """``u = -k s``."""

    Parameters = LawParameters
    signal_size = command_size = 3

    def __init__(self, parameters: LawParameters, ticks_per_second: int) -> None:
        self._k = parameters.k

    def command(self, signal: FloatArray) -> Any:
        """The torque [N m]."""
        return -self._k * signal
