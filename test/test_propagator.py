"""Kernels of one plant kind for arrays of several sizes: each has its own, and what a plant keeps may be anything."""

from __future__ import annotations

from typing import Any

import numpy as np

from etac_ros.maths.compiled import inlined
from etac_ros.maths.rk4 import propagator


@inlined
def _linear(t, state, held, parameters, rate):  # type: ignore[no-untyped-def]
    for i in range(state.size):
        rate[i] = parameters[i % 2] + held.sum()


@inlined
def _of_a_table(t, state, held, parameters, rate):  # type: ignore[no-untyped-def]
    rate[0] = parameters[0][1, 0] + parameters[1]


@inlined
def _as_it_is(state):  # type: ignore[no-untyped-def]
    pass


def ends(propagate: Any, states: int, held: list[float], parameters: Any) -> list[float]:
    """The state after one second at one tick a second, from zero."""
    found: list[float] = propagate(np.zeros(states), 0, 1, np.array(held), parameters, 1, 1)[0].tolist()
    return found


def test_arrays_of_other_sizes_have_a_kernel_of_their_own() -> None:
    propagate = propagator(_linear, _as_it_is)
    assert ends(propagate, 1, [0.5], np.array([1.0, 2.0, 3.0])) == [1.5]
    assert ends(propagate, 3, [0.5], np.array([1.0, 2.0])) == [1.5, 2.5, 1.5]
    assert ends(propagate, 3, [], np.array([1.0, 2.0])) == [1.0, 2.0, 1.0]
    assert ends(propagate, 1, [0.5, 0.25], np.array([4.0, 2.0])) == [4.75]


def test_parameters_that_are_no_vector_come_as_they_are() -> None:
    propagate = propagator(_of_a_table, _as_it_is)
    assert ends(propagate, 1, [0.0], (np.array([[1.0], [2.0]]), 0.5)) == [2.5]
