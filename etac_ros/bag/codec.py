"""Values in and out of serialized ROS messages, without ROS.

The vector of a message is its numbers in a fixed order: x, y, z; x, y, z, w (QuaternionStamped is only a
container of four components); force, then torque; the elements of an array. It is float64 in any case.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping
from operator import attrgetter
from typing import Any

import numpy as np
from rosbags.serde import SerdeError

from etac_ros.bag.clock import NANOSECONDS
from etac_ros.bag.definitions import typestore
from etac_ros.graph.truth import DATA_OFFSET, dimensions, pack_truth, unpack_truth
from etac_ros.graph.wire import ARRAY_DTYPES, SCALAR_FIELDS, TABLE_TYPE
from etac_ros.parameters import FloatArray

_SCALARS: dict[str, Callable[[Any], tuple[float, ...]]] = {
    name: attrgetter(*fields) for name, fields in SCALAR_FIELDS.items()
}


def decode(type_name: str, cdr: bytes) -> FloatArray:
    """Read the vector in a serialized message.

    Raises
    ------
    ValueError
        If the bytes are no such message, or the type carries no vector.
    """
    message = _deserialized(type_name, cdr)
    if type_name in _SCALARS:
        return np.array(_SCALARS[type_name](message), dtype=np.float64)
    if type_name in ARRAY_DTYPES:
        return np.array(message.data, dtype=np.float64)
    raise ValueError(f"no link carries {type_name}")


def encode(type_name: str, value: FloatArray, tick_time_ns: int) -> bytes:
    """Serialize a message that carries a vector; a header gets the simulated time and an empty frame.

    Raises
    ------
    ValueError
        If the type carries no vector.
    """
    types = typestore().types
    if type_name in ARRAY_DTYPES:
        layout = types["std_msgs/msg/MultiArrayLayout"](dim=[], data_offset=0)
        message = types[type_name](layout=layout, data=value.astype(ARRAY_DTYPES[type_name]))
    elif type_name in SCALAR_FIELDS:
        message = _filled(type_name, dict(zip(SCALAR_FIELDS[type_name], value.tolist(), strict=True)), tick_time_ns)
    else:
        raise ValueError(f"no link carries {type_name}")
    return bytes(typestore().serialize_cdr(message, type_name))


def decode_truth(cdr: bytes) -> tuple[int, FloatArray]:
    """Read first tick and samples of a truth message.

    Raises
    ------
    ValueError
        If it is none.
    """
    message = _deserialized(TABLE_TYPE, cdr)
    sizes = [dimension.size for dimension in message.layout.dim]
    return unpack_truth(message.data, message.layout.data_offset, sizes)


def encode_truth(first_tick: int, samples: FloatArray) -> bytes:
    """Serialize a truth message."""
    types = typestore().types
    data, ticks, states = pack_truth(first_tick, samples)
    axes = [types["std_msgs/msg/MultiArrayDimension"](*axis) for axis in dimensions(ticks, states)]
    layout = types["std_msgs/msg/MultiArrayLayout"](dim=axes, data_offset=DATA_OFFSET)
    return bytes(typestore().serialize_cdr(types[TABLE_TYPE](layout=layout, data=data), TABLE_TYPE))


def _filled(type_name: str, numbers: Mapping[str, float], tick_time_ns: int) -> Any:
    """A message with these numbers at their places, by the path to each."""
    store = typestore()
    fields: dict[str, Any] = {}
    for name, (_, kind) in store.fielddefs[type_name][1]:
        inner = {path.partition(".")[2]: number for path, number in numbers.items() if path.partition(".")[0] == name}
        if name == "header":
            stamp = store.types["builtin_interfaces/msg/Time"](*divmod(tick_time_ns, NANOSECONDS))
            fields[name] = store.types["std_msgs/msg/Header"](stamp=stamp, frame_id="")
        else:
            fields[name] = inner[""] if "" in inner else _filled(kind, inner, tick_time_ns)
    return store.types[type_name](**fields)


def _deserialized(type_name: str, cdr: bytes) -> Any:
    try:
        return typestore().deserialize_cdr(cdr, type_name)
    except SerdeError as error:
        raise ValueError(str(error)) from None
