"""The work that everybody does: the rigid body of wu2018 with its rule, law and hold, on a grid of 32 Hz.

The spacecraft of config/wu2018.yaml starts at rest, turned by q_v = (0.1, -0.08, 0.06); inertia and disturbance are
those of the paper. At every tick the signal s = omega + 0.08 q_v is compared with the value that was sent last; where
|s(t_i) - s| >= 0.5 |s| + 1e-6 it is sent, u = -k s is commanded and held within 0.2 N m an axis. A thousand seconds
give 94 triggering instants, and who does not give as many has not done the same work.

Plain numpy and numba, nothing of etac_ros: what stands here is the user's own code in each of the programs.
"""

from __future__ import annotations

import json
import math
import sys
from collections.abc import Callable
from importlib.metadata import version

import numba
import numpy as np

TICKS_PER_SECOND = 32
H = 1.0 / TICKS_PER_SECOND  # [s]
START = np.array([math.sqrt(1.0 - 0.1**2 - 0.08**2 - 0.06**2), 0.1, -0.08, 0.06, 0.0, 0.0, 0.0])
J = np.array([[147.0, 6.5, 6.0], [6.5, 158.0, 5.5], [6.0, 5.5, 137.0]])  # [kg m^2]
J_INVERSE = np.linalg.inv(J)
CONSTANT = np.array([1.0e-4, -1.0e-4, 2.0e-4])  # [N m]
SINE = np.array([2.0e-4, 0.0, 0.0])  # [N m]
COSINE = np.array([0.0, -5.0e-4, -4.0e-4])  # [N m]
FREQUENCY = 0.005  # [rad/s]
BETA = 0.08  # [1/s]
ALPHA, GAMMA = 0.5, 1.0e-6
K = 26.113821209155528  # [N m s]
LIMIT = 0.2  # [N m]


@numba.njit(cache=True)
def disturbance(t):
    sine, cosine = math.sin(FREQUENCY * t), math.cos(FREQUENCY * t)
    d = np.empty(3)
    for i in range(3):
        d[i] = CONSTANT[i] + SINE[i] * sine + COSINE[i] * cosine
    return d


@numba.njit(cache=True)
def derivative(x, u, d, out):
    """Rate of [q (4, scalar first), omega (3)] under the torques u and d [N m]."""
    q0, q1, q2, q3, w0, w1, w2 = x[0], x[1], x[2], x[3], x[4], x[5], x[6]
    h0 = J[0, 0] * w0 + J[0, 1] * w1 + J[0, 2] * w2
    h1 = J[1, 0] * w0 + J[1, 1] * w1 + J[1, 2] * w2
    h2 = J[2, 0] * w0 + J[2, 1] * w1 + J[2, 2] * w2
    m0 = w2 * h1 - w1 * h2 + u[0] + d[0]
    m1 = w0 * h2 - w2 * h0 + u[1] + d[1]
    m2 = w1 * h0 - w0 * h1 + u[2] + d[2]
    out[0] = 0.5 * (-q1 * w0 - q2 * w1 - q3 * w2)
    out[1] = 0.5 * (q0 * w0 + q2 * w2 - q3 * w1)
    out[2] = 0.5 * (q0 * w1 + q3 * w0 - q1 * w2)
    out[3] = 0.5 * (q0 * w2 + q1 * w1 - q2 * w0)
    for i in range(3):
        out[4 + i] = J_INVERSE[i, 0] * m0 + J_INVERSE[i, 1] * m1 + J_INVERSE[i, 2] * m2


@numba.njit(cache=True)
def rk4(x, u, tick):
    """The state one tick later."""
    n = x.size
    k1, k2, k3, k4 = np.empty(n), np.empty(n), np.empty(n), np.empty(n)
    d, middle, end = disturbance(tick * H), disturbance((tick + 0.5) * H), disturbance((tick + 1) * H)
    derivative(x, u, d, k1)
    derivative(x + 0.5 * H * k1, u, middle, k2)
    derivative(x + 0.5 * H * k2, u, middle, k3)
    derivative(x + H * k3, u, end, k4)
    x = x + H / 6.0 * (k1 + 2.0 * k2 + 2.0 * k3 + k4)
    x[0:4] /= math.sqrt(x[0] ** 2 + x[1] ** 2 + x[2] ** 2 + x[3] ** 2)
    return x


@numba.njit(cache=True)
def signal(x):
    """s [rad/s]."""
    return x[4:7] + BETA * x[1:4]


@numba.njit(cache=True)
def fires(s, held):
    """Whether the rule sends s, where held was sent last."""
    return math.sqrt(((held - s) ** 2).sum()) >= ALPHA * math.sqrt((s**2).sum()) + GAMMA


@numba.njit(cache=True)
def command(s):
    """The torque [N m] for what was sent."""
    return -K * s


@numba.njit(cache=True)
def limited(u):
    """What the actuator holds [N m]."""
    return np.minimum(np.maximum(u, -LIMIT), LIMIT)


def report(run: Callable[[float], tuple[float, int]], *distributions: str) -> None:
    """Run as often and as long as the arguments say, and print the outcome for the bench: one line of JSON.

    ``run(duration_s)`` returns the wall time of its loop [s] and the number of triggering instants.
    """
    duration_s, rounds = float(sys.argv[1]), int(sys.argv[2])
    found = [run(duration_s) for _ in range(rounds)]
    outcome = {
        "loops_s": [loop for loop, _ in found],
        "triggers": sorted({count for _, count in found}),
        "versions": {name: version(name) for name in distributions},
    }
    print("outcome " + json.dumps(outcome), flush=True)
