"""The command line of a node's executable is that of any ROS node, and rcl reads it."""

from __future__ import annotations

import sys
from pathlib import Path
from typing import Any
from unittest.mock import patch

import pytest
from hands import what_ros_says

from etac_ros.cli import nodes
from etac_ros.cli.nodes import OwnOptions, own_options
from etac_ros.errors import ScenarioError
from etac_ros.scenario.places import find

RUN = str(find("wu2018"))
FILE = ["--ros-args", "--params-file", RUN]


def understood(
    name: str, *passed_on: str, files: int = 1, own: tuple[Any, ...] = ("None", "sim", None, False)
) -> dict[str, Any]:
    return {"found": [name, [RUN] * files, list(passed_on)], "own": list(own)}


UNDERSTOOD = [
    ("controller", [*FILE, "-r", "__ns:=/pm"], understood("/pm/controller")),
    ("controller", [*FILE, "-r", "__ns:=/pm", "-r", "__node:=other"], understood("/pm/other")),
    ("controller", [*FILE, "--remap", "controller:__ns:=/pm"], understood("/pm/controller")),
    # rcl goes by the new name when it looks for the namespace.
    ("controller", [*FILE, "-r", "controller:__name:=other", "-r", "other:__ns:=/pm"], understood("/pm/other")),
    ("controller", [*FILE, "-r", "controller:__name:=other", "-r", "controller:__ns:=/pm"], understood("/other")),
    ("sensor", [*FILE, "-r", "other:__node:=s", "-r", "/somebodys:=/else"], understood("/sensor")),
    ("sensor", [*FILE, "-p", "other:k:=1"], understood("/sensor")),
    ("sensor", [*FILE, "--params-file", RUN], understood("/sensor", files=2)),
    ("recorder", ["--bag", "b", *FILE], understood("/recorder", own=("b", "sim", None, False))),
    ("recorder", [*FILE, "--", "--bag", "b", "--live"], understood("/recorder", own=("b", "sim", None, True))),
    ("plant", ["--clock", "wall", "--rate", "2.5", *FILE], understood("/plant", own=("None", "wall", 2.5, False))),
    *[
        ("sensor", [*FILE, *usual], understood("/sensor", *usual))
        for usual in (
            ["--log-level", "debug"],
            ["--log-level", "sensor:=info"],
            ["--enclave", "/sensor"],
            ["-e", "/sensor"],
            ["--disable-stdout-logs"],
            ["--enable-rosout-logs", "--disable-external-lib-logs"],
            ["--log-config-file", "log.conf", "--log-file-name", "x"],
        )
    ],
]  # fmt: skip
REFUSED = [
    (["--ros-args", "--params-file"], "ROS says: Couldn't parse trailing --params-file flag"),
    (["--ros-args", "--params-file", "no.yaml"], "ROS says: Couldn't parse params file: '--params-file no.yaml'"),
    ([*FILE, "-r", "nonsense"], "ROS says: Couldn't parse remap rule: '-r nonsense'"),
    ([*FILE, "-r", "__ns:=no name"], "ROS says: Couldn't parse remap rule"),
    ([*FILE, "--log-level", "loud"], "ROS says: Couldn't parse log level: '--log-level loud'"),
    ([*FILE, "--frobnicate", "1"], "is not understood by ROS"),
    ([*FILE, "-p", "k:=1"], "-p k:=1: would change one node only"),
    ([*FILE, "-p", "sensor:k:=[1, 2]"], "would change one node only"),
    ([*FILE, "-r", "/filtered_error:=/s"], "--set links.filtered_error.topic=/s"),
    ([*FILE, "-r", "sensor:filtered_error:=s"], "--set links.filtered_error.topic=/s"),
    ([*FILE, "-r", "/emulation/stop:=/s"], "leave it out: this topic is between the nodes of a run"),
    ([*FILE, "-r", "/clock:=/c"], "would move a topic for one node only"),
    (["--params-file", RUN], "options of ROS stand behind --ros-args"),
    ([*FILE, "--", "--rate", "fast"], "argument --rate: invalid float value: 'fast'"),
]  # fmt: skip


def test_what_rcl_makes_of_it(tmp_path: Path) -> None:
    questions = [(name, arguments) for name, arguments, _ in UNDERSTOOD] + [("sensor", words) for words, _ in REFUSED]
    answers = what_ros_says(questions, tmp_path)
    for (_, arguments, expected), answer in zip(UNDERSTOOD, answers, strict=False):
        assert answer == expected, arguments
    for (words, expected), answer in zip(REFUSED, answers[len(UNDERSTOOD) :], strict=True):
        assert expected in answer.get("refused", ""), (words, answer)


def test_our_own_options() -> None:
    assert own_options("sensor", []) == OwnOptions()
    given = ["--bag", "b", "--clock", "wall", "--rate", "20", "--live", "--live-port", "1234"]
    assert own_options("recorder", given) == OwnOptions(Path("b"), "wall", 20.0, live=True, live_port=1234)


@pytest.mark.parametrize(
    ("arguments", "found"),
    [
        (["--bag"], "argument --bag: expected one argument"),
        (["--clock", "sundial"], "argument --clock: invalid choice: 'sundial'"),
        (["--live-port", "3"], "--live-port 3: is for --live"),
        (["--liv"], "is not understood"),
        (["word"], "is not understood"),
    ],
)
def test_the_rest_is_refused(arguments: list[str], found: str) -> None:
    with pytest.raises(ScenarioError, match=found):
        own_options("sensor", arguments)


@pytest.mark.parametrize("arguments", [["-h"], ["--help"], ["--ros-args", "-h"], [*FILE, "--help"]])
def test_help_is_printed(arguments: list[str], capsys: pytest.CaptureFixture[str]) -> None:
    with patch.object(sys, "argv", ["sensor", *arguments]):
        nodes.sensor()
    assert "--params-file FILE" in capsys.readouterr().out
