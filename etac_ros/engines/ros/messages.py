"""Values and protocol notes as ROS messages. Common interfaces only.

The emulation plane's notes are JSON texts in ``std_msgs/String``: few, small, and legible to ``ros2 topic echo``.
Windows and committed samples are ``Float64MultiArray``.
"""

from __future__ import annotations

import array
import json
from typing import Any

import numpy as np
from builtin_interfaces.msg import Time
from geometry_msgs.msg import Point32, QuaternionStamped, Vector3, Vector3Stamped, WrenchStamped
from rcl_interfaces.msg import ParameterEvent
from rclpy.type_support import check_for_type_support
from rosgraph_msgs.msg import Clock
from std_msgs.msg import Float32MultiArray, Float64MultiArray, MultiArrayDimension, String

from etac_ros.graph.module import Window
from etac_ros.graph.truth import DATA_OFFSET, dimensions, pack_truth, unpack_truth
from etac_ros.graph.wire import Wire
from etac_ros.maths.ticks import NANOSECONDS
from etac_ros.parameters import FloatArray

_WINDOW_HEAD = 3  # epoch, start, grant

_TYPES: dict[str, type] = {
    "geometry_msgs/msg/Point32": Point32,
    "geometry_msgs/msg/Vector3": Vector3,
    "geometry_msgs/msg/Vector3Stamped": Vector3Stamped,
    "geometry_msgs/msg/QuaternionStamped": QuaternionStamped,
    "geometry_msgs/msg/WrenchStamped": WrenchStamped,
    "std_msgs/msg/Float32MultiArray": Float32MultiArray,
    "std_msgs/msg/Float64MultiArray": Float64MultiArray,
}


def preload() -> None:
    """Load the type support of every message now: once before a fork instead of in every child."""
    for kind in (*_TYPES.values(), String, Clock, ParameterEvent):
        check_for_type_support(kind)


def message_type(wire: Wire) -> type:
    """The message class of a wire."""
    return _TYPES[wire.type_name]


def encode(wire: Wire, value: FloatArray, stamp_ns: int) -> Any:
    """A value as the message of its wire.

    Parameters
    ----------
    wire
        The link's wire.
    value
        Already rounded to it.
    stamp_ns
        Simulated time of sending [ns], for formats with a header.
    """
    kind = _TYPES[wire.type_name]
    numbers = value.tolist()
    if kind is Point32 or kind is Vector3:
        return kind(x=numbers[0], y=numbers[1], z=numbers[2])
    if kind is Float32MultiArray:
        return Float32MultiArray(data=array.array("f", numbers))
    if kind is Float64MultiArray:
        return Float64MultiArray(data=array.array("d", numbers))
    message = kind()
    message.header.stamp = Time(sec=stamp_ns // NANOSECONDS, nanosec=stamp_ns % NANOSECONDS)
    for holder, field, number in zip(*_fields(message), numbers, strict=True):
        setattr(holder, field, number)
    return message


def decode(message: Any) -> FloatArray:
    """The value in a message, as contiguous float64."""
    if isinstance(message, Point32 | Vector3):
        return np.array([message.x, message.y, message.z], dtype=np.float64)
    if isinstance(message, (Float32MultiArray, Float64MultiArray)):
        return np.array(message.data, dtype=np.float64)
    return np.array([getattr(h, f) for h, f in zip(*_fields(message), strict=True)], dtype=np.float64)


def stamp_ns(message: Any) -> int | None:
    """Simulated time of sending [ns] that a stamped message carries; None for the other formats."""
    header = getattr(message, "header", None)
    return None if header is None else header.stamp.sec * NANOSECONDS + header.stamp.nanosec


def _fields(message: Any) -> tuple[list[Any], list[str]]:
    if isinstance(message, Vector3Stamped):
        return [message.vector] * 3, ["x", "y", "z"]
    if isinstance(message, QuaternionStamped):
        return [message.quaternion] * 4, ["x", "y", "z", "w"]
    wrench = message.wrench
    return [wrench.force] * 3 + [wrench.torque] * 3, ["x", "y", "z"] * 2


def encode_window(window: Window, grant: int) -> Any:
    """A window of samples ahead, with the leave that goes with it."""
    count, width = window.samples.shape
    data = array.array("d", (float(window.epoch), float(window.start), float(grant)))
    data.frombytes(window.samples.tobytes())
    return _table(data, _WINDOW_HEAD, count, width)


def decode_window(message: Any, plant: str) -> tuple[Window, int]:
    """A window and its grant."""
    numbers = np.frombuffer(message.data, dtype=np.float64)
    rows, columns = (dimension.size for dimension in message.layout.dim)
    epoch, start, grant = (int(number) for number in numbers[:_WINDOW_HEAD])
    return Window(plant, epoch, start, numbers[_WINDOW_HEAD:].reshape(rows, columns)), grant


def encode_truth(first_tick: int, samples: FloatArray) -> Any:
    """Committed samples, laid out as :mod:`etac_ros.graph.truth` says."""
    data, ticks, states = pack_truth(first_tick, samples)
    return _table(array.array("d", data.tobytes()), DATA_OFFSET, ticks, states)


def decode_truth(message: Any) -> tuple[int, FloatArray]:
    """Tick of the first committed sample, and the samples."""
    sizes = [dimension.size for dimension in message.layout.dim]
    return unpack_truth(np.frombuffer(message.data, dtype=np.float64), message.layout.data_offset, sizes)


def _table(data: array.array[float], offset: int, count: int, width: int) -> Any:
    message = Float64MultiArray(data=data)
    message.layout.data_offset = offset
    message.layout.dim = [
        MultiArrayDimension(label=axis.label, size=axis.size, stride=axis.stride) for axis in dimensions(count, width)
    ]
    return message


def note(content: Any) -> String:
    """A protocol note."""
    return String(data=json.dumps(content, separators=(",", ":")))


def read_note(message: String) -> Any:
    """The content of a protocol note."""
    return json.loads(message.data)
