"""Fixed-step Runge-Kutta of fourth order on the tick grid: the same bits whatever the windows were."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any, NamedTuple

import numpy as np

from etac_ros.maths.compiled import inlined, kernel
from etac_ros.maths.scratch import scratch, scratch_matrix
from etac_ros.parameters import FloatArray


class Answer(NamedTuple):
    """What follows from a hit within the same tick, where that is a formula: then computing ahead goes on.

    What is watched is put on a wire; out of that comes a command, out of the command the input that is held from then
    on, each component limited, reduced and put on a wire of its own.
    """

    command: Callable[..., Any]
    """``command(signal, parameters, out)``: writes into ``out``, of the size of the held input."""
    first: int
    """Where its numbers begin in :attr:`Stop.parameters`: for each of the three wires 1.0 if it has single precision;
    least, largest and what is left of each component of the input; and the parameters of ``command``."""


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
    answer: Answer | None = None
    """None to stop, else what happens in the place of that."""


class Stop(NamedTuple):
    """Where to stop computing ahead: behind the first state at which somebody would act.

    It says how far, and nothing else: whoever would act decides by itself, on the samples that it is shown.
    """

    criterion: Criterion
    parameters: FloatArray
    compared: FloatArray
    """What is watched is compared with this: it changes from one window to the next, and costs no compilation."""
    events: FloatArray | None = None
    """Where there is an answer, it is written in here: the number of events, 0.0 unless something was no number, and
    for each event its tick, what was watched, commanded and held, as it came off the wires. Computing ends when this
    is full. The states begin with the given one then, so that those of a whole run are one array."""


@inlined
def _time_itself(t, parameters):  # type: ignore[no-untyped-def]
    return t


@inlined
def _form_nothing(state, parameters, out):  # type: ignore[no-untyped-def]
    pass


@inlined
def _never(watched, row, compared, parameters):  # type: ignore[no-untyped-def]
    return False


@inlined
def _command_nothing(signal, parameters, out):  # type: ignore[no-untyped-def]
    pass


@inlined
def _off_wire(value, single):  # type: ignore[no-untyped-def]
    if single > 0.0:
        return np.float64(np.float32(value))
    return value


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
        # What was asked for last, as mostly: to hash a criterion takes longer than to know it again.
        self._last: tuple[Criterion | None, tuple[int, ...], Callable[..., Any]] = None, (), _never

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
        states: FloatArray = compiled(
            state, tick, count, held, parameters, ticks_per_second, substeps, held, held, held
        )
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
        criterion, watching, compared, events = stop
        key = (state.size, held.size, len(parameters), watching.size)
        last, last_key, compiled = self._last
        if last is not criterion or last_key != key:
            found = self._stopping.get((*key, criterion))
            if found is None:
                sizes = _sizes(state, held, parameters, watching, compared)
                found = self._stopping[(*key, criterion)] = _compiled(self.name, self._parts, criterion, sizes)
            compiled = found
            self._last = criterion, key, compiled
        states: FloatArray = compiled(
            state, tick, count, held, parameters, ticks_per_second, substeps, watching, compared,
            compared if events is None else events,
        )  # fmt: skip
        # Of its own memory alone: what was not computed is not kept.
        return states if len(states) >= count else states.copy()


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
    form, watched_size, holds, first, answer = criterion
    answering = answer is not None
    command, answer_first = answer or (_command_nothing, 0)
    row = 1 + watched_size + 2 * held_size
    lead = 1 if answering else 0

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
        events,
    ):
        states = np.empty((lead + count, states_size))
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
            if lead > 0:
                states[0, a] = state[a]
        rate = ticks_per_second * substeps
        h = 1.0 / rate
        end = drive(tick * substeps / rate, p)
        v = scratch(held_size)
        happened = 0
        unsound = 0.0  # no number as soon as anything is none
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
                states[lead + i, a] = x[a]
            form(x, w[:first], watched[0])
            if answering:
                for a in range(watched_size):
                    unsound += 0.0 * watched[0, a]
            if holds(watched, 0, c, w[first:]):
                if not answering:
                    return states[: i + 1]
                at = 2 + happened * row
                happened += 1
                events[at] = tick + i + 1
                for a in range(watched_size):
                    c[a] = _off_wire(watched[0, a], w[answer_first])
                    events[at + 1 + a] = c[a]
                    unsound += 0.0 * c[a]
                command(c, w[answer_first + 3 + 3 * held_size :], v)
                for a in range(held_size):
                    v[a] = _off_wire(v[a], w[answer_first + 1])
                    events[at + 1 + watched_size + a] = v[a]
                    torque = v[a]
                    if torque < w[answer_first + 3 + a]:
                        torque = w[answer_first + 3 + a]
                    if torque > w[answer_first + 3 + held_size + a]:
                        torque = w[answer_first + 3 + held_size + a]
                    u[a] = _off_wire(torque * w[answer_first + 3 + 2 * held_size + a], w[answer_first + 2])
                    events[at + 1 + watched_size + held_size + a] = u[a]
                    unsound += 0.0 * v[a] + 0.0 * u[a]
                if at + 2 * row > events.size:
                    events[0] = happened
                    events[1] = unsound
                    return states[: i + 2]
        if answering:
            events[0] = happened
            events[1] = unsound
        return states

    # The symbols of cached machine code are made of this name and of a count that begins anew in every process. Under
    # one name, the kernels of two plants that two processes have cached would get in each other's way in a third.
    propagate.__qualname__ = f"{name}.{'.'.join(map(str, sizes))}.{_name(form)}.{watched_size}.{_name(holds)}.{first}"
    if answering:
        propagate.__qualname__ += f".{_name(command)}.{answer_first}"
    return kernel(propagate)
