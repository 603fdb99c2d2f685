"""Single values of a scenario's nodes, by dotted key: ``plant.dynamics.attitude_q``, ``pm/sensor.trigger.delta``."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

from etac_ros.errors import ScenarioError
from etac_ros.scenario.document import choice, shown

Nodes = Mapping[str, Mapping[str, Any]]


def value_at(nodes: Nodes, key: str, where: str) -> Any:
    """The value that stands at a key.

    Parameters
    ----------
    nodes
        Complete parameters of every node.
    key
        NODE.KEY.
    where
        File and key, to begin messages with.

    Raises
    ------
    ScenarioError
        If nothing stands there; the message names the nearest key.
    """
    found: Any = nodes
    for name in _path(nodes, key, where):
        found = _below(found, name, where)
    return found


def with_value(nodes: Nodes, key: str, value: Any, where: str) -> Nodes:
    """The nodes with one value replaced; those that are given are not changed.

    Raises
    ------
    ScenarioError
        If nothing stands there yet.
    """
    return _replaced(nodes, _path(nodes, key, where), value, where)  # type: ignore[no-any-return]


def _path(nodes: Nodes, key: str, where: str) -> list[str]:
    first, *rest = key.split(".")
    node = "/" + first.strip("/")
    if node not in nodes:
        raise ScenarioError(where, f"there is no node '{first}'", choice(first, [name.lstrip("/") for name in nodes]))
    if not rest:
        raise ScenarioError(where, f"'{key}' names a whole node", f"a key below it, as in {key}.KEY")
    return [node, *rest]


def _below(found: Any, name: str, where: str) -> Any:
    if not isinstance(found, Mapping):
        raise ScenarioError(where, f"there is no '{name}' below {shown(found)}")
    if name not in found:
        raise ScenarioError(where, f"unknown key '{name}'", choice(name, found))
    return found[name]


def _replaced(found: Any, path: list[str], value: Any, where: str) -> Any:
    if not path:
        return value
    return {**found, path[0]: _replaced(_below(found, path[0], where), path[1:], value, where)}
