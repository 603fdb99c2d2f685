"""A whole experiment with a plant of one's own: a motor that follows a voltage, in its own scenario servo.yaml.

$ python servo.py
"""

from __future__ import annotations

import numpy as np
from pydantic import PositiveFloat

from etac_ros.maths.compiled import inlined
from etac_ros.maths.rk4 import propagator
from etac_ros.parameters import FloatArray, Parameters


@inlined
def _derivative(t, state, voltage, parameters, rate):  # type: ignore[no-untyped-def]
    rate[0] = state[1]
    rate[1] = (parameters[0] * voltage[0] - state[1]) / parameters[1]


@inlined
def _project(state):  # type: ignore[no-untyped-def]
    """Nothing to normalise, as a quaternion would have."""


class ServoParameters(Parameters):
    """Parameters of :class:`Servo`."""

    gain_rad_sv: PositiveFloat = 10.0
    time_constant_s: PositiveFloat = 0.1
    start_rad: float = 0.8


class Servo:
    """A direct-current motor: ``angle' = speed``, ``T speed' = K voltage - speed``.

    Parameters
    ----------
    parameters
        ``K`` is ``gain_rad_sv`` [rad/s/V], ``T`` is ``time_constant_s``.
    ticks_per_second
        The grid on which samples are computed.
    """

    Parameters = ServoParameters
    labels = ("angle [rad]", "speed [rad/s]")
    inputs = {"voltage": 1}
    _propagate = staticmethod(propagator(_derivative, _project))

    def __init__(self, parameters: ServoParameters, ticks_per_second: int) -> None:
        self._packed = np.array([parameters.gain_rad_sv, parameters.time_constant_s])
        self._start = np.array([parameters.start_rad, 0.0])
        self._ticks_per_second = ticks_per_second

    def initial_state(self) -> FloatArray:
        """Angle and speed at the start."""
        return self._start.copy()

    def propagate(self, state: FloatArray, tick: int, count: int, held: FloatArray) -> FloatArray:
        """The samples of the ``count`` ticks after ``tick``, under a voltage that is held."""
        states: FloatArray = self._propagate(state, tick, count, held, self._packed, self._ticks_per_second, 1)
        return states


class State:
    """The signal that is watched and sent: angle and speed as they are."""

    Parameters = Parameters
    size = 2
    label = "x"

    def __init__(self, parameters: Parameters, ticks_per_second: int) -> None:
        pass

    def evaluate(self, states: FloatArray) -> FloatArray:
        """The signal of each sample, a row a sample."""
        return states.copy()


class StateFeedback:
    """voltage = -stiffness angle - damping speed."""

    class Parameters(Parameters):
        """Volts a radian, and volt seconds a radian."""

        stiffness: PositiveFloat = 2.0
        damping: PositiveFloat = 0.05

    signal_size = 2
    command_size = 1

    def __init__(self, parameters: Parameters, ticks_per_second: int) -> None:
        self._gains = np.array([parameters.stiffness, parameters.damping])

    def command(self, signal: FloatArray) -> FloatArray:
        """The voltage for an angle and a speed."""
        return np.array([-float(np.sum(self._gains * signal))])


def experiment() -> None:
    """Run it with thresholds that are tighter and tighter, and beside them the time-triggered loop."""
    from etac_ros.runs import load, run_in_process

    print(f"{'trigger':16}  {'messages':>8}  {'bytes':>6}  {'angle at the end [rad]':>22}")
    runs = [(f"alpha = {alpha}", None, [f"sensor.trigger.alpha={alpha}"]) for alpha in (0.05, 0.1, 0.3)]
    for name, variant, overrides in [*runs, ("every 0.02 s", "periodic", [])]:
        summary = run_in_process(load("servo.yaml", variant, overrides)).summary
        network, angle = summary.network, summary.final_state["/servo"][0]
        print(f"{name:16}  {network.messages:8}  {network.payload_bytes:6}  {angle:22.2e}")


if __name__ == "__main__":
    experiment()
