"""What the shell's environment means: nothing to a launched run, the last word for a node that is started by hand."""

from __future__ import annotations

import os
import subprocess
import sys
import xml.etree.ElementTree as ET
from importlib.resources import files
from pathlib import Path

import pytest

from etac_ros.bag.read import read_bag
from etac_ros.cli.nodes import join_domain
from etac_ros.engines.ros.domain import check_domain, domain_of_environment, take_domain
from etac_ros.engines.ros.environment import (
    MOST_PEERS,
    SET_ASIDE,
    dds_environment,
    enter_launched_run,
    join_by_hand,
    may_keep_apart,
    without_effect,
)
from etac_ros.errors import ScenarioError

LIMIT_S = 90
NAMESPACE = "{http://www.eprosima.com/XMLSchemas/fastRTPS_Profiles}"

PROFILE_OF_ANOTHER = """<?xml version="1.0" encoding="UTF-8"?>
<dds xmlns="http://www.eprosima.com/XMLSchemas/fastRTPS_Profiles"><profiles>
  <participant profile_name="alone" is_default_profile="true">
    <rtps><builtin><discovery_config><discoveryProtocol>NONE</discoveryProtocol></discovery_config></builtin></rtps>
  </participant>
</profiles></dds>
"""


def etac(*arguments: str, folder: Path, **environment: str) -> subprocess.CompletedProcess[str]:
    return subprocess.run(
        [sys.executable, "-m", "etac_ros", *arguments],
        cwd=folder,
        env={**os.environ, "PYTHONPATH": os.pathsep.join(sys.path), **environment},
        capture_output=True,
        text=True,
        timeout=LIMIT_S,
        check=False,
    )


def test_a_launched_run_goes_its_way_in_a_hostile_environment(tmp_path: Path) -> None:
    (tmp_path / "DEFAULT_FASTRTPS_PROFILES.xml").write_text(PROFILE_OF_ANOTHER)
    (tmp_path / "mine.xml").write_text(PROFILE_OF_ANOTHER)
    hostile = {
        "RMW_IMPLEMENTATION": "rmw_cyclonedds_cpp",
        "RMW_FASTRTPS_PUBLICATION_MODE": "ASYNCHRONOUS",
        "ROS_AUTOMATIC_DISCOVERY_RANGE": "OFF",
        "ROS_DISCOVERY_SERVER": "127.0.0.1:11811",
        "ROS_LOCALHOST_ONLY": "1",
        "ROS_SECURITY_ENABLE": "true",
        "ROS_SECURITY_STRATEGY": "Enforce",
        "ROS_LOG_DIR": "/proc/there/is/no/such",
        "FASTRTPS_DEFAULT_PROFILES_FILE": str(tmp_path / "mine.xml"),
    }
    options = ["--set", "duration_s=20", "--set", "baseline=null", "--bag", "bag", "--quiet-s", "10"]
    done = etac("run", "wu2018", *options, folder=tmp_path, **hostile)
    assert done.returncode == 0, done.stderr
    assert read_bag(tmp_path / "bag").recording().messages["filtered_error"]
    told = done.stderr.splitlines()[0]
    assert told.startswith("etac: no effect on a run")
    silent = {"ROS_LOG_DIR"}  # it only says where log files go, and there are none
    assert [name for name in hostile if name not in silent and f"{name}={hostile[name]}" not in told] == []
    assert f"DEFAULT_FASTRTPS_PROFILES.xml in {tmp_path}" in told


def test_the_processes_of_a_run_get_none_of_it() -> None:
    environment = dict.fromkeys(SET_ASIDE, "anything") | {"ROS_DOMAIN_ID": "3", "HOME": "/home"}
    enter_launched_run(environment, 7, private=True)
    assert environment == {"HOME": "/home", **dds_environment(7, private=True)}


def test_only_a_launched_run_says_how_many_it_looks_for() -> None:
    assert dds_environment(7, private=True, peers=13)["ETAC_ROS_PEERS"] == "13"
    assert dds_environment(7, private=True, peers=1000)["ETAC_ROS_PEERS"] == str(MOST_PEERS)
    assert "ETAC_ROS_PEERS" not in dds_environment(7)
    by_hand = ET.parse(dds_environment(7)["FASTRTPS_DEFAULT_PROFILES_FILE"]).getroot()
    assert [one.text for one in by_hand.iter(f"{NAMESPACE}maxInitialPeersRange")] == [str(MOST_PEERS)]


def test_nothing_is_said_of_a_plain_environment(tmp_path: Path) -> None:
    plain = {"RMW_IMPLEMENTATION": "rmw_fastrtps_cpp", "ROS_LOCALHOST_ONLY": "0", "ROS_SECURITY_ENABLE": "false"}
    assert without_effect(plain, tmp_path) == []
    assert without_effect(dds_environment(3), tmp_path) == []
    assert may_keep_apart({}, tmp_path) == ""


