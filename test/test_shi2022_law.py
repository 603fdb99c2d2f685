"""The adaptive law of shi2022 against a plain formulation written from the paper's equations (7)-(20)."""

from __future__ import annotations

from itertools import pairwise
from typing import Any

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from hypothesis.extra.numpy import arrays
from pydantic import ValidationError

from etac_ros.laws.shi2022 import AdaptivePrescribedPerformance, AdaptivePrescribedPerformanceParameters
from etac_ros.parameters import FloatArray

GRID = 100
VALUES: dict[str, Any] = {
    "alpha": 0.2,
    "margin_rad_s": 0.1,
    "rho_infinity_rad_s": 1e-4,
    "mu": 0.03,
    "beta": 0.01,
    "gain_nm": 5.0,
    "kappa": 1.0,
    "robust_nm": [0.1, 0.1, 0.1],
    "leakage": 10.0,
    "adaptation": 2.0,
    "centres": [-1.0, -0.5, 0.0, 0.5, 1.0],
    "width": 5.0,
    "limit_nm": 2.0,
}
# Values that are all different, so that none can take another's place.
ODD: dict[str, Any] = {
    "alpha": 0.3,
    "margin_rad_s": 0.4,
    "rho_infinity_rad_s": 2e-3,
    "mu": 0.5,
    "a1": 0.9,
    "a2": 0.7,
    "beta": 0.2,
    "gain_nm": 1.7,
    "kappa": 0.6,
    "robust_nm": [0.1, -0.2, 0.3],
    "leakage": 3.0,
    "adaptation": 4.0,
    "centres": [-0.3, 0.4],
    "width": 0.8,
    "limit_nm": None,
}
TABLES = {"printed": VALUES, "odd": ODD, "over rho": {**ODD, "gradient": "rho"}}


def law(grid: int = GRID, **values: Any) -> AdaptivePrescribedPerformance:
    parameters = AdaptivePrescribedPerformanceParameters.model_validate({**VALUES, **values})
    return AdaptivePrescribedPerformance(parameters, grid)


def T(chi: FloatArray, a1: float, a2: float) -> FloatArray:  # noqa: N802  as in the paper
    """Eq. (10)."""
    return np.log(np.exp(chi + a1) - 1.0) - np.log(np.exp(a2 - chi) - 1.0)


def paper(values: dict[str, Any], states: FloatArray, tick: int, rho_0: FloatArray) -> tuple[FloatArray, FloatArray]:
    """Torques and the weights after each sample, weights zero before the first; with matrices as printed."""
    a1, a2 = values.get("a1", 1.0), values.get("a2", 1.0)
    m = len(values["centres"])
    W = np.zeros((m, 3))
    Gamma = values["adaptation"] * np.eye(m)
    D_m = np.array(values["robust_nm"])
    torques, weights = [], []
    for k, state in enumerate(states):
        t = (tick + k) / GRID
        q_e, omega = state[1:4], state[4:7]
        rho = (rho_0 - values["rho_infinity_rad_s"]) * np.exp(-values["mu"] * t) + values["rho_infinity_rad_s"]
        chi = (omega + values["alpha"] * q_e) / rho
        eps = T(chi, a1, a2)
        h = 1e-6  # the derivative by differences: no formula to copy a mistake from
        slope = (T(chi + h, a1, a2) - T(chi - h, a1, a2)) / (2.0 * h)
        nabla = np.diag(slope / rho if values.get("gradient") == "rho" else slope)
        x = np.concatenate([q_e, omega])
        b = values["width"]
        H = np.array(
            [np.exp(-np.sum((x - c) ** 2) / (2.0 * b**2)) / np.sqrt(2.0 * np.pi * b) for c in values["centres"]]
        )
        tau_bar = values["gain_nm"] * np.linalg.inv(nabla) @ eps + W.T @ H
        tau = -(1.0 + values["beta"]) * (
            tau_bar * np.tanh(eps @ nabla @ tau_bar / values["kappa"])
            + D_m * np.tanh(eps @ nabla @ D_m / values["kappa"])
        )
        if values["limit_nm"] is not None:
            tau = np.clip(tau, -values["limit_nm"], values["limit_nm"])
        W = W + (Gamma @ np.outer(H, eps @ nabla) - values["leakage"] * Gamma @ W) / GRID
        torques.append(tau)
        weights.append(W)
    return np.array(torques), np.array(weights)


