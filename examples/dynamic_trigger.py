"""A whole experiment with a trigger rule of one's own, one with memory: dynamic against static triggering.

$ python dynamic_trigger.py
"""

from __future__ import annotations

from typing import Annotated

import numpy as np
from numpy.typing import NDArray
from pydantic import Field

from etac_ros.parameters import FloatArray, Parameters


class DynamicThreshold:
    """Fires when ``eta + theta (alpha |s| + gamma - |s(t_i) - s|) < 0``, where ``eta`` is a reserve that was saved up.

    ``eta' = -decay eta + (alpha |s| + gamma - |s(t_i) - s|)``, ``eta(0) = 0``, after A. Girard, "Dynamic triggering
    mechanisms for event-triggered control", IEEE TAC 60 (2015). Without ``eta`` it is the static rule of wu2018.

    Parameters
    ----------
    parameters
        ``alpha``, ``gamma`` as in the static rule; ``decay`` [1/s] of the reserve; ``theta`` [s].
    ticks_per_second
        The grid on which the reserve is folded.
    """

    class Parameters(Parameters):
        """Validated by pydantic: a scenario with an alpha of 1.5 is refused before anything starts."""

        alpha: Annotated[float, Field(gt=0.0, lt=1.0)] = 0.5
        gamma: Annotated[float, Field(gt=0.0)] = 1e-6
        decay: Annotated[float, Field(gt=0.0)] = 0.1
        theta: Annotated[float, Field(ge=0.0)] = 1.0

    def __init__(self, parameters: Parameters, ticks_per_second: int) -> None:
        self._p = parameters
        self._step = 1.0 / ticks_per_second

    def initial_memory(self) -> FloatArray:
        """The reserve at the start: none."""
        return np.zeros(1)

    def fold(
        self, signals: FloatArray, tick: int, held: FloatArray, held_tick: int, memory: FloatArray
    ) -> tuple[NDArray[np.bool_], FloatArray]:
        """Whether each sample fires, and the memory after it. Pure: asked again about samples that come to nothing."""
        fires, memories = np.zeros(len(signals), dtype=np.bool_), np.empty((len(signals), 1))
        eta = memory[0]
        for i, (error, threshold) in enumerate(zip(*self._both(signals, held), strict=True)):
            fires[i] = eta + self._p.theta * (threshold - error) < 0.0
            eta = max(0.0, eta + self._step * (threshold - error - self._p.decay * eta))
            memories[i] = eta
        return fires, memories

    def margin(self, signals: FloatArray, tick: int, held: FloatArray) -> tuple[FloatArray, FloatArray]:
        """What reports draw: error and threshold of each sample."""
        return self._both(signals, held)

    def _both(self, signals: FloatArray, held: FloatArray) -> tuple[FloatArray, FloatArray]:
        errors: FloatArray = np.linalg.norm(held - signals, axis=1)
        thresholds: FloatArray = self._p.alpha * np.linalg.norm(signals, axis=1) + self._p.gamma
        return errors, thresholds


def experiment() -> None:
    """Run the spacecraft of wu2018 with the paper's static rule and with reserves that last longer and longer."""
    from etac_ros.runs import load, run_in_process

    rules = {"static (the paper)": []} | {
        f"dynamic, decay {decay:g}/s": [f"sensor.trigger={{class: 'dynamic_trigger:DynamicThreshold', decay: {decay}}}"]
        for decay in (10.0, 1.0, 0.1)
    }
    print(f"{'rule':20}  {'triggers':>8}  {'longest interval [s]':>20}  {'steady error [deg]':>18}")
    for name, overrides in rules.items():
        summary = run_in_process(load("wu2018", None, overrides)).summary
        error = summary.performance["/plant"].max_attitude_error_deg
        print(f"{name:20}  {summary.value('triggers'):8g}  {summary.value('max_interval_s'):20.2f}  {error:18.4f}")


if __name__ == "__main__":
    experiment()
