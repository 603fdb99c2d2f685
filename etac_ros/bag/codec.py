"""Values in and out of serialized ROS messages, without ROS.

The vector of a message is its numbers in a fixed order: x, y, z; x, y, z, w (QuaternionStamped is only a
container of four components); force, then torque; the elements of an array. It is float64 in any case.
"""

from __future__ import annotations

from collections.abc import Callable
from operator import attrgetter
from typing import Any

import numpy as np

from etac_ros.bag.definitions import typestore
from etac_ros.graph.cdr import NumberTable, layout_of, read_table, read_value, write_table
from etac_ros.graph.truth import DATA_OFFSET, unpack_truth
from etac_ros.graph.wire import LINK_TYPES, SCALAR_FIELDS, TABLE_TYPE
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
    if type_name not in LINK_TYPES:
        raise ValueError(f"no link carries {type_name}")
    value = read_value(type_name, cdr)
    if value is not None:
        return value
    message = _deserialized(type_name, cdr)
    return np.array(_SCALARS[type_name](message) if type_name in _SCALARS else message.data, dtype=np.float64)


def encode(type_name: str, value: FloatArray, tick_time_ns: int) -> bytes:
    """Serialize a message that carries a vector; a header gets the simulated time and an empty frame.

    Raises
    ------
    ValueError
        If the type carries no vector, or none of this size.
    """
    return layout_of(type_name, value.size).write(value, tick_time_ns)


def decode_table(cdr: bytes) -> NumberTable:
    """Read an array of numbers with dimensions.

    Raises
    ------
    ValueError
        If it is none.
    """
    table = read_table(cdr)
    if table is not None:
        return table
    message = _deserialized(TABLE_TYPE, cdr)
    sizes = tuple(dimension.size for dimension in message.layout.dim)
    return NumberTable(message.layout.data_offset, sizes, np.array(message.data, dtype=np.float64))


def decode_truth(cdr: bytes) -> tuple[int, FloatArray]:
    """Read first tick and samples of a truth message.

    Raises
    ------
    ValueError
        If it is none.
    """
    table = decode_table(cdr)
    return unpack_truth(table.numbers, table.offset, table.sizes)


def encode_truth(first_tick: int, samples: FloatArray) -> bytes:
    """Serialize a truth message, laid out as :mod:`etac_ros.graph.truth` says."""
    return write_table(DATA_OFFSET, np.array((first_tick,), dtype=np.float64), samples)


def _deserialized(type_name: str, cdr: bytes) -> Any:
    from rosbags.serde import SerdeError  # here: only what others have written needs it

    try:
        return typestore().deserialize_cdr(cdr, type_name)
    except SerdeError as error:
        raise ValueError(str(error)) from None
