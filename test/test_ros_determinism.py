"""The same scenario puts the same payloads on the network, however busy the machine and however long the windows."""

from __future__ import annotations

import multiprocessing
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path

from etac_ros.runs import run_over_ros
from etac_ros.scenario.load import load

Payloads = dict[str, list[tuple[int, int, int, bytes]]]


def payloads(bag: Path, *overrides: str) -> Payloads:
    """All messages of all links of a run over DDS."""
    recording = run_over_ros(load("wu2018", None, ["duration_s=300", *overrides]), bag).recording
    return {
        link: [(m.sequence, m.tick, m.step, m.value.tobytes()) for m in messages]
        for link, messages in recording.messages.items()
    }


def burn() -> None:
    """Keep a core busy."""
    while True:
        pass


@contextmanager
def busy_machine() -> Iterator[None]:
    """Two processes that never rest."""
    burners = [multiprocessing.get_context("fork").Process(target=burn, daemon=True) for _ in range(2)]
    for burner in burners:
        burner.start()
    try:
        yield
    finally:
        for burner in burners:
            burner.kill()
            burner.join()


def test_two_runs_are_the_same(tmp_path: Path) -> None:
    first = payloads(tmp_path / "one")
    assert first == payloads(tmp_path / "two", "windows={first: 5, longest: 100}")
    with busy_machine():
        assert first == payloads(tmp_path / "three")
    assert len(first["filtered_error"]) > 20
