"""The command line of a node's executable is that of any ROS node, and nothing in it is silently ignored."""

from __future__ import annotations

from pathlib import Path

import pytest

from etac_ros.cli.nodes import parse_arguments
from etac_ros.errors import ScenarioError

FILE = ["--ros-args", "--params-file", "run.yaml"]


def test_what_a_launch_file_gives() -> None:
    remaps = ["-r", "__ns:=/pm", "-r", "__node:=controller"]
    assert parse_arguments("controller", [*FILE, *remaps]) == ("/pm/controller", ("run.yaml",), None)
    ours = ["-r", "controller:__ns:=/pm", "--remap", "controller:__node:=other"]
    assert parse_arguments("controller", [*FILE, *ours]) == ("/pm/other", ("run.yaml",), None)
    assert parse_arguments("recorder", ["--bag", "b", *FILE]) == ("/recorder", ("run.yaml",), Path("b"))


@pytest.mark.parametrize(
    "usual",
    [
        ["--log-level", "debug"],
        ["--log-level", "sensor:=info"],
        ["--enclave", "/sensor"],
        ["--disable-stdout-logs"],
        ["--enable-rosout-logs", "--disable-external-lib-logs"],
    ],
)
def test_what_any_ros_node_takes_is_taken(usual: list[str]) -> None:
    assert parse_arguments("sensor", [*FILE, *usual]) == ("/sensor", ("run.yaml",), None)
    assert parse_arguments("sensor", ["--ros-args", *usual, *FILE[1:]]) == ("/sensor", ("run.yaml",), None)


def test_several_parameter_files_are_all_taken_in_their_order() -> None:
    assert parse_arguments("sensor", [*FILE, "--params-file", "/tmp/more"])[1] == ("run.yaml", "/tmp/more")


def test_help_is_printed(capsys: pytest.CaptureFixture[str]) -> None:
    for word in ("-h", "--help"):
        with pytest.raises(SystemExit) as caught:
            parse_arguments("sensor", [word])
        assert caught.value.code == 0
        assert "--params-file FILE" in capsys.readouterr().out


@pytest.mark.parametrize(
    ("arguments", "found"),
    [
        ([], "has no parameter file"),
        (["--params-file"], "has no value"),
        ([*FILE, "-p", "k:=1"], "would change one node only"),
        ([*FILE, "-r", "/filtered_error:=/s"], "would move a topic for one node only"),
        ([*FILE, "-r", "sensor:filtered_error:=s"], "would move a topic for one node only"),
        ([*FILE, "-r", "other:__node:=s"], "is not understood|would move"),
        ([*FILE, "--frobnicate", "1"], "is not understood"),
    ],
)
def test_the_rest_is_refused(arguments: list[str], found: str) -> None:
    with pytest.raises(ScenarioError, match=found):
        parse_arguments("sensor", arguments)
