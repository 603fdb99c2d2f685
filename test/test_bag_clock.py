"""Ticks and steps come back from the times in a bag exactly."""

import pytest
from hypothesis import given
from hypothesis import strategies as st

from etac_ros.bag.clock import MOST_STEPS, log_time_ns, published_ns, step_of, tick_of, tick_time_ns

rates = st.integers(1, 100_000)
ticks = st.integers(0, 10**12)


@given(ticks, rates)
def test_a_tick_comes_back_from_its_time(tick, rate):
    assert tick_of(tick_time_ns(tick, rate), rate) == tick


@given(ticks, rates)
def test_times_are_integers_below_the_true_time_by_less_than_a_nanosecond(tick, rate):
    time = tick_time_ns(tick, rate)
    assert isinstance(time, int)
    assert time * rate <= tick * 10**9 < (time + 1) * rate


@given(ticks, rates, st.integers(0, MOST_STEPS - 1))
def test_a_step_comes_back_and_stays_within_its_tick(tick, rate, step):
    published = tick_time_ns(tick, rate)
    logged = log_time_ns(published, step)
    assert step_of(logged, published) == step
    assert published_ns(logged, published) == published <= logged < tick_time_ns(tick + 1, rate)


@given(ticks, rates, st.integers(0, MOST_STEPS - 1))
def test_bags_of_before_with_both_times_exchanged_say_the_same(tick, rate, step):
    logged = tick_time_ns(tick, rate)
    published = logged + step
    assert step_of(logged, published) == step
    assert published_ns(logged, published) == logged


@given(ticks, rates, st.integers(1, 9_998))
def test_a_time_off_the_grid_is_refused(tick, rate, beside):
    with pytest.raises(ValueError, match="no tick"):
        tick_of(tick_time_ns(tick, rate) + beside, rate)


def test_known_times():
    assert tick_time_ns(1, 3) == 333_333_333
    assert tick_time_ns(32 * 1000, 32) == 1_000_000_000_000
    assert tick_of(31_250_000, 32) == 1


@pytest.mark.parametrize("step", [-1, MOST_STEPS])
def test_a_step_out_of_range_is_refused(step):
    with pytest.raises(ValueError, match=r"step .* is not within 0 \.\. 999"):
        log_time_ns(0, step)


@pytest.mark.parametrize("apart", [-MOST_STEPS, MOST_STEPS])
def test_times_too_far_apart_are_no_step(apart):
    with pytest.raises(ValueError, match="no step"):
        step_of(5000 + apart, 5000)
