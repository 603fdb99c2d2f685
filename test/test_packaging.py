"""Set-up, packaging and scripts: what a user, pip, colcon and `ros2 run` get to see."""

from __future__ import annotations

import os
import runpy
import shutil
import subprocess
import sys
import tempfile
import types
import xml.etree.ElementTree as ET
from collections.abc import Iterator
from importlib.metadata import EntryPoint, distribution
from pathlib import Path
from typing import Any

import pytest

import etac_ros

ROOT = Path(__file__).resolve().parent.parent
NODES = {"plant", "sensor", "controller", "actuator", "recorder", "coordinator"}


def output_of(*command: str | Path, cwd: Path = ROOT, **environment: str) -> str:
    """What a command prints; a test fails with all that it printed if the command does."""
    done = subprocess.run(
        command, cwd=cwd, env={**os.environ, **environment}, capture_output=True, text=True, check=False
    )
    assert done.returncode == 0, f"{command}: exit {done.returncode}\n{done.stdout}{done.stderr}"
    return done.stdout


# What is declared


@pytest.mark.smoke
def test_the_version_is_the_same_wherever_it_stands() -> None:
    manifest = ET.parse(ROOT / "package.xml").getroot()
    assert manifest.findtext("version") == etac_ros.__version__
    assert f'version="{etac_ros.__version__}"' in (ROOT / "setup.py").read_text()
    assert f"\nversion: {etac_ros.__version__}\n" in (ROOT / "CITATION.cff").read_text()


def commands() -> list[EntryPoint]:
    return [entry for entry in distribution("etac_ros").entry_points if entry.group == "console_scripts"]


def test_every_command_can_be_loaded() -> None:
    assert {entry.name for entry in commands()} == {"etac", *NODES}
    for entry in commands():
        assert callable(entry.load()), entry.value


def test_requirements_are_met_and_agree() -> None:
    output_of(sys.executable, "-m", "pip", "check")


def requirements(folder: Path, **environment: str) -> str:
    folder.mkdir()
    output_of(sys.executable, "setup.py", "--quiet", "egg_info", "--egg-base", folder, **environment)
    return (folder / "etac_ros.egg-info" / "requires.txt").read_text()


def test_ros_wheels_are_required_only_where_no_jazzy_is_sourced(tmp_path: Path) -> None:
    prefixes = [tmp_path / "opt" / "ros" / "jazzy", tmp_path / "wheels"]
    for prefix in prefixes:
        (prefix / "share" / "rclpy").mkdir(parents=True)
        (prefix / "share" / "rclpy" / "package.xml").touch()
    ros, wheels = map(str, prefixes)
    (tmp_path / "wheels" / "pyvenv.cfg").touch()

    assert "ros-jazzy-rclpy[fastrtps]" in requirements(tmp_path / "a", ROS_DISTRO="", AMENT_PREFIX_PATH=ros)
    assert "ros-jazzy-rclpy" in requirements(tmp_path / "b", ROS_DISTRO="jazzy", AMENT_PREFIX_PATH=wheels)
    sourced = requirements(tmp_path / "c", ROS_DISTRO="jazzy", AMENT_PREFIX_PATH=f"{tmp_path}:{ros}")
    assert "ros-jazzy" not in sourced
    assert "numba" in sourced


# Scripts


@pytest.mark.smoke
@pytest.mark.parametrize("name", ["scripts/setup", "scripts/run", "scripts/etac", "scripts/test", ".ci/run"])
def test_script_can_be_called(name: str) -> None:
    assert os.access(ROOT / name, os.X_OK)
    output_of("bash", "-n", ROOT / name)


@pytest.mark.smoke
def test_the_environment_comes_before_that_of_a_parent(tmp_path: Path) -> None:
    venv, other = tmp_path / "our own", tmp_path / "other"
    libraries = "lib/python3.12/site-packages/ros_rcl.libs"
    (venv / libraries).mkdir(parents=True)
    inherited = f"{other}/lib:{other}/{libraries}"
    shown = 'printf "%s\n" "$LD_LIBRARY_PATH" "$AMENT_PREFIX_PATH"'
    # Entered twice, as where a test calls scripts/run: nothing is listed twice.
    script = f'set -eu; source "$1/scripts/setup"; ros=wheels; enter; enter; {shown}'
    lines = output_of(
        "bash", "-c", script, "-", ROOT,
        ETAC_ROS_VENV=str(venv), LD_LIBRARY_PATH=inherited, AMENT_PREFIX_PATH=str(other),
    ).splitlines()  # fmt: skip
    assert lines == [f"{venv}/lib:{venv}/{libraries}:{inherited}", f"{venv}:{other}"]


@pytest.fixture
def tree_of_another() -> Iterator[Path]:
    """A folder that anybody may read and only its owner write; pytest's own folders keep others out."""
    with tempfile.TemporaryDirectory() as name:
        Path(name).chmod(0o755)
        yield Path(name)


@pytest.mark.skipif(os.getuid() != 0, reason="only root can become somebody else")
@pytest.mark.parametrize("writable", [True, False])
def test_who_has_no_home_gets_one_or_is_told(writable: bool, tree_of_another: Path) -> None:
    script, folder = tree_of_another / "scripts" / "setup", tree_of_another / "tmp"
    script.parent.mkdir()
    script.write_text((ROOT / "scripts/setup").read_text())
    folder.mkdir(mode=0o777)
    folder.chmod(0o777 if writable else 0o555)
    done = subprocess.run(
        ["bash", "-c", f'set -eu; source "{script}"; ros=wheels; enter; echo "$HOME"'],
        env={"PATH": os.environ["PATH"], "TMPDIR": str(folder)},
        user=12345, group=12345, extra_groups=[], cwd="/", capture_output=True, text=True, check=False,
    )  # fmt: skip
    if writable:
        assert done.stdout.strip() == str(folder / "etac_ros-12345"), done.stderr
        assert (folder / "etac_ros-12345").stat().st_mode & 0o777 == 0o700
    else:
        assert done.returncode == 1
        assert "there is no folder to write to" in done.stderr
        assert "mkdir" not in done.stderr


