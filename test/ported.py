"""Classes as a researcher brings them along: small plants, laws and rules, none of which knows etac_ros from inside."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray
from pydantic import PositiveFloat, PositiveInt

from etac_ros.graph.module import Arrivals, Context, Module, Outputs, Window
from etac_ros.laws.law import TickArray
from etac_ros.maths.compiled import inlined
from etac_ros.maths.rk4 import propagator
from etac_ros.maths.ticks import seconds
from etac_ros.parameters import FloatArray, Parameters

# --- A DC servo: angle and speed, one voltage. ---


@inlined
def _servo(t, state, voltage, parameters, rate):  # type: ignore[no-untyped-def]
    rate[0] = state[1]
    rate[1] = (parameters[0] * voltage[0] - state[1]) / parameters[1]


@inlined
def _nothing(state):  # type: ignore[no-untyped-def]
    pass


class ServoParameters(Parameters):
    gain_rad_sv: PositiveFloat = 10.0
    time_constant_s: PositiveFloat = 0.1


class Servo:
    """Two states, compiled, no attitude."""

    Parameters = ServoParameters
    labels = ("angle [rad]", "speed [rad/s]")
    inputs = {"voltage": 1}
    _propagate = staticmethod(propagator(_servo, _nothing))

    def __init__(self, parameters: ServoParameters, ticks_per_second: int) -> None:
        self._packed = np.array([parameters.gain_rad_sv, parameters.time_constant_s])
        self._ticks_per_second = ticks_per_second

    def initial_state(self) -> FloatArray:
        return np.array([0.8, 0.0])

    def propagate(self, state: FloatArray, tick: int, count: int, held: FloatArray) -> FloatArray:
        states: FloatArray = self._propagate(state, tick, count, held, self._packed, self._ticks_per_second, 1)
        return states


class Reference(Parameters):
    amplitude_rad: PositiveFloat = 1.0
    half_period_s: PositiveFloat = 1.0
    stiffness: PositiveFloat = 2.0
    damping: PositiveFloat = 0.05


class TrackingError:
    """Watches (e, omega) against a reference that jumps, and sends the voltage: three classes in one."""

    Parameters = Reference
    size = 2
    sent_size = 1
    label = "[e, omega]"

    def __init__(self, parameters: Reference, ticks_per_second: int) -> None:
        self._p = parameters
        self._ticks_per_second = ticks_per_second

    def evaluate(self, states: FloatArray, ticks: TickArray) -> FloatArray:
        halves = np.floor(seconds(ticks, self._ticks_per_second) / self._p.half_period_s)
        wanted = self._p.amplitude_rad * np.where(halves % 2 == 0, 1.0, -1.0)
        return np.stack([states[:, 0] - wanted, states[:, 1]], axis=1)

    def sent(self, states: FloatArray, ticks: TickArray) -> FloatArray:
        watched = self.evaluate(states, ticks)
        return -self._p.stiffness * watched[:, :1] - self._p.damping * watched[:, 1:]


class State:
    """The whole state, as it is."""

    class Parameters(Parameters):
        size: PositiveInt = 2

    label = "x"

    def __init__(self, parameters: State.Parameters, ticks_per_second: int) -> None:
        self.size = parameters.size

    def evaluate(self, states: FloatArray) -> FloatArray:
        return states[:, : self.size].copy()


class ServoPd:
    """A law that counts its messages: the gain rises with each, and the reference moves with the tick."""

    class Parameters(Parameters):
        stiffness: PositiveFloat = 1.0

    signal_size = 2
    command_size = 1

    def __init__(self, parameters: ServoPd.Parameters, ticks_per_second: int) -> None:
        self._stiffness = parameters.stiffness
        self._messages = 0

    def command(self, signal: FloatArray, tick: int) -> FloatArray:
        self._messages += 1
        wanted = np.sin(0.01 * tick)
        return -self._stiffness * (1.0 + 0.01 * self._messages) * (signal[:1] - wanted) - 0.05 * signal[1:]


# --- Rules: with memory, self-triggered, against a model. ---


class DynamicParameters(Parameters):
    sigma: PositiveFloat = 0.1
    decay_1_s: PositiveFloat = 1.0
    theta: PositiveFloat = 0.5


class Dynamic:
    """Dynamic triggering: fires where ``eta + theta (sigma |x|^2 - |e|^2) < 0``; ``eta' = -decay eta + ...``."""

    Parameters = DynamicParameters

    def __init__(self, parameters: DynamicParameters, ticks_per_second: int) -> None:
        self._p = parameters
        self._step = 1.0 / ticks_per_second

    def initial_memory(self) -> FloatArray:
        return np.array([0.05])

    def fold(
        self, signals: FloatArray, tick: int, held: FloatArray, held_tick: int, memory: FloatArray
    ) -> tuple[NDArray[np.bool_], FloatArray]:
        fires, memories = np.zeros(len(signals), dtype=np.bool_), np.empty((len(signals), 1))
        eta = memory[0]
        for i, x in enumerate(signals):
            error = x - held
            reserve = self._p.sigma * np.dot(x, x) - np.dot(error, error)
            fires[i] = eta + self._p.theta * reserve < 0.0
            eta = eta + self._step * (-self._p.decay_1_s * eta + reserve)
            memories[i] = eta
        return fires, memories

    def margin(self, signals: FloatArray, tick: int, held: FloatArray) -> None:
        return None


