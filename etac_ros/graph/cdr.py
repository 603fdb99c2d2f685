"""The few messages of a run as serialized bytes, written and read directly.

A library that knows every type builds an object with a part for each field, of which we want the numbers; where a hop
is to take as long as its bytes, that is half of it. What a run sends has few shapes, and in each the numbers stand in
one place. So a shape is its fixed first bytes and where the numbers begin. CDR is little-endian here, as every writer
of ours has it; whoever reads a message that begins otherwise (another's frame, another byte order) gets None and asks
the library. The tests hold both ways against it.
"""

from __future__ import annotations

from functools import lru_cache
from struct import Struct
from typing import NamedTuple

import numpy as np

from etac_ros.graph.truth import dimensions
from etac_ros.graph.wire import ARRAY_DTYPES, LINK_TYPES, SCALAR_FIELDS, bytes_a_component, is_stamped
from etac_ros.maths.ticks import NANOSECONDS
from etac_ros.parameters import FloatArray

_BEGINNING = b"\x00\x01\x00\x00"
"""Plain CDR, little-endian. What follows is aligned with respect to its end."""
_STAMP = Struct("<iI")
_UNFRAMED = b"\x01\x00\x00\x00\x00\x00\x00\x00"
"""An empty ``frame_id``, which is its closing zero, and what aligns the numbers behind it."""
_NUMBER = Struct("<I")
_ARRAY_COUNT = len(_BEGINNING) + 2 * _NUMBER.size
"""Where an array without dimensions says how many numbers it has."""
_LABELS = [axis.label.encode() + b"\x00" for axis in dimensions(0, 0)]
_AXES = "".join(f"I{len(label)}s{-len(label) % 4}xII" for label in _LABELS)
"""Of each dimension: its label, with its length before it, its size and its stride."""
_TABLE = Struct(f"<4sI{_AXES}II{-(Struct(f'<I{_AXES}II').size) % 8}x")
_ROWS, _WIDTH, _OFFSET = 4, 8, 10
"""Where sizes and offset stand among the fields of a table."""


class NumberTable(NamedTuple):
    """What stands in a ``std_msgs/Float64MultiArray`` with two dimensions."""

    offset: int
    """The field ``layout.data_offset``."""
    sizes: tuple[int, ...]
    """How many rows, and numbers in a row."""
    numbers: FloatArray
    """The field ``data``: a few numbers, then the rows."""


class ValueLayout:
    """The message that carries a value.

    Parameters
    ----------
    type_name
        One of :data:`~etac_ros.graph.wire.LINK_TYPES`.
    size
        Components of the value.

    Raises
    ------
    ValueError
        If the type carries no such value.
    """

    def __init__(self, type_name: str, size: int) -> None:
        if type_name not in LINK_TYPES:
            raise ValueError(f"no link carries {type_name}")
        if type_name in SCALAR_FIELDS and len(SCALAR_FIELDS[type_name]) != size:
            raise ValueError(f"{type_name} carries {len(SCALAR_FIELDS[type_name])} components, not {size}")
        width = bytes_a_component(type_name)
        self._dtype = f"<f{width}"
        self._size = size
        self._stamped = is_stamped(type_name)
        self._head = _BEGINNING
        if type_name in ARRAY_DTYPES:
            # No dimensions, no offset, and how many numbers there are.
            self._head += _aligned(_NUMBER.pack(0) + _NUMBER.pack(0) + _NUMBER.pack(size), width)
        self._first = len(self._head) + self._stamped * (_STAMP.size + len(_UNFRAMED))
        self._whole = self._first + width * size

    def write(self, value: FloatArray, stamp_ns: int) -> bytes:
        """Serialize a value that has been rounded to its wire.

        Parameters
        ----------
        value
            Shape (size,).
        stamp_ns
            Simulated time of sending [ns], for formats with a header.
        """
        numbers = value.astype(self._dtype).tobytes()
        if self._stamped:
            return self._head + _STAMP.pack(*divmod(stamp_ns, NANOSECONDS)) + _UNFRAMED + numbers
        return self._head + numbers

    def read(self, data: bytes) -> FloatArray | None:
        """The value as contiguous float64, shape (size,); None if the message is laid out differently."""
        if len(data) != self._whole or not data.startswith(self._head):
            return None
        if self._stamped and data[self._first - len(_UNFRAMED) : self._first - 3] != _UNFRAMED[:5]:
            return None
        return np.frombuffer(data, self._dtype, self._size, self._first).astype(np.float64)

    def read_stamp_ns(self, data: bytes) -> int | None:
        """Simulated time of sending [ns]; None for formats without, and for messages of another byte order."""
        if not self._stamped or not data.startswith(_BEGINNING):
            return None
        seconds, nanoseconds = _STAMP.unpack_from(data, len(_BEGINNING))
        return int(seconds) * NANOSECONDS + int(nanoseconds)


