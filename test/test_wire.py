"""Wires: what a message does to the numbers, and what it costs."""

from __future__ import annotations

from typing import Any

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from hypothesis.extra.numpy import arrays

from etac_ros.graph.wire import Wire, WireFormat
from etac_ros.parameters import FloatArray

COMPACT, STAMPED, DOUBLE = WireFormat.COMPACT, WireFormat.STAMPED, WireFormat.DOUBLE
SIZES = {COMPACT: range(1, 13), STAMPED: (3, 4, 6), DOUBLE: range(1, 13)}
WIRES = [Wire(kind, size) for kind, sizes in SIZES.items() for size in sizes]
wires = st.sampled_from(WIRES)
values = st.lists(st.floats(-1e30, 1e30), min_size=12, max_size=12).map(np.array)


def name(wire: Wire) -> str:
    return f"{wire.format.value}{wire.size}"


@given(wires, values)
def test_rounding_twice_is_rounding_once(wire: Wire, value: FloatArray) -> None:
    once = wire.rounded(value[: wire.size])
    assert wire.rounded(once).tobytes() == once.tobytes()
    assert once.dtype == np.float64
    assert once.flags.c_contiguous


@given(values)
def test_compact_is_float32_and_the_others_keep_every_bit(value: FloatArray) -> None:
    assert Wire(COMPACT, 12).rounded(value).tolist() == [float(np.float32(x)) for x in value]
    assert Wire(STAMPED, 6).rounded(value[:6]).tobytes() == value[:6].tobytes()
    assert Wire(DOUBLE, 12).rounded(value).tobytes() == value.tobytes()


@given(arrays(np.float64, (12, 2), elements=st.floats(-1.0, 1.0)), wires)
def test_a_rounded_value_is_no_view_of_the_old(value: FloatArray, wire: Wire) -> None:
    column = value[: wire.size, 0]
    rounded = wire.rounded(column)
    before = rounded.copy()
    column[:] = 2.0
    assert np.array_equal(rounded, before)
    assert rounded.flags.c_contiguous


@pytest.mark.parametrize("wire", WIRES, ids=name)
def test_payload_is_the_bytes_of_the_components(wire: Wire) -> None:
    # What a message of one component more costs more: 4 bytes of float32, 8 of float64.
    assert wire.payload_bytes == (4 if wire.format is COMPACT else 8) * wire.size


@pytest.mark.parametrize(
    ("wire", "type_name", "cdr_bytes"),
    [
        (Wire(COMPACT, 3), "geometry_msgs/msg/Point32", 16),
        (Wire(DOUBLE, 3), "geometry_msgs/msg/Vector3", 28),
        (Wire(STAMPED, 3), "geometry_msgs/msg/Vector3Stamped", 44),
        (Wire(STAMPED, 6), "geometry_msgs/msg/WrenchStamped", 68),
        # A Float32MultiArray of three is 28 bytes: 12 of numbers and 16 of everything else.
        (Wire(COMPACT, 6), "std_msgs/msg/Float32MultiArray", 28 + 12),
    ],
    ids=lambda value: name(value) if isinstance(value, Wire) else "",
)
def test_cdr_sizes_are_the_measured_ones(wire: Wire, type_name: str, cdr_bytes: int) -> None:
    assert wire.type_name == type_name
    assert wire.cdr_bytes == cdr_bytes


@pytest.mark.parametrize("wire", WIRES, ids=name)
def test_cdr_sizes_are_those_of_ros(wire: Wire) -> None:
    serialization: Any = pytest.importorskip("rclpy.serialization")
    from etac_ros.bag.codec import decode
    from etac_ros.engines.ros.messages import encode, message_type, stamp_ns

    value = wire.rounded(np.linspace(-1.0, 2.0, wire.size))
    sent = encode(wire, value, 3_000_000_007)
    serialized = serialization.serialize_message(serialization.deserialize_message(sent, message_type(wire)))
    assert len(sent) == len(serialized) == wire.cdr_bytes
    assert decode(wire.type_name, serialized).tobytes() == value.tobytes()
    if wire.format is STAMPED:
        assert stamp_ns(wire, serialized) == 3_000_000_007


@pytest.mark.parametrize("size", [1, 2, 5, 7, 12])
def test_stamped_carries_three_four_or_six(size: int) -> None:
    with pytest.raises(ValueError, match=rf"carries {size} components \(only \[3, 4, 6\]\); use wire: double"):
        Wire(STAMPED, size)