class SelfTriggered:
    """Knows at an instant when the next one is: the smaller what was sent, the later."""

    class Parameters(Parameters):
        longest_ticks: PositiveInt = 30

    def __init__(self, parameters: SelfTriggered.Parameters, ticks_per_second: int) -> None:
        self._longest = parameters.longest_ticks

    def first(self, signals: FloatArray, tick: int, held: FloatArray, held_tick: int | None = None) -> int:
        assert held_tick is not None
        due = held_tick + max(2, int(self._longest * np.exp(-float(np.abs(held).max())))) - tick
        return due if 0 <= due < len(signals) else -1

    def margin(self, signals: FloatArray, tick: int, held: FloatArray) -> None:
        return None


class ModelError:
    """Fires where the state has left what a model predicts from the last-sent one."""

    class Parameters(Parameters):
        bound: PositiveFloat = 0.05
        decay: PositiveFloat = 0.95

    def __init__(self, parameters: ModelError.Parameters, ticks_per_second: int) -> None:
        self._p = parameters

    def first(self, signals: FloatArray, tick: int, held: FloatArray, held_tick: int | None = None) -> int:
        assert held_tick is not None
        ages = tick - held_tick + np.arange(len(signals))
        predicted = held * np.power(self._p.decay, ages)[:, np.newaxis]
        hits = np.flatnonzero(np.abs(signals - predicted).max(axis=1) >= self._p.bound)
        return int(hits[0]) if hits.size else -1

    def margin(self, signals: FloatArray, tick: int, held: FloatArray) -> None:
        return None


class ModelHoldParameters(Parameters):
    gain: PositiveFloat = 1.0
    decay: PositiveFloat = 0.95


class ModelHold(Module):
    """A model-based hold: between messages it goes on with the model's state, so it acts at every tick."""

    Parameters = ModelHoldParameters

    def __init__(self, context: Context, parameters: ModelHoldParameters) -> None:
        super().__init__(context)
        self.inputs = {"state": 2}
        self.outputs = {"voltage": 1}
        self._p = parameters
        self._state = np.zeros(2)
        self._tick = 0

    def scan(self, window: Window | None, after: int) -> int | None:
        return after + 1

    def fire(self, tick: int, sample: FloatArray | None) -> Outputs:
        return self._voltage(tick)

    def receive(self, tick: int | None, arrivals: Arrivals, sample: FloatArray | None) -> Outputs:
        assert tick is not None
        self._state, self._tick = arrivals[-1].value, tick
        return self._voltage(tick)

    def _voltage(self, tick: int) -> Outputs:
        predicted = self._state * self._p.decay ** (tick - self._tick)
        return {"voltage": -self._p.gain * (predicted[:1] - 1.0)}


