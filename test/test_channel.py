"""The channel: what becomes of a message is a pure function of seed, link, receiver and sequence number."""

from __future__ import annotations

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from etac_ros.graph.channel import Bursts, Channel, Jitter, Way
from etac_ros.maths.noise import stream_key, uniforms

MESSAGES = 400
seeds = st.integers(0, 2**63)
names = st.text(min_size=1, max_size=8)


def fates(channel: Channel, receiver: str, count: int = MESSAGES) -> list[bool]:
    return [channel.drops(receiver, sequence) for sequence in range(1, count + 1)]


@given(seeds, names, names, st.floats(0.01, 0.99), st.lists(st.integers(1, 10**9), max_size=10))
def test_fate_depends_on_nothing_else(seed: int, link: str, receiver: str, loss: float, numbers: list[int]) -> None:
    channel = Channel(seed, link, loss=loss)
    fate = {number: channel.drops(receiver, number) for number in numbers}
    for number in sorted(numbers, reverse=True):
        channel.drops("another", number)
        assert channel.drops(receiver, number) == fate[number]
        assert Channel(seed, link, delay_ticks=7, loss=loss).drops(receiver, number) == fate[number]


@given(seeds, names, st.integers(1, 10**6), st.floats(0.0, 0.98), st.floats(0.0, 0.98))
def test_a_lossier_channel_loses_the_same_and_more(seed: int, link: str, number: int, one: float, other: float) -> None:
    low, high = sorted([one, other])
    if Channel(seed, link, loss=low).drops("/a", number):
        assert Channel(seed, link, loss=high).drops("/a", number)


@pytest.mark.parametrize("loss", [0.05, 0.3, 0.9])
def test_rate_is_the_probability(loss: float) -> None:
    count = 5000
    lost = np.mean(fates(Channel(1, "link", loss=loss), "/a", count))
    # Five standard errors; the draws are fixed.
    assert abs(lost - loss) < 5.0 * np.sqrt(loss * (1.0 - loss) / count)


def test_seeds_links_and_receivers_are_independent() -> None:
    streams = [
        fates(Channel(1, "link", loss=0.5), "/a"),
        fates(Channel(1, "link", loss=0.5), "/b"),
        fates(Channel(1, "other", loss=0.5), "/a"),
        fates(Channel(2, "link", loss=0.5), "/a"),
    ]
    correlation = np.corrcoef(np.array(streams, dtype=float)) - np.eye(4)
    assert np.abs(correlation).max() < 5.0 / np.sqrt(MESSAGES)


def test_losses_do_not_follow_each_other() -> None:
    lost = np.array(fates(Channel(1, "link", loss=0.5), "/a", 4000), dtype=float)
    assert abs(np.corrcoef(lost[1:], lost[:-1])[0, 1]) < 5.0 / np.sqrt(4000)


def test_ideal_channel_loses_and_delays_nothing() -> None:
    ideal = Channel(1, "link")
    assert (ideal.delay_ticks, ideal.loss) == (0, 0.0)
    assert [ideal.arrivals("/a", number, 7 * number) for number in range(1, 50)] == [(7 * n,) for n in range(1, 50)]
    assert ideal.ideal
    assert not any(fates(Channel(1, "link", delay_ticks=1), "/a"))


@given(seeds, names, st.integers(1, 10**6), st.integers(0, 10**6), st.integers(0, 50), st.floats(0.0, 0.9))
def test_what_is_not_dropped_arrives_after_the_delay(
    seed: int, link: str, number: int, tick: int, delay: int, loss: float
) -> None:
    channel = Channel(seed, link, delay, loss)
    arrived = channel.arrivals("/a", number, tick)
    assert arrived == (() if channel.drops("/a", number) else (tick + delay,))


def test_an_outage_takes_what_is_sent_while_it_lasts() -> None:
    channel = Channel(1, "link", 5, outages={"/a": ((10, 20),)})
    assert [channel.arrivals("/a", 1, tick) for tick in (9, 10, 19, 20)] == [(14,), (), (), (25,)]
    assert channel.arrivals("/b", 1, 10) == (15,)


def test_a_receiver_can_tell_by_itself_what_does_not_depend_on_the_tick() -> None:
    assert Channel(1, "link", loss=0.5).told_by_message
    assert not Channel(1, "link", delay_ticks=1).told_by_message
    assert not Channel(1, "link", outages={"/a": ((1, 2),)}).told_by_message
    assert not Channel(1, "link", jitter=Jitter(uniform_s=1.0)).told_by_message
    assert not Channel(1, "link", bursts=Bursts(good_s=1.0, bad_s=1.0)).told_by_message
    assert not Channel(1, "link", duplication=0.1).told_by_message