def track(count: int, seed: int, size: float = 0.1) -> FloatArray:
    """Some smooth motion, small enough to stay inside every bound above."""
    draws = np.random.default_rng(seed)
    t = np.arange(count)[:, np.newaxis] / 15.0
    rate = size * np.sin(t + draws.uniform(0.0, 6.0, 3)) * draws.uniform(0.2, 1.0, 3)
    vector = 2.0 * size * np.cos(0.7 * t + draws.uniform(0.0, 6.0, 3))
    scalar = np.sqrt(1.0 - np.sum(vector**2, axis=1, keepdims=True))
    return np.ascontiguousarray(np.concatenate([scalar, vector, rate], axis=1))


def memory_for(control: AdaptivePrescribedPerformance, rho_0: Any) -> FloatArray:
    memory = np.zeros(control.memory_size)
    memory[0:3] = rho_0
    return memory


@pytest.mark.parametrize("table", TABLES)
@pytest.mark.parametrize("tick", [0, 37])
def test_law_is_the_papers(table: str, tick: int) -> None:
    values = TABLES[table]
    control = law(**values)
    rho_0 = np.array([0.6, 0.7, 0.8])
    states = track(60, 3)
    torques, memories = control.fold(states, tick, memory_for(control, rho_0))
    expected, weights = paper(values, states, tick, rho_0)
    assert torques == pytest.approx(expected, rel=1e-6, abs=1e-8)
    assert memories[:, 3:].reshape(weights.shape) == pytest.approx(weights, rel=1e-6, abs=1e-8)
    assert np.array_equal(memories[:, 0:3], np.tile(rho_0, (60, 1)))
    # The network does take part, and so does time.
    assert np.abs(weights[-1]).max() > 1e-3
    assert np.abs(torques - control.fold(states, tick + 50, memory_for(control, rho_0))[0]).max() > 1e-4


def test_transform_by_hand() -> None:
    """One axis, no network yet, tanh at its end: ``tau = -(1 + beta) K eps / nabla``.

    With ``chi = ln 2``: ``eps = ln((2e - 1) / (e/2 - 1))``, ``nabla = 2e / (2e - 1) + (e/2) / (e/2 - 1)``.
    """
    e = np.e
    eps = np.log((2.0 * e - 1.0) / (e / 2.0 - 1.0))
    nabla = 2.0 * e / (2.0 * e - 1.0) + (e / 2.0) / (e / 2.0 - 1.0)
    control = law(robust_nm=[0.0, 0.0, 0.0], kappa=1e-9, limit_nm=None)
    state = np.array([[1.0, 0.0, 0.0, 0.0, 0.5 * np.log(2.0), 0.0, 0.0]])
    torques, memories = control.fold(state, 0, memory_for(control, 0.5))
    assert torques[0] == pytest.approx([-1.01 * 5.0 * eps / nabla, 0.0, 0.0], rel=1e-12, abs=1e-15)
    # Weights: Gamma h eps nabla / 100, on this axis alone; |x|^2 is that of the rate.
    h = np.exp(-(5.0 * 0.25 + (0.5 * np.log(2.0) - 0.5) ** 2) / 50.0) / np.sqrt(10.0 * np.pi)  # centre 0.5
    assert memories[0, 3 + 3 * 3 : 3 + 3 * 4] == pytest.approx([2.0 * h * eps * nabla / 100.0, 0.0, 0.0], abs=1e-15)


states_inside = st.tuples(arrays(np.float64, 3, elements=st.floats(-0.95, 0.95)), st.integers(0, 8000))
weights = arrays(np.float64, 15, elements=st.floats(-3.0, 3.0))


