"""Simulated time can be slowed down to be watched: no bit depends on it, and nothing is ahead of what is shown."""

from __future__ import annotations

from pathlib import Path

import pytest
from rosbags.highlevel import AnyReader

from etac_ros import runs
from etac_ros.errors import ScenarioError
from etac_ros.runs import Pace, RosOptions, run_in_process, run_over_ros
from etac_ros.scenario.load import load
from etac_ros.timing.windows import WindowPolicy, short_windows


def test_the_bits_are_those_of_a_run_that_nobody_slows_down(tmp_path: Path) -> None:
    for name, duration in (("wu2018", 40), ("xie2021", 1)):
        free = run_in_process(load(name, None, [f"duration_s={duration}"])).recording.digest()
        paced = run_in_process(load(name, None, [f"duration_s={duration}"]), pace=100.0).recording.digest()
        assert paced == free
    for name, duration in (("wu2018", 20), ("xie2021", 0.5)):  # one coordinator in a plant's process, one in its own
        free = run_in_process(load(name, None, [f"duration_s={duration}"])).recording.digest()
        options = RosOptions("one", record_windows=True, pace=40.0)
        run = run_over_ros(load(name, None, [f"duration_s={duration}"]), tmp_path / name, options)
        assert run.recording.digest() == free
        with AnyReader([tmp_path / name]) as reader:
            chosen = [c for c in reader.connections if c.topic.endswith("/window")]
            windows = [reader.deserialize(data, c.msgtype) for c, _, data in reader.messages(connections=chosen)]
        longest = max(window.layout.dim[0].size for window in windows)
        assert longest <= 0.1 * 40.0 * run.scenario.run.ticks_per_second


def test_nothing_is_done_before_its_time(monkeypatch: pytest.MonkeyPatch) -> None:
    now = [100.0]
    monkeypatch.setattr(runs.time, "perf_counter", lambda: now[0])
    monkeypatch.setattr(runs.time, "sleep", lambda seconds: now.__setitem__(0, now[0] + seconds))
    pace = Pace(2.0, 10)
    seen = []
    for tick in (0, 10, 20, 20, 50):
        pace.wait(tick)
        seen.append(now[0] - 100.0)
    assert seen == [0.0, 0.5, 1.0, 1.0, 2.5]
    Pace(None, 10).wait(10**9)
    assert now[0] == 102.5


def test_windows_reach_a_tenth_of_a_second_ahead() -> None:
    assert short_windows(WindowPolicy(64, 1024), None, 32) == WindowPolicy(64, 1024)
    assert short_windows(WindowPolicy(64, 1024), 100.0, 32) == WindowPolicy(64, 320)
    assert short_windows(WindowPolicy(64, 1024), 0.1, 32) == WindowPolicy(1, 1)
    with pytest.raises(ScenarioError, match="is no rate"):
        short_windows(WindowPolicy(64, 1024), 0.0, 32)
