"""A run over two machines, which are two network namespaces that a veth pair joins."""

from __future__ import annotations

import json
import os
import select
import shutil
import subprocess
import sys
import time
from collections.abc import Iterator, Mapping
from pathlib import Path
from typing import NamedTuple
from xml.etree import ElementTree

import pytest
from test_engines_equal import assert_same

from etac_ros.bag.read import read_bag
from etac_ros.engines.ros import several_machines
from etac_ros.engines.ros.environment import dds_environment, enter_launched_run, join_by_hand
from etac_ros.engines.ros.several_machines import Machines, machines_of
from etac_ros.errors import ScenarioError
from etac_ros.runs import run_in_process
from etac_ros.scenario.load import load

LIMIT_S = 60.0


class Machine(NamedTuple):
    """A network namespace in the place of a machine."""

    namespace: str
    interface: str
    address: str
    peer: str

    def etac(self, folder: Path, *arguments: str) -> subprocess.Popen[str]:
        command = ["ip", "netns", "exec", self.namespace, sys.executable, "-m", "etac_ros", *arguments]
        environment = {**os.environ, "PYTHONPATH": os.pathsep.join(sys.path)}
        return subprocess.Popen(
            command, cwd=folder, env=environment, stdout=subprocess.PIPE, stderr=subprocess.STDOUT, text=True
        )


def ip(*words: str) -> None:
    done = subprocess.run(["ip", *words], capture_output=True, text=True, check=False)
    if done.returncode:
        raise OSError(f"`ip {' '.join(words)}`: {done.stderr.strip() or done.stdout.strip()}")


@pytest.fixture(scope="module")
def machines() -> Iterator[tuple[Machine, Machine]]:
    """Two machines on one wire; where there cannot be any, the tests are skipped, and say why."""
    if shutil.which("ip") is None:
        pytest.skip("there is no `ip` (iproute2) to make network namespaces with")
    names = [f"etac{os.getpid()}{end}" for end in "ab"]
    cables = [f"ve{os.getpid()}{end}" for end in "ab"]
    made = [
        Machine(names[0], cables[0], "10.77.0.1", "10.77.0.2"), Machine(names[1], cables[1], "10.77.0.2", "10.77.0.1"),
    ]  # fmt: skip
    try:
        try:
            for name in names:
                ip("netns", "add", name)
            ip(
                "link",
                "add",
                cables[0],
                "netns",
                names[0],
                "type",
                "veth",
                "peer",
                "name",
                cables[1],
                "netns",
                names[1],
            )
            for one in made:
                ip("-n", one.namespace, "addr", "add", f"{one.address}/24", "dev", one.interface)
                ip("-n", one.namespace, "link", "set", "lo", "up")
                ip("-n", one.namespace, "link", "set", one.interface, "up")
        except OSError as error:
            pytest.skip(f"no network namespaces can be made here: {error}")
        yield made[0], made[1]
    finally:
        for name in names:
            subprocess.run(["ip", "netns", "del", name], capture_output=True, check=False)


def play(machines: tuple[Machine, Machine], folder: Path, *options: str) -> str:
    """``/pm`` on the one machine, ``/sm`` and the simulator with its recorder on the other."""
    here, there = machines
    common = ["run", "qi2022", "--set", "duration_s=2", "--set", "baseline=null", "--join", "7", "--quiet-s", "20"]
    parts = {
        "pm": here.etac(folder, *common, "--only", "/pm", "--peers", here.peer, *options),
        "sm": there.etac(folder, *common, "--only", "/sm", "--peers", there.peer, *options),
        "sim": there.etac(
            folder, *common, "--only", "/sim", "--interface", there.interface, "--peers", there.peer, "--bag", "bag",
            "--json", "summary.json", *options,
        ),
    }  # fmt: skip
    try:
        return all_end_well(parts)["sim"]
    finally:
        for part in parts.values():
            part.kill()
            part.wait()


