"""Noise belongs to its tick: the same draws whatever the windows are, and no two streams alike."""

from __future__ import annotations

from itertools import pairwise

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from scipy import stats

from etac_ros.maths.noise import normals, stream_key, uniforms

TICKS = 60
widths = st.integers(1, 13)
cuts = st.lists(st.integers(0, TICKS), max_size=6).map(lambda some: sorted({0, TICKS, *some}))


@given(st.integers(0, 2**40), widths, cuts)
def test_windows_of_any_cut_give_the_same_draws(first: int, width: int, cuts: list[int]) -> None:
    key = stream_key(1, "/sensor")
    together = normals(key, first, TICKS, width)
    parts = [normals(key, first + start, end - start, width) for start, end in pairwise(cuts)]
    assert together.shape == (TICKS, width)
    assert np.concatenate(parts).tobytes() == together.tobytes()


@given(st.integers(0, 10**6), widths)
def test_ticks_differ_from_each_other(first: int, width: int) -> None:
    draws = uniforms(stream_key(1, "/sensor"), first, TICKS, width)
    assert np.unique(draws).size == draws.size


@given(
    st.lists(st.tuples(st.integers(0, 2**63), st.text(max_size=8)), min_size=2, max_size=5, unique=True),
)
def test_seeds_and_names_separate_streams(streams: list[tuple[int, str]]) -> None:
    draws = np.array([uniforms(stream_key(seed, name), 0, 8, 3).ravel() for seed, name in streams])
    assert np.unique(draws).size == draws.size


def test_seed_and_name_both_count_and_do_not_run_into_each_other() -> None:
    keys = [stream_key(1, "/x"), stream_key(2, "/x"), stream_key(1, "/y"), stream_key(11, "/x"), stream_key(1, "1/x")]
    assert len(set(keys)) == len(keys)


@given(st.integers(0, 2**63), st.integers(0, 2**40), widths)
def test_deviates_are_finite_and_uniforms_lie_inside(seed: int, first: int, width: int) -> None:
    key = stream_key(seed, "/sensor")
    even = uniforms(key, first, TICKS, width)
    assert ((even > 0.0) & (even < 1.0)).all()
    assert np.isfinite(normals(key, first, TICKS, width)).all()


def test_no_word_gives_an_infinite_deviate(monkeypatch: pytest.MonkeyPatch) -> None:
    class Extremes:
        """In place of the generator: the smallest and the largest words there are."""

        def __init__(self, **position: int) -> None:
            pass

        def random_raw(self, count: int) -> np.ndarray:
            return np.resize(np.array([0, 2**64 - 1], dtype=np.uint64), count)

    monkeypatch.setattr(np.random, "Philox", Extremes)
    even = uniforms(1, 0, 1, 4)
    assert ((even > 0.0) & (even < 1.0)).all()
    assert np.isfinite(normals(1, 0, 1, 4)).all()


def test_moments_of_the_standard_normal() -> None:
    draws = normals(stream_key(7, "/sensor"), 0, 40_000, 6)
    # Five standard errors of each estimate: fixed draws, so it holds or it does not.
    assert np.abs(draws.mean(axis=0)).max() < 5.0 / np.sqrt(40_000)
    assert np.abs(draws.var(axis=0) - 1.0).max() < 5.0 * np.sqrt(2.0 / 40_000)
    assert np.abs(np.corrcoef(draws.T) - np.eye(6)).max() < 5.0 / np.sqrt(40_000)
    along = [np.corrcoef(draws[:-1, i], draws[1:, i])[0, 1] for i in range(6)]
    assert np.abs(along).max() < 5.0 / np.sqrt(40_000)
    assert stats.kstest(draws.ravel(), "norm").pvalue > 1e-3
