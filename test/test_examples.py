"""Each of the examples takes part in a run: as controller, sensor and plant, by rclpy and by another DDS."""

from __future__ import annotations

import os
import shutil
import subprocess
import xml.etree.ElementTree as ET
from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np
import pytest
import yaml
from hands import LIMIT_S, Start, foreign
from rclpy.serialization import serialize_message
from rich.console import Console
from std_msgs.msg import Float64MultiArray, MultiArrayDimension, MultiArrayLayout

from etac_ros.cli.contract import contract, example, show_contract, window_example
from etac_ros.engines.ros.domain import DomainLease
from etac_ros.engines.ros.messages import decode_window
from etac_ros.errors import ScenarioError
from etac_ros.graph.graph import LinkKind
from etac_ros.graph.plant import PlantModule
from etac_ros.graph.wire import Wire, WireFormat
from etac_ros.metrics.latency_tables import real_time_tables
from etac_ros.runs import RosOptions, Run, run_in_process, run_over_ros
from etac_ros.scenario.load import load

EXAMPLES = Path(__file__).resolve().parent.parent / "examples"
GAIN = "-26.113821209155528"
REMAPPED = ["--ros-args", "-r", "signal:=/filtered_error", "-r", "command:=/torque_command", "-p", f"gain:={GAIN}"]
RELAY = ["--ros-args", "-r", "signal:=/pm/relative", "-r", "command:=/sm/torque_s"]


def example_node(start: Start, name: str, *options: str) -> None:
    process = start(str(EXAMPLES / name), *options)
    assert process.stdout is not None
    assert process.stdout.readline().strip() == "ready"


def run(
    lease: DomainLease,
    bag: Path,
    scenario: str,
    node: str,
    duration_s: float,
    rate: float | None,
    on_start: Callable[[dict[str, int]], None] = lambda pids: None,
) -> Run:
    lease.release()
    loaded = load(scenario, None, [f"{node}.external=true", f"duration_s={duration_s}"])
    return run_over_ros(loaded, bag, RosOptions(domain=lease.domain, rate=rate), on_start=on_start)


def answered(found: Run, asked: str, answers: str) -> None:
    assert found.summary.topics[asked].messages == found.summary.topics[answers].messages > 5


def test_a_controller_in_plain_rclpy_and_one_who_watches(tmp_path: Path, start: Start, lease: DomainLease) -> None:
    """The run begins when the controller is there, and that comes when the watcher knows of the run: it sees all."""
    watcher = start("-m", "etac_ros", "watch", "--domain", str(lease.domain))

    def come_in(pids: dict[str, int]) -> None:
        assert watcher.stdout is not None
        assert watcher.stdout.readline() == "wu2018: listening\n"
        example_node(start, "foreign_controller.py", *REMAPPED)

    found = run(lease, tmp_path / "bag", "wu2018", "controller", 20, 20.0, come_in)
    answered(found, "/filtered_error", "/torque_command")
    account = found.summary.real_time
    assert account is not None
    assert account.loops["/emulation/torque"].ms.count == found.summary.topics["/torque_command"].messages
    assert account.foreign["/controller"].fits
    shown, complaints = watcher.communicate(timeout=LIMIT_S)
    assert watcher.returncode == 0, complaints
    count, network = found.summary.triggers["/sensor"].count, found.summary.network
    last = shown.splitlines()[-1]
    assert last.startswith("wu2018: 20.0 of 20 s simulated")
    assert last.endswith(
        f"{count} triggers, {network.messages} messages and {network.payload_bytes} B on the network; the run is over"
    )


@pytest.mark.slow
def test_one_that_answers_twice_is_shown(tmp_path: Path, start: Start, lease: DomainLease) -> None:
    foreign(start, "--replies", "2")
    account = run(lease, tmp_path / "bag", "wu2018", "controller", 20, 20.0).summary.real_time
    assert account is not None
    counts = account.foreign["/controller"]
    assert counts.came == 2 * counts.asked
    assert not counts.fits
    assert any("not one answer to each message" in row.cells for t in real_time_tables(account) for row in t.rows)


