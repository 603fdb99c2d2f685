"""Messages from plain values, for the few types that every bag has: as the library serializes them, without it.

The library makes a class and seventeen functions for each type before it serializes a first message. Of a run that is
as long as the run itself; of what is written here only the template of each :class:`~etac_ros.bag.mould.Mould` is
serialized at all. The tests hold every template against the library.
"""

from __future__ import annotations

import re
import struct
from collections.abc import Iterable, Mapping
from typing import Any

from etac_ros.bag.definitions import fields_of

_BEGINNING = b"\x00\x01\x00\x00"
"""Plain CDR, little-endian. What follows is aligned with respect to its end."""
_FORMATS = {
    "bool": "<?", "float32": "<f", "float64": "<d", "int8": "<b", "int16": "<h", "int32": "<i", "int64": "<q",
    "octet": "<B", "uint8": "<B", "uint16": "<H", "uint32": "<I", "uint64": "<Q",
}  # fmt: skip
_ARRAY = re.compile(r"(.+)\[(\d*)\]")


def serialized(type_name: str, values: Mapping[str, Any]) -> bytes:
    """Serialize a message.

    Parameters
    ----------
    type_name
        Message type, as ``geometry_msgs/msg/PoseStamped``.
    values
        By field, nested as the type is. What is not given is zero, empty or false, as ROS has it.
    """
    data = bytearray()
    _write_fields(data, type_name, values)
    return _BEGINNING + bytes(data)


def _write_fields(data: bytearray, type_name: str, values: Mapping[str, Any]) -> None:
    fields = fields_of(type_name)
    if not values.keys() <= fields.keys():
        raise ValueError(f"{type_name} has no field {sorted(values.keys() - fields.keys())}")
    for name, kind in fields.items():
        _write(data, kind, values.get(name))


def _write(data: bytearray, kind: str, value: Any) -> None:
    array = _ARRAY.fullmatch(kind)
    if array is not None:
        _write_array(data, array[1], array[2], () if value is None else value)
    elif kind == "string":
        text = (value or "").encode() + b"\x00"
        _write(data, "uint32", len(text))
        data += text
    elif kind in _FORMATS:
        packed = struct.pack(_FORMATS[kind], 0 if value is None else value)
        data += bytes(-len(data) % len(packed)) + packed
    else:
        _write_fields(data, kind, {} if value is None else value)


def _write_array(data: bytearray, kind: str, size: str, values: Iterable[Any]) -> None:
    elements = list(values)
    if size:  # which is not written then
        elements += [None] * (int(size) - len(elements))
    else:
        _write(data, "uint32", len(elements))
    for element in elements:
        _write(data, kind, element)