# --- Wheels. ---


class FourWheels:
    """A law of three axes for a pyramid of four wheels: one torque a wheel."""

    class Parameters(Parameters):
        k: PositiveFloat

    signal_size = 3
    command_size = 4

    def __init__(self, parameters: FourWheels.Parameters, ticks_per_second: int) -> None:
        self._k = parameters.k
        axes = np.array([[1.0, 0.0, -1.0, 0.0], [0.0, 1.0, 0.0, -1.0], [1.0, 1.0, 1.0, 1.0]]) / np.sqrt(2.0)
        self._allocation = np.linalg.pinv(axes)

    def command(self, signal: FloatArray) -> FloatArray:
        return np.einsum("ij,j->i", self._allocation, -self._k * signal)


# --- Vehicles that share one plant, as wagons on a track do. ---


class TrackParameters(Parameters):
    vehicles: PositiveInt
    stiffness: PositiveFloat = 4.0


class Track:
    """Carts in a row, coupled by springs to their neighbours and to both ends: ``[positions, speeds]``."""

    Parameters = TrackParameters

    def __init__(self, parameters: TrackParameters, ticks_per_second: int) -> None:
        n = self._n = parameters.vehicles
        self._stiffness, self._step = parameters.stiffness, 1.0 / ticks_per_second
        names = range(1, n + 1)
        self.labels = (*(f"x{i} [m]" for i in names), *(f"v{i} [m/s]" for i in names))
        self.inputs = {f"force{i}": 1 for i in names}

    def initial_state(self) -> FloatArray:
        return np.concatenate([np.linspace(-0.5, 1.0, self._n), np.zeros(self._n)])

    def propagate(self, state: FloatArray, tick: int, count: int, held: FloatArray) -> FloatArray:
        states = np.empty((count, state.size))
        x, v = state[: self._n].copy(), state[self._n :].copy()
        for i in range(count):
            around = np.concatenate([[0.0], x, [0.0]])
            v = v + self._step * (held + self._stiffness * (around[2:] - 2.0 * x + around[:-2]))
            x = x + self._step * v
            states[i] = np.concatenate([x, v])
        return states


class OneVehicle:
    """Position and speed of one vehicle of the plant."""

    class Parameters(Parameters):
        number: PositiveInt
        vehicles: PositiveInt

    size = 2
    label = "[x, v]"

    def __init__(self, parameters: OneVehicle.Parameters, ticks_per_second: int) -> None:
        self._columns = [parameters.number - 1, parameters.vehicles + parameters.number - 1]

    def evaluate(self, states: FloatArray) -> FloatArray:
        return np.ascontiguousarray(states[:, self._columns])


class Brake:
    class Parameters(Parameters):
        gain: PositiveFloat = 1.0

    signal_size = 2
    command_size = 1

    def __init__(self, parameters: Brake.Parameters, ticks_per_second: int) -> None:
        self._gain = parameters.gain

    def command(self, signal: FloatArray) -> FloatArray:
        return -self._gain * (signal[:1] + 2.0 * signal[1:])


class Distance:
    class Parameters(Parameters):
        bound: PositiveFloat = 0.1

    def __init__(self, parameters: Distance.Parameters, ticks_per_second: int) -> None:
        self._bound = parameters.bound

    def first(self, signals: FloatArray, tick: int, held: FloatArray, held_tick: int | None = None) -> int:
        hits = np.flatnonzero(np.abs(signals - held).max(axis=1) >= self._bound)
        return int(hits[0]) if hits.size else -1

    def margin(self, signals: FloatArray, tick: int, held: FloatArray) -> tuple[FloatArray, FloatArray]:
        return np.abs(signals - held).max(axis=1), np.full(len(signals), self._bound)
