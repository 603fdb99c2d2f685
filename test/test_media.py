"""Shared media: for every access rule an execution trace, computed by hand, and what holds for all of them.

Times are in microseconds here; a medium counts nanoseconds.
"""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

import pytest
from hypothesis import given
from hypothesis import strategies as st

from etac_ros.errors import ProtocolError
from etac_ros.maths.noise import uniform, uniforms
from etac_ros.media.access import Air, Turn, Waiting, WithoutCollisions
from etac_ros.media.csma import Csma, CsmaParameters
from etac_ros.media.fifo import Fifo, FifoParameters
from etac_ros.media.frame import Fate, Line, Outcome, landing_tick
from etac_ros.media.medium import Full, Medium, MediumPlan
from etac_ros.media.priority import Priority, PriorityParameters
from etac_ros.media.round_robin import RoundRobin, RoundRobinParameters
from etac_ros.media.tdma import Tdma, TdmaParameters

US = 1000
LINES = {"a1": Line("/a", 4, 10, 100 * US), "a2": Line("/a", 4, 20, 200 * US), "b1": Line("/b", 4, 10, 100 * US)}
"""Two links of one sender, the second with longer frames, and one of another."""
RULES: dict[str, Any] = {
    "fifo": Fifo(FifoParameters(), LINES),
    "priority": Priority(PriorityParameters(order=("b1", "a2")), LINES),
    "round robin": RoundRobin(RoundRobinParameters(), LINES),
    "tdma": Tdma(TdmaParameters(slot_s=250e-6), LINES),
    "csma": Csma(CsmaParameters(slot_s=20e-6, window=4, window_most=8, tries=3), LINES),
}
Offer = tuple[int, str]
"""When [us], and on which link."""


def medium(rule: Any, full: Full = Full.NEWEST, length: int = 64, propagation_us: int = 0) -> Medium:
    return Medium(MediumPlan("air", 1, 1.0, propagation_us * US, length, full, LINES, rule))


def run(air: Medium, offers: Sequence[Offer]) -> list[Fate]:
    """Drive a medium as the time master does: to each offer, and then from event to event until nothing waits."""
    numbers = dict.fromkeys(LINES, 0)
    for time, link in sorted(offers, key=lambda offer: offer[0]):
        air.advance(time * US)
        numbers[link] += 1
        air.offer(link, numbers[link], time * US)
    while (event := air.next_ns()) is not None:
        air.advance(event)
    return air.take_log()


def trace(fates: Sequence[Fate]) -> list[str]:
    return [
        f"{fate.start_ns / US:g}-{fate.end_ns / US:g} {fate.link}#{fate.sequence} {fate.outcome.name}" for fate in fates
    ]


TOGETHER = [(0, "a1"), (0, "a2"), (0, "b1"), (50, "b1"), (50, "a1"), (1000, "a2")]
TRACES = {
    # In the order of offering, one behind the other, and at once where the air is idle.
    "fifo": ["0-100 a1#1", "100-300 a2#1", "300-400 b1#1", "400-500 b1#2", "500-600 a1#2", "1000-1200 a2#2"],
    # b1 before a2 before a1, whoever came first; what is on the air stays there.
    "priority": ["0-100 b1#1", "100-200 b1#2", "200-400 a2#1", "400-500 a1#1", "500-600 a1#2", "1000-1200 a2#2"],
    # /a and /b in turn, of each the oldest.
    "round robin": ["0-100 a1#1", "100-200 b1#1", "200-400 a2#1", "400-500 b1#2", "500-600 a1#2", "1000-1200 a2#2"],
    # /a has 0-250, 500-750, 1000-1250; /b has 250-500. After a1#1 there are 150 left, too few for the 200 of a2#1, but
    # a1#2 is still to fit into the same slot; it is in another queue.
    "tdma": ["0-100 a1#1", "100-200 a1#2", "250-350 b1#1", "350-450 b1#2", "500-700 a2#1", "1000-1200 a2#2"],
}


@pytest.mark.parametrize("rule", list(TRACES))
def test_execution_trace(rule: str) -> None:
    assert trace(run(medium(RULES[rule]), TOGETHER)) == [f"{line} SENT" for line in TRACES[rule]]


class Draws(Csma):
    """Carrier sense with given draws instead of random ones: by link, sequence number and turn."""

    def __init__(self, draws: dict[tuple[str, int, int], int], **parameters: Any) -> None:
        super().__init__(CsmaParameters(slot_s=20e-6, **parameters), LINES)
        self._draws = draws

    def turn(self, air: Air, waiting: Sequence[Waiting]) -> Turn:
        return super().turn(air, [_Drawn.of(one, self._draws, self._parameters) for one in waiting])


class _Drawn(Waiting):
    slots: float

    @classmethod
    def of(cls, frame: Waiting, draws: dict[tuple[str, int, int], int], parameters: CsmaParameters) -> _Drawn:
        found = cls(*frame)
        window = min(parameters.window << frame.collisions, parameters.window_most)
        found.slots = (draws[frame.link, frame.sequence, frame.turns] + 0.5) / window
        return found

    def drawn(self) -> float:
        return self.slots


