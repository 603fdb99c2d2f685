"""A loop written by hand, without an allocation: what the work costs where nothing but it is done."""

from __future__ import annotations

import math
import time

import numba
import numpy as np
import workload
from workload import (
    ALPHA,
    BETA,
    CONSTANT,
    COSINE,
    FREQUENCY,
    GAMMA,
    LIMIT,
    SINE,
    START,
    TICKS_PER_SECOND,
    H,
    K,
    derivative,
)


@numba.njit(cache=True)
def disturb(t, d):
    sine, cosine = math.sin(FREQUENCY * t), math.cos(FREQUENCY * t)
    for i in range(3):
        d[i] = CONSTANT[i] + SINE[i] * sine + COSINE[i] * cosine


@numba.njit(cache=True)
def simulate(x, end):
    """Triggering instants up to the tick ``end``, from the state x."""
    count = 0
    y, k1, k2, k3, k4 = np.empty(7), np.empty(7), np.empty(7), np.empty(7), np.empty(7)
    held, u, d, middle = np.empty(3), np.empty(3), np.empty(3), np.empty(3)
    disturb(0.0, d)
    for tick in range(end + 1):
        error, norm = 0.0, 0.0
        for i in range(3):
            s = x[4 + i] + BETA * x[1 + i]
            error += (held[i] - s) ** 2
            norm += s**2
        if tick == 0 or math.sqrt(error) >= ALPHA * math.sqrt(norm) + GAMMA:
            count += 1
            for i in range(3):
                held[i] = x[4 + i] + BETA * x[1 + i]
                u[i] = min(max(-K * held[i], -LIMIT), LIMIT)
        disturb((tick + 0.5) * H, middle)
        derivative(x, u, d, k1)
        for i in range(7):
            y[i] = x[i] + 0.5 * H * k1[i]
        derivative(y, u, middle, k2)
        for i in range(7):
            y[i] = x[i] + 0.5 * H * k2[i]
        derivative(y, u, middle, k3)
        for i in range(7):
            y[i] = x[i] + H * k3[i]
        disturb((tick + 1) * H, d)
        derivative(y, u, d, k4)
        for i in range(7):
            x[i] += H / 6.0 * (k1[i] + 2.0 * k2[i] + 2.0 * k3[i] + k4[i])
        length = math.sqrt(x[0] ** 2 + x[1] ** 2 + x[2] ** 2 + x[3] ** 2)
        for i in range(4):
            x[i] /= length
    return count


def run(duration_s: float) -> tuple[float, int]:
    began = time.perf_counter()
    count = simulate(START.copy(), round(duration_s * TICKS_PER_SECOND))
    return time.perf_counter() - began, count


if __name__ == "__main__":
    run(1.0)  # compiles
    workload.report(run, "numba")
