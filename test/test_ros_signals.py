"""Whatever signal ends a run, its processes leave, its bag is complete, and the exit code says which it was."""

from __future__ import annotations

import os
import signal
import subprocess
import sys
from collections.abc import Callable, Iterator
from contextlib import suppress
from pathlib import Path

import psutil
import pytest

from etac_ros.bag.read import read_bag
from etac_ros.engines.ros.signals import ENDING, EndedBySignal, SignalGuard

LIMIT_S = 60
LOOK_S = 0.02
FOREVER = ["--set", "duration_s=100000", "--set", "sensor.trigger.period_s=0.25", "--set", "baseline=null"]

Start = Callable[..., "subprocess.Popen[str]"]


@pytest.fixture
def start(tmp_path: Path) -> Iterator[Start]:
    """Starts a run that nobody lives to see the end of."""
    started: list[subprocess.Popen[str]] = []

    def begin(*more: str) -> subprocess.Popen[str]:
        command = [sys.executable, "-m", "etac_ros", "run", "wu2018", "--variant", "periodic", *FOREVER, "--bag", "bag"]
        environment = {**os.environ, "PYTHONPATH": os.pathsep.join(sys.path)}
        process = subprocess.Popen(
            [*more, *command],
            cwd=tmp_path,
            env=environment,
            stdout=subprocess.PIPE,
            stderr=subprocess.STDOUT,
            text=True,
        )
        started.append(process)
        return process

    yield begin
    for process in started:
        process.kill()
        process.communicate()


def children(run: subprocess.Popen[str], until: Callable[[list[psutil.Process]], bool]) -> list[psutil.Process]:
    """The processes of a run, once they are as they should be."""
    while run.poll() is None:
        found = psutil.Process(run.pid).children()
        if until(found):
            return found
        with suppress(subprocess.TimeoutExpired):
            run.wait(LOOK_S)  # and leaves the processor to it
    raise AssertionError(run.communicate()[0])


def under_way(bag: Path) -> Callable[[list[psutil.Process]], bool]:
    return lambda found: any(file.stat().st_size > 20_000 for file in bag.glob("*.mcap"))


def ended(run: subprocess.Popen[str], processes: list[psutil.Process]) -> str:
    """What a run has printed, which leaves no process."""
    output, _ = run.communicate(timeout=LIMIT_S)
    assert not [process for process in processes if process.is_running()]
    return output


@pytest.mark.parametrize("number", ENDING)
def test_a_signal_ends_a_run(number: signal.Signals, tmp_path: Path, start: Start) -> None:
    run = start()
    processes = children(run, under_way(tmp_path / "bag"))
    run.send_signal(number)
    output = ended(run, processes)
    assert run.returncode == 128 + number
    assert f"etac: {number.name}: ending the run" in output
    assert "Traceback" not in output
    assert (tmp_path / "bag/metadata.yaml").exists()
    assert read_bag(tmp_path / "bag").recording().messages["filtered_error"]


def test_a_signal_to_the_terminal_while_all_are_starting(tmp_path: Path, start: Start) -> None:
    run = start("setsid")  # a process group of its own, as of a terminal's job
    children(run, lambda found: len(found) > 0)
    os.killpg(run.pid, signal.SIGINT)
    output = ended(run, [])
    assert run.returncode == 130
    assert "Traceback" not in output
    assert not [process for process in psutil.process_iter() if process.pid != run.pid and group(process) == run.pid]


def group(process: psutil.Process) -> int | None:
    try:
        return os.getpgid(process.pid)
    except ProcessLookupError:
        return None


def test_pressing_it_twice_does_not_spoil_the_bag(tmp_path: Path, start: Start) -> None:
    run = start()
    processes = children(run, under_way(tmp_path / "bag"))
    run.send_signal(signal.SIGINT)
    assert run.stdout is not None
    assert "SIGINT: ending the run" in run.stdout.readline()
    run.send_signal(signal.SIGINT)
    run.send_signal(signal.SIGTERM)
    ended(run, processes)
    assert run.returncode == 130
    assert (tmp_path / "bag/metadata.yaml").exists()


def test_a_killed_launcher_leaves_no_process(tmp_path: Path, start: Start) -> None:
    run = start()
    processes = children(run, under_way(tmp_path / "bag"))
    run.kill()
    _, alive = psutil.wait_procs(processes, timeout=LIMIT_S)
    assert not alive
    assert (tmp_path / "bag/metadata.yaml").exists()


def test_a_signal_waits_for_the_moment_and_the_second_has_no_effect() -> None:
    before = signal.getsignal(signal.SIGTERM)
    with SignalGuard() as guard:
        os.kill(os.getpid(), signal.SIGTERM)
        os.kill(os.getpid(), signal.SIGINT)
        assert guard.received == signal.SIGTERM
        with pytest.raises(EndedBySignal) as caught:
            guard.check()
    assert caught.value.code == 128 + signal.SIGTERM
    assert signal.getsignal(signal.SIGTERM) == before


def test_a_signal_that_nobody_asked_for_is_not_lost() -> None:
    with pytest.raises(KeyboardInterrupt), SignalGuard():
        os.kill(os.getpid(), signal.SIGINT)


@pytest.mark.parametrize("own", [signal.SIG_IGN, lambda number, frame: None], ids=["nohup", "a handler of its own"])
def test_who_has_decided_otherwise_keeps_the_signal(own: Callable[..., None] | signal.Handlers) -> None:
    before = signal.signal(signal.SIGHUP, own)
    try:
        with SignalGuard() as guard:
            os.kill(os.getpid(), signal.SIGHUP)
            guard.check()
        assert guard.received is None
    finally:
        signal.signal(signal.SIGHUP, before)
