"""ROS message definitions without ROS: schema text, type hash and QoS as ``ros2 bag record`` writes them."""

from __future__ import annotations

from functools import cache
from typing import Any

import yaml
from rosbags.typesys import Stores, get_typestore

from etac_ros.errors import BagError

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
    return get_typestore(Stores.ROS2_JAZZY)


@cache
def schema_text(type_name: str) -> str:
    """Write the message definition with those it depends on, in the encoding ``ros2msg``.

    Raises
    ------
    BagError
        If the type is none of the common interfaces.
    """
    _check(type_name)
    text, _ = typestore().generate_msgdef(type_name, ros_version=2)
    return str(text)


@cache
def type_hash(type_name: str) -> str:
    """Compute the type description hash (``RIHS01_...``), as DDS discovery announces it.

    Raises
    ------
    BagError
        If the type is none of the common interfaces.
    """
    _check(type_name)
    return str(typestore().hash_rihs01(type_name))


def _check(type_name: str) -> None:
    if type_name not in typestore().fielddefs:
        raise BagError(type_name, "there is no such message type", "one of the common interfaces of ROS 2 Jazzy")
