"""Modified Rodrigues parameters against scipy's rotations, against quaternions, and against their matrix form."""

from __future__ import annotations

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from hypothesis.extra.numpy import arrays
from scipy.integrate import solve_ivp
from scipy.spatial.transform import Rotation

from etac_ros.maths.mrp import (
    mrp_rate,
    mrp_rotation_angle,
    mrp_to_euler_321,
    mrp_to_quaternion,
    omega_of_mrp_rate,
    switch_shadow,
)
from etac_ros.maths.quaternion import from_euler_321, quaternion_rate
from etac_ros.parameters import FloatArray

vectors = arrays(np.float64, 3, elements=st.floats(-3.0, 3.0))
mrps = vectors.filter(lambda p: np.linalg.norm(p) > 1e-3)


def rate(p: FloatArray, omega: FloatArray) -> FloatArray:
    dp = np.empty(3)
    mrp_rate(p, omega, dp)
    return dp


def switched(p: FloatArray) -> FloatArray:
    p = p.copy()
    switch_shadow(p)
    return p


def same_attitude(p: FloatArray, other: FloatArray, tolerance: float = 1e-14) -> bool:
    q, r = mrp_to_quaternion(p), mrp_to_quaternion(other)
    return bool(min(np.abs(q - r).max(), np.abs(q + r).max()) < tolerance)


@given(mrps)
def test_the_shadow_set_is_the_same_attitude_and_no_longer_than_one(p: FloatArray) -> None:
    shadow = switched(p)
    assert same_attitude(p, shadow)
    assert np.linalg.norm(shadow) <= 1.0 + 1e-15
    assert np.array_equal(switched(shadow), shadow)


@given(mrps)
def test_below_one_nothing_is_switched_and_above_one_it_is(p: FloatArray) -> None:
    inside, outside = 0.999 * p / np.linalg.norm(p), 1.001 * p / np.linalg.norm(p)
    assert np.array_equal(switched(inside), inside)
    assert switched(outside) == pytest.approx(-outside / 1.001**2, rel=1e-12)


def test_a_rotation_by_hand() -> None:
    """A turn of 60 degrees about y: tan(15 deg) = 2 - sqrt 3. The shadow of 300 degrees is minus that."""
    p = np.array([0.0, 2.0 - np.sqrt(3.0), 0.0])
    assert mrp_to_quaternion(p) == pytest.approx([np.sqrt(0.75), 0.0, 0.5, 0.0], abs=1e-15)
    assert mrp_rotation_angle(p) == pytest.approx(np.pi / 3.0, abs=1e-15)
    assert mrp_to_euler_321(p) == pytest.approx([0.0, np.pi / 3.0, 0.0], abs=1e-15)
    assert switched(np.array([0.0, 2.0 + np.sqrt(3.0), 0.0])) == pytest.approx(-p, abs=1e-15)


@given(vectors)
def test_quaternion_is_scipys(p: FloatArray) -> None:
    theirs = Rotation.from_mrp(p).as_quat(scalar_first=True)
    ours = mrp_to_quaternion(p)
    assert ours * np.sign(ours @ theirs) == pytest.approx(theirs, abs=1e-14)


@given(arrays(np.float64, (5, 3), elements=st.floats(-3.0, 3.0)))
def test_angle_is_that_of_the_shortest_rotation(p: FloatArray) -> None:
    assert mrp_rotation_angle(p) == pytest.approx(Rotation.from_mrp(p).magnitude(), abs=1e-12)


def test_angle_of_no_rotation_and_of_half_a_turn() -> None:
    assert mrp_rotation_angle(np.zeros(3)) == 0.0
    assert mrp_rotation_angle(np.array([0.6, 0.0, 0.8])) == pytest.approx(np.pi, abs=1e-15)


@given(st.floats(-3.1, 3.1), st.floats(-1.5, 1.5), st.floats(-3.1, 3.1))
def test_euler_angles_come_back(roll: float, pitch: float, yaw: float) -> None:
    p = Rotation.from_euler("ZYX", [yaw, pitch, roll]).as_mrp()
    assert mrp_to_euler_321(p) == pytest.approx([roll, pitch, yaw], abs=1e-11)
    # A quaternion of the same angles is the same attitude.
    q = from_euler_321([roll, pitch, yaw])
    assert mrp_to_quaternion(p) * np.sign(mrp_to_quaternion(p) @ q) == pytest.approx(q, abs=1e-14)


def test_arrays_of_attitudes_are_their_rows() -> None:
    p = np.random.default_rng(3).normal(size=(7, 3))
    for function in (mrp_to_quaternion, mrp_to_euler_321, mrp_rotation_angle):
        assert np.array_equal(function(p), np.array([function(row) for row in p]))


@given(vectors, vectors)
def test_rate_is_the_printed_matrix(p: FloatArray, omega: FloatArray) -> None:
    """Eq. (5) of the flexible paper, as matrices."""
    cross = np.array([[0.0, -p[2], p[1]], [p[2], 0.0, -p[0]], [-p[1], p[0], 0.0]])
    G = 0.25 * ((1.0 - p @ p) * np.eye(3) + 2.0 * cross + 2.0 * np.outer(p, p))
    assert rate(p, omega) == pytest.approx(G @ omega, abs=1e-13)


@given(vectors, vectors)
def test_angular_velocity_comes_back_from_the_rate(p: FloatArray, omega: FloatArray) -> None:
    found = np.empty(3)
    omega_of_mrp_rate(p, rate(p, omega), found)
    assert found == pytest.approx(omega, abs=1e-13)


@given(vectors, vectors)
def test_rate_is_that_of_the_quaternion(p: FloatArray, omega: FloatArray) -> None:
    """``p = q_v / (1 + q0)``, differentiated by hand."""
    q, dq = mrp_to_quaternion(p), np.empty(4)
    quaternion_rate(q, omega, dq)
    expected = (dq[1:] - p * dq[0]) / (1.0 + q[0])
    assert rate(p, omega) == pytest.approx(expected, rel=1e-9, abs=1e-9)


@given(mrps, vectors)
def test_the_shadow_set_obeys_the_same_kinematics(p: FloatArray, omega: FloatArray) -> None:
    """The derivative of ``-p / |p|^2`` along the motion is the rate at the shadow set."""
    square = p @ p
    dp = rate(p, omega)
    expected = -dp / square + 2.0 * p * (p @ dp) / square**2
    assert rate(-p / square, omega) == pytest.approx(expected, rel=1e-9, abs=float(1e-9 / square**2))


@pytest.mark.parametrize("omega", [[0.7, -0.4, 0.5], [-0.1, 0.9, 0.3]])
def test_a_steady_turn_is_that_of_scipy(omega: list[float]) -> None:
    """A constant rate in the body for 20 s, with the shadow set whenever it is due: several full turns."""
    w = np.array(omega)
    start = Rotation.from_euler("ZYX", [0.4, -0.3, 0.2])
    p = start.as_mrp()
    switches = 0
    for second in range(20):
        solution = solve_ivp(lambda t, y: rate(y, w), (0.0, 1.0), p, method="DOP853", rtol=1e-13, atol=1e-14)
        p = solution.y[:, -1]
        switches += int(np.linalg.norm(p) > 1.0)
        p = switched(p)
        expected = (start * Rotation.from_rotvec(w * (second + 1.0))).as_mrp()
        assert same_attitude(p, expected, 1e-11)
    assert switches >= 2
