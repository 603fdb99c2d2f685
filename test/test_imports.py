"""Rooms import one way, files never in a circle, and only the room of the ros engine knows ROS."""

from __future__ import annotations

import ast
import subprocess
import sys
from collections.abc import Iterator
from graphlib import CycleError, TopologicalSorter
from pathlib import Path

import pytest

import etac_ros

PACKAGE = Path(etac_ros.__file__).parent
FLOORS = [
    "plain_text",
    "processes",
    "whole_files",
    "source_digest",
    "beside",
    "errors",
    "tables",
    "parameters",
    "maths",
    "plants",
    "laws",
    "triggers",
    "media",
    "graph",
    "modules",
    "timing",
    "bag",
    "capture",
    "engines",
    "scenario",
    "metrics",
    "runs",
    "check",
    "theorems",
    "report",
    "export",
    "sweep",
    "reproduce",
    "tradeoff",
    "robustness",
    "cli",
    "__main__",
]
"""From the ground up: a room imports its own floor and those above it in this list."""
ROS_ENGINE = "etac_ros.engines.ros"
ROS = {"rclpy", "builtin_interfaces"}
ROS_SUFFIXES = ("_msgs", "_interfaces")


def module_name(path: Path) -> str:
    parts = ("etac_ros", *path.relative_to(PACKAGE).with_suffix("").parts)
    return ".".join(parts[:-1] if parts[-1] == "__init__" else parts)


FILES = {module_name(path): path for path in sorted(PACKAGE.rglob("*.py"))}


def imports_of(name: str) -> Iterator[str]:
    """Full names of the modules that a file imports, anywhere in it but for type checkers only."""
    pending: list[ast.AST] = [ast.parse(FILES[name].read_text(encoding="utf-8"))]
    while pending:
        node = pending.pop()
        if isinstance(node, ast.If) and ast.unparse(node.test).removeprefix("typing.") == "TYPE_CHECKING":
            pending += node.orelse
            continue
        if isinstance(node, ast.Import):
            yield from (alias.name for alias in node.names)
        elif isinstance(node, ast.ImportFrom):
            package = name.split(".") if FILES[name].name == "__init__.py" else name.split(".")[:-1]
            base = ".".join([*package[: len(package) - node.level + 1], *([node.module] if node.module else [])])
            base = base if node.level else str(node.module)
            for alias in node.names:
                below = f"{base}.{alias.name}"
                yield below if below in FILES else base
        pending += ast.iter_child_nodes(node)


GRAPH = {name: set(imports_of(name)) for name in FILES}
OWN = {name: {other for other in imports if other.split(".")[0] == "etac_ros"} for name, imports in GRAPH.items()}


def room(name: str) -> str:
    return name.split(".")[1]


def test_every_room_has_its_floor() -> None:
    assert {room(name) for name in FILES if name != "etac_ros"} <= set(FLOORS)


@pytest.mark.parametrize("name", [name for name in FILES if name != "etac_ros"])
def test_imports_come_from_floors_above(name: str) -> None:
    upwards = {
        other for other in OWN[name] if other != "etac_ros" and FLOORS.index(room(other)) > FLOORS.index(room(name))
    }
    assert not upwards, f"{name} is on the floor '{room(name)}' and must not import {sorted(upwards)}"


def test_the_package_itself_imports_nothing_of_its_rooms() -> None:
    assert not OWN["etac_ros"]


def test_only_the_ros_engine_imports_ros() -> None:
    ros = {
        name: sorted(other for other in imports if is_ros(other))
        for name, imports in GRAPH.items()
        if any(is_ros(other) for other in imports)
    }
    assert ros, "this test no longer sees what it is about"
    assert [name for name in ros if not name.startswith(ROS_ENGINE)] == []


def is_ros(name: str) -> bool:
    top = name.split(".")[0]
    return top in ROS or top.startswith("rosidl_") or top.endswith(ROS_SUFFIXES)


def test_files_do_not_import_in_a_circle() -> None:
    try:
        order = list(TopologicalSorter(OWN).static_order())
    except CycleError as error:
        pytest.fail(f"circle: {' -> '.join(error.args[1])}")
    assert set(FILES) <= set(order)


def test_everything_else_loads_without_ros() -> None:
    names = [name for name in FILES if not name.startswith(ROS_ENGINE) and not name.endswith("__main__")]
    code = (
        f"import importlib, sys\n"
        f"for name in {names}: importlib.import_module(name)\n"
        f"loaded = [name for name in sys.modules if name.split('.')[0] in ('rclpy', 'std_msgs', 'geometry_msgs')]\n"
        f"sys.exit(f'loaded: {{loaded}}' if loaded else 0)\n"
    )
    done = subprocess.run([sys.executable, "-c", code], cwd=PACKAGE.parent, capture_output=True, text=True, check=False)
    assert done.returncode == 0, done.stderr
