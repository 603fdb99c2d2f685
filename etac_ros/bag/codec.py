"""Values in and out of serialized ROS messages, without ROS.

The vector of a message is its numbers in a fixed order: x, y, z; x, y, z, w (QuaternionStamped is only a
container of four components); force, then torque; the elements of an array. It is float64 in any case.
"""

from __future__ import annotations

from collections.abc import Callable
from operator import attrgetter
from typing import Any

import numpy as np
from rosbags.serde import SerdeError

from etac_ros.bag.clock import NANOSECONDS
from etac_ros.bag.definitions import typestore
from etac_ros.bag.topics import TRUTH_TYPE
from etac_ros.graph.truth import DATA_OFFSET, dimensions, pack_truth, unpack_truth
from etac_ros.parameters import FloatArray

_SCALARS: dict[str, Callable[[Any], tuple[float, ...]]] = {
    "geometry_msgs/msg/Point32": attrgetter("x", "y", "z"),
    "geometry_msgs/msg/Vector3": attrgetter("x", "y", "z"),
    "geometry_msgs/msg/Vector3Stamped": attrgetter("vector.x", "vector.y", "vector.z"),
    "geometry_msgs/msg/QuaternionStamped": attrgetter(
        "quaternion.x", "quaternion.y", "quaternion.z", "quaternion.w"
    ),
    "geometry_msgs/msg/WrenchStamped": attrgetter(
        "wrench.force.x", "wrench.force.y", "wrench.force.z",
        "wrench.torque.x", "wrench.torque.y", "wrench.torque.z",
    ),
}  # fmt: skip
_BARE = ("geometry_msgs/msg/Point32", "geometry_msgs/msg/Vector3")
_ARRAYS = {"std_msgs/msg/Float32MultiArray": np.float32, "std_msgs/msg/Float64MultiArray": np.float64}


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
    if type_name in _ARRAYS:
        return np.array(message.data, dtype=np.float64)
    raise ValueError(f"no link carries {type_name}")


def encode(type_name: str, value: FloatArray, log_time_ns: int) -> bytes:
    """Serialize a message that carries a vector; a header gets the simulated time and an empty frame.

    Raises
    ------
    ValueError
        If the type carries no vector.
    """
    types = typestore().types
    if type_name in _ARRAYS:
        layout = types["std_msgs/msg/MultiArrayLayout"](dim=[], data_offset=0)
        message = types[type_name](layout=layout, data=value.astype(_ARRAYS[type_name]))
    elif type_name in _BARE:
        message = types[type_name](*value.tolist())
    elif type_name in _SCALARS:
        stamp = types["builtin_interfaces/msg/Time"](*divmod(log_time_ns, NANOSECONDS))
        header = types["std_msgs/msg/Header"](stamp=stamp, frame_id="")
        message = types[type_name](header, _body(type_name, value.tolist()))
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
    message = _deserialized(TRUTH_TYPE, cdr)
    sizes = [dimension.size for dimension in message.layout.dim]
    return unpack_truth(message.data, message.layout.data_offset, sizes)


def encode_truth(first_tick: int, samples: FloatArray) -> bytes:
    """Serialize a truth message."""
    types = typestore().types
    data, ticks, states = pack_truth(first_tick, samples)
    axes = [types["std_msgs/msg/MultiArrayDimension"](*axis) for axis in dimensions(ticks, states)]
    layout = types["std_msgs/msg/MultiArrayLayout"](dim=axes, data_offset=DATA_OFFSET)
    return bytes(typestore().serialize_cdr(types[TRUTH_TYPE](layout=layout, data=data), TRUTH_TYPE))


def _body(type_name: str, value: list[float]) -> Any:
    types = typestore().types
    vector = types["geometry_msgs/msg/Vector3"]
    match type_name:
        case "geometry_msgs/msg/Vector3Stamped":
            return vector(*value)
        case "geometry_msgs/msg/QuaternionStamped":
            return types["geometry_msgs/msg/Quaternion"](*value)
        case _:
            return types["geometry_msgs/msg/Wrench"](vector(*value[:3]), vector(*value[3:]))


def _deserialized(type_name: str, cdr: bytes) -> Any:
    try:
        return typestore().deserialize_cdr(cdr, type_name)
    except SerdeError as error:
        raise ValueError(str(error)) from None
