"""Norms of rows are numpy's to the bit."""

from __future__ import annotations

import numpy as np
from hypothesis import given
from hypothesis import strategies as st
from hypothesis.extra.numpy import arrays

from etac_ros.maths.norms import row_norms
from etac_ros.parameters import FloatArray

numbers = st.one_of(st.floats(), st.floats(-1.0, 1.0), st.sampled_from([1e200, 5e-324, np.inf, np.nan]))


@given(arrays(np.float64, st.tuples(st.integers(0, 20), st.just(5)), elements=numbers))
def test_they_have_the_bits_of_numpys(states: FloatArray) -> None:
    with np.errstate(all="ignore"):
        for vectors in (states[:, 1:4], np.ascontiguousarray(states[:, 1:4])):
            assert row_norms(vectors).tobytes() == np.linalg.norm(vectors, axis=-1).tobytes()
            for vector in vectors[:2]:
                assert row_norms(vector).tobytes() == np.linalg.norm(vector, axis=-1).tobytes()


def test_so_they_have_of_many() -> None:
    states = np.random.default_rng(3).normal(size=(30000, 7)) * 10.0 ** np.arange(-3, 4)
    assert row_norms(states[:, 4:7]).tobytes() == np.linalg.norm(states[:, 4:7], axis=1).tobytes()
