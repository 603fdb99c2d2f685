"""Carrier sense with random backoff: whoever draws the shortest wait begins, and who draws the same collides."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from fractions import Fraction

from pydantic import NonNegativeFloat, PositiveFloat, PositiveInt, model_validator

from etac_ros.media.access import Air, Turn, Waiting
from etac_ros.media.frame import Line
from etac_ros.parameters import Parameters


class CsmaParameters(Parameters):
    """Parameters of :class:`Csma`. The defaults are those of IEEE 802.15.4-2020 at 2450 MHz.

    aUnitBackoffPeriod is 20 symbols of 16 us, macMinBe 3, macMaxBe 5, macMaxFrameRetries 3 (clauses 6.2.5, 8.4.2, 11).
    """

    slot_s: PositiveFloat = 320.0e-6
    """Unit of the backoff [s], and the time in which one sender does not hear yet that another has begun."""
    gap_s: NonNegativeFloat = 0.0
    """For how long the air has to be idle before the backoff begins [s]."""
    window: PositiveInt = 8
    """Slots of which one is drawn at first; twice as many after each collision."""
    window_most: PositiveInt = 32
    tries: PositiveInt = 4
    """Collisions of a frame after which it is given up."""

    @model_validator(mode="after")
    def _in_order(self) -> CsmaParameters:
        if self.window > self.window_most:
            raise ValueError(f"window is {self.window}, and must be no more than window_most, {self.window_most}")
        return self


class Csma:
    """CSMA/CA in its essence: each waits a random number of slots once the air is idle, anew for every turn.

    Acknowledgements do not contend: as in both standards, they follow their frame at once, one after the other, before
    anybody else has sensed that the air is idle.

    Of what the standards add, this has neither the freezing of counters (802.11) nor the give-up after a busy channel
    (802.15.4); nobody is hidden from anybody.
    """

    Parameters = CsmaParameters

    def __init__(self, parameters: CsmaParameters, lines: Mapping[str, Line]) -> None:
        self._parameters = parameters
        self._slot = int(Fraction(repr(parameters.slot_s)) * 1_000_000_000)
        self._gap = int(Fraction(repr(parameters.gap_s)) * 1_000_000_000)

    def turn(self, air: Air, waiting: Sequence[Waiting]) -> Turn:
        """Who begins first, with all who begin before they could hear him."""
        if len(waiting) == 1:
            return Turn(max(air.now_ns, self._start(air, waiting[0])), (0,))
        first_of: dict[str, int] = {}  # a sender contends with one frame at a time
        for place, one in enumerate(waiting):
            if one.sender not in first_of or _sooner(one, waiting[first_of[one.sender]]):
                first_of[one.sender] = place
        starts = {place: max(air.now_ns, self._start(air, waiting[place])) for place in first_of.values()}
        first = min(starts.values())
        answers = [place for place, start in starts.items() if start == first and waiting[place].answers]
        if answers:
            return Turn(first, (min(answers, key=lambda place: waiting[place].order),))
        return Turn(first, tuple(sorted(place for place, start in starts.items() if start - first < self._slot)))

    def may_retry(self, collisions: int) -> bool:
        """Until the last of the tries."""
        return collisions < self._parameters.tries

    def _start(self, air: Air, frame: Waiting) -> int:
        if frame.answers:
            return max(air.idle_ns, frame.since_ns)
        window = min(self._parameters.window << min(frame.collisions, 32), self._parameters.window_most)
        return max(air.idle_ns, frame.since_ns) + self._gap + int(frame.drawn() * window) * self._slot


def _sooner(one: Waiting, other: Waiting) -> bool:
    """Which frame of a sender goes first: acknowledgements before all else, then the oldest."""
    return (not one.answers, one.order) < (not other.answers, other.order)
