"""Fixed-step Runge-Kutta of fourth order on the tick grid: the same bits whatever the windows were."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any, NamedTuple

import numpy as np

from etac_ros.maths.compiled import inlined, kernel
from etac_ros.maths.scratch import scratch, scratch_matrix
from etac_ros.parameters import FloatArray


class Criterion(NamedTuple):
    """When to stop computing ahead. It is compiled together with a plant."""

    form: Callable[..., Any]
    """``form(state, parameters, out)``: writes what is watched of a state into ``out``."""
    size: int
    """Components of what is watched."""
    holds: Callable[..., Any]
    """``holds(watched, row, compared, parameters)``: whether to stop; what is watched is a row of a matrix."""
    first: int
    """Where the parameters of ``holds`` begin; those of ``form`` stand before them."""


class Stop(NamedTuple):
    """Where to stop computing ahead: behind the first state at which somebody would act.

    It says how far, and nothing else: whoever would act decides by itself, on the samples that it is shown.
    """

    criterion: Criterion
    parameters: FloatArray
    compared: FloatArray
    """What is watched is compared with this: it changes from one window to the next, and costs no compilation."""


@inlined
def _time_itself(t, parameters):  # type: ignore[no-untyped-def]
    return t


@inlined
def _form_nothing(state, parameters, out):  # type: ignore[no-untyped-def]
    pass


@inlined
def _never(watched, row, compared, parameters):  # type: ignore[no-untyped-def]
    return False


_ON = Criterion(_form_nothing, 1, _never, 0)


class Propagator:
    """The propagation of one kind of plant over a number of ticks under a held input, compiled when it is first called.

    Parameters
    ----------
    derivative
        ``derivative(t, state, held, parameters, rate)``: writes the time derivative of the state into ``rate``. With
        a ``drive``, what that returned stands in the place of ``t``.
    project
        ``project(state)``: called once after each tick, in place: normalises a quaternion, switches a shadow set.
        Once a tick and never at a window's end, so that it does not depend on windows.
    drive
        ``drive(t, parameters)``: what the derivative needs of the time ``t`` [s], a number or a tuple of numbers. A
        step has two new instants and four derivatives, so costly functions of time belong here.
    """

    def __init__(self, derivative: Callable[..., Any], project: Callable[..., Any], drive: Callable[..., Any]) -> None:
        self._parts = (derivative, project, drive)
        self.name = "propagate." + ".".join(map(_name, self._parts))
        self._plain: dict[tuple[int, ...], Callable[..., Any]] = {}
        self._stopping: dict[tuple[int, int, int, int, Criterion], Callable[..., Any]] = {}

    def __call__(
        self,
        state: FloatArray,
        tick: int,
        count: int,
        held: FloatArray,
        parameters: FloatArray,
        ticks_per_second: int,
        substeps: int,
    ) -> FloatArray:
        """Compute the states at ``tick + 1 .. tick + count``, shape (count, n), under a constant input ``held``."""
        key = (state.size, held.size, len(parameters))
        compiled = self._plain.get(key)
        if compiled is None:
            sizes = _sizes(state, held, parameters, held, held)
            compiled = self._plain[key] = _compiled(self.name, self._parts, _ON, sizes)
        states: FloatArray = compiled(state, tick, count, held, parameters, ticks_per_second, substeps, held, held)
        return states

    def until(
        self,
        stop: Stop,
        state: FloatArray,
        tick: int,
        count: int,
        held: FloatArray,
        parameters: FloatArray,
        ticks_per_second: int,
        substeps: int,
    ) -> FloatArray:
        """As a call, but no further than the first state at which to stop."""
        criterion, watching, compared = stop
        key = (state.size, held.size, len(parameters), watching.size, criterion)
        compiled = self._stopping.get(key)
        if compiled is None:
            sizes = _sizes(state, held, parameters, watching, compared)
            compiled = self._stopping[key] = _compiled(self.name, self._parts, criterion, sizes)
        states: FloatArray = compiled(
            state, tick, count, held, parameters, ticks_per_second, substeps, watching, compared
        )
        # Of its own memory alone: what was not computed is not kept.
        return states if len(states) == count else states.copy()


def propagator(
    derivative: Callable[..., Any], project: Callable[..., Any], drive: Callable[..., Any] = _time_itself
) -> Propagator:
    """Compile the propagation of one kind of plant: see :class:`Propagator`.

    Returns
    -------
    callable
        ``propagate(state, tick, count, held, parameters, ticks_per_second, substeps)``.
    """
    return Propagator(derivative, project, drive)


def _name(function: Callable[..., Any]) -> str:
    return f"{function.__module__}.{function.__qualname__}"


class _Sizes(NamedTuple):
    state: int
    held: int
    parameters: int
    """-1 where they are no vector of numbers: then they are handed on as they are."""
    watching: int
    compared: int


def _sizes(state: FloatArray, held: FloatArray, parameters: Any, watching: FloatArray, compared: FloatArray) -> _Sizes:
    vector = isinstance(parameters, np.ndarray) and parameters.ndim == 1 and parameters.dtype == np.float64
    return _Sizes(state.size, held.size, parameters.size if vector else -1, watching.size, compared.size)


def _compiled(
    name: str,
    parts: tuple[Callable[..., Any], Callable[..., Any], Callable[..., Any]],
    criterion: Criterion,
    sizes: _Sizes,
) -> Callable[..., Any]:
    """The kernel for arrays of these sizes: known beforehand, the loops over them are unrolled."""
    derivative, project, drive = parts
    states_size, held_size, parameters_size, watching_size, compared_size = sizes
    form, watched_size, holds, first = criterion

    def propagate(  # type: ignore[no-untyped-def]
        state,
        tick,
        count,
        held,
        parameters,
        ticks_per_second,
        substeps,
        watching,
        compared,
    ):
        states = np.empty((count, states_size))
        # Copies on the stack: the owners of a slice of anything else would be counted, four times a step.
        u = scratch(held_size)
        for a in range(held_size):
            u[a] = held[a]
        w = scratch(watching_size)
        for a in range(watching_size):
            w[a] = watching[a]
        c = scratch(compared_size)
        for a in range(compared_size):
            c[a] = compared[a]
        if parameters_size < 0:
            p = parameters
        else:
            p = scratch(parameters_size)
            for a in range(parameters_size):
                p[a] = parameters[a]
        watched = scratch_matrix(1, watched_size)
        x = scratch(states_size)
        y = scratch(states_size)
        k1 = scratch(states_size)
        k2 = scratch(states_size)
        k3 = scratch(states_size)
        k4 = scratch(states_size)
        for a in range(states_size):
            x[a] = state[a]
        rate = ticks_per_second * substeps
        h = 1.0 / rate
        end = drive(tick * substeps / rate, p)
        for i in range(count):
            for j in range(substeps):
                step = (tick + i) * substeps + j
                begin = end
                middle = drive((2 * step + 1) / (2 * rate), p)
                end = drive((step + 1) / rate, p)
                derivative(begin, x, u, p, k1)
                for a in range(states_size):
                    y[a] = x[a] + 0.5 * h * k1[a]
                derivative(middle, y, u, p, k2)
                for a in range(states_size):
                    y[a] = x[a] + 0.5 * h * k2[a]
                derivative(middle, y, u, p, k3)
                for a in range(states_size):
                    y[a] = x[a] + h * k3[a]
                derivative(end, y, u, p, k4)
                for a in range(states_size):
                    x[a] += h / 6.0 * (k1[a] + 2.0 * k2[a] + 2.0 * k3[a] + k4[a])
            project(x)
            for a in range(states_size):
                states[i, a] = x[a]
            form(x, w[:first], watched[0])
            if holds(watched, 0, c, w[first:]):
                return states[: i + 1]
        return states

    # The symbols of cached machine code are made of this name and of a count that begins anew in every process. Under
    # one name, the kernels of two plants that two processes have cached would get in each other's way in a third.
    propagate.__qualname__ = f"{name}.{'.'.join(map(str, sizes))}.{_name(form)}.{watched_size}.{_name(holds)}.{first}"
    return kernel(propagate)
