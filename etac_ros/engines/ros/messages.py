"""Values and protocol notes as serialized ROS messages. Common interfaces only.

The emulation plane's notes are JSON texts in ``std_msgs/String``: few, small, and legible to ``ros2 topic echo``.
Windows and committed samples are ``Float64MultiArray``.
"""

from __future__ import annotations

import json
from importlib import import_module
from typing import Any

import numpy as np
from rcl_interfaces.msg import ParameterEvent
from rclpy.serialization import deserialize_message
from rclpy.type_support import check_for_type_support
from rosgraph_msgs.msg import Clock
from std_msgs.msg import String

from etac_ros.bag.codec import decode_table
from etac_ros.graph.cdr import layout_of, read_text, write_table, write_text
from etac_ros.graph.module import Window
from etac_ros.graph.wire import LINK_TYPES, Wire
from etac_ros.maths.ticks import NANOSECONDS
from etac_ros.parameters import FloatArray

_WINDOW_HEAD = 3  # epoch, start, grant


def _class(type_name: str) -> Any:
    package, _, name = type_name.split("/")
    return getattr(import_module(f"{package}.msg"), name)


_TYPES: dict[str, Any] = {name: _class(name) for name in LINK_TYPES}


def preload() -> None:
    """Load the type support of every message now: once before a fork instead of in every child."""
    for kind in (*_TYPES.values(), String, Clock, ParameterEvent):
        check_for_type_support(kind)


def message_type(wire: Wire) -> type:
    """The message class of a wire."""
    kind: type = _TYPES[wire.type_name]
    return kind


def encode(wire: Wire, value: FloatArray, stamp_ns: int) -> bytes:
    """A value as the serialized message of its wire.

    Parameters
    ----------
    wire
        The link's wire.
    value
        Already rounded to it.
    stamp_ns
        Simulated time of sending [ns], for formats with a header.
    """
    return layout_of(wire.type_name, wire.size).write(value, stamp_ns)


def stamp_ns(wire: Wire, data: bytes) -> int:
    """Simulated time of sending [ns] that a message with a header carries."""
    stamp = layout_of(wire.type_name, wire.size).read_stamp_ns(data)
    if stamp is not None:
        return stamp
    said = deserialize_message(data, _TYPES[wire.type_name]).header.stamp
    return int(said.sec) * NANOSECONDS + int(said.nanosec)


def encode_window(window: Window, grant: int) -> bytes:
    """A window of samples ahead, with the leave that goes with it."""
    return write_table(_WINDOW_HEAD, np.array((window.epoch, window.start, grant), dtype=np.float64), window.samples)


def decode_window(data: bytes, plant: str) -> tuple[Window, int]:
    """A window and its grant."""
    _, sizes, numbers = decode_table(data)
    epoch, start, grant = map(int, numbers[:_WINDOW_HEAD].tolist())
    return Window(plant, epoch, start, numbers[_WINDOW_HEAD:].reshape(sizes)), grant


def write_note(content: Any, run: str) -> bytes:
    """A protocol note of a run."""
    return write_text(json.dumps({"run": run, "is": content}, separators=(",", ":")))


def read_note(data: bytes, run: str) -> Any:
    """The content of a protocol note; None if it is not of this run, or no note at all."""
    note = _json(data)
    return note.get("is") if note is not None and note.get("run") == run else None


def open_note(data: bytes) -> Any:
    """A note of any run as a flat mapping, with its ``run``; None if it is none."""
    note = _json(data)
    if note is None or not isinstance(note.get("is"), dict):
        return None
    return {**note["is"], "run": note.get("run")}


def _json(data: bytes) -> dict[str, Any] | None:
    text = read_text(data)
    try:
        note = json.loads(deserialize_message(data, String).data if text is None else text)
    except (ValueError, RuntimeError):  # no such bytes, no JSON, or nested without end
        return None
    return note if isinstance(note, dict) else None
