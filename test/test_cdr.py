"""Messages as bytes: what is written directly is what ROS writes, and what anybody else writes is read the same."""

from __future__ import annotations

from typing import Any

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from hypothesis.extra.numpy import arrays
from rosbags.typesys import Stores, get_typestore

from etac_ros.bag.codec import decode, decode_truth
from etac_ros.graph.cdr import layout_of, read_table, read_text, read_value, write_table, write_text
from etac_ros.graph.truth import dimensions
from etac_ros.graph.wire import ARRAY_DTYPES, SCALAR_FIELDS, Wire, WireFormat
from etac_ros.parameters import FloatArray

STORE = get_typestore(Stores.ROS2_JAZZY)
WIRES = [
    *(Wire(WireFormat.COMPACT, size) for size in (1, 3, 5, 13)),
    *(Wire(WireFormat.DOUBLE, size) for size in (1, 3, 5)),
    *(Wire(WireFormat.STAMPED, size) for size in (3, 4, 6)),
]
wires = st.sampled_from(WIRES)
stamps = st.integers(0, 2**31 * 10**9 - 1)
TEXTS = st.text(st.characters(exclude_characters="\x00", exclude_categories=("Cs",)), max_size=40)
TABLE, TEXT = "std_msgs/msg/Float64MultiArray", "std_msgs/msg/String"


@st.composite
def values(draw: st.DrawFn, size: int) -> FloatArray:
    return draw(arrays(np.float64, size, elements=st.floats(width=32)))


def message_of(wire: Wire, value: FloatArray, stamp_ns: int, frame: str = "") -> Any:
    """The message as another program makes it: field by field."""
    types, name = STORE.types, wire.type_name
    if name in ARRAY_DTYPES:
        layout = types["std_msgs/msg/MultiArrayLayout"](dim=[], data_offset=0)
        return types[name](layout=layout, data=value.astype(ARRAY_DTYPES[name]))
    numbers = dict(zip(SCALAR_FIELDS[name], value.tolist(), strict=True))
    if wire.format is not WireFormat.STAMPED:
        return types[name](**numbers)
    stamp = types["builtin_interfaces/msg/Time"](*divmod(stamp_ns, 10**9))
    header = types["std_msgs/msg/Header"](stamp=stamp, frame_id=frame)
    part = {3: "Vector3", 4: "Quaternion"}
    if wire.size == 6:
        halves = [types["geometry_msgs/msg/Vector3"](*value[first : first + 3].tolist()) for first in (0, 3)]
        return types[name](header=header, wrench=types["geometry_msgs/msg/Wrench"](*halves))
    inner = types[f"geometry_msgs/msg/{part[wire.size]}"](*value.tolist())
    return types[name](header, inner)


def table_of(offset: int, head: FloatArray, rows: FloatArray, labels: tuple[str, str] = ("tick", "state")) -> Any:
    types = STORE.types
    axes = [
        types["std_msgs/msg/MultiArrayDimension"](label, axis.size, axis.stride)
        for label, axis in zip(labels, dimensions(*rows.shape), strict=True)
    ]
    layout = types["std_msgs/msg/MultiArrayLayout"](dim=axes, data_offset=offset)
    return types[TABLE](layout=layout, data=np.concatenate((head, rows.ravel())))


@given(data=st.data(), wire=wires, stamp_ns=stamps)
def test_a_value_is_written_as_the_library_writes_it_and_read_back(data: Any, wire: Wire, stamp_ns: int) -> None:
    value = data.draw(values(wire.size))
    written = layout_of(wire.type_name, wire.size).write(value, stamp_ns)
    theirs = bytes(STORE.serialize_cdr(message_of(wire, value, stamp_ns), wire.type_name))
    assert written == theirs
    back = layout_of(wire.type_name, wire.size).read(theirs)
    assert back is not None
    assert back.tobytes() == value.tobytes()
    assert back.flags.aligned
    assert back.flags.writeable
    stamp = stamp_ns if wire.format is WireFormat.STAMPED else None
    assert layout_of(wire.type_name, wire.size).read_stamp_ns(theirs) == stamp
    again = read_value(wire.type_name, theirs)
    assert again is not None
    assert again.tobytes() == value.tobytes()


