"""What a node that is started by hand shows to ROS tools: its parameters, to read, and what it says, on /rosout."""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from typing import Any

from rcl_interfaces.msg import ParameterDescriptor
from rclpy.node import Node

Values = Mapping[str, Any]
"""Parameters of one node, by their full names as ROS has them: ``trigger.alpha``."""


def flattened(section: Mapping[str, Any], above: str = "") -> Iterator[tuple[str, Any]]:
    """Names and values of a section as ROS knows them: no mappings, and arrays of one type.

    Parameters
    ----------
    section
        Of a parameter file.
    above
        Name of what it stands below; empty for a node's own section.
    """
    for key, value in section.items():
        name = f"{above}.{key}" if above else str(key)
        if isinstance(value, Mapping):
            yield from flattened(value, name)
        elif isinstance(value, list):
            if value:
                yield name, _array(value)
        elif value is not None:
            yield name, value


def _array(values: list[Any]) -> list[Any]:
    kinds = {type(value) for value in values}
    if kinds == {int, float}:
        return [float(value) for value in values]
    return values if len(kinds) == 1 and kinds < {bool, int, float, str} else [str(value) for value in values]


def show_parameters(node: Node, values: Values) -> None:
    """Declare them, to be read and not to be set: all nodes of a run go by the same file, and it is being run."""
    fixed = ParameterDescriptor(read_only=True, description="of the scenario; fixed while the run is on")
    for name, value in values.items():
        if not node.has_parameter(name):
            node.declare_parameter(name, value, fixed)
