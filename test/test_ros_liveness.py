"""Who stands still is told from who computes, and from who waits for one that stands still."""

from __future__ import annotations

import itertools
import os
import signal
import time

import pytest
from hypothesis import given
from hypothesis import strategies as st

from etac_ros.engines.ros.liveness import LOOK_EVERY_S, Glimpse, LifeSigns, Stillness, Watch, glimpse

NOW = itertools.count(100.0, LOOK_EVERY_S)
ASLEEP, STOPPED = Glimpse("S", 1.0, 2.0), Glimpse("T", 1.0, 2.0)


def looks(watch: Watch, seconds: float, signs: dict[int, float], seen: dict[int, Glimpse | None]) -> None:
    """Look at the same for some time."""
    for _ in range(round(seconds / LOOK_EVERY_S) + 1):
        watch.look(next(NOW), signs, seen)


def test_who_gives_no_sign_stands_still() -> None:
    watch = Watch(5.0)
    looks(watch, 4.0, {0: 1.0, 1: 1.0}, {0: ASLEEP, 1: ASLEEP})
    assert watch.standing_still() == []
    looks(watch, 5.5, {0: 2.0, 1: 1.0}, {0: ASLEEP, 1: ASLEEP})
    assert watch.standing_still() == [0, 1]
    looks(watch, 1.0, {0: 3.0, 1: 1.0}, {0: ASLEEP, 1: ASLEEP})
    assert watch.standing_still() == [1]
    assert watch.still[1].manner == "blocked"


def test_who_waits_for_a_stopped_one_is_not_blamed() -> None:
    watch = Watch(5.0)
    looks(watch, 4.0, {0: 1.0, 1: 1.0}, {0: ASLEEP, 1: ASLEEP})
    looks(watch, 4.0, {0: 1.0, 1: 2.0}, {0: ASLEEP, 1: STOPPED})
    assert watch.still[0].silent_s > 5.0
    assert watch.standing_still() == []
    looks(watch, 2.0, {0: 1.0, 1: 2.0}, {0: ASLEEP, 1: STOPPED})
    assert watch.standing_still() == [1]
    assert watch.still[1].manner == "stopped by a signal"


@pytest.mark.parametrize(
    "works",
    [
        lambda k: Glimpse("R", 1.0, 2.0),
        lambda k: Glimpse("S", 1.0 + 0.05 * k, 2.0 + 0.05 * k),
        lambda k: Glimpse("S", 1.0, 2.0 + 0.2 * k),
    ],
    ids=["caught running", "its main thread worked", "its threads work"],
)
def test_who_computes_does_not_stand_still(works) -> None:  # type: ignore[no-untyped-def]
    watch = Watch(5.0)
    told = 0
    for k in range(100):
        watch.look(k * LOOK_EVERY_S, {0: 1.0}, {0: works(k)})
        told += len(watch.computing_long())
        assert watch.standing_still() == []
    assert told == 4  # once every 5 s of 25 s


def test_threads_of_dds_are_no_work() -> None:
    still = Stillness()
    for k in range(40):
        still.look(LOOK_EVERY_S, 1.0, Glimpse("S", 1.0, 2.0 + 0.01 * k))
    assert still.silent_s == pytest.approx(39 * LOOK_EVERY_S)


@given(st.lists(st.floats(0.0, 1e6), min_size=1, max_size=30))
def test_a_launcher_that_was_away_blames_nobody_for_it(pauses: list[float]) -> None:
    watch = Watch(1e9)
    now = 0.0
    for pause in pauses:
        now += pause
        watch.look(now, {0: 1.0}, {0: ASLEEP})
    assert watch.still[0].silent_s <= 2 * LOOK_EVERY_S * len(pauses)


def test_signs_cross_processes() -> None:
    signs = LifeSigns(2, 1.0)
    signs.give(1)
    assert not signs.all_fresh()
    before = time.monotonic()
    child = os.fork()
    if child == 0:
        signs.give(0)
        os._exit(0)
    os.waitpid(child, 0)
    assert before <= signs.last(0) <= time.monotonic()
    signs.take_leave(0)
    assert signs.last(0) == float("inf")


def test_a_stopped_process_is_seen_as_stopped() -> None:
    child = os.fork()
    if child == 0:
        signal.pause()
    try:
        os.kill(child, signal.SIGSTOP)
        os.waitpid(child, os.WUNTRACED)
        seen = glimpse(child)
        assert seen is not None
        assert seen.state == "T"
    finally:
        os.kill(child, signal.SIGKILL)
        os.waitpid(child, 0)
    assert glimpse(child) is None