@given(data=st.data(), wire=wires, stamp_ns=stamps)
def test_what_another_wrote_differently_is_the_librarys_matter(data: Any, wire: Wire, stamp_ns: int) -> None:
    messages: Any = pytest.importorskip("etac_ros.engines.ros.messages")
    value = data.draw(values(wire.size))
    frame = data.draw(TEXTS) if wire.format is WireFormat.STAMPED else ""
    little = data.draw(st.booleans())
    theirs = bytes(STORE.serialize_cdr(message_of(wire, value, stamp_ns, frame), wire.type_name, little_endian=little))
    if not little or len(frame.encode()) > 3:
        assert layout_of(wire.type_name, wire.size).read(theirs) is None
    assert decode(wire.type_name, theirs).tobytes() == value.tobytes()
    if wire.format is WireFormat.STAMPED:
        assert messages.stamp_ns(wire, theirs) == stamp_ns


@pytest.mark.parametrize("wire", [Wire(WireFormat.COMPACT, 5), Wire(WireFormat.DOUBLE, 3)], ids=["array", "vector"])
def test_a_message_that_was_cut_is_not_taken_for_a_value(wire: Wire) -> None:
    layout = layout_of(wire.type_name, wire.size)
    whole = layout.write(np.ones(wire.size), 0)
    assert [layout.read(whole[:length]) for length in range(len(whole))] == [None] * len(whole)
    assert [read_value(wire.type_name, whole[:length]) for length in range(len(whole))] == [None] * len(whole)
    assert layout.read(whole + b"\x00") is None


def test_fewer_numbers_with_dimensions_are_no_value_of_the_same_length() -> None:
    """Eight bytes of one number and an axis of no label: as long as other contents, and no such value."""
    wire = Wire(WireFormat.DOUBLE, 5)
    axis = STORE.types["std_msgs/msg/MultiArrayDimension"]("abc", 4, 4)
    layout = STORE.types["std_msgs/msg/MultiArrayLayout"](dim=[axis], data_offset=0)
    message = STORE.types[wire.type_name](layout=layout, data=np.arange(3.0))
    theirs = bytes(STORE.serialize_cdr(message, wire.type_name))
    assert len(theirs) == wire.cdr_bytes
    assert layout_of(wire.type_name, wire.size).read(theirs) is None


@given(
    rows=arrays(np.float64, st.tuples(st.integers(0, 4), st.integers(1, 9)), elements=st.floats(width=32)),
    head=arrays(np.float64, st.integers(0, 3), elements=st.floats(width=32)),
    offset=st.integers(0, 3),
)
def test_a_table_is_written_as_the_library_writes_it_and_read_back(
    rows: FloatArray, head: FloatArray, offset: int
) -> None:
    written = write_table(offset, head, rows)
    if rows.size + head.size:  # the alignment of numbers that are not there is nobody's matter
        assert written == bytes(STORE.serialize_cdr(table_of(offset, head, rows), TABLE))
    found = read_table(written)
    assert found is not None
    assert (found.offset, found.sizes) == (offset, rows.shape)
    assert found.numbers.tobytes() == head.tobytes() + rows.tobytes()
    assert found.numbers.flags.aligned
    for length in range(0, len(written), 8):
        assert read_table(written[:length]) is None


@pytest.mark.parametrize("little", [True, False])
@pytest.mark.parametrize("labels", [("tick", "state"), ("row", "column"), ("ticks", "state")])
def test_another_table_is_read_by_the_library(little: bool, labels: tuple[str, str]) -> None:
    rows = np.arange(6.0).reshape(2, 3)
    theirs = bytes(STORE.serialize_cdr(table_of(1, np.array([7.0]), rows, labels), TABLE, little_endian=little))
    assert (read_table(theirs) is None) is (not little or labels != ("tick", "state"))
    first, samples = decode_truth(theirs)
    assert first == 7
    np.testing.assert_array_equal(samples, rows)


@given(text=TEXTS, little=st.booleans())
def test_a_text_is_written_as_the_library_writes_it_and_read_back(text: str, little: bool) -> None:
    theirs = bytes(STORE.serialize_cdr(STORE.types[TEXT](text), TEXT, little_endian=little))
    if little:
        assert write_text(text) == theirs
        assert read_text(theirs) == text.encode()
    else:
        assert read_text(theirs) is None


@given(st.binary(max_size=40))
def test_bytes_that_are_no_text_are_none_of_ours(data: bytes) -> None:
    found = read_text(data)
    assert found is None or data[8 : 8 + len(found)] == found


def test_a_note_of_another_byte_order_is_read_too() -> None:
    messages: Any = pytest.importorskip("etac_ros.engines.ros.messages")
    note = STORE.types[TEXT]('{"run":"r","is":[1]}')
    theirs = bytes(STORE.serialize_cdr(note, TEXT, little_endian=False))
    assert messages.read_note(theirs, "r") == [1]
    assert messages.read_note(theirs, "another") is None
    assert messages.read_note(b"\x00\x01\x00\x00\xff\xff\xff\x7fnothing", "r") is None