@pytest.mark.slow
def test_the_same_controller_in_simulated_time(tmp_path: Path, start: Start, lease: DomainLease) -> None:
    example_node(start, "foreign_controller.py", *REMAPPED)
    found = run(lease, tmp_path / "bag", "wu2018", "controller", 100, None)
    ours = run_in_process(load("wu2018", None, ["duration_s=100"]))
    assert found.recording.messages["torque_command"][3].tick == ours.recording.messages["torque_command"][3].tick


@pytest.mark.slow
def test_a_controller_of_another_scenario(tmp_path: Path, start: Start, lease: DomainLease) -> None:
    example_node(start, "foreign_controller.py", *RELAY)
    answered(run(lease, tmp_path / "bag", "qi2022", "sm/controller", 3, 1.0), "/pm/relative", "/sm/torque_s")


@pytest.mark.slow
@pytest.mark.parametrize("scenario", ["wu2018", "qi2022"])
def test_a_controller_in_another_dds(scenario: str, tmp_path: Path, start: Start, lease: DomainLease) -> None:
    pytest.importorskip("cyclonedds", reason="the PyPI package cyclonedds is not installed")
    asked, answers, node, gain = {
        "wu2018": ("/filtered_error", "/torque_command", "controller", GAIN),
        "qi2022": ("/pm/relative", "/sm/torque_s", "sm/controller", "1.0"),
    }[scenario]
    domain = str(lease.domain)
    example_node(
        start, "dds_controller.py", "--domain", domain, "--signal", asked, "--command", answers, f"--gain={gain}"
    )
    duration, rate = (20, 20.0) if scenario == "wu2018" else (3, 1.0)
    answered(run(lease, tmp_path / "bag", scenario, node, duration, rate), asked, answers)


@pytest.mark.slow
def test_a_sensor_with_its_own_trigger(tmp_path: Path, start: Start, lease: DomainLease) -> None:
    example_node(start, "foreign_sensor.py")
    found = run(lease, tmp_path / "bag", "wu2018", "sensor", 15, 5.0)
    answered(found, "/filtered_error", "/torque_command")
    assert found.summary.triggers["/sensor"].count == found.summary.topics["/filtered_error"].messages


@pytest.mark.slow
def test_a_plant_of_ones_own(tmp_path: Path, start: Start, lease: DomainLease) -> None:
    example_node(start, "foreign_plant.py")
    found = run(lease, tmp_path / "bag", "wu2018", "plant", 15, 5.0)
    answered(found, "/filtered_error", "/emulation/torque")
    first, states = found.recording.samples("/plant")
    assert (first, len(states)) == (0, 15 * 32 + 1)
    assert np.linalg.norm(states[:, :4], axis=1) == pytest.approx(np.ones(len(states)), abs=1e-4)
    assert np.ptp(states[:, 4]) > 1e-3  # it moves under our torque


@pytest.mark.parametrize("node", ["plant", "sensor"])
def test_these_roles_are_for_real_time(node: str, tmp_path: Path) -> None:
    scenario = load("wu2018", None, [f"{node}.external=true"])
    with pytest.raises(ScenarioError, match=rf"/{node}.external: a foreign node cannot play /{node} in simulated time"):
        run_over_ros(scenario, tmp_path / "bag")


def test_foreign_nodes_know_nothing_of_etac_ros() -> None:
    for path in (*EXAMPLES.glob("foreign_*.py"), EXAMPLES / "dds_controller.py", EXAMPLES / "real_time.py"):
        assert "import etac_ros" not in path.read_text()
        assert "from etac_ros" not in path.read_text()


def test_the_cpp_package_says_what_it_needs() -> None:
    folder = EXAMPLES / "cpp_controller"
    manifest = ET.parse(folder / "package.xml").getroot()
    needs = {element.text for element in manifest if element.tag.endswith("depend")}
    assert needs == {"ament_cmake", "rclcpp", "geometry_msgs"}
    cmake = (folder / "CMakeLists.txt").read_text()
    assert all(f"find_package({name} REQUIRED)" in cmake for name in needs)


