"""Attitude maths: the conventions of ``etac_ros.maths``, held against each other and against scipy."""

from __future__ import annotations

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from scipy.spatial.transform import Rotation

from etac_ros.maths.quaternion import (
    dcm,
    from_euler_321,
    normalise,
    perturbed_attitudes,
    product,
    quaternion_rate,
    rotation_angle,
    to_euler_321,
)
from etac_ros.parameters import FloatArray

angles = st.floats(-np.pi, np.pi)
components = st.floats(-1.0, 1.0)
vectors = st.tuples(components, components, components).map(np.array)
raw_quaternions = (
    st.tuples(components, components, components, components)
    .map(np.array)
    .filter(lambda q: float(np.linalg.norm(q)) > 1e-3)
)
quaternions = raw_quaternions.map(lambda q: q / np.linalg.norm(q))


def times(a: FloatArray, b: FloatArray) -> FloatArray:
    out = np.empty(4)
    product(a, b, out)
    return out


def matrix(q: FloatArray) -> FloatArray:
    C = np.empty((3, 3))
    dcm(q, C)
    return C


def rate(q: FloatArray, omega: FloatArray) -> FloatArray:
    dq = np.empty(4)
    quaternion_rate(q, omega, dq)
    return dq


@given(raw_quaternions)
def test_normalise_scales_to_unit_norm(q: FloatArray) -> None:
    unit = q.copy()
    normalise(unit)
    assert np.linalg.norm(unit) == pytest.approx(1.0, abs=4e-16)
    assert unit == pytest.approx(q / np.linalg.norm(q), abs=1e-15)


@given(quaternions, quaternions)
def test_product_of_unit_quaternions_is_one(a: FloatArray, b: FloatArray) -> None:
    assert np.linalg.norm(times(a, b)) == pytest.approx(1.0, abs=1e-15)


@given(quaternions, quaternions, quaternions)
def test_product_is_associative(a: FloatArray, b: FloatArray, c: FloatArray) -> None:
    assert times(times(a, b), c) == pytest.approx(times(a, times(b, c)), abs=1e-15)


@given(quaternions)
def test_conjugate_undoes(q: FloatArray) -> None:
    conjugate = q * [1.0, -1.0, -1.0, -1.0]
    assert times(q, conjugate) == pytest.approx([1.0, 0.0, 0.0, 0.0], abs=1e-15)


@given(quaternions)
def test_dcm_is_a_rotation(q: FloatArray) -> None:
    C = matrix(q)
    assert pytest.approx(np.eye(3), abs=2e-15) == C @ C.T
    assert np.linalg.det(C) == pytest.approx(1.0, abs=4e-15)


@given(quaternions)
def test_dcm_takes_reference_components_to_the_body(q: FloatArray) -> None:
    # scipy's matrix (scalar last) turns vectors, so it takes body components to the reference frame.
    turned = Rotation.from_quat(q[[1, 2, 3, 0]]).as_matrix()
    assert matrix(q) == pytest.approx(turned.T, abs=1e-15)


@given(quaternions, quaternions)
def test_product_follows_in_the_body(q_BN: FloatArray, q_CB: FloatArray) -> None:
    assert matrix(times(q_BN, q_CB)) == pytest.approx(matrix(q_CB) @ matrix(q_BN), abs=4e-15)


@given(quaternions, vectors)
def test_kinematics_agree_with_a_small_turn_in_the_body(q: FloatArray, omega: FloatArray) -> None:
    # Central difference over the exact solution for a constant rate.
    h = 1e-4
    angle = np.linalg.norm(omega)

    def after(t: float) -> FloatArray:
        turn = np.array([np.cos(angle * t / 2.0), *(0.5 * t * np.sinc(angle * t / (2.0 * np.pi)) * omega)])
        return times(q, turn)

    assert rate(q, omega) == pytest.approx((after(h) - after(-h)) / (2.0 * h), abs=1e-8)


@given(quaternions, vectors)
def test_kinematics_agree_with_those_of_the_dcm(q: FloatArray, omega: FloatArray) -> None:
    h = 1e-4
    dq = rate(q, omega)
    assert q @ dq == pytest.approx(0.0, abs=1e-15)
    difference = (matrix(q + h * dq) - matrix(q - h * dq)) / (2.0 * h)
    cross = np.array([[0.0, -omega[2], omega[1]], [omega[2], 0.0, -omega[0]], [-omega[1], omega[0], 0.0]])
    assert difference == pytest.approx(-cross @ matrix(q), abs=1e-8)


@given(angles, st.floats(-1.5, 1.5), angles)
def test_euler_angles_there_and_back(roll: float, pitch: float, yaw: float) -> None:
    back = to_euler_321(from_euler_321([roll, pitch, yaw]))
    difference = back - [roll, pitch, yaw]
    assert (difference + np.pi) % (2.0 * np.pi) - np.pi == pytest.approx(np.zeros(3), abs=1e-12)


@given(angles, st.floats(-1.5, 1.5), angles)
def test_euler_angles_are_yaw_pitch_roll(roll: float, pitch: float, yaw: float) -> None:
    q = from_euler_321([roll, pitch, yaw])
    intrinsic = Rotation.from_euler("ZYX", [yaw, pitch, roll]).as_matrix()
    assert matrix(q) == pytest.approx(intrinsic.T, abs=2e-15)


def test_euler_angles_of_many_are_those_of_each() -> None:
    qs = np.array([from_euler_321([0.1 * i, -0.2 * i, 0.3 * i]) for i in range(5)])
    assert np.array_equal(to_euler_321(qs), np.array([to_euler_321(q) for q in qs]))


def test_pitch_beside_the_singularity_is_no_nan() -> None:
    beyond_by_rounding = np.array([1.0, 0.0, 1.0, 0.0]) * (np.sqrt(0.5) + 1e-15)
    assert to_euler_321(beyond_by_rounding)[1] == pytest.approx(np.pi / 2.0)


@given(quaternions)
def test_rotation_angle_is_that_of_the_shortest_rotation(q: FloatArray) -> None:
    assert rotation_angle(q) == pytest.approx(Rotation.from_quat(q[[1, 2, 3, 0]]).magnitude(), abs=1e-12)
    assert rotation_angle(-q) == rotation_angle(q)


@given(quaternions, vectors)
def test_perturbed_attitude_is_off_by_the_rotation_vector_in_the_body(q: FloatArray, way: FloatArray) -> None:
    error = 1e-4 * way
    seen = perturbed_attitudes(q[np.newaxis], error[np.newaxis])[0]
    assert np.linalg.norm(seen) == pytest.approx(1.0, abs=1e-15)
    off = times(q * [1.0, -1.0, -1.0, -1.0], seen)
    assert 2.0 * off[1:] == pytest.approx(error, abs=1e-12)


def test_perturbed_attitudes_of_many_are_those_of_each() -> None:
    rng = np.random.default_rng(1)
    qs = rng.normal(size=(20, 4))
    qs /= np.linalg.norm(qs, axis=1)[:, np.newaxis]
    errors = 1e-3 * rng.normal(size=(20, 3))
    each = [perturbed_attitudes(qs[i : i + 1], errors[i : i + 1])[0] for i in range(20)]
    assert np.array_equal(perturbed_attitudes(qs, errors), np.array(each))
