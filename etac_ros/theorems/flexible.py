"""Theorems 1 and 2 of flexible: ultimate bounds, the decrease of V, and the least interval."""

from __future__ import annotations

import numpy as np

from etac_ros.parameters import square
from etac_ros.theorems.bound import Lyapunov, Theorems, at_most, ceiling_of, everywhere
from etac_ros.theorems.evidence import Evidence, norms
from etac_ros.theorems.held_error import HeldErrorLaw, Numbers, interval_bounds

_NUMBERS = Numbers("(66), (67)", "(68)", "(70)", "(72)", "(73)")


def theorems(evidence: Evidence) -> Theorems:
    """Every bound of the paper along a run; the disturbance is that of eqs. (22) and (23)."""
    dynamics = evidence.parameters("/plant", "dynamics")
    trigger = evidence.parameters("/sensor", "trigger")
    alpha = float(evidence.parameters("/sensor", "signal")["alpha"])
    coupling = np.asarray(dynamics["coupling_sqrt_kg_m"]).reshape(-1, 3)
    law = HeldErrorLaw(
        float(evidence.parameters("/controller", "law")["k"]),
        float(trigger["alpha"]),
        float(trigger["gamma"]),
        square(tuple(dynamics["inertia_kg_m2"])) - coupling.T @ coupling,
    )
    states, torques, times = evidence.states("/plant"), evidence.torques("/plant"), evidence.times_s("/plant")
    p, omega = states[:, 0:3], states[:, 3:6]
    d = evidence.quantity("/plant", "overall disturbance")
    square_of_p = np.sum(p * p, axis=1)
    along = np.sum(p * omega, axis=1)
    momentum = omega @ law.inertia
    spring = law.k * alpha
    V = 2.0 * spring * square_of_p + 0.5 * np.sum(omega * momentum, axis=1)
    V_dot = spring * (1.0 + square_of_p) * along + np.sum(omega * (torques + d), axis=1)
    speed = norms(omega)
    largest_d = float(norms(d).max())
    push = (law.k * law.gamma + 2.0 * spring * law.alpha + largest_d) ** 2 / (4.0 * law.eta)
    phi = push + 2.0 * spring * law.rate
    p_dot = 0.25 * (
        (1.0 - square_of_p)[:, np.newaxis] * omega + 2.0 * np.cross(p, omega) + 2.0 * along[:, np.newaxis] * p
    )
    sigma = omega + alpha * (1.0 + square_of_p)[:, np.newaxis] * p
    of_p = alpha * ((1.0 + square_of_p)[:, np.newaxis] * p_dot + 2.0 * np.sum(p * p_dot, axis=1)[:, np.newaxis] * p)
    gyroscopic = np.cross(omega, momentum)
    omega_dot = np.linalg.solve(law.inertia, (torques + d - gyroscopic).T).T
    drift = -gyroscopic + d + of_p @ law.inertia
    with_d = f"with the largest |d| of this run, {largest_d:.3g} N m"
    gamma = float((norms(drift) / (1.0 + speed + speed**2)).max())
    return Theorems(
        bounds=(
            at_most(
                "(30), (54)",
                "|omega|, ultimately",
                float(np.sqrt(2.0 * phi / (law.smallest * law.rate))),
                float(speed[speed.size // 2 :].max()),
                "rad/s",
                note="measured over the second half of the run",
            ),
            at_most(
                "(31), (53)",
                "|p|, ultimately",
                float(np.sqrt(phi / (spring * law.rate))),
                float(norms(p)[speed.size // 2 :].max()),
                trivial=1.0,
                note="at least sqrt(2) for any gains, by the 4 k alpha of eq. (33); the shadow set keeps |p| <= 1",
            ),
            everywhere("(43)", "V'", V_dot, -(law.k * (1.0 - law.alpha) - law.eta) * speed**2 + push, with_d),
            everywhere("(32), (33), (49)", "V'", V_dot, -law.rate * V + phi, with_d),
            at_most(
                "(52)",
                "V, ultimately",
                phi / law.rate,
                float(V[V.size // 2 :].max()),
                "N m",
                2.0 * spring,
                "V at rest half a turn away is 2 k alpha",
            ),
            at_most("(64)", "|G| / Omega", gamma, gamma, "N m", 0.0, "that Gamma exists is all that is said"),
            *interval_bounds(
                law, drift, omega, sigma, omega_dot + of_p, evidence.trigger("/sensor"), evidence.tick_s, _NUMBERS
            ),
        ),
        lyapunov=Lyapunov("(34)", times, V, ceiling_of(float(V[0]), law.rate, phi, times)),
    )