@lru_cache(maxsize=256)
def layout_of(type_name: str, size: int) -> ValueLayout:
    """The layout of a message type and size, made once."""
    return ValueLayout(type_name, size)


def read_value(type_name: str, data: bytes) -> FloatArray | None:
    """The value in a message of any size, as :meth:`ValueLayout.read` does."""
    if type_name in SCALAR_FIELDS:
        return layout_of(type_name, len(SCALAR_FIELDS[type_name])).read(data)
    if len(data) < _ARRAY_COUNT + _NUMBER.size or not data.startswith(_BEGINNING):
        return None
    (size,) = _NUMBER.unpack_from(data, _ARRAY_COUNT)
    return layout_of(type_name, size).read(data) if size * bytes_a_component(type_name) < len(data) else None


def write_table(offset: int, head: FloatArray, rows: FloatArray) -> bytes:
    """Serialize rows of numbers behind a few others, as ``std_msgs/Float64MultiArray``.

    Parameters
    ----------
    offset
        The field ``layout.data_offset``.
    head
        Numbers before the rows.
    rows
        Shape (count, width); what is counted are ticks.
    """
    before = _TABLE.pack(*_table_fields(offset, head.size, *rows.shape))
    return b"".join((before, head.tobytes(), rows.tobytes()))


def read_table(data: bytes) -> NumberTable | None:
    """The inverse of :func:`write_table`; None for other layouts."""
    if len(data) < _TABLE.size:
        return None
    fields = _TABLE.unpack_from(data)
    count, width, offset, numbers = fields[_ROWS], fields[_WIDTH], fields[_OFFSET], fields[-1]
    ours = _table_fields(offset, numbers - count * width, count, width)
    if fields != ours or len(data) != _TABLE.size + 8 * numbers:
        return None
    return NumberTable(offset, (count, width), np.frombuffer(data, "<f8", -1, _TABLE.size).astype(np.float64))


def write_text(text: str) -> bytes:
    """Serialize a ``std_msgs/String``."""
    data = text.encode() + b"\x00"
    return b"".join((_BEGINNING, _NUMBER.pack(len(data)), data))


def read_text(data: bytes) -> bytes | None:
    """The text of a ``std_msgs/String`` as UTF-8; None for other byte orders and lengths that are not true."""
    if len(data) < 9 or not data.startswith(_BEGINNING):
        return None
    (length,) = _NUMBER.unpack_from(data, 4)
    return data[8 : 7 + length] if 1 <= length <= len(data) - 8 else None


def _table_fields(offset: int, head: int, count: int, width: int) -> tuple[int | bytes, ...]:
    """What stands before the numbers of a table."""
    ticks, states = _LABELS
    return (
        *(_BEGINNING, len(_LABELS)),
        *(len(ticks), ticks, count, count * width),
        *(len(states), states, width, width),
        *(offset, head + count * width),
    )


def _aligned(data: bytes, size: int) -> bytes:
    return data + bytes(-len(data) % size)
