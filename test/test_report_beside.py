"""What a forked process draws is what this one would have drawn, also where that process comes to nothing."""

from __future__ import annotations

import os
import signal
from functools import partial
from pathlib import Path

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
def test_two_processes_share_the_work_out_and_each_piece_keeps_its_place() -> None:
    beside = Beside()
    outcomes = [beside(lambda number=number: (number, os.getpid(), LARGE)) for number in range(4)]
    found = [outcome() for outcome in outcomes]
    assert [number for number, _, _ in found] == [0, 1, 2, 3]
    assert all(large == LARGE for _, _, large in found)
    assert found[0][1] != ME  # begun at once, while this process brought the others
    assert [outcome() for outcome in outcomes] == found


@pytest.mark.usefixtures("two_cores")
def test_nothing_is_begun_twice_and_the_other_process_takes_one_at_a_time(tmp_path: Path) -> None:
    beside, (waits, go) = Beside(), os.pipe()

    def first() -> int:
        os.read(waits, 1)
        return os.getpid()

    def other(name: str) -> int:
        with (tmp_path / name).open("a", encoding="utf-8") as file:
            file.write("done\n")
        return os.getpid()

    held = beside(first)
    others = [beside(partial(other, name)) for name in "abc"]
    assert others[0]() == ME  # the other process is not done with the first
    os.write(go, b"!")
    assert held() != ME
    assert [outcome() == ME for outcome in others] == [True, True, False]  # while this one did b, the other did c
    assert [(tmp_path / name).read_text(encoding="utf-8") for name in "abc"] == ["done\n"] * 3
    os.close(waits)
    os.close(go)


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
