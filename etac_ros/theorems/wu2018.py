"""Theorems 1 and 2 of wu2018: ultimate bounds, the decrease of V, and the least interval."""

from __future__ import annotations

import numpy as np

from etac_ros.parameters import square
from etac_ros.theorems.bound import Lyapunov, Theorems, at_most, ceiling_of, everywhere
from etac_ros.theorems.evidence import Evidence, norms, sinusoids
from etac_ros.theorems.held_error import HeldErrorLaw, Numbers, interval_bounds

_NUMBERS = Numbers("(30), (31)", "(32)", "(33)", "(35)", "(36)")


def theorems(evidence: Evidence) -> Theorems:
    """Every bound of the paper along a run."""
    dynamics = evidence.parameters("/plant", "dynamics")
    trigger = evidence.parameters("/sensor", "trigger")
    beta = float(evidence.parameters("/sensor", "signal")["beta"])
    law = HeldErrorLaw(
        float(evidence.parameters("/controller", "law")["k"]),
        float(trigger["alpha"]),
        float(trigger["gamma"]),
        square(tuple(dynamics["inertia_kg_m2"])),
    )
    states, torques, times = evidence.states("/plant"), evidence.torques("/plant"), evidence.times_s("/plant")
    q_0, q, omega = states[:, 0], states[:, 1:4], states[:, 4:7]
    d = sinusoids(dynamics.get("disturbance", {}), times)
    momentum = omega @ law.inertia
    spring = law.k * beta
    V = 2.0 * spring * (1.0 - q_0) + 0.5 * np.sum(omega * momentum, axis=1)
    V_dot = spring * np.sum(q * omega, axis=1) + np.sum(omega * (torques + d), axis=1)
    speed = norms(omega)
    largest_d = float(norms(d).max())
    push = (law.k * law.gamma + law.k * law.alpha * beta + largest_d) ** 2 / (4.0 * law.eta)
    phi = push + 4.0 * spring * law.rate
    q_dot = 0.5 * (np.cross(q, omega) + q_0[:, np.newaxis] * omega)
    gyroscopic = np.cross(omega, momentum)
    omega_dot = np.linalg.solve(law.inertia, (torques + d - gyroscopic).T).T
    drift = -gyroscopic + beta * q_dot @ law.inertia + d
    saturated = "an axis at the torque limit is none of the theorem's"
    return Theorems(
        bounds=(
            at_most(
                "(9)",
                "|omega|, ultimately",
                float(np.sqrt(2.0 * phi / (law.smallest * law.rate))),
                float(speed[speed.size // 2 :].max()),
                "rad/s",
                note="measured over the second half of the run",
            ),
            at_most(
                "(9)",
                "|q_v|, ultimately",
                float(np.sqrt(phi / (spring * law.rate))),
                float(norms(q)[speed.size // 2 :].max()),
                trivial=1.0,
                note="at least 2 for any gains, by the 8 k beta of eq. (23); no quaternion is beyond 1",
            ),
            everywhere("(18)", "V'", V_dot, -(law.k * (1.0 - law.alpha) - law.eta) * speed**2 + push, saturated),
            everywhere("(21), (23)", "V'", V_dot, -law.rate * V + phi, saturated),
            at_most(
                "(23)",
                "V, ultimately",
                phi / law.rate,
                float(V[V.size // 2 :].max()),
                "N m",
                4.0 * spring,
                "V at rest half a turn away is 2 k beta, at rest a whole turn away 4 k beta",
            ),
            at_most(
                "(27)",
                "|L| / Phi",
                float((norms(drift) / (1.0 + speed + speed**2)).max()),
                float((norms(drift) / (1.0 + speed + speed**2)).max()),
                "N m",
                0.0,
                "that b exists is all that is said; eq. (26) prints k for beta",
            ),
            *interval_bounds(
                law,
                drift,
                omega,
                omega + beta * q,
                omega_dot + beta * q_dot,
                evidence.trigger("/sensor"),
                evidence.tick_s,
                _NUMBERS,
            ),
        ),
        lyapunov=Lyapunov("(10)", times, V, ceiling_of(float(V[0]), law.rate, phi, times)),
    )