def state_of(chi: FloatArray, tick: int, rho_0: float = 0.3) -> FloatArray:
    rho = (rho_0 - 1e-4) * np.exp(-0.03 * tick / GRID) + 1e-4
    return np.array([[1.0, 0.0, 0.0, 0.0, *(chi * rho)]])


@given(states_inside, weights)
def test_torque_never_pushes_eps_up(inside: tuple[FloatArray, int], weights: FloatArray) -> None:
    """``eps' nabla_1 tau <= 0``: what the proof makes of eq. (18), whatever the network says."""
    chi, tick = inside
    control = law(limit_nm=None)
    memory = memory_for(control, 0.3)
    memory[3:] = weights
    torque = control.fold(state_of(chi, tick), tick, memory)[0][0]
    eps = T(chi, 1.0, 1.0)
    nabla = (T(chi + 1e-6, 1.0, 1.0) - T(chi - 1e-6, 1.0, 1.0)) / 2e-6
    scale = np.abs(eps * nabla).max() * np.abs(torque).max()
    assert (eps * nabla) @ torque <= 1e-6 * scale


@given(states_inside, weights)
def test_law_is_odd_but_for_the_network(inside: tuple[FloatArray, int], weights: FloatArray) -> None:
    """With centres on both sides of 0 alike, the mirrored motion with mirrored weights has the mirrored torque."""
    chi, tick = inside
    control = law()
    memory, mirrored = memory_for(control, 0.3), memory_for(control, 0.3)
    memory[3:] = weights
    mirrored[3:] = -weights.reshape(5, 3)[::-1].ravel()
    torque, after = control.fold(state_of(chi, tick), tick, memory)
    opposite, after_opposite = control.fold(state_of(-chi, tick), tick, mirrored)
    # D_m tanh(...) is even in D_m and odd in eps: part of the mirror, too.
    assert opposite[0] == pytest.approx(-torque[0], rel=1e-6, abs=1e-9)
    assert after_opposite[0, 3:].reshape(5, 3)[::-1].ravel() == pytest.approx(-after[0, 3:], rel=1e-6, abs=1e-9)


@given(states_inside, weights)
def test_torque_is_clipped_on_each_axis(inside: tuple[FloatArray, int], weights: FloatArray) -> None:
    chi, tick = inside
    free, limited = law(limit_nm=None), law(limit_nm=0.7)
    memory = memory_for(free, 0.3)
    memory[3:] = weights
    torque = free.fold(state_of(chi, tick), tick, memory)[0]
    assert limited.fold(state_of(chi, tick), tick, memory)[0].tolist() == np.clip(torque, -0.7, 0.7).tolist()


def test_nothing_moves_nothing() -> None:
    torques, memories = law().fold(np.array([[1.0, 0, 0, 0, 0, 0, 0]]), 5, memory_for(law(), 0.1))
    assert torques.tolist() == [[0.0, 0.0, 0.0]]
    assert not memories[0, 3:].any()


def test_weights_leak_when_nothing_moves() -> None:
    """``W_dot = -gamma Gamma W``: each Euler step of 10 ms leaves 1 - 0.01 x 20 = 0.8 of it."""
    memory = memory_for(law(), 0.1)
    memory[3:] = 1.0
    _, memories = law().fold(np.tile([1.0, 0, 0, 0, 0, 0, 0], (4, 1)), 0, memory)
    assert memories[0, 3] < 1.0
    control = law(gain_nm=1e-12)
    _, memories = control.fold(np.tile([1.0, 0, 0, 0, 0, 0, 0], (4, 1)), 0, memory)
    assert memories[:, 3] == pytest.approx([0.8, 0.64, 0.512, 0.4096])


cuts = st.lists(st.integers(0, 80), max_size=6).map(lambda some: sorted({0, 80, *some}))


