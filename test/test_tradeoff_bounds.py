"""Lower bounds of the inter-event time: the papers' formulas, and what a run puts into them."""

from __future__ import annotations

import math

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from scipy.integrate import solve_ivp

from etac_ros.metrics.published import held_torque
from etac_ros.parameters import square
from etac_ros.runs import simulate
from etac_ros.scenario.load import load
from etac_ros.tradeoff.bounds import bound_of
from etac_ros.triggers import relative, split_norm


@given(st.floats(1e-6, 1e-2), st.floats(1.0, 100.0), st.floats(1e-3, 1.0), st.floats(1e-3, 1.0))
def test_the_relative_bound_is_the_time_of_the_comparison_lemma(
    gamma: float, gain: float, drift: float, signal: float
) -> None:
    inertia = np.diag([3.0, 2.0, 5.0])  # |J^-1| is 1/2
    bound = relative.shortest_interval_s(gamma, gain, inertia, drift, signal)
    # wu2018 eq. (31) with equality: the error grows from 0 to gamma.
    grown = solve_ivp(
        lambda _, e: 0.5 * (drift + gain * signal + gain * e), (0.0, bound), [0.0], rtol=1e-10, atol=1e-14
    )
    assert grown.y[0, -1] == pytest.approx(gamma, rel=1e-6)


def test_the_bound_of_a_formation_by_hand() -> None:
    # psi = 2 * 5 * 2 * 0.1 + 2 * 6 * 0.2 + (2 * 0.1 * 0.2 + 0.3) * 10 = 2 + 2.4 + 3.4
    assert split_norm.shortest_interval_s(0.78, 1.0, 4, 2.0, (0.1, 0.2, 0.3), 10.0) == pytest.approx(
        0.1 * math.exp(-math.pi / 2.0)
    )


def test_what_acts_on_wu2018_s_signal_is_its_eq_26() -> None:
    scenario = load("wu2018", None, ["duration_s=60"])
    states = simulate(scenario).recording.samples("/plant")[1]
    dynamics, beta = scenario.nodes["/plant"]["dynamics"], scenario.nodes["/sensor"]["signal"]["beta"]
    inertia = square(dynamics["inertia_kg_m2"])
    q0, q, omega = states[:, :1], states[:, 1:4], states[:, 4:7]
    seconds = np.arange(states.shape[0])[:, np.newaxis] / 32.0
    angle = dynamics["disturbance"]["frequency_rad_s"] * seconds
    disturbance = (
        np.array(dynamics["disturbance"]["constant_nm"])
        + np.sin(angle) * dynamics["disturbance"]["sine_nm"]
        + np.cos(angle) * dynamics["disturbance"]["cosine_nm"]
    )
    # The printed k of its second term is beta: the term is the rate of beta q_v.
    drift = -np.cross(omega, omega @ inertia) + 0.5 * beta * (np.cross(q, omega) + q0 * omega) @ inertia + disturbance
    signal = np.linalg.norm(omega + beta * q, axis=1).max()
    expected = relative.shortest_interval_s(
        1e-6, scenario.nodes["/controller"]["law"]["k"], inertia, np.linalg.norm(drift, axis=1).max(), signal
    )
    bound = bound_of(scenario)
    assert bound is not None
    assert bound.equation == "wu2018 eq. (36)"
    assert bound.seconds == pytest.approx(expected, rel=2e-3)


def test_what_moves_xie2021_is_its_torque() -> None:
    scenario = load("xie2021", None, ["duration_s=3"])
    graph, recording = scenario.build(), simulate(scenario).recording
    rates, accelerations, norms = [], [], []
    for plant in graph.plants:
        states = recording.samples(plant)[1]
        inertia = square(scenario.nodes[plant]["dynamics"]["inertia_kg_m2"])
        omega = states[:, 3:6]
        torque = held_torque(graph, recording, plant) - np.cross(omega, omega @ inertia)
        rates.append(np.linalg.norm(omega, axis=1).max())
        accelerations.append(np.linalg.norm(torque @ np.linalg.inv(inertia), axis=1).max())
        norms.append(np.linalg.norm(inertia, 2))
    # The reference's part, delta_3, is a thousandth of the whole.
    expected = split_norm.shortest_interval_s(0.001, 1.0, 4, 2.0, (max(rates), max(accelerations), 0.0), max(norms))
    bound = bound_of(scenario)
    assert bound is not None
    assert bound.seconds == pytest.approx(expected, rel=3e-3)
    assert "broadcasts" in bound.remark


@pytest.mark.parametrize(("name", "missing"), [("qi2022", "gamma"), ("shi2022", "tau_m")])
def test_a_bound_whose_constants_are_missing_has_no_value(name: str, missing: str) -> None:
    bound = bound_of(load(name))
    assert bound is not None
    assert bound.seconds is None
    assert f"the paper gives no {missing}" in bound.remark


def test_no_paper_no_bound() -> None:
    assert bound_of(load("wu2018", "periodic")) is None
    law = '{class: "etac_ros.laws.law:Relay"}'
    assert bound_of(load("wu2018", None, [f"controller.law={law}"])) is None
