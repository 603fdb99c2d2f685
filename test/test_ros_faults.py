"""A run that fails names who failed, leaves no process and no shared memory, and loses nothing that it recorded."""

from __future__ import annotations

import os
import signal
from collections.abc import Callable, Iterable
from pathlib import Path

import psutil
import pytest

from etac_ros.bag.read import read_bag
from etac_ros.errors import EtacError, RunError
from etac_ros.graph.recording import Recording
from etac_ros.runs import run_in_process, run_over_ros
from etac_ros.scenario.load import load

FOREVER = ["duration_s=100000", "sensor.trigger.period_s=0.25"]


def run_until(
    bag: Path, act: Callable[[dict[str, int]], None], overrides: list[str]
) -> tuple[EtacError, dict[str, int]]:
    """Run long enough for ``act`` to happen once there is something in the bag; returns the error."""
    pids: dict[str, int] = {}
    told = 0

    def on_progress(tick: int, fired: dict[str, int]) -> None:
        nonlocal told
        told += 1
        if told == 12:
            act(pids)

    scenario = load("wu2018", "periodic", overrides)
    with pytest.raises(EtacError) as caught:
        run_over_ros(scenario, bag, on_progress=on_progress, on_start=pids.update)
    return caught.value, pids


def shared_memory(pids: Iterable[int]) -> set[str]:
    """Files of Fast DDS in shared memory that these processes have open; other programs may have theirs."""
    maps = [Path(f"/proc/{pid}/maps").read_text() for pid in pids]
    return {line.split()[-1] for text in maps for line in text.splitlines() if "/dev/shm/fast" in line}


def is_prefix(part: Recording, whole: Recording) -> bool:
    """Whether everything in ``part`` stands in ``whole``, at the same place with the same bits."""
    for link, messages in part.messages.items():
        for mine, theirs in zip(messages, whole.messages[link], strict=False):
            if (mine.sequence, mine.value.tobytes()) != (theirs.sequence, theirs.value.tobytes()):
                return False
    _, samples = part.samples("/plant")
    return samples.tobytes() == whole.samples("/plant")[1][: samples.shape[0]].tobytes()


@pytest.mark.parametrize("victim", ["/plant", "/sensor", "/controller", "/actuator", "/recorder"])
def test_killed_node(victim: str, tmp_path: Path) -> None:
    bag = tmp_path / "bag"
    shared: set[str] = set()

    def kill(pids: dict[str, int]) -> None:
        shared.update(shared_memory(pids.values()))
        os.kill(pids[victim], signal.SIGKILL)

    error, pids = run_until(bag, kill, FOREVER)
    assert isinstance(error, RunError)
    assert victim in error.where
    assert "SIGKILL" in error.found
    assert not [pid for pid in pids.values() if psutil.pid_exists(pid)]
    assert not [path for path in shared if Path(path).exists()]
    recorded = read_bag(bag).recording()
    assert len(recorded.messages["filtered_error"]) > 10
    # Samples are written at once, messages when their tick is known: either may be ahead in a bag that was cut off.
    samples = recorded.samples("/plant")[1].shape[0]
    seconds = max(len(recorded.messages["filtered_error"]) // 4, samples // 32) + 2
    whole = run_in_process(load("wu2018", "periodic", [f"duration_s={seconds}", FOREVER[1]]))
    assert is_prefix(recorded, whole.recording)


def test_node_that_raises_is_named(tmp_path: Path) -> None:
    scenario = load("wu2018", "periodic", ["duration_s=20", "controller.law.class=broken:BrokenLaw"])
    with pytest.raises(RunError, match=r"^/controller: BrokenLaw.command raised RuntimeError: the law is broken"):
        run_over_ros(scenario, tmp_path / "bag")
    assert len(read_bag(tmp_path / "bag").recording().messages["filtered_error"]) >= 1


def test_interrupted_run_leaves_a_bag_and_no_process(tmp_path: Path) -> None:
    bag = tmp_path / "bag"
    pids: dict[str, int] = {}

    def interrupt(tick: int, fired: dict[str, int]) -> None:
        if tick > 100:
            raise KeyboardInterrupt

    with pytest.raises(KeyboardInterrupt):
        run_over_ros(load("wu2018", "periodic", FOREVER), bag, on_progress=interrupt, on_start=pids.update)
    assert not [pid for pid in pids.values() if psutil.pid_exists(pid)]
    assert read_bag(bag).recording().messages["filtered_error"]
