"""``metadata.yaml`` of a rosbag2 directory, version 9, as ROS 2 Jazzy writes it."""

from __future__ import annotations

import os
from collections.abc import Mapping
from pathlib import Path
from typing import Any

import yaml

from etac_ros.bag.definitions import offered_qos, type_hash
from etac_ros.bag.topics import TopicDescription
from etac_ros.errors import BagError

FILE_NAME = "metadata.yaml"
_ROOT = "rosbag2_bagfile_information"
_MOST_BYTES = 4 * 1024 * 1024
_LOADER: Any = getattr(yaml, "CSafeLoader", yaml.SafeLoader)
_DUMPER: Any = getattr(yaml, "CSafeDumper", yaml.SafeDumper)
"""Those of libyaml, where they are there: they take a tenth of the time, and the loader has a limit of depth."""


def bag_information(
    mcap_name: str,
    counts: Mapping[TopicDescription, int],
    first_ns: int,
    last_ns: int,
    custom_data: Mapping[str, str],
) -> dict[str, Any]:
    """Say of a bag of one MCAP file what rosbag2 says.

    Parameters
    ----------
    mcap_name
        Name of that file, without its directory.
    counts
        Messages of each topic.
    first_ns, last_ns
        Log times of the first and of the last message; 0 and 0 for a bag without messages.
    custom_data
        Any text by key.
    """
    duration = {"nanoseconds": last_ns - first_ns}
    start = {"nanoseconds_since_epoch": first_ns}
    total = sum(counts.values())
    return {
        "version": 9,
        "storage_identifier": "mcap",
        "duration": dict(duration),
        "starting_time": dict(start),
        "message_count": total,
        "topics_with_message_count": [
            {
                "topic_metadata": {
                    "name": topic.name,
                    "type": topic.type_name,
                    "serialization_format": "cdr",
                    "offered_qos_profiles": offered_qos(topic.reliability.value, topic.latched),
                    "type_description_hash": type_hash(topic.type_name),
                },
                "message_count": count,
            }
            for topic, count in counts.items()
        ],
        "compression_format": "",
        "compression_mode": "",
        "relative_file_paths": [mcap_name],
        "files": [{"path": mcap_name, "starting_time": start, "duration": duration, "message_count": total}],
        "custom_data": dict(custom_data),
        "ros_distro": "jazzy",
    }


def to_yaml(information: Mapping[str, Any]) -> str:
    """Write YAML without anchors, which yaml-cpp would read but people would not."""
    return yaml.dump(dict(information), Dumper=_WithoutAnchors, sort_keys=False, allow_unicode=True)


def write_metadata(directory: Path, information: Mapping[str, Any]) -> None:
    """Write ``metadata.yaml`` whole or not at all."""
    temporary = directory / f".{FILE_NAME}.new"
    temporary.write_text(to_yaml({_ROOT: information}), encoding="utf-8")
    os.replace(temporary, directory / FILE_NAME)


def add_custom_data(directory: Path, more: Mapping[str, str]) -> None:
    """Add to the ``custom_data`` of a bag what is known only after it was closed.

    Raises
    ------
    BagError
        If its metadata are missing, cannot be understood, or cannot be written.
    """
    information = _information(directory)
    information["custom_data"] = {**(information.get("custom_data") or {}), **more}
    try:
        write_metadata(directory, information)
    except OSError as error:
        raise BagError(str(directory / FILE_NAME), f"cannot be written: {error.strerror}") from None


def read_custom_data(directory: Path) -> dict[str, str]:
    """The ``custom_data`` of a bag.

    Raises
    ------
    BagError
        If its metadata are missing or cannot be understood.
    """
    found = _information(directory).get("custom_data") or {}
    if not isinstance(found, dict):
        raise BagError(str(directory / FILE_NAME), "is damaged", "the metadata of a rosbag2 bag")
    return {str(key): str(value) for key, value in found.items()}


def read_counts(directory: Path) -> dict[str, int]:
    """Count the messages of each topic as ``metadata.yaml`` does.

    Raises
    ------
    BagError
        If it is missing or cannot be understood.
    """
    try:
        topics = _information(directory)["topics_with_message_count"]
        return {str(topic["topic_metadata"]["name"]): int(topic["message_count"]) for topic in topics}
    except _NOT_UNDERSTOOD:
        raise _damaged(directory) from None


_NOT_UNDERSTOOD = (LookupError, TypeError, ValueError, OverflowError, AttributeError)


def _damaged(directory: Path) -> BagError:
    remedy = f"etac recover {directory}"
    return BagError(str(directory / FILE_NAME), "is damaged", "the metadata of a rosbag2 bag", remedy)


def _information(directory: Path) -> dict[str, Any]:
    path = directory / FILE_NAME
    remedy = f"etac recover {directory}"
    try:
        if not path.is_file() and path.exists():
            raise ValueError("no file")  # a pipe would keep its reader waiting for good
        with path.open("rb") as file:
            text = file.read(_MOST_BYTES + 1)
        if len(text) > _MOST_BYTES:
            raise ValueError("too long")
        information = yaml.load(text, Loader=_LOADER)[_ROOT]
        if not isinstance(information, dict):
            raise TypeError("no mapping")
        return information
    except FileNotFoundError:
        found = f"there is no {FILE_NAME}: its recorder was cut off"
        raise BagError(str(directory), found, "a bag that was closed", remedy) from None
    except OSError as error:
        raise BagError(str(path), f"cannot be read: {error.strerror}") from None
    except (yaml.YAMLError, RecursionError, *_NOT_UNDERSTOOD):
        raise _damaged(directory) from None


class _WithoutAnchors(_DUMPER):  # type: ignore[misc]  # one of two classes
    def ignore_aliases(self, data: Any) -> bool:
        return True
