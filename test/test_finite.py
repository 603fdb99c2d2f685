"""The quick question whether all numbers are numbers has the answer of the slow one."""

from __future__ import annotations

import warnings

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from hypothesis.extra.numpy import array_shapes, arrays

from etac_ros.maths.finite import all_finite
from etac_ros.parameters import FloatArray

numbers = st.one_of(st.floats(), st.sampled_from([1e200, -1e200, 5e-324, np.inf, -np.inf, np.nan]))


@given(arrays(np.float64, array_shapes(max_dims=3, min_side=0, max_side=4), elements=numbers))
def test_it_is_the_answer_of_isfinite(values: FloatArray) -> None:
    assert all_finite(values) is bool(np.isfinite(values).all())
    assert all_finite(values.T) is bool(np.isfinite(values).all())
    assert all_finite(values[..., ::2]) is bool(np.isfinite(values[..., ::2]).all())


@pytest.mark.parametrize("strange", [np.inf, -np.inf, np.nan])
@pytest.mark.parametrize("place", [0, 1, 700, 1023])
def test_one_among_many_is_found_and_large_numbers_are_numbers(strange: float, place: int) -> None:
    values = np.full((1024, 7), 1e300)
    assert all_finite(values)
    values[place, 3] = strange
    assert not all_finite(values)


@pytest.mark.parametrize("many", [3, 17, 4096, 4097])
def test_neither_large_numbers_nor_what_is_none_warns(many: int) -> None:
    values = np.full(many, 1e300)
    with warnings.catch_warnings():
        warnings.simplefilter("error")
        assert all_finite(values)
        values[0], values[-1] = np.inf, -np.inf
        assert not all_finite(values)