@pytest.mark.parametrize(
    ("name", "value"), [("RMW_IMPLEMENTATION", "rmw_cyclonedds_cpp"), ("ROS_AUTOMATIC_DISCOVERY_RANGE", "OFF")]
)
def test_a_node_that_could_meet_nobody_is_refused(name: str, value: str, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setenv(name, value)
    with pytest.raises(ScenarioError, match=f"{name}={value} in the environment") as caught:
        join_domain()
    assert f"unset {name}" in caught.value.remedy


def test_a_node_by_hand_keeps_what_the_shell_says() -> None:
    environment = {
        "FASTRTPS_DEFAULT_PROFILES_FILE": "/mine.xml",
        "ROS_DISCOVERY_SERVER": "here:1",
        "RMW_IMPLEMENTATION": "",
    }
    join_by_hand(environment, 5)
    assert environment["FASTRTPS_DEFAULT_PROFILES_FILE"] == "/mine.xml"
    assert environment["ROS_DISCOVERY_SERVER"] == "here:1"
    assert environment["RMW_IMPLEMENTATION"] == "rmw_fastrtps_cpp"
    assert environment["ROS_DOMAIN_ID"] == "5"


def test_a_node_that_waits_names_what_may_keep_it_apart(tmp_path: Path) -> None:
    lease = take_domain()
    scenario = tmp_path / "wu.yaml"
    scenario.write_text(etac("resolve", "wu2018", folder=tmp_path).stdout)
    environment = {**os.environ, "PYTHONPATH": os.pathsep.join(sys.path), "ROS_DOMAIN_ID": str(lease.domain)}
    environment["ROS_DISCOVERY_SERVER"] = "127.0.0.1:11811"
    command = [sys.executable, "-m", "etac_ros", "node", "sensor", str(scenario), "--quiet-s", "5"]
    with subprocess.Popen(
        command, cwd=tmp_path, env=environment, stdout=subprocess.PIPE, stderr=subprocess.STDOUT, text=True
    ) as waiting:
        try:
            assert waiting.stdout is not None
            lines = iter(waiting.stdout.readline, "")
            told = next(line for line in lines if "still no other end" in line)
            assert f"in ROS domain {lease.domain}, still no other end for" in told
            assert "/emulation/plant/window (no publisher: /plant)" in told
            assert "a possible cause: ROS_DISCOVERY_SERVER=127.0.0.1:11811" in told
        finally:
            waiting.terminate()
    assert waiting.returncode == 128 + 15
    lease.release()


@pytest.mark.parametrize("text", ["abc", "-3"])
def test_a_domain_is_checked_at_every_door(text: str, tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    doors = [(["run", "wu2018"], {"ROS_DOMAIN_ID": text}), (["node", "sensor", "wu2018"], {"ROS_DOMAIN_ID": text})]
    if text.lstrip("-").isdigit():
        doors += [(["run", "wu2018", "--domain", text], {}), (["run", "qi2022", "--only", "/pm", "--join", text], {})]
        with pytest.raises(ScenarioError, match="out of range"):
            check_domain(int(text), "here")
    for arguments, environment in doors:
        done = etac(*arguments, folder=tmp_path, **environment)
        assert done.returncode == 2
        assert text in done.stderr
        assert "0 to 101" in done.stderr
        assert "Traceback" not in done.stderr
    assert list(tmp_path.iterdir()) == []


def test_an_empty_domain_is_none() -> None:
    assert domain_of_environment({}) is None
    assert domain_of_environment({"ROS_DOMAIN_ID": ""}) is None
    assert domain_of_environment({"ROS_DOMAIN_ID": "17"}) == 17


def test_a_run_takes_the_domain_of_the_environment_unless_told_otherwise(tmp_path: Path) -> None:
    wanted, other = take_domain(), take_domain()
    by_variable = etac("run", "wu2018", folder=tmp_path, ROS_DOMAIN_ID=str(wanted.domain))
    by_option = etac("run", "wu2018", "--domain", str(other.domain), folder=tmp_path, ROS_DOMAIN_ID=str(wanted.domain))
    assert f"ROS domain {wanted.domain}: is in use" in by_variable.stderr
    assert f"ROS domain {other.domain}: is in use" in by_option.stderr
    wanted.release()
    other.release()


def test_the_two_profiles_differ_in_what_is_meant_to_differ() -> None:
    def settings(name: str) -> list[tuple[str, str]]:
        root = ET.fromstring(files("etac_ros.engines.ros").joinpath(name).read_text())
        return [(each.tag.removeprefix(NAMESPACE), (each.text or "").strip()) for each in root.iter()]

    by_hand, launched = settings("fastdds_profile.xml"), settings("fastdds_profile_launched.xml")
    different = [(a, b) for a, b in zip(by_hand, launched, strict=True) if a != b]
    peers = "maxInitialPeersRange"
    assert different == [
        ((peers, "110"), (peers, "${ETAC_ROS_PEERS}")),
        (("sec", "4"), ("sec", "DURATION_INFINITY")),
        (("nanosec", "50000000"), ("nanosec", "20000000")),
    ]
