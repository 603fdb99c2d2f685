"""A bag is played as ROS topics: a node that knows nothing of etac_ros gets every message, in order, with its clock."""

from __future__ import annotations

from pathlib import Path

import pytest
from hands import Start
from typer.testing import CliRunner

from etac_ros.cli.main import app
from etac_ros.cli.play import play_bag
from etac_ros.cli.show import make_console
from etac_ros.engines.ros.domain import DomainLease
from etac_ros.errors import BagError, ScenarioError
from etac_ros.runs import run_in_process
from etac_ros.scenario.load import load


def test_a_listener_gets_what_was_recorded(tmp_path: Path, start: Start, lease: DomainLease) -> None:
    run = run_in_process(load("wu2018", None, ["duration_s=40"]), tmp_path / "bag")
    sent = run.recording.messages["filtered_error"]
    listener = start(str(Path(__file__).parent / "listener.py"), str(len(sent)))
    assert listener.stdout is not None
    assert listener.stdout.readline() == "ready\n"
    player = start(
        "-m", "etac_ros", "play", str(tmp_path / "bag"), "--rate", "200", "--wait",
        "--topic", "/filtered_error",
    )  # fmt: skip
    values = [[float(word) for word in listener.stdout.readline().split()] for _ in sent]
    assert values == [message.value.tolist() for message in sent]
    assert listener.stdout.readline() == "clock True True\n"
    assert player.stdout is not None
    said = player.stdout.read()
    assert (player.wait(), f"played {len(sent)} messages" in said) == (0, True), said


@pytest.mark.parametrize(
    ("options", "found"), [(["--rate", "0"], "is no pace"), (["--topic", "/nothing"], "no topic begins like that")]
)
def test_what_makes_no_sense_is_named(options: list[str], found: str, tmp_path: Path) -> None:
    run_in_process(load("wu2018", None, ["duration_s=5"]), tmp_path / "bag")
    done = CliRunner().invoke(app, ["play", str(tmp_path / "bag"), *options])
    assert isinstance(done.exception, (BagError, ScenarioError))
    assert found in str(done.exception)


def test_a_bag_that_is_none_is_named(tmp_path: Path) -> None:
    with pytest.raises(BagError, match="is not there"):
        play_bag(tmp_path / "none", 1.0, None, (), False, False, make_console())
