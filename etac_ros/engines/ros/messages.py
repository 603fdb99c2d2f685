"""Values and protocol notes as ROS messages. Common interfaces only.

The emulation plane's notes are JSON texts in ``std_msgs/String``: few, small, and legible to ``ros2 topic echo``.
Windows and committed samples are ``Float64MultiArray``.
"""

from __future__ import annotations

import array
import json
from importlib import import_module
from operator import attrgetter
from typing import Any

import numpy as np
from builtin_interfaces.msg import Time
from rcl_interfaces.msg import ParameterEvent
from rclpy.type_support import check_for_type_support
from rosgraph_msgs.msg import Clock
from std_msgs.msg import Float64MultiArray, MultiArrayDimension, String

from etac_ros.graph.module import Window
from etac_ros.graph.truth import DATA_OFFSET, dimensions, pack_truth, unpack_truth
from etac_ros.graph.wire import ARRAY_DTYPES, LINK_TYPES, SCALAR_FIELDS, Wire
from etac_ros.maths.ticks import NANOSECONDS
from etac_ros.parameters import FloatArray

_WINDOW_HEAD = 3  # epoch, start, grant


def _class(type_name: str) -> Any:
    package, _, name = type_name.split("/")
    return getattr(import_module(f"{package}.msg"), name)


_TYPES: dict[str, Any] = {name: _class(name) for name in LINK_TYPES}
_NAMES = {kind: name for name, kind in _TYPES.items()}
_SCALARS = {name: attrgetter(*fields) for name, fields in SCALAR_FIELDS.items()}
_PLACES = {name: [field.rpartition(".")[::2] for field in fields] for name, fields in SCALAR_FIELDS.items()}
"""Of each component: the part of the message that holds it (empty is the message itself), and its name there."""
_ARRAY_CODES = {name: np.dtype(kind).char for name, kind in ARRAY_DTYPES.items()}


def preload() -> None:
    """Load the type support of every message now: once before a fork instead of in every child."""
    for kind in (*_TYPES.values(), String, Clock, ParameterEvent):
        check_for_type_support(kind)


def message_type(wire: Wire) -> type:
    """The message class of a wire."""
    kind: type = _TYPES[wire.type_name]
    return kind


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
    name, numbers = wire.type_name, value.tolist()
    if name in ARRAY_DTYPES:
        return _TYPES[name](data=array.array(_ARRAY_CODES[name], numbers))
    message = _TYPES[name]()
    if hasattr(message, "header"):
        message.header.stamp = Time(sec=stamp_ns // NANOSECONDS, nanosec=stamp_ns % NANOSECONDS)
    for (part, field), number in zip(_PLACES[name], numbers, strict=True):
        setattr(attrgetter(part)(message) if part else message, field, number)
    return message


def decode(message: Any) -> FloatArray:
    """The value in a message, as contiguous float64."""
    scalars = _SCALARS.get(_NAMES[type(message)])
    return np.array(message.data if scalars is None else scalars(message), dtype=np.float64)


def stamp_ns(message: Any) -> int | None:
    """Simulated time of sending [ns] that a stamped message carries; None for the other formats."""
    header = getattr(message, "header", None)
    return None if header is None else header.stamp.sec * NANOSECONDS + header.stamp.nanosec


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


def write_note(content: Any, run: str) -> String:
    """A protocol note of a run."""
    return String(data=json.dumps({"run": run, "is": content}, separators=(",", ":")))


def read_note(message: String, run: str) -> Any:
    """The content of a protocol note; None if it is not of this run, or no note at all."""
    note = _json(message)
    return note.get("is") if note is not None and note.get("run") == run else None


def open_note(message: String) -> Any:
    """A note of any run as a flat mapping, with its ``run``; None if it is none."""
    note = _json(message)
    if note is None or not isinstance(note.get("is"), dict):
        return None
    return {**note["is"], "run": note.get("run")}


def _json(message: String) -> dict[str, Any] | None:
    try:
        note = json.loads(message.data)
    except (ValueError, RecursionError):
        return None
    return note if isinstance(note, dict) else None