@given(cuts, st.integers(0, 100), st.integers(0, 5000), st.sampled_from(sorted(TABLES)))
def test_folding_in_pieces_gives_the_same_bits(cuts: list[int], seed: int, tick: int, table: str) -> None:
    control = law(**TABLES[table])
    states = track(80, seed)
    memory = memory_for(control, [0.5, 0.6, 0.7])
    torques, memories = control.fold(states, tick, memory)
    parts = []
    for start, end in pairwise(cuts):
        part = control.fold(states[start:end], tick + start, memory)
        memory = part[1][-1]
        parts.append(part)
    assert np.concatenate([part[0] for part in parts]).tobytes() == torques.tobytes()
    assert np.concatenate([part[1] for part in parts]).tobytes() == memories.tobytes()


def test_folding_changes_nothing() -> None:
    control = law()
    states, memory = track(20, 1), memory_for(control, 0.5)
    before = states.tobytes(), memory.tobytes()
    first = control.fold(states, 3, memory)
    again = control.fold(states, 3, memory)
    assert (states.tobytes(), memory.tobytes()) == before
    assert first[0].tobytes() == again[0].tobytes()


def start(rate: list[float], vector: list[float] | None = None) -> FloatArray:
    vector = vector or [0.0, 0.0, 0.0]
    return np.array([np.sqrt(1.0 - sum(v * v for v in vector)), *vector, *rate])


def test_bound_begins_with_the_signed_error() -> None:
    """``s(0) = omega + 0.2 q_e``, ``rho_0 = s(0) + 0.1``."""
    memory = law().initial_memory(start([0.03, -0.02, 0.01], [0.1, -0.1, 0.2]))
    assert memory[0:3] == pytest.approx([0.15, 0.06, 0.15])
    assert memory.shape == (law().memory_size,) == (18,)
    assert not memory[3:].any()


def test_a_start_outside_the_bound_is_refused_with_the_way_out() -> None:
    """s(0) = -0.06 allows +-0.04 only."""
    with pytest.raises(ValueError, match="outside the performance bound about y") as caught:
        law().initial_memory(start([0.0, -0.06, 0.0]))
    for words in (
        "s(0) = -0.06 rad/s",
        "= 0.04 rad/s",
        "-0.04 to 0.04 rad/s",
        "margin_rad_s",
        "start_outside: saturate",
    ):
        assert words in str(caught.value)
    assert law().initial_memory(start([0.0, -0.0499, 0.0]))[1] == pytest.approx(0.0501)


def test_saturation_allows_it_but_not_a_bound_that_rises() -> None:
    control = law(start_outside="saturate")
    assert control.initial_memory(start([0.0, -0.06, 0.0]))[1] == pytest.approx(0.04)
    for rate in (-0.1, -0.09995, -0.2):
        with pytest.raises(ValueError, match="about y cannot fall"):
            control.initial_memory(start([0.0, rate, 0.0]))


def test_sides_of_the_bound_count() -> None:
    assert law(a2=0.1).initial_memory(start([-0.04, 0.0, 0.0])).size  # chi = -2/3, and a1 = 1
    with pytest.raises(ValueError, match="about x"):
        law(a1=0.5).initial_memory(start([-0.04, 0.0, 0.0]))
    with pytest.raises(ValueError, match="about x"):
        law(a2=0.5).initial_memory(start([0.2, 0.0, 0.0]))  # chi = 2/3


def test_watch_is_chi() -> None:
    """With ``a1 = 0.5`` and ``a2 = 0.8`` of ``rho = 0.5`` at t = 0: 0.2 is 0.5 of the bound, -0.2 is -0.8."""
    control = law(a1=0.5, a2=0.8)
    states = np.array([start([0.2, -0.2, 0.0]), start([0.0, 0.0, 0.0])])
    (watch,) = control.watches(states, 0, memory_for(control, 0.5))
    assert watch.values[0] == pytest.approx([0.5, -0.8, 0.0])
    assert (watch.bound, watch.axes) == (1.0, ("x", "y", "z"))
    later = control.watches(states, 1000, memory_for(control, 0.5))[0].values[0]
    assert later[0] == pytest.approx(0.2 / ((0.5 - 1e-4) * np.exp(-0.3) + 1e-4) / 0.8)


