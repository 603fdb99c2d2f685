"""Keys that every trigger rule has in a scenario: the least interval, and the longest silence (a heartbeat)."""

from __future__ import annotations

from typing import Any

import numpy as np
import numpy.typing as npt
from pydantic import Field, PositiveFloat

from etac_ros.maths.ticks import whole_ticks
from etac_ros.parameters import FloatArray, Parameters
from etac_ros.triggers.rule import AnyRule, RuleWithMemory, TriggerRule


class RuleTiming(Parameters):
    """What may stand beside the parameters of any trigger rule. Without these keys the rule alone decides."""

    least_interval_s: PositiveFloat | None = Field(
        default=None, description="nothing is sent sooner after the last time, a dwell time [s]"
    )
    longest_silence_s: PositiveFloat | None = Field(
        default=None, description="something is sent at the latest so long after the last time, a heartbeat [s]"
    )


class _Timed:
    """The two times in ticks, of a rule.

    Raises
    ------
    ValueError
        If a time is no whole number of ticks, or the silence ends before the interval.
    """

    def __init__(self, rule: AnyRule, timing: RuleTiming, ticks_per_second: int) -> None:
        self.least = 0 if timing.least_interval_s is None else whole_ticks(timing.least_interval_s, ticks_per_second)
        silence = timing.longest_silence_s
        self.longest = None if silence is None else whole_ticks(silence, ticks_per_second)
        if self.longest is not None and self.longest < self.least:
            raise ValueError(
                f"longest_silence_s {silence:g} is shorter than least_interval_s {timing.least_interval_s:g}"
            )
        self._margin = rule.margin

    def margin(self, signals: FloatArray, tick: int, held: FloatArray) -> tuple[FloatArray, FloatArray] | None:
        """Error and threshold of the rule itself."""
        return self._margin(signals, tick, held)


class TimedRule(_Timed):
    """A rule without memory that keeps a least interval and a longest silence."""

    Parameters = RuleTiming

    def __init__(self, rule: TriggerRule, timing: RuleTiming, ticks_per_second: int) -> None:
        super().__init__(rule, timing, ticks_per_second)
        self.rule = rule

    def first(self, signals: FloatArray, tick: int, held: FloatArray, held_tick: int | None = None) -> int:
        """Index of the first sample that fires, or -1."""
        assert held_tick is not None
        count = signals.shape[0]
        earliest = max(0, held_tick + self.least - tick)
        if earliest >= count:
            return -1
        index = self.rule.first(signals[earliest:], tick + earliest, held, held_tick)
        if isinstance(index, bool) or not isinstance(index, int | np.integer) or not -1 <= index < count - earliest:
            return index  # no index of a sample: whoever asked refuses it
        found = -1 if index < 0 else int(index) + earliest
        due = count if self.longest is None else max(earliest, held_tick + self.longest - tick)
        if due >= count:
            return found
        return due if found < 0 else min(found, due)


class TimedRuleWithMemory(_Timed):
    """A rule with memory that keeps a least interval and a longest silence."""

    Parameters = RuleTiming

    def __init__(self, rule: RuleWithMemory, timing: RuleTiming, ticks_per_second: int) -> None:
        super().__init__(rule, timing, ticks_per_second)
        self.rule = rule

    def initial_memory(self) -> FloatArray:
        """That of the rule."""
        return self.rule.initial_memory()

    def fold(
        self, signals: FloatArray, tick: int, held: FloatArray, held_tick: int, memory: FloatArray
    ) -> tuple[npt.NDArray[np.bool_], FloatArray]:
        """Whether each sample fires, and the memory after each."""
        fires, memories = self.rule.fold(signals, tick, held, held_tick, memory)
        since = tick - held_tick + np.arange(signals.shape[0])
        fires = fires & (since >= self.least)
        if self.longest is not None:
            fires |= since >= self.longest
        return fires, memories


def timed(rule: AnyRule, timing: RuleTiming, ticks_per_second: int) -> AnyRule:
    """The rule with the times that a scenario gives it: itself where it gives none.

    Raises
    ------
    ValueError
        If a time is no whole number of ticks, or the silence ends before the interval.
    """
    if timing.least_interval_s is None and timing.longest_silence_s is None:
        return rule
    kind: Any = TimedRuleWithMemory if hasattr(rule, "fold") else TimedRule
    around: AnyRule = kind(rule, timing, ticks_per_second)
    return around
