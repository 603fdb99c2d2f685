"""The plant simulator: committed state, held inputs, and windows of samples computed ahead."""

from __future__ import annotations

import numpy as np

from etac_ros.graph.held import HeldInputs
from etac_ros.graph.module import Arrivals, Context, Module, Outputs, Window
from etac_ros.graph.promises import Component
from etac_ros.maths.finite import all_finite
from etac_ros.maths.rk4 import Stop
from etac_ros.maths.ticks import seconds
from etac_ros.parameters import FloatArray, Parameters
from etac_ros.plants.plant import Plant, watches_of
from etac_ros.plants.watch import Watch, rows_left, words


class PlantModuleParameters(Parameters):
    """A plant module has no parameters beside its dynamics'."""


class PlantModule(Module):
    """Simulates one plant. The only module that offers windows instead of looking at them.

    Parameters
    ----------
    context
        Name and grid.
    parameters
        None: they are the dynamics'.
    dynamics
        The plant.
    """

    Parameters = PlantModuleParameters
    components = ("dynamics",)

    def __init__(self, context: Context, parameters: PlantModuleParameters, dynamics: Plant) -> None:
        super().__init__(context)
        plant = self.plant = dynamics
        self.inputs = dict(plant.inputs)
        self._inputs = HeldInputs(plant.inputs, context.incoming)
        self.held: FloatArray = self._inputs.total()
        self._component = Component(context.name, plant)
        self._watches = hasattr(plant, "watches")
        size = len(plant.labels)
        self.state = self._component.vector(size, "initial_state")
        self.tick = 0
        self._epoch = 0
        self._window: Window | None = None

    def receive(self, tick: int | None, arrivals: Arrivals, sample: FloatArray | None) -> Outputs:
        """Hold new inputs, a zero-order hold for each link; they act from this tick on."""
        self.held = self._inputs.take(arrivals)
        return {}

    def commit(self, tick: int) -> tuple[int, FloatArray]:
        """Make the samples up to ``tick`` final.

        Returns
        -------
        int, ndarray
            Tick of the first newly committed sample, and the samples, shape (n, states).
        """
        window = self._window
        if window is None or tick < window.start:
            return tick + 1, np.empty((0, self.state.size))
        _, _, start, samples = window
        count = tick - start + 1
        fresh = samples if count == len(samples) else samples[:count]
        if not self.halt:
            self.halt = self.left_bounds(start, fresh)
        self.state = fresh[-1].copy()
        self.tick = tick
        self._window = None
        return start, fresh

    @property
    def can_stop(self) -> bool:
        """Whether a window may end before it was asked to.

        Not of a plant that changes how it propagates, and inherits how it does so until it is to stop.
        """
        if "propagate" in vars(self.plant):
            return False
        for kind in type(self.plant).__mro__:
            if "propagate_until" in vars(kind):
                return True
            if "propagate" in vars(kind):
                return False
        return False

    @property
    def watching(self) -> bool:
        """Whether the plant watches anything."""
        return self._watches

    def watches(self, window: Window) -> tuple[Watch, ...]:
        """What the plant watches."""
        return watches_of(self.plant, window.samples)

    def left_bounds(self, start: int, samples: FloatArray) -> str:
        """Why the run has to end: only committed samples count, never the uncommitted tail of a window."""
        if samples.size and not all_finite(samples[-1]):  # what is no number stays so
            row = int(np.argmin(np.isfinite(samples).all(axis=1)))
            at = seconds(start + row, self.context.ticks_per_second)
            return f"the state is no number from {at:.6g} s (tick {start + row}) on; held inputs {self.held.tolist()}"
        if not self._watches:
            return ""
        watches = self._component.call("watches", samples)
        rows = rows_left(watches)
        if not rows.size:
            return ""
        row = int(rows[0])
        return words(watches, row, start + row, self.context.ticks_per_second, samples[row])

    def open(self, length: int, stop: Stop | None = None) -> Window:
        """Compute samples that follow the committed state; the first window starts with tick 0 itself.

        Parameters
        ----------
        length
            How many.
        stop
            Where there may be fewer: the last is the first at which it holds. Of a plant that :attr:`can_stop`.
        """
        start = self.tick + 1
        if self._epoch == 0:
            start = 0
            following = [self._propagated(0, length - 1)] if length > 1 else []
            samples = np.concatenate([self.state[np.newaxis, :], *following])
        else:
            samples = self._propagated(self.tick, length, stop)
        self._epoch += 1
        self._window = Window(self.context.name, self._epoch, start, samples)
        return self._window

    def _propagated(self, tick: int, count: int, stop: Stop | None = None) -> FloatArray:
        # Arrays of its own: a plant that works in place changes nobody's state.
        arguments = (self.state.copy(), tick, count, self.held.copy())
        if stop is None:
            return self._component.rows(count, self.state.size, "propagate", *arguments)
        found = self._component.call("propagate_until", stop, *arguments)
        rows = len(found) if isinstance(found, np.ndarray) and found.ndim and 0 < len(found) < count else count
        return self._component.array((rows, self.state.size), "propagate_until", found)