def test_saturated_chi_is_reported_and_ends_nothing() -> None:
    control = law(start_outside="saturate")
    (watch,) = control.watches(start([0.7, 0.0, 0.0])[np.newaxis], 0, memory_for(control, 0.5))
    assert (watch.bound, watch.notice) == (None, 1.0)
    assert watch.values[0, 0] == pytest.approx(1.4)


def test_saturated_chi_is_held_at_its_part_of_the_bound() -> None:
    control = law(start_outside="saturate", inside=0.9, limit_nm=None, centres=[0.0], width=1e6)
    memory = memory_for(control, 0.5)
    held, at, below = (control.fold(start([rate, 0.0, 0.0])[np.newaxis], 0, memory)[0] for rate in (5.0, 0.45, 0.449))
    assert held == pytest.approx(at)
    assert below[0, 0] != held[0, 0]


@pytest.mark.parametrize("mode", ["refuse", "saturate"])
def test_outside_there_is_always_a_number_that_pulls_back(mode: str) -> None:
    control = law(start_outside=mode)
    states = np.array([start([rate, -rate, 0.0]) for rate in (0.5, 0.50001, 1.0, 1e6)])
    torques, memories = control.fold(states, 0, memory_for(control, 0.5))
    assert np.isfinite(torques).all()
    assert np.isfinite(memories).all()
    assert (torques[:, 0] < 0.0).all()
    assert (torques[:, 1] > 0.0).all()


def test_near_the_bound_it_is_the_network_that_pulls_back() -> None:
    """``K eps / nabla`` falls towards 0 there, as nabla grows faster than eps; the weights grow instead."""
    control = law(start_outside="saturate")
    states = np.tile(start([1.0, 0.0, 0.0]), (30, 1))
    torques, _ = control.fold(states, 0, memory_for(control, 0.5))
    middle = law(limit_nm=None).fold(start([0.35, 0.0, 0.0])[np.newaxis], 0, memory_for(control, 0.5))[0]
    assert abs(torques[0, 0]) < 0.2 * abs(middle[0, 0])  # chi 0.99 against 0.7, before any weights
    assert torques[-1, 0] == -2.0  # all that the actuator gives


def test_inside_counts_only_where_chi_is_saturated() -> None:
    """A law that refuses has the true transform up to its bound."""
    state = start([0.4999, 0.0, 0.0])[np.newaxis]
    refusing, saturating = (law(start_outside=mode, limit_nm=None) for mode in ("refuse", "saturate"))
    torque = refusing.fold(state, 0, memory_for(refusing, 0.5))[0]
    assert torque == pytest.approx(paper({**VALUES, "limit_nm": None}, state, 0, np.full(3, 0.5))[0], rel=1e-4)
    assert torque[0, 0] != saturating.fold(state, 0, memory_for(saturating, 0.5))[0][0, 0]


def test_sizes_that_do_not_fit_are_refused() -> None:
    for call in (law().fold, law().watches):
        with pytest.raises(ValueError, match="7 columns are needed"):
            call(np.zeros((1, 6)), 0, memory_for(law(), 0.5))
        with pytest.raises(ValueError, match="18 numbers are needed"):
            call(np.zeros((1, 7)), 0, np.zeros(17))


def test_weights_that_euler_cannot_follow_are_refused() -> None:
    with pytest.raises(ValueError, match=r"20 1/s, which Euler steps of 1/10 s cannot follow"):
        law(grid=10)
    assert law(grid=11).memory_size == 18


@pytest.mark.parametrize(
    "change",
    [
        {"a1": 0.0}, {"a2": 1.1}, {"beta": 1.0}, {"beta": 0.0}, {"gain_nm": 0.0}, {"kappa": -1.0}, {"centres": []},
        {"width": 0.0}, {"margin_rad_s": 0.0}, {"inside": 1.0}, {"gradient": "none"}, {"start_outside": "allow"},
        {"limit_nm": 0.0}, {"mu": 0.0}, {"alpha": 0.0}, {"leakage": 0.0}, {"adaptation": 0.0}, {"gain": 5.0},
    ],
)  # fmt: skip
def test_wrong_parameters_are_refused(change: dict[str, Any]) -> None:
    with pytest.raises(ValidationError):
        law(**change)