def test_execution_trace_of_carrier_sense() -> None:
    draws = {
        # Both draw 2 of 4 slots: they begin together at 40 and are lost. Then 5 and 1 of 8: /b begins a slot after the
        # air is idle at 140, /a sees that, and draws 3 anew once it is idle again at 260.
        ("a1", 1, 0): 2, ("b1", 1, 0): 2, ("a1", 1, 1): 5, ("b1", 1, 1): 1, ("a1", 1, 2): 3,
    }  # fmt: skip
    found = run(medium(Draws(draws, window=4, window_most=8)), [(0, "a1"), (0, "b1")])
    assert trace(found) == [
        "40-140 a1#1 COLLIDED",
        "40-140 b1#1 COLLIDED",
        "160-260 b1#1 SENT",
        "320-420 a1#1 SENT",
    ]


def test_a_frame_is_given_up_after_the_last_try_and_the_next_begins_anew() -> None:
    draws = {("a1", 1, 0): 0, ("b1", 1, 0): 0, ("a1", 1, 1): 1, ("b1", 1, 1): 1, ("a1", 2, 0): 0}
    found = run(medium(Draws(draws, window=2, window_most=2, tries=2)), [(0, "a1"), (0, "b1"), (10, "a1")])
    assert trace(found) == [
        "0-100 a1#1 COLLIDED",
        "0-100 b1#1 COLLIDED",
        "120-220 a1#1 GIVEN_UP",
        "120-220 b1#1 GIVEN_UP",
        "220-320 a1#2 SENT",
    ]


def test_one_sender_does_not_collide_with_itself() -> None:
    draws = {("a1", 1, 0): 0, ("a2", 1, 0): 0, ("a2", 1, 1): 0}
    assert trace(run(medium(Draws(draws)), [(0, "a1"), (0, "a2")])) == ["0-100 a1#1 SENT", "100-300 a2#1 SENT"]


QUEUES = {
    # Two frames wait at a sender at most; a1#1 is on the air from 0 to 100 and waits no more.
    Full.NEWEST: ["30-30 a2#1 DROPPED", "0-100 a1#1 SENT", "100-200 a1#2 SENT", "200-300 a1#3 SENT"],
    Full.OLDEST: ["30-30 a1#2 DROPPED", "0-100 a1#1 SENT", "100-200 a1#3 SENT", "200-400 a2#1 SENT"],
    Full.REPLACE: ["20-20 a1#2 DROPPED", "0-100 a1#1 SENT", "100-200 a1#3 SENT", "200-400 a2#1 SENT"],
}


@pytest.mark.parametrize("full", list(QUEUES))
def test_execution_trace_of_a_queue_that_is_full(full: Full) -> None:
    offers = [(0, "a1"), (10, "a1"), (20, "a1"), (30, "a2")]
    found = run(medium(RULES["fifo"], full, length=2), offers)
    assert sorted(trace(found)) == sorted(QUEUES[full])


def test_what_is_sent_lands_after_the_propagation_at_the_next_tick() -> None:
    air = medium(RULES["fifo"], propagation_us=7)
    air.offer("a1", 1, 0)
    assert air.next_ns() == 107 * US
    assert air.advance(107 * US - 1) == []
    (landed,) = air.advance(107 * US)
    assert (landed.end_ns, landed.landed_ns) == (100 * US, 107 * US)
    assert [landing_tick(landed.landed_ns, rate) for rate in (1, 9345, 9346, 1_000_000)] == [1, 1, 2, 107]


@given(
    st.sampled_from(list(RULES)),
    st.lists(st.tuples(st.integers(0, 1500), st.sampled_from(list(LINES))), min_size=1, max_size=30),
    st.sampled_from(list(Full)),
    st.integers(1, 4),
)
def test_what_holds_for_every_rule(rule: str, offers: list[Offer], full: Full, length: int) -> None:
    fates = run(medium(RULES[rule], full, length), offers)
    final = [fate for fate in fates if fate.outcome is not Outcome.COLLIDED]
    # Conservation: every frame has one end.
    offered = {link: sum(name == link for _, name in offers) for link in LINES}
    ends = sorted((fate.link, fate.sequence) for fate in final)
    assert ends == sorted((link, number) for link, count in offered.items() for number in range(1, count + 1))
    # Nobody sends what was not offered yet, and every frame takes its time.
    on_air = [fate for fate in fates if fate.outcome is not Outcome.DROPPED]
    assert all(fate.start_ns >= fate.offered_ns for fate in fates)
    assert all(fate.end_ns - fate.start_ns == LINES[fate.link].duration_ns for fate in on_air)
    # Only who collides is on the air together with others, and whoever is there with others collides.
    for one, other in ((one, other) for place, one in enumerate(on_air) for other in on_air[:place]):
        if one.start_ns < other.end_ns and other.start_ns < one.end_ns:
            assert Outcome.SENT not in (one.outcome, other.outcome)
            assert one.start_ns == other.start_ns
    assert rule == "csma" or all(fate.outcome in (Outcome.SENT, Outcome.DROPPED) for fate in fates)
    # A link keeps its order.
    for link in LINES:
        sent = [fate.sequence for fate in fates if fate.link == link and fate.outcome is Outcome.SENT]
        assert sent == sorted(sent)


