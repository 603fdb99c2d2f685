"""What a run of a sweep draws belongs to (master seed, run, key), and to nothing else."""

from __future__ import annotations

from typing import Any

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from scipy.spatial.transform import Rotation

from etac_ros.errors import ScenarioError
from etac_ros.maths.mrp import mrp_to_quaternion
from etac_ros.scenario.schema import Dispersion
from etac_ros.sweep.draws import check_target, dispersed, run_seed

RUNS = range(3000)
seeds = st.integers(0, 2**31)
runs = st.integers(0, 10**6)


def many(value: Any, key: str = "a.b", **kind: float) -> np.ndarray[Any, Any]:
    return np.array([dispersed(value, key, Dispersion(**kind), 7, run) for run in RUNS])


def angles(a: np.ndarray[Any, Any], b: np.ndarray[Any, Any]) -> np.ndarray[Any, Any]:
    """Angle between attitudes [deg], from the scalar product of their quaternions."""
    return np.degrees(2.0 * np.arccos(np.clip(np.abs(np.sum(a * b, axis=-1)), 0.0, 1.0)))


@given(seeds, runs)
def test_a_draw_can_be_had_again_in_any_order(seed: int, run: int) -> None:
    kind = Dispersion(normal=2.0)
    first = dispersed([1.0, 2.0], "a.b", kind, seed, run)
    dispersed([1.0, 2.0], "a.b", kind, seed, run + 1)
    assert dispersed([1.0, 2.0], "a.b", kind, seed, run) == first
    assert dispersed([1.0, 2.0], "a.b", kind, seed, run + 1) != first
    assert dispersed([1.0, 2.0], "a.b", kind, seed + 1, run) != first
    assert dispersed([1.0, 2.0], "a.c", kind, seed, run) != first


@given(seeds, runs, st.floats(-1e3, 1e3))
def test_the_deviate_does_not_depend_on_what_it_is_added_to(seed: int, run: int, value: float) -> None:
    kind = Dispersion(uniform=3.0)
    there = dispersed(value, "a.b", kind, seed, run)
    assert isinstance(there, float)
    assert there - value == pytest.approx(dispersed(0.0, "a.b", kind, seed, run), abs=1e-9)


@given(seeds, runs)
def test_seeds_of_runs_fit_into_a_signed_number_and_differ(seed: int, run: int) -> None:
    assert 0 <= run_seed(seed, run) < 2**63
    assert len({run_seed(seed, run), run_seed(seed, run + 1), run_seed(seed + 1, run)}) == 3


def test_normal_has_its_mean_and_standard_deviation() -> None:
    found = many([5.0, -1.0], normal=0.5)
    assert found.mean(axis=0) == pytest.approx([5.0, -1.0], abs=0.04)
    assert found.std(axis=0) == pytest.approx([0.5, 0.5], rel=0.06)
    assert abs(np.corrcoef(found.T)[0, 1]) < 0.08


def test_uniform_fills_its_range() -> None:
    found = many(10.0, uniform=2.0)
    assert 8.0 < found.min() < 8.01
    assert 11.99 < found.max() < 12.0
    assert found.std() == pytest.approx(2.0 / np.sqrt(3.0), rel=0.05)


@pytest.mark.parametrize("norm", [1.0, 1.3])
def test_a_turned_quaternion_keeps_its_norm_and_turns_by_sigma_an_axis(norm: float) -> None:
    start = norm * np.array([0.5, -0.5, 0.5, 0.5])
    found = many([float(number) for number in start], rotation_deg=2.0)
    assert np.linalg.norm(found, axis=1) == pytest.approx(norm, abs=1e-12)
    turned = angles(found / norm, start / norm)
    assert np.sqrt(np.mean(turned**2)) == pytest.approx(2.0 * np.sqrt(3.0), rel=0.04)
    # Body-fixed: the turn, which is what happens to the unit attitude, stands behind the attitude.
    turns = many([1.0, 0.0, 0.0, 0.0], rotation_deg=2.0)
    expected = Rotation.from_quat(np.roll(start / norm, -1)) * Rotation.from_quat(np.roll(turns, -1, axis=1))
    assert angles(np.roll(expected.as_quat(), 1, axis=1), found / norm).max() < 1e-5
    vectors = np.degrees(2.0 * turns[:, 1:])
    assert vectors.mean(axis=0) == pytest.approx([0.0, 0.0, 0.0], abs=0.15)
    assert vectors.std(axis=0) == pytest.approx([2.0, 2.0, 2.0], rel=0.06)


@pytest.mark.parametrize("start", [[0.1, -0.2, 0.3], [0.0, 0.999, 0.0], [0.0, 0.0, 0.0]])
def test_a_turned_mrp_is_the_same_attitude_as_the_turned_quaternion(start: list[float]) -> None:
    found = many(start, "plant.attitude_mrp", rotation_deg=3.0)
    assert np.linalg.norm(found, axis=1).max() <= 1.0
    quaternion = [float(number) for number in mrp_to_quaternion(np.array(start))]
    same = many(quaternion, "plant.attitude_mrp", rotation_deg=3.0)
    assert angles(mrp_to_quaternion(found), same).max() < 1e-5


@pytest.mark.parametrize(
    ("key", "value", "kind", "said"),
    [
        ("a.word", "fast", {"normal": 1.0}, "number"),
        ("a.flag", True, {"normal": 1.0}, "number"),
        ("a.substeps", 1, {"uniform": 1.0}, "whole numbers"),
        ("a.empty", [], {"normal": 1.0}, "number"),
        ("a.mixed", [1.0, "x"], {"normal": 1.0}, "number"),
        ("a.section", {"b": 1.0}, {"normal": 1.0}, "number"),
        ("a.euler_deg", [1.0, 2.0, 3.0], {"rotation_deg": 1.0}, "_mrp"),
        ("a.k", 2.0, {"rotation_deg": 1.0}, "quaternion"),
    ],
)
def test_what_cannot_be_dispersed_is_refused(key: str, value: Any, kind: dict[str, float], said: str) -> None:
    with pytest.raises(ScenarioError, match=said) as caught:
        check_target(key, value, Dispersion(**kind), "file.yaml: here")
    assert "file.yaml: here" in str(caught.value)
    assert key in str(caught.value)


@pytest.mark.parametrize(
    ("key", "value", "kind"),
    [
        ("a.k", 2.0, {"normal": 1.0}),
        ("a.list", [2.0], {"uniform": 1.0}),
        ("a.q", [1.0, 0.0, 0.0, 0.0], {"rotation_deg": 1.0}),
        ("a.start_mrp", [0.0, 0.0, 0.0], {"rotation_deg": 1.0}),
    ],
)
def test_numbers_and_attitudes_may_be_dispersed(key: str, value: Any, kind: dict[str, float]) -> None:
    check_target(key, value, Dispersion(**kind), "here")
