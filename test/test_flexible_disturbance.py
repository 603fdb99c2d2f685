"""The overall disturbance of flexible's eqs. (22) and (23), which fig. 10 shows."""

from __future__ import annotations

import numpy as np
import pytest

from etac_ros.laws.flexible_smc import EventTriggeredSlidingMode, EventTriggeredSlidingModeParameters
from etac_ros.maths.mrp import mrp_rotation_angle
from etac_ros.metrics.published import held_torque, quantity
from etac_ros.parameters import FloatArray, square
from etac_ros.runs import run_in_process
from etac_ros.scenario.load import load


def of_equation_23(states: FloatArray, torques: FloatArray, times: FloatArray) -> FloatArray:
    """Eqs. (17) to (23) with matrices as the paper prints them."""
    parameters = load("flexible").nodes["/plant"]["dynamics"]
    delta = np.array(parameters["coupling_sqrt_kg_m"]).reshape(4, 3)
    nominal = square(tuple(parameters["inertia_kg_m2"])) - delta.T @ delta
    uncertain = square(tuple(parameters["inertia_uncertainty_kg_m2"]))
    frequency, ratio = np.array(parameters["modal_frequency_rad_s"]), np.array(parameters["modal_damping"])
    K, C = np.diag(frequency**2), np.diag(2.0 * ratio * frequency)
    inverse = np.linalg.inv(nominal)
    hat = -inverse @ uncertain @ np.linalg.inv(np.eye(3) + inverse @ uncertain) @ inverse  # of eq. (20)
    found = []
    for state, u, t in zip(states, torques, times, strict=True):
        w, eta, eta_dot = state[3:6], state[6:10], state[10:14]
        pi = delta @ w + eta_dot  # (10)
        psi = delta.T @ (K @ eta + C @ pi) - delta.T @ C @ delta @ w - np.cross(w, delta.T @ (pi - delta @ w))
        # What of the gyroscopic term (18) has delta' delta in J0: -w x J w = -w x (J0 + dJ) w - w x delta' delta w.
        psi = psi - np.cross(w, delta.T @ delta @ w)
        d0 = 1e-4 * np.array([1 + 2 * np.sin(0.005 * t), -1 - 5 * np.cos(0.005 * t), 2 - 4 * np.sin(0.005 * t)])
        left = np.eye(3) + nominal @ hat
        found.append(
            -np.cross(w, uncertain @ w)
            + left @ psi
            - nominal @ hat @ np.cross(w, (nominal + uncertain) @ w)
            + nominal @ hat @ u
            + left @ d0
        )
    return np.array(found)


def test_disturbance_of_a_recording_is_that_of_equation_23() -> None:
    found = run_in_process(load("flexible", None, ("duration_s=20",)))
    graph = found.scenario.build()
    first, values = quantity(graph, found.recording, "/plant", "overall disturbance")
    assert first == 0
    states = found.recording.samples("/plant")[1]
    torques = held_torque(graph, found.recording, "/plant")
    rows = np.arange(0, 2000, 37)
    expected = of_equation_23(states[rows], torques[rows], rows / 100.0)
    assert values[rows] == pytest.approx(expected, abs=1e-9)
    _, accelerations = quantity(graph, found.recording, "/plant", "overall disturbance as acceleration")
    delta = np.array(load("flexible").nodes["/plant"]["dynamics"]["coupling_sqrt_kg_m"]).reshape(4, 3)
    nominal = square(tuple(load("flexible").nodes["/plant"]["dynamics"]["inertia_kg_m2"])) - delta.T @ delta
    assert accelerations[rows] == pytest.approx(np.linalg.solve(nominal, expected.T).T, abs=1e-11)


def test_angles_in_rad_are_the_attitude() -> None:
    found = run_in_process(load("flexible", None, ("duration_s=5",)))
    graph = found.scenario.build()
    _, angles = quantity(graph, found.recording, "/plant", "Euler angles in rad")
    states = found.recording.samples("/plant")[1]
    assert np.linalg.norm(angles, axis=1) == pytest.approx(
        mrp_rotation_angle(states[:, 0:3]), rel=0.05
    )  # small angles add nearly as vectors


def law(width: float) -> EventTriggeredSlidingMode:
    parameters = EventTriggeredSlidingModeParameters(
        inertia_bound_kg_m2=360.0, mu_1_s=3.0, disturbance_bound_nm=1.0, alpha_1_nm=0.001, beta_1_nms=530.0,
        boundary_layer_rad_s=width,
    )  # fmt: skip
    return EventTriggeredSlidingMode(parameters, 100)


def test_boundary_layer_is_linear_inside_and_the_sign_outside() -> None:
    signal = np.array([0.01, 0.0, 0.0, 0.05, -0.15, 0.3])
    whole = law(0.0).command(signal)
    assert law(0.15).command(signal) == pytest.approx(whole * [1.0 / 3.0, 1.0, 1.0], rel=1e-12)
    assert law(0.15).command(np.zeros(6)) == pytest.approx(np.zeros(3))
