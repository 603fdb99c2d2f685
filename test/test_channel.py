"""The channel: what becomes of a message is a pure function of seed, link, receiver and sequence number."""

from __future__ import annotations

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from etac_ros.graph.channel import Channel

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
    assert [ideal.arrival("/a", number, 7 * number) for number in range(1, 50)] == [7 * n for n in range(1, 50)]
    assert not any(fates(Channel(1, "link", delay_ticks=1), "/a"))


@given(seeds, names, st.integers(1, 10**6), st.integers(0, 10**6), st.integers(0, 50), st.floats(0.0, 0.9))
def test_what_is_not_dropped_arrives_after_the_delay(
    seed: int, link: str, number: int, tick: int, delay: int, loss: float
) -> None:
    channel = Channel(seed, link, delay, loss)
    arrived = channel.arrival("/a", number, tick)
    assert arrived == (None if channel.drops("/a", number) else tick + delay)


def test_an_outage_takes_what_is_sent_while_it_lasts() -> None:
    channel = Channel(1, "link", 5, outages={"/a": ((10, 20),)})
    assert [channel.arrival("/a", 1, tick) for tick in (9, 10, 19, 20)] == [14, None, None, 25]
    assert channel.arrival("/b", 1, 10) == 15


def test_a_receiver_can_tell_by_itself_what_does_not_depend_on_the_tick() -> None:
    assert Channel(1, "link", loss=0.5).told_by_message
    assert not Channel(1, "link", delay_ticks=1).told_by_message
    assert not Channel(1, "link", outages={"/a": ((1, 2),)}).told_by_message