@pytest.mark.smoke
def test_a_folder_of_somebody_else_is_not_touched(tmp_path: Path) -> None:
    (tmp_path / "thesis.tex").touch()
    done = subprocess.run(
        [ROOT / "scripts/run", "wu2018"],
        env={**os.environ, "ETAC_ROS_VENV": str(tmp_path)},
        capture_output=True,
        text=True,
        check=False,
    )
    assert done.returncode == 1
    assert f"{tmp_path} was not made by scripts/setup" in done.stderr
    assert [path.name for path in tmp_path.iterdir()] == ["thesis.tex"]


# colcon


@pytest.fixture(scope="module")
def workspace(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """A workspace with the package in src/, built."""
    folder = tmp_path_factory.mktemp("workspace")
    (folder / "src").mkdir()
    (folder / "src" / "etac_ros").symlink_to(ROOT)
    colcon(folder, "build")
    return folder


def colcon(workspace: Path, *arguments: str) -> str:
    """Call colcon with this very Python: a system's colcon runs a Python without our requirements."""
    script = shutil.which("colcon")
    assert script
    return output_of(sys.executable, script, *arguments, cwd=workspace)


def in_terminal(workspace: Path, *command: str | Path) -> str:
    """What a command prints in a terminal in which the workspace is sourced."""
    return output_of("bash", "-c", 'source install/setup.bash; "$@"', "-", *command, cwd=workspace).strip()


def test_colcon_takes_it_for_an_ament_package(workspace: Path) -> None:
    assert colcon(workspace, "list").split() == ["etac_ros", "src/etac_ros", "(ros.ament_python)"]


def test_ament_index_finds_what_colcon_installed(workspace: Path) -> None:
    code = 'import ament_index_python as index; print(index.get_package_share_directory("etac_ros"))'
    share = Path(in_terminal(workspace, sys.executable, "-c", code))
    assert share == workspace / "install/etac_ros/share/etac_ros"
    assert (share / "package.xml").is_file()
    for folder, pattern in (("config", "*.yaml"), ("launch", "*.launch.py")):
        names = {path.name for path in (ROOT / folder).glob(pattern)}
        assert names
        assert {path.name for path in (share / folder).iterdir()} == names


def test_data_files_of_the_package_are_installed(workspace: Path) -> None:
    code = "import etac_ros; print(etac_ros.__path__[0])"
    installed = Path(in_terminal(workspace, sys.executable, "-c", code))
    assert workspace in installed.parents
    package = ROOT / "etac_ros"
    data = [path for pattern in ("*.xml", "*.json") for path in package.rglob(pattern)]
    assert package / "engines/ros/fastdds_profile.xml" in data
    assert [path for path in data if not (installed / path.relative_to(package)).is_file()] == []


def test_ros2_run_finds_every_executable(workspace: Path) -> None:
    folder = workspace / "install/etac_ros/lib/etac_ros"
    assert {path.name for path in folder.iterdir() if os.access(path, os.X_OK)} == {"etac", *NODES}
    assert in_terminal(workspace, folder / "etac", "--version") == f"etac_ros {etac_ros.__version__}"


def test_colcon_test_passes_on_the_smoke_subset(workspace: Path) -> None:
    shown = ("--event-handlers", "console_cohesion+")
    colcon(workspace, "test", "--return-code-on-test-failure", *shown, "--pytest-args", "-m", "smoke")
    report = ET.parse(workspace / "build/etac_ros/pytest.xml").getroot()
    ran = {case.get("name") for case in report.iter("testcase")}
    assert "test_a_folder_of_somebody_else_is_not_touched" in ran
    assert "test_colcon_test_passes_on_the_smoke_subset" not in ran


# launch, which there are no wheels of: stand-ins tell what the launch file asks for


def test_the_launch_file_starts_every_node_of_a_scenario(monkeypatch: pytest.MonkeyPatch) -> None:
    def stand_in(**known: Any) -> types.SimpleNamespace:
        return types.SimpleNamespace(**known)

    def keep(*_: Any, **given: Any) -> dict[str, Any]:
        return given

    class Configuration:
        def __init__(self, name: str) -> None:
            self.name = name

        def perform(self, context: dict[str, str]) -> str:
            return context[self.name]

    for name, module in {
        "launch": stand_in(LaunchDescription=list),
        "launch.actions": stand_in(DeclareLaunchArgument=keep, OpaqueFunction=keep),
        "launch.substitutions": stand_in(LaunchConfiguration=Configuration),
        "launch_ros": stand_in(),
        "launch_ros.actions": stand_in(Node=keep),
    }.items():
        monkeypatch.setitem(sys.modules, name, module)
    file = runpy.run_path(str(ROOT / "launch/scenario.launch.py"))

    nodes = file["nodes"]({"scenario": "wu2018", "bag": "/some/bag"})
    assert {(node["namespace"], node["name"], node["executable"]) for node in nodes} == {
        ("/", name, name) for name in ("plant", "sensor", "controller", "actuator", "recorder")
    }
    assert {node["name"] for node in nodes if node["arguments"] == ["--bag", "/some/bag"]} == {"recorder"}
    assert {Path(path) for node in nodes for path in node["parameters"]} == {ROOT / "config/wu2018.yaml"}
    assert file["generate_launch_description"]()[-1] == {"function": file["nodes"]}
