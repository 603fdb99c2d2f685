"""Working memory of kernels is the caller's own, small or large, and the plain function is of the same shape."""

from __future__ import annotations

import numpy as np

from etac_ros.maths.compiled import inlined, kernel
from etac_ros.maths.scratch import scratch, scratch_matrix


@inlined
def _reversed(values, out):  # type: ignore[no-untyped-def]
    copy = scratch(3)
    for i in range(3):
        copy[i] = values[2 - i]
    for i in range(3):
        out[i] = copy[i]


def _shuffled(values):  # type: ignore[no-untyped-def]
    one = scratch(3)
    other = scratch(3)
    matrix = scratch_matrix(2, 3)
    for i in range(3):
        one[i] = values[i]
        other[i] = -values[i]
    _reversed(one, other)
    for i in range(3):
        matrix[0, i] = other[i]
        matrix[1, i] = 10.0 * one[i]
    _reversed(matrix[1], matrix[1])
    out = np.empty((2, 3))
    for i in range(2):
        for j in range(3):
            out[i, j] = matrix[i, j]
    return out


def _sums(values):  # type: ignore[no-untyped-def]
    total = 0.0
    for i in range(values.size):
        large = scratch(2000)
        for j in range(2000):
            large[j] = values[i]
        total += large.sum()
    return total


def test_arrays_of_a_kernel_and_of_what_it_calls_are_apart() -> None:
    values = np.array([1.0, 2.0, 3.0])
    expected = [[3.0, 2.0, 1.0], [30.0, 20.0, 10.0]]
    assert kernel(_shuffled)(values).tolist() == expected
    assert _shuffled(values).tolist() == expected


def test_one_asked_for_in_a_loop_does_not_grow_the_stack() -> None:
    assert kernel(_sums)(np.ones(20_000)) == 2000.0 * 20_000