def test_the_cpp_package_builds_on_a_full_ros(tmp_path: Path) -> None:
    prefixes = os.environ.get("AMENT_PREFIX_PATH", "").split(os.pathsep)
    if not any(Path(prefix, "share", "ament_cmake").is_dir() for prefix in prefixes):
        pytest.skip("there is no ament_cmake here: this builds on a full ROS 2 only")
    assert shutil.which("colcon") is not None
    command = ["colcon", "build", "--base-paths", str(EXAMPLES / "cpp_controller")]
    done = subprocess.run(command, cwd=tmp_path, capture_output=True, text=True, check=False)
    assert done.returncode == 0, done.stderr


# The contract that is printed


@pytest.mark.parametrize("name", ["wu2018", "qi2022", "flexible", "shi2022", "xie2021"])
def test_every_node_has_a_contract_with_all_its_topics(name: str) -> None:
    scenario = load(name)
    for node in scenario.graph.modules:
        found = contract(scenario, node)
        topics = {row.cells[1] for row in found.topics.rows}
        assert {link.topic for link in (*scenario.graph.hears[node], *scenario.graph.sends[node])} <= topics
        assert {link.topic for link in scenario.graph.sends[node]} <= set(found.examples)
        physical = [link for link in scenario.graph.sends[node] if link.kind is LinkKind.PHYSICAL]
        assert all(
            "N m" in row.cells[4] for row in found.topics.rows if row.cells[1] in {one.topic for one in physical}
        )


def fill(message: Any, values: dict[str, Any]) -> None:
    """Set fields as `ros2 topic pub` does."""
    for name, value in values.items():
        if isinstance(value, dict):
            fill(getattr(message, name), value)
        else:
            setattr(message, name, value)


@pytest.mark.parametrize(
    ("kind", "size"),
    [(WireFormat.COMPACT, 3), (WireFormat.COMPACT, 5), (WireFormat.DOUBLE, 3), (WireFormat.STAMPED, 3),
     (WireFormat.STAMPED, 4), (WireFormat.STAMPED, 6)],
)  # fmt: skip
def test_an_example_is_the_message_that_it_says(kind: WireFormat, size: int) -> None:
    from etac_ros.bag.codec import decode
    from etac_ros.engines.ros.messages import message_type

    wire = Wire(kind, size)
    message = message_type(wire)()
    fill(message, yaml.safe_load(example(wire)))
    sent = serialize_message(message)
    assert decode(wire.type_name, sent) == pytest.approx([0.1 * (place + 1) for place in range(size)])


def test_an_example_of_a_window_is_one() -> None:
    graph = load("wu2018").graph
    plant = graph.modules["/plant"]
    assert isinstance(plant, PlantModule)
    values = yaml.safe_load(window_example(plant))
    layout = MultiArrayLayout(
        dim=[MultiArrayDimension(**one) for one in values["layout"].pop("dim")], **values["layout"]
    )
    message = Float64MultiArray(layout=layout, data=[float(one) for one in values["data"]])
    window, _ = decode_window(serialize_message(message), "/plant")
    assert (window.epoch, window.start, window.last) == (1, 0, 0)
    assert window.samples[0] == pytest.approx(plant.state, rel=1e-5)


def test_the_contract_is_shown(capsys: pytest.CaptureFixture[str]) -> None:
    show_contract(load("wu2018"), "sensor", Console(width=140, markup=False))
    shown = capsys.readouterr().out
    for words in ("/emulation/plant/window", "/filtered_error", "s [rad/s]", "reliable, volatile", "omega_x [rad/s]"):
        assert words in shown


def test_a_contract_of_nobody() -> None:
    with pytest.raises(ScenarioError, match=r"has no node '/nobody'"):
        contract(load("wu2018"), "nobody")
