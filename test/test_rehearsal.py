"""What each process goes through before it joins is a run like any other, and ends in time."""

from __future__ import annotations

import math
from pathlib import Path

import pytest

from etac_ros import runs
from etac_ros.engines.inprocess import InProcess
from etac_ros.engines.ros.rehearsal import Rehearsal
from etac_ros.runs import windows_of
from etac_ros.scenario.load import load


@pytest.mark.parametrize(
    ("name", "changes"),
    [
        ("wu2018", ["duration_s=20"]),
        ("wu2018", ["duration_s=20", "links.filtered_error={loss: 0.3, acknowledged: {timeout_s: 0.5, retries: 1}}"]),
        ("qi2022", ["duration_s=0.2"]),
        ("shi2022", ["duration_s=1"]),
        ("xie2021", ["duration_s=0.1"]),
    ],
)
def test_a_rehearsal_is_a_run(name: str, changes: list[str]) -> None:
    scenario = load(name, None, changes)
    rehearsal = Rehearsal(scenario.build(), windows_of(scenario))
    rehearsal.run(math.inf)
    usual = InProcess(scenario.build(), windows_of(scenario))
    usual.run()
    assert rehearsal.finished
    assert rehearsal.master.sent == usual.master.sent
    assert rehearsal.master.fired == usual.master.fired


def test_it_takes_no_longer_than_it_may() -> None:
    scenario = load("wu2018")
    rehearsal = Rehearsal(scenario.build(), windows_of(scenario))
    rehearsal.run(-math.inf)
    assert not rehearsal.finished
    assert not sum(rehearsal.master.fired.values())


def test_classes_of_a_user_act_in_their_run_alone(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    (tmp_path / "own_actuator.py").write_text(
        "from etac_ros.modules.actuator import Actuator\nclass Own(Actuator):\n    pass\n"
    )
    monkeypatch.syspath_prepend(tmp_path)
    assert runs._rehearsal(load("wu2018")) is not None
    assert runs._rehearsal(load("wu2018", None, ["actuator.module=own_actuator:Own"])) is None


def test_what_fails_in_a_rehearsal_is_left_to_the_run(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    def fails() -> None:
        raise ValueError("only in the rehearsal")

    monkeypatch.setattr(runs, "_rehearsal", lambda scenario: fails)
    scenario = load("wu2018", None, ["duration_s=20"])
    over_ros = runs.run_over_ros(scenario, tmp_path / "bag")
    assert over_ros.recording.digest() == runs.run_in_process(scenario).recording.digest()
