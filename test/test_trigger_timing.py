"""The keys of every trigger rule: the least interval and the longest silence."""

from __future__ import annotations

from collections.abc import Callable
from itertools import pairwise
from pathlib import Path

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from hypothesis.extra.numpy import arrays
from test_promises import RULE

from etac_ros.errors import ScenarioError
from etac_ros.parameters import FloatArray
from etac_ros.runs import run_in_process
from etac_ros.scenario.load import load
from etac_ros.triggers.relative import RelativeThreshold, RelativeThresholdParameters
from etac_ros.triggers.timing import RuleTiming, TimedRule, timed

Small = Callable[..., Path]
TICKS_PER_SECOND = 10
rows = arrays(np.float64, st.tuples(st.integers(1, 15), st.just(2)), elements=st.floats(-1.0, 1.0))
rule = RelativeThreshold(RelativeThresholdParameters(alpha=0.5, gamma=0.3), TICKS_PER_SECOND)


def around(least: int | None, longest: int | None) -> TimedRule:
    timing = RuleTiming(
        least_interval_s=None if least is None else least / TICKS_PER_SECOND,
        longest_silence_s=None if longest is None else longest / TICKS_PER_SECOND,
    )
    found = timed(rule, timing, TICKS_PER_SECOND)  # type: ignore[arg-type]
    return found  # type: ignore[return-value]


@given(signals=rows, tick=st.integers(1, 30), since=st.integers(1, 30), least=st.integers(1, 9), more=st.integers(0, 9))
def test_a_sample_fires_when_rule_and_times_say_so(
    signals: FloatArray, tick: int, since: int, least: int, more: int
) -> None:
    held, held_tick = np.zeros(2), tick - since
    errors, thresholds = rule.margin(signals, tick, held) or (np.empty(0), np.empty(0))
    age = since + np.arange(len(signals))
    longest = least + more
    for low, high in ((least, longest), (None, longest), (least, None)):
        fires = (errors >= thresholds) & (age >= (low or 0))
        if high is not None:
            fires |= age >= high
        expected = int(np.argmax(fires)) if fires.any() else -1
        assert around(low, high).first(signals, tick, held, held_tick) == expected


def test_without_the_keys_the_rule_is_itself() -> None:
    assert timed(rule, RuleTiming(), TICKS_PER_SECOND) is rule  # type: ignore[arg-type, comparison-overlap]


def test_the_keys_stand_beside_those_of_the_rule(small: Small) -> None:
    plain = run_in_process(load(str(small()))).summary.triggers["/sensor"].times_s
    with_times = RULE.replace("}", ", least_interval_s: 0.6, longest_silence_s: 1.2}")
    instants = run_in_process(load(str(small((RULE, with_times))))).summary.triggers["/sensor"].times_s
    gaps = [round(later - sooner, 9) for sooner, later in pairwise(instants)]
    assert min(gaps) >= 0.6
    assert max(gaps) <= 1.2
    assert instants != plain


@pytest.mark.parametrize(
    ("keys", "words"),
    [
        ("longest_silence_s: 0.25", "no whole number of ticks"),
        ("least_interval_s: 2.0, longest_silence_s: 1.0", "longest_silence_s 1 is shorter than least_interval_s 2"),
        ("least_interval_s: -1.0", "/sensor.trigger.least_interval_s: found -1"),
        ("least_intervall_s: 1.0", "'least_interval_s'?"),
    ],
)
def test_times_that_make_no_sense_are_refused(keys: str, words: str, small: Small) -> None:
    with pytest.raises(ScenarioError, match=words):
        load(str(small((RULE, RULE.replace("}", f", {keys}}}")))))


class Asked:
    """Never fires, and keeps what it was asked."""

    def __init__(self) -> None:
        self.asked: list[tuple[list[float], int, int | None]] = []
        self.margin = rule.margin

    def first(self, signals: FloatArray, tick: int, held: FloatArray, held_tick: int | None = None) -> int:
        self.asked.append((signals[:, 0].tolist(), tick, held_tick))
        return -1


class Adding:
    """Fires on what is positive; its memory is the sum of all that it has seen."""

    margin = rule.margin

    def initial_memory(self) -> FloatArray:
        return np.zeros(1)

    def fold(self, signals: FloatArray, tick: int, held: FloatArray, held_tick: int, memory: FloatArray):  # type: ignore[no-untyped-def]
        return signals[:, 0] > 0.0, memory + np.cumsum(signals, axis=0)


def test_the_rule_is_asked_about_the_samples_that_may_fire_with_their_tick() -> None:
    asked = Asked()
    around = timed(asked, RuleTiming(least_interval_s=0.5), TICKS_PER_SECOND)  # type: ignore[arg-type]
    signals = np.arange(4.0)[:, np.newaxis]
    for tick in (11, 12, 14, 15, 20):
        around.first(signals, tick, np.zeros(1), 10)  # type: ignore[union-attr]
    # At tick 11 none of the four may fire yet.
    assert asked.asked == [
        ([3.0], 15, 10),
        ([1.0, 2.0, 3.0], 15, 10),
        ([0.0, 1.0, 2.0, 3.0], 15, 10),
        ([0.0, 1.0, 2.0, 3.0], 20, 10),
    ]


@pytest.mark.parametrize(
    ("times", "expected"),
    [
        ({"least_interval_s": 0.3}, [False, False, True, False, True]),
        ({"longest_silence_s": 0.4}, [True, False, True, True, True]),
        ({"least_interval_s": 0.3, "longest_silence_s": 0.4}, [False, False, True, True, True]),
    ],
)
def test_a_rule_with_memory_keeps_the_times_and_its_memory(times: dict[str, float], expected: list[bool]) -> None:
    around = timed(Adding(), RuleTiming(**times), TICKS_PER_SECOND)  # type: ignore[arg-type]
    signals = np.array([1.0, 0.0, 1.0, 0.0, 1.0])[:, np.newaxis]
    # The first sample is one tick after what is held.
    fires, memories = around.fold(signals, 21, np.zeros(1), 20, around.initial_memory())  # type: ignore[union-attr]
    assert fires.tolist() == expected
    assert memories.ravel().tolist() == [1.0, 1.0, 2.0, 2.0, 3.0]