JITTERS = {
    # Mean and standard deviation of what is added [s]; by hand.
    "uniform": (Jitter(uniform_s=0.3), 0.15, 0.3 / np.sqrt(12.0)),
    "normal": (Jitter(normal_s=0.1), 0.0, 0.1),
    "exponential": (Jitter(exponential_s=0.2), 0.2, 0.2),
}


@pytest.mark.parametrize("kind", list(JITTERS))
def test_jitter_has_its_distribution(kind: str) -> None:
    jitter, mean, deviation = JITTERS[kind]
    rate = 100_000  # so fine that rounding up to a tick does not matter
    channel = Channel(1, "link", 10 * rate, jitter=jitter, ticks_per_second=rate)
    late = np.array([channel.arrivals("/a", n, 0)[0] for n in range(1, 3001)]) / rate - 10.0
    assert abs(late.mean() - mean) < 5.0 * deviation / np.sqrt(late.size) + 1.0 / rate
    assert late.std() == pytest.approx(deviation, rel=0.1)


def test_delay_and_jitter_are_added_before_they_are_rounded_up_and_never_come_before_the_sending() -> None:
    jitter = Jitter(normal_s=0.5)
    channel = Channel(1, "link", 0.5, jitter=jitter, ticks_per_second=10)
    found = [channel.arrivals("/a", n, 40)[0] for n in range(1, 200)]
    draws = uniforms(stream_key(1, "channel/link/jitter//a"), 1, 199, 2)[:, 0]
    assert found == [40 + max(0, int(np.ceil(0.5 + 10.0 * jitter.seconds(u)))) for u in draws.tolist()]
    assert min(found) == 40 < max(found)


@given(seeds, st.lists(st.integers(0, 3), min_size=1, max_size=60))
def test_who_may_not_overtake_arrives_in_order_and_no_earlier_than_alone(seed: int, gaps: list[int]) -> None:
    free = Channel(seed, "link", 1, jitter=Jitter(exponential_s=4.0))
    kept = Channel(seed, "link", 1, jitter=Jitter(exponential_s=4.0, overtaking=False))
    way, ticks = Way(kept, "/a"), np.cumsum(gaps).tolist()
    found = [way.arrivals(n, tick)[0] for n, tick in enumerate(ticks, 1)]
    alone = [free.arrivals("/a", n, tick)[0] for n, tick in enumerate(ticks, 1)]
    assert found == np.maximum.accumulate(alone).tolist()


def test_a_burst_is_a_function_of_the_tick_and_lasts_as_long_as_it_should() -> None:
    bursts = Bursts(good_s=3.0, bad_s=1.0, loss_good=0.1, loss_bad=0.9)
    channel = Channel(3, "link", bursts=bursts, ticks_per_second=10)
    ticks = 40_000
    bad = np.array([channel.is_bad("/a", tick) for tick in range(ticks)])
    again = Channel(3, "link", bursts=bursts, ticks_per_second=10)
    assert [again.is_bad("/a", tick) for tick in range(ticks - 1, 0, -977)] == bad[ticks - 1 : 0 : -977].tolist()
    # 1000 cycles of 40 ticks; the variance of the bad share of a cycle is known: 2 (g b)^2 / (g + b)^3 / T.
    assert abs(bad.mean() - 0.25) < 5.0 * np.sqrt(2.0 * (3.0 * 1.0) ** 2 / 4.0**3 / (ticks / 10))
    stays = np.diff(np.flatnonzero(np.diff(bad.astype(int))))
    bad_stays = stays[::2] if bad[np.flatnonzero(np.diff(bad.astype(int)))[0] + 1] else stays[1::2]
    # A stay that falls between two ticks is not seen: those seen are geometric, of mean 1 / (1 - exp(-T / 1 s)) or so.
    assert bad_stays.mean() == pytest.approx(10.0, rel=0.25)
    lost = np.array([not channel.arrivals("/a", tick + 1, tick) for tick in range(ticks)])
    assert abs(lost[bad].mean() - 0.9) < 5.0 * np.sqrt(0.09 / bad.sum())
    assert abs(lost[~bad].mean() - 0.1) < 5.0 * np.sqrt(0.09 / (~bad).sum())
    assert bursts.mean_loss == pytest.approx(0.3)


def test_duplicates_come_as_often_as_they_should_each_in_its_own_time() -> None:
    channel = Channel(1, "link", jitter=Jitter(uniform_s=5.0), duplication=0.25)
    found = [channel.arrivals("/a", n, 0) for n in range(1, 2001)]
    assert [len(ticks) for ticks in found] == [channel.copies("/a", n) for n in range(1, 2001)]
    twice = [ticks for ticks in found if len(ticks) == 2]
    assert abs(len(twice) / 2000 - 0.25) < 5.0 * np.sqrt(0.25 * 0.75 / 2000)
    assert all(one <= other for one, other in twice)
    assert any(one < other for one, other in twice)
