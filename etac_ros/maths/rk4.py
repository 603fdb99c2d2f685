"""Fixed-step Runge-Kutta of fourth order on the tick grid: the same bits whatever the windows were."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

import numpy as np

from etac_ros.maths.compiled import inlined, kernel, source_digest
from etac_ros.maths.scratch import scratch


@inlined
def _time_itself(t, parameters):  # type: ignore[no-untyped-def]
    return t


def propagator(
    derivative: Callable[..., Any], project: Callable[..., Any], drive: Callable[..., Any] = _time_itself
) -> Callable[..., Any]:
    """Compile the propagation of one kind of plant over a number of ticks under a held input.

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

    Returns
    -------
    callable
        ``propagate(state, tick, count, held, parameters, ticks_per_second, substeps)`` returning the states at
        ``tick + 1 .. tick + count``, shape (count, n). ``held`` is the input, constant throughout.
    """
    digest = source_digest(derivative, project, drive)
    kernels: dict[int, Callable[..., Any]] = {}

    def propagate(state, tick, count, held, parameters, ticks_per_second, substeps):  # type: ignore[no-untyped-def]
        compiled = kernels.get(state.size)
        if compiled is None:
            compiled = kernels[state.size] = _compiled(digest, name, state.size, derivative, project, drive)
        return compiled(state, tick, count, held, parameters, ticks_per_second, substeps)

    # The symbols of cached machine code are made of this name and of a count that begins anew in every process. Under
    # one name, the kernels of two plants that two processes have cached would get in each other's way in a third.
    parts = (derivative, project, drive)
    name = "propagate." + ".".join(f"{part.__module__}.{part.__qualname__}" for part in parts)
    propagate.__qualname__ = name
    return propagate


def _compiled(
    digest: str,
    name: str,
    size: int,
    derivative: Callable[..., Any],
    project: Callable[..., Any],
    drive: Callable[..., Any],
) -> Callable[..., Any]:
    """The kernel for states of a size: known beforehand, the loops over a state are unrolled."""

    def propagate(state, tick, count, held, parameters, ticks_per_second, substeps):  # type: ignore[no-untyped-def]
        digest  # noqa: B018  part of the closure: the key under which the machine code is cached
        states = np.empty((count, size))
        x = scratch(size)
        y = scratch(size)
        k1 = scratch(size)
        k2 = scratch(size)
        k3 = scratch(size)
        k4 = scratch(size)
        for a in range(size):
            x[a] = state[a]
        rate = ticks_per_second * substeps
        h = 1.0 / rate
        end = drive(tick * substeps / rate, parameters)
        for i in range(count):
            for j in range(substeps):
                step = (tick + i) * substeps + j
                begin = end
                middle = drive((2 * step + 1) / (2 * rate), parameters)
                end = drive((step + 1) / rate, parameters)
                derivative(begin, x, held, parameters, k1)
                for a in range(size):
                    y[a] = x[a] + 0.5 * h * k1[a]
                derivative(middle, y, held, parameters, k2)
                for a in range(size):
                    y[a] = x[a] + 0.5 * h * k2[a]
                derivative(middle, y, held, parameters, k3)
                for a in range(size):
                    y[a] = x[a] + h * k3[a]
                derivative(end, y, held, parameters, k4)
                for a in range(size):
                    x[a] += h / 6.0 * (k1[a] + 2.0 * k2[a] + 2.0 * k3[a] + k4[a])
            project(x)
            for a in range(size):
                states[i, a] = x[a]
        return states

    propagate.__qualname__ = f"{name}.{size}"
    return kernel(propagate)
