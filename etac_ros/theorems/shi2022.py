"""Theorem 1 of shi2022: performance bounds, the decrease of V, the sets of q_e and omega, and the least interval."""

from __future__ import annotations

import numpy as np

from etac_ros.modules.sensing_controller import SensingController
from etac_ros.parameters import FloatArray, square
from etac_ros.theorems.bound import Bound, Lyapunov, Theorems, at_least, at_most, ceiling_of, everywhere
from etac_ros.theorems.evidence import Evidence, norms, sinusoids

_HALF_SIGN = 0.2785
"""Of eq. (28): ``|x| - x tanh(x / kappa) <= 0.2785 kappa``."""


def theorems(evidence: Evidence) -> Theorems:
    """Every bound of the paper along a run.

    The ideal weights W of the proof are not known to anybody. They stand for 0 here: V has the estimate instead of the
    estimation error, and eta_2 is the least that it can be.
    """
    dynamics, law = evidence.parameters("/plant", "dynamics"), evidence.parameters("/controller", "law")
    rule = evidence.parameters("/controller", "trigger")
    states, times = evidence.states("/plant"), evidence.times_s("/plant")
    q_e, omega = states[:, 1:4], states[:, 4:7]
    inertia = square(tuple(dynamics["inertia_kg_m2"]))
    moments = np.linalg.eigvalsh(inertia)
    a, alpha = max(law["a1"], law["a2"]), law["alpha"]
    s = omega + alpha * q_e
    start = np.abs(s[0]) if law.get("start") == "magnitude" else s[0]
    rho_0 = start + law["margin_rad_s"]
    rho = (rho_0 - law["rho_infinity_rad_s"]) * np.exp(-law["mu"] * times)[:, np.newaxis] + law["rho_infinity_rad_s"]
    inside = law["inside"] if law["start_outside"] == "saturate" else 1.0 - 1e-12
    chi = np.clip(s / rho, -inside * law["a1"], inside * law["a2"])
    eps = np.log(np.expm1(chi + law["a1"])) - np.log(np.expm1(law["a2"] - chi))
    nabla = -1.0 / np.expm1(-(chi + law["a1"])) - 1.0 / np.expm1(-(law["a2"] - chi))
    if law["gradient"] == "rho":
        nabla = nabla / rho
    weights = _weights(evidence, states)
    tau_bar = law["gain_nm"] * eps / nabla + np.einsum("kj,kji->ki", _activations(states, law), weights)
    pull = eps * nabla
    along, along_d = np.sum(pull * tau_bar, axis=1), pull @ np.asarray(law["robust_nm"])
    tau = evidence.trigger("/controller").shown.rows[:, :3]
    kappa, beta = law["kappa"], law["beta"]
    weight_norms = np.sum(weights**2, axis=(1, 2))
    V = 0.5 * np.sum(eps * (eps @ inertia), axis=1) + 0.5 * weight_norms / law["adaptation"]
    eta_1 = min(2.0 * law["gain_nm"] / moments[-1], law["leakage"] * law["adaptation"])
    eta_2 = 2.0 * _HALF_SIGN * kappa
    floor = rule.get("absolute_nm", 1.0) * np.exp(-rule["delta"] * times)
    d = sinusoids(dynamics.get("disturbance", {}), times)
    wide = np.sqrt(3.0) * a * rho.max(axis=1)
    limit = dynamics.get("rate_limit_rad_s")
    limited = "fails where the torque limit cuts"
    bounds = [
        everywhere("(7)", "|s_i| / rho_i", np.abs(s / rho).max(axis=1), np.full(times.size, a)),
        everywhere("(27)", "eps' nabla tau <= 0", np.sum(pull * tau, axis=1), np.zeros(times.size), limited),
        everywhere(
            "(31)",
            "eps' nabla tau / (1 + beta)",
            np.sum(pull * tau, axis=1) / (1.0 + beta),
            -along - along_d + 2.0 * _HALF_SIGN * kappa,
            limited,
        ),
        at_least(
            "before (35)",
            "|D_m| against what the threshold leaves and |d| [N m]",
            float((floor / (1.0 - beta) + norms(d)).max()),
            float(np.linalg.norm(law["robust_nm"])),
            "N m",
            note="a condition on the design; the approximation error is taken for 0",
        ),
        _decrease(V, times, eta_1, eta_2),
        at_most(
            "(39)",
            "|eps|, ultimately",
            float(np.sqrt(2.0 * eta_2 / (eta_1 * moments[0]))),
            float(norms(eps)[times.size // 2 :].max()),
            note="over the second half of the run; W = 0",
        ),
        everywhere("Omega_1", "|s| <= sqrt(3) a rho", norms(s), wide, "with the largest rho_i"),
        everywhere("Omega_2", "|q_e| <= sqrt(3) a rho / alpha", norms(q_e), wide / alpha, "q_e follows s with a lag"),
        everywhere("Omega_3", "|omega| <= 2 sqrt(3) a rho", norms(omega), 2.0 * wide, "as Omega_2"),
        at_most(
            "Omega_2, in the end",
            "|q_e|",
            float(np.sqrt(3.0) * a * law["rho_infinity_rad_s"] / alpha),
            float(norms(q_e)[-1]),
            note="rho is still on its way at the end of the run",
        ),
        at_most(
            "Omega_3, in the end",
            "|omega|",
            float(2.0 * np.sqrt(3.0) * a * law["rho_infinity_rad_s"]),
            float(norms(omega)[-1]),
            "rad/s",
            note="as Omega_2",
        ),
    ]
    if limit is not None:
        bounds += [
            at_most("(6)", "|omega_i|", float(limit), float(np.abs(omega).max()), "rad/s"),
            at_least(
                "corollary 1",
                "omega_max against alpha + a rho_i0 [rad/s]",
                float(alpha + a * rho_0.max()),
                float(limit),
                "rad/s",
                note="a condition on the design",
            ),
        ]
    bounds.append(_interval(evidence, tau, floor, beta))
    return Theorems(tuple(bounds), Lyapunov("(25)", times, V, ceiling_of(float(V[0]), eta_1, eta_2, times)))


def _weights(evidence: Evidence, states: FloatArray) -> FloatArray:
    """The network's weights before each sample, shape (n, neurons, 3)."""
    module = evidence.graph.modules["/controller"]
    assert isinstance(module, SensingController)
    memories = module.memories(states, 0)
    return np.asarray(memories[:, 3:].reshape(states.shape[0], -1, 3))


def _activations(states: FloatArray, law: object) -> FloatArray:
    """``H`` of eq. (13) at each state, shape (n, neurons)."""
    assert isinstance(law, dict)
    distances = states[:, np.newaxis, 1:7] - np.asarray(law["centres"])[np.newaxis, :, np.newaxis]
    width = law["width"]
    return np.asarray(np.exp(-np.sum(distances**2, axis=2) / (2.0 * width**2)) / np.sqrt(2.0 * np.pi * width))


def _decrease(V: FloatArray, times_s: FloatArray, eta_1: float, eta_2: float) -> Bound:
    """Eq. (38), by differences: from one sample to the next V changes by at most what its larger end allows."""
    allowed = np.maximum(-eta_1 * V[:-1] + eta_2, -eta_1 * V[1:] + eta_2)
    return everywhere(
        "(35), (38)", "V'", np.diff(V) / np.diff(times_s), allowed, "with W = 0, and D_m as small as it is"
    )


def _interval(evidence: Evidence, tau: FloatArray, floor: FloatArray, beta: float) -> Bound:
    trigger = evidence.trigger("/controller")
    steepest = float(norms(np.diff(tau, axis=0)).max()) / evidence.tick_s
    least = float((beta * np.abs(tau).min(axis=1) + floor[: tau.shape[0]]).min()) / steepest
    return at_least(
        "(45)",
        "shortest interval",
        least,
        float(trigger.intervals_s.min()),
        "s",
        evidence.tick_s,
        f"with the steepest |tau'| of this run, {steepest:.3g} N m/s, and eq. (21) for (42), whose sign is wrong",
    )
