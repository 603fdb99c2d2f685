"""Theorems 1 and 2 of xie2021: the decrease of V, its ultimate bound, the least interval; what a held torque allows.

The proof takes e and chi with the neighbours' true states, whatever a spacecraft knows of them; so does this.
"""

from __future__ import annotations

import math
from dataclasses import dataclass
from functools import cached_property

import numpy as np

from etac_ros.parameters import FloatArray, square
from etac_ros.theorems.bound import Bound, Lyapunov, Theorems, at_least, at_most, ceiling_of, everywhere
from etac_ros.theorems.evidence import Evidence, norms


@dataclass(frozen=True)
class _Craft:
    """One spacecraft along a run; arrays of shape (n, 3) in B."""

    inertia: FloatArray
    torque: FloatArray
    sigma: FloatArray
    omega: FloatArray
    sigma_e: FloatArray
    omega_e: FloatArray
    neighbours: tuple[str, ...]
    weights: tuple[float, ...]
    r: float
    k0: float

    @cached_property
    def spectral(self) -> float:
        """``|J|`` [kg m^2]."""
        return float(np.linalg.norm(self.inertia, 2))

    @property
    def k(self) -> float:
        """Gain of eq. (11)."""
        return self.k0 + self.r * self.spectral + 1.0

    @cached_property
    def sigma_dot(self) -> FloatArray:
        """Eqs. (1) and (2) [1/s]."""
        return _mrp_rates(self.sigma, self.omega)

    @cached_property
    def omega_dot(self) -> FloatArray:
        """Eq. (3) [rad/s^2]."""
        gyroscopic = np.cross(self.omega, self.omega @ self.inertia)
        return np.asarray(np.linalg.solve(self.inertia, (self.torque - gyroscopic).T).T)


def _mrp_rates(sigma: FloatArray, omega: FloatArray) -> FloatArray:
    squares = np.sum(sigma * sigma, axis=1)[:, np.newaxis]
    along = np.sum(sigma * omega, axis=1)[:, np.newaxis]
    return np.asarray(0.25 * ((1.0 - squares) * omega + 2.0 * np.cross(sigma, omega) + 2.0 * along * sigma))


