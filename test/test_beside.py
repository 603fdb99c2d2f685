"""What a forked process draws is what this one would have drawn, also where that process comes to nothing."""

from __future__ import annotations

import os
import signal
import subprocess
import sys
from functools import partial
from pathlib import Path

import pytest

from etac_ros.beside import Beside, here

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


HOLDS = """
import os, sys
os.sched_getaffinity = lambda _: {0, 1}
from etac_ros.beside import Beside
alive, go = int(sys.argv[1]), int(sys.argv[2])
def work():
    os.write(alive, b'work')
    os.read(go, 1)  # which nobody writes
    os.write(alive, b'left')
outcome = Beside(longest_s=None)(work)
try:
    os.write(alive, b'wait')
    os.close(alive)  # held by the other process alone from now on
    outcome()
except KeyboardInterrupt:
    sys.exit(130)
"""


@pytest.mark.parametrize(("number", "code"), [("SIGINT", 130), ("SIGTERM", -15), ("SIGKILL", -9)])
def test_who_waits_takes_the_other_process_along_however_it_ends(number: str, code: int) -> None:
    (reads, alive), (go, keeps) = os.pipe(), os.pipe()
    command = [sys.executable, "-c", HOLDS, str(alive), str(go)]
    process = subprocess.Popen(command, pass_fds=[alive, go], start_new_session=True)
    os.close(alive)
    os.close(go)
    try:
        both = os.read(reads, 4) + os.read(reads, 4)
        assert sorted(both) == sorted(b"workwait")
        if number == "SIGINT":
            os.killpg(process.pid, signal.SIGINT)  # as a terminal does
        else:
            os.kill(process.pid, getattr(signal, number))
        assert process.wait() == code
        os.close(keeps)
        assert os.read(reads, 4) == b""  # nobody is left to hold it, or to write into it
    finally:
        process.kill()
        process.wait()
        os.close(reads)


@pytest.mark.usefixtures("two_cores")
def test_what_is_printed_is_printed_once(capfd: pytest.CaptureFixture[str]) -> None:
    print("before")
    outcome = Beside()(lambda: print("beside"))
    outcome()
    print("after")
    sys.stdout.flush()
    assert capfd.readouterr().out == "before\nbeside\nafter\n"
