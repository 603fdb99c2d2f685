"""scipy's DOP853 with its dense output, read at every tick: an integrator with steps of its own choice."""

from __future__ import annotations

import time

import numba
import numpy as np
import workload
from scipy.integrate import DOP853
from workload import START, TICKS_PER_SECOND, H, command, derivative, disturbance, fires, limited, signal

WINDOW = 1024
"""Ticks after which an integration that found nothing is asked again."""


@numba.njit(cache=True)
def first_of(states, held):
    for i in range(states.shape[1]):
        if fires(signal(states[:, i]), held):
            return i
    return -1


@numba.njit(cache=True)
def rate(t, x, u):
    out = np.empty(7)
    derivative(x, u, disturbance(t), out)
    return out


def run(duration_s: float) -> tuple[float, int]:
    end = round(duration_s * TICKS_PER_SECOND)
    began = time.perf_counter()
    x, tick, count = START.copy(), 0, 1
    held = signal(x)
    u = limited(command(held))
    while tick < end:
        solver = DOP853(lambda t, y, u=u: rate(t, y, u), tick * H, x, end * H, rtol=1e-10, atol=1e-12)
        hit, done = -1, tick  # the last tick that was looked at
        while hit < 0 and done < end:
            solver.step()
            output, last = solver.dense_output(), min(int(np.floor(solver.t / H + 1e-9)), end)
            while hit < 0 and done < last:
                until = min(done + WINDOW, last)
                states = output(np.arange(done + 1, until + 1) * H)
                hit = first_of(states, held)
                if hit >= 0:
                    x = np.ascontiguousarray(states[:, hit])
                    done += hit + 1
                else:
                    done = until
        if hit < 0:
            break
        tick, count = done, count + 1
        x[0:4] /= np.linalg.norm(x[0:4])
        held = signal(x)
        u = limited(command(held))
    return time.perf_counter() - began, count


if __name__ == "__main__":
    run(100.0)
    workload.report(run, "scipy")
