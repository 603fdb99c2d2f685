"""Classes that each break one promise, for the tests that say what is said then."""

from __future__ import annotations

from typing import Any

import numpy as np

from etac_ros.graph.module import Arrivals, Context, Module, Outputs, Window
from etac_ros.graph.role import Acts, Role
from etac_ros.laws.wu2018 import FilteredError, Proportional
from etac_ros.parameters import FloatArray, Parameters
from etac_ros.plants.rigid import RigidBody
from etac_ros.triggers.relative import RelativeThreshold


class Law(Proportional):
    """Returns what its parameter says."""

    class Parameters(Parameters):
        returns: str = "fine"

    def __init__(self, parameters: Law.Parameters, ticks_per_second: int) -> None:
        self._returns = parameters.returns

    def command(self, signal: FloatArray) -> Any:
        return {
            "fine": lambda: -2.0 * signal,
            "scalar": lambda: float(signal[0]),
            "wide": lambda: np.zeros(4),
            "nothing": lambda: None,
            "list": lambda: [0.0, 0.0, 0.0],
            "nan": lambda: signal * np.nan,
            "complex": lambda: signal * 1j,
            "huge": lambda: np.full(3, 1e300),
            "raises": lambda: self._divide(0),
            "exits": lambda: exit(0),
        }[self._returns]()

    def _divide(self, zero: int) -> float:
        return 1 / zero


class Rule(RelativeThreshold):
    """Returns what its parameter says, from tick 20 on."""

    class Parameters(Parameters):
        returns: str

    def __init__(self, parameters: Rule.Parameters, ticks_per_second: int) -> None:
        super().__init__(RelativeThreshold.Parameters(alpha=0.5, gamma=1e-6), ticks_per_second)
        self._returns = parameters.returns

    def first(self, signals: FloatArray, tick: int, held: FloatArray, held_tick: int | None = None) -> Any:
        if tick < 20:
            return super().first(signals, tick, held, held_tick)
        return {"nothing": None, "true": True, "float": 0.0, "beyond": len(signals), "negative": -2}[self._returns]


class Signal(FilteredError):
    """Is no number where the body turns fast, or has another width."""

    def evaluate(self, states: FloatArray) -> FloatArray:
        with np.errstate(invalid="ignore"):
            return super().evaluate(states) + np.sqrt(0.05 - np.abs(states[:, 4:5])) * 0.0


class WideSignal(FilteredError):
    def evaluate(self, states: FloatArray) -> FloatArray:
        return states[:, :4].copy()


class Plant(RigidBody):
    """Propagates too few samples."""

    def propagate(self, state: FloatArray, tick: int, count: int, held: FloatArray) -> FloatArray:
        return super().propagate(state, tick, count, held)[:-1]


class InitRaises(Proportional):
    def __init__(self, parameters: Any, ticks_per_second: int) -> None:
        super().__init__(parameters, ticks_per_second)
        {}["gain"]


class InitGetsValueError(Proportional):
    def __init__(self, parameters: Any, ticks_per_second: int) -> None:
        np.zeros(3).reshape(2, 2)


class AsksForMore(Proportional):
    def command(self, signal: FloatArray, temperature: float) -> FloatArray:
        return signal


class Answering(Module):
    """An actuator whose answer is what its parameter says."""

    class Parameters(Parameters):
        says: str

    role = Role(Acts.AT_ONCE)

    def __init__(self, context: Context, parameters: Answering.Parameters) -> None:
        super().__init__(context)
        self.inputs, self.outputs = {"command": 3}, {"torque": 3}
        self._says = parameters.says

    def receive(self, tick: int | None, arrivals: Arrivals, sample: FloatArray | None) -> Any:
        value = arrivals[-1].value
        return {
            "misspelt": {"torqe": value},
            "nothing": {},
            "none": None,
            "array": value,
            "narrow": {"torque": value[:2]},
            "nan": {"torque": value / 0.0 * 0.0},
        }[self._says]


class Acting(Module):
    """A sensor whose next own act is what its parameter says."""

    class Parameters(Parameters):
        scan: str

    role = Role(triggers="signal")

    def __init__(self, context: Context, parameters: Acting.Parameters) -> None:
        super().__init__(context)
        self.outputs = {"signal": 3}
        self._scan = parameters.scan

    def scan(self, window: Window | None, after: int) -> Any:
        assert window is not None
        if after < 5:
            return after + 1
        return {"after": after, "before": after - 3, "true": True, "float": after + 1.0, "beyond": window.last + 1}[
            self._scan
        ]

    def fire(self, tick: int, sample: FloatArray | None) -> Outputs:
        return {"signal": np.ones(3)}


class Unrounded(Answering):
    """Sends numbers that do not fit into float32."""

    def receive(self, tick: int | None, arrivals: Arrivals, sample: FloatArray | None) -> Outputs:
        return {"torque": arrivals[-1].value * (1.0 / 3.0)}


class OldFlags:
    """Made by :func:`old`, since the class statement itself is refused."""


def old() -> type:
    return type("Old", (Module,), {"answers": True})


class NoSuper(Module):
    def __init__(self, context: Context, parameters: Parameters) -> None:
        pass


class OddSize(Module):
    def __init__(self, context: Context, parameters: Parameters) -> None:
        super().__init__(context)
        self.inputs, self.outputs = {"command": 3}, {"torque": 3.0}  # type: ignore[dict-item]


class WrongPort(Answering):
    role = Role(Acts.ON_ARRIVAL, triggers="torqe")


# --- For etac check. ---


class Forgetful(RigidBody):
    """A plant with a hidden state: its torque wears off with every call."""

    _calls = 0

    def propagate(self, state: FloatArray, tick: int, count: int, held: FloatArray) -> FloatArray:
        self._calls += 1
        return super().propagate(state, tick, count, held * 0.999**self._calls)


class Matrix(FilteredError):
    """A signal by a matrix product, whose last bit depends on the number of rows."""

    def evaluate(self, states: FloatArray) -> FloatArray:
        gains = np.array([[0.0, 0.5, 0.1, 0.3, 1.0, 0.7, 0.2], [0.1] * 7, [0.3, 0.2, 0.7, 0.5, 0.9, 1.1, 0.6]])
        return np.ascontiguousarray(states @ gains.T)


class InPlace(FilteredError):
    def evaluate(self, states: FloatArray) -> FloatArray:
        states[:, 4:] *= 1.0 + 1e-12
        return super().evaluate(states)


class Counting(RelativeThreshold):
    """A rule that fires at every third time that it is asked."""

    _calls = 0

    def first(self, signals: FloatArray, tick: int, held: FloatArray, held_tick: int | None = None) -> int:
        self._calls += 1
        return 0 if self._calls % 3 == 0 else -1


class Restless(Acting):
    """A module whose memory changes when it only looks."""

    _looked = 0

    def scan(self, window: Window | None, after: int) -> int | None:
        assert window is not None
        self._looked += 1
        due = after + 1 + self._looked % 4
        return due if due <= window.last else None