def all_end_well(parts: Mapping[str, subprocess.Popen[str]]) -> dict[str, str]:
    """What each part printed, once all have ended; where one fails, or does not end, all that is known of all."""
    pending = {os.pidfd_open(part.pid): part for part in parts.values()}
    deadline = time.monotonic() + LIMIT_S
    while pending:
        ended, _, _ = select.select(list(pending), [], [], max(0.0, deadline - time.monotonic()))
        for ending in ended:
            pending.pop(ending).wait()
            os.close(ending)
        if not ended or any(part.returncode for part in parts.values()):
            break
    complete = not pending and not any(part.returncode for part in parts.values())
    states = "" if complete else f"{LIMIT_S - (deadline - time.monotonic()):.0f} s\n" + "".join(
        f"{path.read_text()[:60]} {path.with_name('wchan').read_text()}\n"
        for part in parts.values() if part.returncode is None
        for path in [Path(f"/proc/{one}/stat") for one in descendants(part.pid)]
    )  # fmt: skip
    for descriptor in pending:
        os.close(descriptor)
    for part in parts.values():
        if part.poll() is None:
            part.terminate()
    outputs = {name: part.communicate(timeout=LIMIT_S)[0] for name, part in parts.items()}
    codes = {name: part.returncode for name, part in parts.items()}
    assert complete, f"{states}{codes}\n" + "\n".join(f"{name}: {output}" for name, output in outputs.items())
    return outputs


def descendants(process: int) -> list[int]:
    """A process and all that it and its children have started."""
    try:
        children = Path(f"/proc/{process}/task/{process}/children").read_text().split()
    except OSError:  # it has just ended
        return []
    return [process, *(one for child in children for one in descendants(int(child)))]


def test_simulated_time_has_the_bits_of_one_machine(machines: tuple[Machine, Machine], tmp_path: Path) -> None:
    scenario = load("qi2022", None, ["duration_s=2", "baseline=null"])
    on_one = run_in_process(scenario).recording  # first, so that kernels are compiled once and not by three at a time
    play(machines, tmp_path)
    assert_same(read_bag(tmp_path / "bag").recording(), on_one)


@pytest.mark.slow
def test_real_time_has_latencies(machines: tuple[Machine, Machine], tmp_path: Path) -> None:
    output = play(machines, tmp_path, "--clock", "wall", "--rate", "2")
    assert "Latency of topics" in output
    latency = json.loads((tmp_path / "summary.json").read_text())["real_time"]["latency_ms"]["/pm/relative"]
    assert latency["count"] > 0
    assert latency["least"] > 0.0


LISTENER = """
import os, sys
from etac_ros.engines.ros.environment import join_by_hand
from etac_ros.engines.ros.several_machines import machines_of
join_by_hand(os.environ, 9, machines_of(sys.argv[1], None))
import rclpy
from geometry_msgs.msg import Point32
from rclpy.node import Node
rclpy.init()
node = Node("listener")
heard = []
node.create_subscription(Point32, "/filtered_error", heard.append, 100)
while len(heard) < int(sys.argv[2]):
    rclpy.spin_once(node)
print(len(heard), flush=True)
os._exit(0)
"""


