"""ROS message definitions without ROS: schema text, type hash and QoS as ``ros2 bag record`` writes them."""

from __future__ import annotations

import json
from collections.abc import Iterable, Mapping
from dataclasses import asdict, dataclass
from functools import cache
from importlib.resources import files
from typing import Any

import yaml

from etac_ros.errors import BagError
from etac_ros.graph.wire import CLOCK_TYPE, LINK_TYPES, NOTE_TYPE, TABLE_TYPE

_FOREVER = {"sec": 9223372036, "nsec": 854775807}  # RMW_DURATION_INFINITE

OFFERED_QOS: list[dict[str, Any]] = [
    {
        "history": "keep_all",
        "depth": 0,
        "reliability": "reliable",
        "durability": "volatile",
        "deadline": dict(_FOREVER),
        "lifespan": dict(_FOREVER),
        "liveliness": "automatic",
        "liveliness_lease_duration": dict(_FOREVER),
        "avoid_ros_namespace_conventions": False,
    }
]
"""What publishers of etac_ros offer, in the form of rosbag2 version 9."""

LATCHED_QOS: list[dict[str, Any]] = [{**OFFERED_QOS[0], "durability": "transient_local"}]
"""Of topics that say something once, as ``/tf_static``."""


def offered_qos(reliability: str, latched: bool) -> list[dict[str, Any]]:
    """What the publisher of a topic offers."""
    return [{**profile, "reliability": reliability} for profile in (LATCHED_QOS if latched else OFFERED_QOS)]


@cache
def offered_qos_yaml(reliability: str, latched: bool) -> str:
    """The same as the metadata of an MCAP channel has it."""
    return yaml.safe_dump(offered_qos(reliability, latched), sort_keys=False).strip()


@cache
def typestore() -> Any:
    """Load the common interfaces of ROS 2 Jazzy, once, and only when they are needed: it takes 0.1 s."""
    from rosbags.typesys import Stores, get_typestore

    return get_typestore(Stores.ROS2_JAZZY)


FILE_NAME = "definitions.json"
KEPT_TYPES = (
    *LINK_TYPES,
    TABLE_TYPE,
    NOTE_TYPE,
    CLOCK_TYPE,
    "geometry_msgs/msg/PoseStamped",
    "std_msgs/msg/Float64",
    "tf2_msgs/msg/TFMessage",
    "visualization_msgs/msg/MarkerArray",
)
"""Types whose definitions are kept in that file: all that runs record."""


@dataclass(frozen=True)
class Definition:
    """What there is to know of a message type.

    Attributes
    ----------
    fields
        Kinds by name, in their order: ``float64``, another type, ``string[]``, ``float64[36]``.
    text
        The message definition with those it depends on, in the encoding ``ros2msg``.
    hash
        The type description hash (``RIHS01_...``), as DDS discovery announces it.
    """

    fields: Mapping[str, str]
    text: str
    hash: str


@cache
def _kept() -> dict[str, Definition]:
    """Those that runs record, and what they depend on: nobody should wait for all others to be loaded."""
    text = files("etac_ros.bag").joinpath(FILE_NAME).read_text(encoding="utf-8")
    return {name: Definition(**found) for name, found in json.loads(text).items()}


def definitions_text(type_names: Iterable[str]) -> str:
    """Write the file of those definitions that are kept: what the library says of these types, and of their parts."""
    found: dict[str, Definition] = {}
    pending = list(type_names)
    while pending:
        name = pending.pop()
        if name not in found:
            found[name] = _defined(name)
            parts = [kind.partition("[")[0] for kind in found[name].fields.values()]
            pending += [part for part in parts if "/" in part]
    return json.dumps({name: asdict(found[name]) for name in sorted(found)}, indent=1) + "\n"


@cache
def _defined(type_name: str) -> Definition:
    store = typestore()
    if type_name not in store.fielddefs:
        raise BagError(type_name, "there is no such message type", "one of the common interfaces of ROS 2 Jazzy")
    fields = {name: _kind(*described) for name, described in store.fielddefs[type_name][1]}
    text, _ = store.generate_msgdef(type_name, ros_version=2)
    return Definition(fields, str(text), str(store.hash_rihs01(type_name)))


def _kind(node: Any, described: Any) -> str:
    number = int(node)
    if number == 1:  # a base type: its name and the limit of a string
        return str(described[0])
    if number == 2:
        return str(described)
    inner, size = described
    return f"{_kind(*inner)}[{size if number == 3 else ''}]"


def _definition(type_name: str) -> Definition:
    return _kept().get(type_name) or _defined(type_name)


def fields_of(type_name: str) -> Mapping[str, str]:
    """The fields of a message type: kinds by name.

    Raises
    ------
    BagError
        If the type is none of the common interfaces.
    """
    return _definition(type_name).fields


def schema_text(type_name: str) -> str:
    """The message definition with those it depends on, in the encoding ``ros2msg``.

    Raises
    ------
    BagError
        If the type is none of the common interfaces.
    """
    return _definition(type_name).text


def type_hash(type_name: str) -> str:
    """The type description hash (``RIHS01_...``), as DDS discovery announces it.

    Raises
    ------
    BagError
        If the type is none of the common interfaces.
    """
    return _definition(type_name).hash
