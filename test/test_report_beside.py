"""What a forked process draws is what this one would have drawn, also where that process comes to nothing."""

from __future__ import annotations

import os
import signal

import pytest

from etac_ros.report.beside import Beside, here

ME = os.getpid()
LARGE = bytes(range(256)) * 4096  # more than a pipe takes


@pytest.fixture
def two_cores(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr("os.sched_getaffinity", lambda _: {0, 1})


def killed() -> bytes:
    if os.getpid() != ME:
        os.kill(os.getpid(), signal.SIGKILL)
    return b"here"


def refused() -> bytes:
    raise OSError("no")


@pytest.mark.usefixtures("two_cores")
def test_each_piece_is_made_in_a_process_of_its_own_and_keeps_its_place() -> None:
    beside = Beside()
    outcomes = [beside(lambda number=number: b"%d %d " % (number, os.getpid()) + LARGE) for number in range(3)]
    found = [outcome().split(b" ", 2) for outcome in outcomes]
    assert [number for number, _, _ in found] == [b"0", b"1", b"2"]
    assert len({process for _, process, _ in found} | {b"%d" % ME}) == 4
    assert all(large == LARGE for _, _, large in found)


@pytest.mark.usefixtures("two_cores")
def test_what_a_killed_process_leaves_is_made_here() -> None:
    outcome = Beside()(killed)
    assert (outcome(), outcome()) == (b"here", b"here")


@pytest.mark.usefixtures("two_cores")
def test_a_fault_of_the_work_is_told_by_who_waits() -> None:
    outcome = Beside()(refused)
    with pytest.raises(OSError, match="no"):
        outcome()


def test_on_a_single_core_nothing_is_forked(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr("os.sched_getaffinity", lambda _: {0})
    assert Beside()(lambda: b"%d" % os.getpid())() == b"%d" % ME
    assert here(lambda: b"%d" % os.getpid())() == b"%d" % ME