@pytest.mark.slow
def test_the_recorder_may_be_on_the_other_machine_and_so_may_who_hears_its_bag_played(
    machines: tuple[Machine, Machine], tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    here, there = machines
    monkeypatch.setenv("ROS_DOMAIN_ID", "9")
    (tmp_path / "wu.yaml").write_text(load("wu2018", None, ["duration_s=20"]).text)
    clock = ["--clock", "wall", "--rate", "5"]
    parts = [
        machine.etac(tmp_path, "node", name, "wu.yaml", "--peers", machine.peer, *clock, *more)
        for machine, name, *more in (
            (here, "/plant"), (here, "/sensor"), (here, "/actuator"), (here, "/coordinator"),
            (there, "/controller"), (there, "/recorder", "--bag", "bag"),
        )
    ]  # fmt: skip
    try:
        for part in parts:
            output, _ = part.communicate(timeout=LIMIT_S)
            assert part.returncode == 0, output
        sent = len(read_bag(tmp_path / "bag").recording().messages["filtered_error"])
        assert sent > 5
        command = ["ip", "netns", "exec", there.namespace, sys.executable, "-c", LISTENER, there.peer, str(sent)]
        parts.append(subprocess.Popen(command, stdout=subprocess.PIPE, text=True))
        played = here.etac(tmp_path, "play", "bag", "--domain", "9", "--rate", "10", "--peers", here.peer, "--wait")
        parts.append(played)
        assert "played" in played.communicate(timeout=LIMIT_S)[0]
        assert parts[-2].communicate(timeout=LIMIT_S)[0].strip() == str(sent)
    finally:
        for part in parts:
            part.kill()
            part.wait()


def test_a_peer_that_is_not_there_is_named(machines: tuple[Machine, Machine], tmp_path: Path) -> None:
    with machines[0].etac(tmp_path, "run", "wu2018", "--peers", "10.77.0.9") as run:
        output, _ = run.communicate(timeout=LIMIT_S)
    assert run.returncode == 2
    assert "--peers 10.77.0.9: cannot be reached from 10.77.0.1: No route to host" in output


def test_a_network_that_is_not_there_is_named(machines: tuple[Machine, Machine], tmp_path: Path) -> None:
    with machines[0].etac(tmp_path, "node", "/sensor", "wu2018", "--peers", "10.78.0.1") as node:
        output, _ = node.communicate(timeout=LIMIT_S)
    assert node.returncode == 2
    assert "--peers 10.78.0.1: no way leads there: Network is unreachable" in output


def test_an_interface_without_a_link_is_named(machines: tuple[Machine, Machine], tmp_path: Path) -> None:
    """DDS would leave it out, with a line about its transport, and the nodes would wait for ever."""
    there = machines[1]
    ip("-n", there.namespace, "link", "set", there.interface, "down")
    node = there.etac(tmp_path, "node", "/sensor", "wu2018", "--interface", there.interface)
    try:
        output, _ = node.communicate(timeout=LIMIT_S)
    finally:
        node.kill()
        ip("-n", there.namespace, "link", "set", there.interface, "up")
    assert node.returncode == 2
    assert f"interface {there.interface} ({there.address}): is down, or has no link" in output


def test_a_link_that_is_about_to_come_up_is_waited_for(monkeypatch: pytest.MonkeyPatch) -> None:
    """Linux says so late; DDS would have left the interface out by then."""
    answers = iter([several_machines._Down("eth0", True), several_machines._Down("eth0", True), None])
    monkeypatch.setattr(several_machines, "_without_link", lambda address: next(answers))
    monkeypatch.setattr(several_machines, "_LOOK_EVERY_S", 0.0)
    assert machines_of(None, "127.0.0.1") == Machines("127.0.0.1")
    assert next(answers, "all asked") == "all asked"


@pytest.mark.parametrize(
    ("peers", "interface", "expected"),
    [
        ("nobody.invalid", None, "--peers nobody.invalid: is unknown"),
        ("127.0.0.1,", None, "names nobody"),
        ("127.0.0.1", "wlan77", "--interface wlan77: is no interface or address of this machine"),
        (None, "192.0.2.1", "--interface 192.0.2.1: is no interface or address of this machine"),
    ],
)
def test_refused(peers: str | None, interface: str | None, expected: str) -> None:
    with pytest.raises(ScenarioError, match=expected):
        machines_of(peers, interface)


def test_without_either_a_run_keeps_to_the_loopback() -> None:
    assert machines_of(None, None) is None
    assert machines_of("127.0.0.1", "lo") == Machines("127.0.0.1")


@pytest.mark.parametrize("private", [True, False])
def test_the_profile_differs_in_addresses_alone(private: bool, tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setenv("XDG_CACHE_HOME", str(tmp_path))
    variable = "FASTRTPS_DEFAULT_PROFILES_FILE"
    alone = ElementTree.parse(dds_environment(3, private)[variable]).getroot()
    path = dds_environment(3, private, Machines("10.0.0.1", ("10.0.0.2", "10.0.0.3")))[variable]
    spread = ElementTree.parse(path).getroot()
    addresses = [element.text for element in spread.iter() if element.tag.endswith("}address")]
    assert addresses == ["10.0.0.1", "10.0.0.1", "10.0.0.2", "10.0.0.3"]

    def rest(root: ElementTree.Element) -> list[tuple[str, str]]:
        names = ("address", "udpv4", "locator")
        return [(one.tag, (one.text or "").strip()) for one in root.iter() if one.tag.partition("}")[2] not in names]

    assert rest(alone) == rest(spread)
    assert [path] == [str(found) for found in tmp_path.rglob("*.xml")]


def test_machines_that_are_named_are_used_whoever_starts_the_node() -> None:
    machines = Machines("10.0.0.1", ("10.0.0.2",))
    by_hand = {"FASTRTPS_DEFAULT_PROFILES_FILE": "/mine.xml"}
    join_by_hand(by_hand, 5, machines)
    launched: dict[str, str] = {}
    enter_launched_run(launched, 5, False, machines)
    assert by_hand["FASTRTPS_DEFAULT_PROFILES_FILE"] == launched["FASTRTPS_DEFAULT_PROFILES_FILE"] != "/mine.xml"