@given(
    st.sampled_from(list(RULES)),
    st.lists(st.tuples(st.integers(0, 1500), st.sampled_from(list(LINES))), min_size=1, max_size=20),
    st.lists(st.integers(0, 3000), max_size=20),
)
def test_who_looks_more_often_sees_the_same(rule: str, offers: list[Offer], looks: list[int]) -> None:
    """The master may be woken at any tick, for instance by a sensor: nothing depends on that."""
    usual = run(medium(RULES[rule]), offers)
    air = medium(RULES[rule])
    numbers = dict.fromkeys(LINES, 0)
    for time, _, link in sorted([(time, 1, link) for time, link in offers] + [(time, 0, "") for time in looks],
                                key=lambda item: item[:2]):  # fmt: skip
        air.advance(time * US)
        if link:
            numbers[link] += 1
            air.offer(link, numbers[link], time * US)
    while (event := air.next_ns()) is not None:
        air.advance(event)
    assert air.take_log() == usual


@pytest.mark.parametrize(
    ("answer", "found"),
    [
        (Turn(-1, (0,)), "a start at -1 ns"),
        (Turn(0, ()), "places"),
        (Turn(0, (3,)), "places"),
        (Turn(0, (0, 0)), "places"),
    ],
)
def test_a_rule_that_does_not_keep_its_promise_is_named(answer: Turn, found: str) -> None:
    class Wrong(WithoutCollisions):
        def turn(self, air: Air, waiting: Sequence[Waiting]) -> Turn:
            return answer

    with pytest.raises(ProtocolError, match=rf"medium air: Wrong\.turn returned {found}"):
        run(medium(Wrong()), [(0, "a1")])


def test_draws_are_uniform_and_belong_to_frame_and_turn() -> None:
    assert uniform(17, 77) == uniforms(17, 77, 1, 1)[0, 0]

    def drawn(link: str, sequence: int, turns: int) -> float:
        return Waiting(link, "/a", 0, 1, 0, turns, 0, 17, sequence).drawn()

    values = [drawn("a1", sequence, turns) for sequence in range(1, 51) for turns in range(20)]
    assert len(set(values)) == len(values)
    assert abs(sum(values) / len(values) - 0.5) < 5.0 / (12.0 * len(values)) ** 0.5
    assert drawn("a1", 7, 3) == values[6 * 20 + 3]


def test_who_becomes_the_first_of_its_sender_begins_no_earlier_than_now() -> None:
    """Where the latest value takes the place of one that waits, another frame of the sender may be first at once."""
    rule = Csma(CsmaParameters(slot_s=20e-6, window=64, window_most=64), LINES)
    late = 0
    for time in range(10, 1300, 10):
        fates = run(medium(rule, Full.REPLACE), [(0, "a1"), (1, "a2"), (time, "a1")])
        replaced = [fate for fate in fates if fate.outcome is Outcome.DROPPED]
        starts = {(fate.link, fate.sequence): fate.start_ns for fate in fates}
        if replaced:
            assert starts["a2", 1] >= time * US
            late += starts["a2", 1] == time * US
    assert late  # it would have begun before, had it been alone


def test_an_acknowledgement_follows_its_frame_before_anybody_else() -> None:
    lines = {**LINES, "a1<-1": Line("/b", 0, 5, 50 * US, True)}
    expected = {
        "csma": ["a1", "a1<-1", "b1"],  # without backoff, and no slot to collide in
        "fifo": ["a1", "b1", "a1<-1"],  # in the order of offering, as all
        "priority": ["a1", "a1<-1", "b1"],  # as important as its link
    }
    rules = {
        "csma": Csma(CsmaParameters(slot_s=20e-6, window=1, window_most=1), lines),
        "fifo": Fifo(FifoParameters(), lines),
        "priority": Priority(PriorityParameters(order=("a1",)), lines),
    }
    for name, rule in rules.items():
        air = Medium(MediumPlan("air", 1, 1.0, 0, 64, Full.NEWEST, lines, rule))
        air.offer("a1", 1, 0)
        air.advance(50 * US)
        air.offer("b1", 1, 50 * US)  # senses the air, and draws no wait
        assert air.advance(100 * US)[0].link == "a1"
        air.offer("a1<-1", 1, 100 * US)
        while (event := air.next_ns()) is not None:
            air.advance(event)
        fates = air.take_log()
        assert [fate.link for fate in fates] == expected[name]
        assert all(fate.outcome is Outcome.SENT for fate in fates)
        assert fates[1].start_ns == 100 * US


def test_another_try_has_another_luck() -> None:
    rule = Csma(CsmaParameters(slot_s=20e-6, window=1024, window_most=1024), LINES)
    starts = []
    for attempt in (1, 2, 3):
        air = medium(rule)
        air.offer("a1", 1, 0, attempt)
        air.advance(10**9)
        (fate,) = air.take_log()
        assert fate.attempt == attempt
        starts.append(fate.start_ns)
    assert len(set(starts)) == 3