def theorems(evidence: Evidence) -> Theorems:
    """Every bound of the paper along a run."""
    plants = evidence.graph.plants
    craft = {plant.rpartition("/")[0].strip("/"): _craft(evidence, plant) for plant in plants}
    times, step = evidence.times_s(plants[0]), evidence.tick_s
    rule = evidence.parameters(_sensor(plants[0]), "trigger")
    floor = rule["c1"] * np.exp(-rule["c2"] * np.tanh(times))
    some = next(iter(craft.values()))
    sigma_d_dot = np.gradient(some.sigma - some.sigma_e, step, axis=0)
    omega_d_dot = np.gradient(some.omega - some.omega_e, step, axis=0)
    V, V_dot = np.zeros(times.size), np.zeros(times.size)
    fastest = max(float(norms(one.omega).max()) for one in craft.values())
    fastest = max(fastest, *(float(norms(one.sigma_dot).max()) for one in craft.values()))
    hardest = max(float(norms(one.omega_dot).max()) for one in craft.values())
    errors: dict[str, FloatArray] = {}
    for name, one in craft.items():
        e, e_dot = one.sigma_e.copy(), one.sigma_dot - sigma_d_dot
        for other, weight in zip(one.neighbours, one.weights, strict=True):
            e += weight * (one.sigma - craft[other].sigma)
            e_dot += weight * (one.sigma_dot - craft[other].sigma_dot)
        errors[name] = e_dot
        chi = one.omega_e + one.r * e
        pull = one.torque - np.cross(one.omega, one.omega @ one.inertia) - (omega_d_dot - one.r * e_dot) @ one.inertia
        V += np.sum(chi * (chi @ one.inertia), axis=1)
        V_dot += 2.0 * np.sum(chi * pull, axis=1)
    n, largest = len(craft), max(one.spectral for one in craft.values())
    k_max = max(one.k for one in craft.values())
    mu, delta = some.k0 / largest, 2.0 * n * floor**2 * k_max
    limited = "a torque at its limit is none of the theorem's"
    delta_3 = float(norms(np.gradient(omega_d_dot, step, axis=0)[2:-2]).max())
    accelerations = max(hardest, *(_largest_mrp_acceleration(one) for one in craft.values()))
    psi = (
        2.0 * (n + 1) * some.r * fastest
        + 2.0 * (n + 2) * accelerations
        + (2.0 * fastest * accelerations + delta_3) * largest
    )
    bounds = [
        everywhere("(23), (26)", "V'", V_dot, -mu * V + delta, limited),
        everywhere(
            "(27)", "V", V, ceiling_of(float(V[0]), mu, float(delta[0]), times), "with Delta at t = 0, its largest"
        ),
        at_most(
            "(27)",
            "V, ultimately",
            float(delta[-1]) / mu,
            float(V[times.size // 2 :].max()),
            "kg m^2/s^2",
            note="over the second half of the run",
        ),
        *_growth(craft, errors, omega_d_dot, n, fastest, accelerations, delta_3, step),
        _interval(evidence, psi, rule, step),
    ]
    return Theorems(tuple(bounds), Lyapunov("(16)", times, V, ceiling_of(float(V[0]), mu, float(delta[0]), times)))


def _sensor(plant: str) -> str:
    return f"{plant.rpartition('/')[0]}/sensor"


def _craft(evidence: Evidence, plant: str) -> _Craft:
    sensor = evidence.scenario.nodes[_sensor(plant)]
    law = evidence.parameters(f"{plant.rpartition('/')[0]}/controller", "law")
    states = evidence.states(plant)
    return _Craft(
        square(tuple(evidence.parameters(plant, "dynamics")["inertia_kg_m2"])),
        evidence.torques(plant),
        states[:, 0:3],
        states[:, 3:6],
        evidence.quantity(plant, "attitude components"),
        evidence.quantity(plant, "rate in rad/s"),
        tuple(sensor["neighbours"]),
        tuple(sensor["signal"]["weights"]),
        float(law["r"]),
        float(law["k0"]),
    )


def _largest_mrp_acceleration(one: _Craft) -> float:
    """Largest ``|sigma_ddot|`` [1/s^2]; the part that jumps with the torque is exact, the rest small."""
    squares = np.sum(one.sigma * one.sigma, axis=1)[:, np.newaxis]
    s, w, v = one.sigma, one.omega, one.sigma_dot
    of_attitude = 0.5 * (
        -np.sum(s * v, axis=1)[:, np.newaxis] * w
        + np.cross(v, w)
        + np.sum(v * w, axis=1)[:, np.newaxis] * s
        + np.sum(s * w, axis=1)[:, np.newaxis] * v
    )
    assert squares.shape[1] == 1
    return float(norms(_mrp_rates(s, one.omega_dot) + of_attitude).max())


def _growth(
    craft: dict[str, _Craft],
    errors: dict[str, FloatArray],
    omega_d_dot: FloatArray,
    n: int,
    fastest: float,
    hardest: float,
    delta_3: float,
    step: float,
) -> list[Bound]:
    """Eqs. (29) to (31): how fast chi, e_dot and eta change, of the spacecraft that comes nearest to the bound."""
    chi = max(float(norms(one.omega_dot - omega_d_dot + one.r * errors[name]).max()) for name, one in craft.items())
    # Between jumps of the torque; a jump is no derivative.
    e_ddot = max(float(np.quantile(norms(np.diff(errors[name], axis=0)) / step, 0.99)) for name in craft)
    eta = 0.0
    allowed = 0.0
    for one in craft.values():
        moved = np.diff(np.cross(one.omega, one.omega @ one.inertia) + omega_d_dot @ one.inertia, axis=0) / step
        eta = max(eta, float(np.quantile(norms(moved), 0.99)))
        allowed = max(allowed, 2.0 * one.spectral * fastest * hardest + one.spectral * delta_3)
    some = next(iter(craft.values()))
    least = f"with delta_1 = {fastest:.3g}, delta_2 = {hardest:.3g}, delta_3 = {delta_3:.3g} of this run"
    return [
        at_most("(29), (32)", "|chi'|", 2.0 * (n + 1) * some.r * fastest + 2.0 * hardest, chi, "rad/s^2", note=least),
        at_most("(30)", "|e''|", 2.0 * (n + 1) * hardest, e_ddot, "1/s^2", note="99 % of the samples"),
        at_most("(31)", "|eta'|", allowed, eta, "N m/s", note="99 % of the samples"),
    ]


def _interval(evidence: Evidence, psi: float, rule: object, step: float) -> Bound:
    assert isinstance(rule, dict)
    shortest = min(evidence.trigger(_sensor(plant)).intervals_s.min() for plant in evidence.graph.plants)
    return at_least(
        "(33), (35)",
        "shortest interval",
        rule["c1"] * math.exp(-rule["c2"] * math.pi / 2.0) / psi,
        float(shortest),
        "s",
        step,
        f"with psi = {psi:.3g} of this run; pi / 2 for the largest tanh, which is 1",
    )


@dataclass(frozen=True)
class HeldTorque:
    """What Tables 3 and 5 ask of the longest interval of a spacecraft, if its torque was held all through it."""

    least_torque_nm: float
    """``|u|`` over the interval, from mean and standard deviation of Table 5."""
    least_rate_square: float
    """What it makes of the mean square of ``|omega_e|`` from 15 s on [rad^2/s^2]."""
    printed_rate_square: float
    """The mean square that Table 5 prints, mean squared and deviation squared."""

    @property
    def possible(self) -> bool:
        """Whether the tables allow a held torque."""
        return self.least_rate_square <= self.printed_rate_square


def held_torque(
    interval_s: float,
    span_s: float,
    torque_nm: tuple[float, float],
    rate_rad_s: tuple[float, float],
    inertia_kg_m2: float,
    reference_rad_s2: float,
) -> HeldTorque:
    """Whether the published means and deviations leave room for one held torque over the longest interval.

    A value that is taken for a share f of the time is no further from the mean than ``sd sqrt((1 - f) / f)``. Such a
    torque turns the rate at a constant acceleration, so that its mean square over the interval is at least a twelfth of
    the square of the change, wherever the change began.

    Parameters
    ----------
    interval_s, span_s
        The interval, and the time over which the table's figures are taken.
    torque_nm, rate_rad_s
        Mean and standard deviation of ``|u|`` and of ``|omega_e|``.
    inertia_kg_m2
        The largest moment of inertia, which turns least.
    reference_rad_s2
        How fast the reference's rate changes at most: it may go along.
    """
    share = interval_s / span_s
    torque = max(torque_nm[0] - torque_nm[1] * math.sqrt((1.0 - share) / share), 0.0)
    change = max(torque / inertia_kg_m2 - reference_rad_s2, 0.0) * interval_s
    return HeldTorque(torque, share * change**2 / 12.0, rate_rad_s[0] ** 2 + rate_rad_s[1] ** 2)
