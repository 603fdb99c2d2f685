"""Wire formats: which message type carries a value, what it costs, and what it does to the numbers.

This file is the one list of message types, by the names of the common interfaces; it needs no ROS. Two byte counts of a
message stand side by side: the payload (its components: 4 bytes each where they are float32, as the papers count, 8
where they are float64), and CDR (the serialized message with its 4-byte header). The rounding happens on the sender's
side, so that sender, receiver and both engines use the very value that was on the wire.
"""

from __future__ import annotations

from dataclasses import dataclass
from enum import StrEnum
from typing import Any

import numpy as np

from etac_ros.parameters import FloatArray

_CDR_HEADER = 4
_FLOAT32, _FLOAT64 = np.dtype(np.float32), np.dtype(np.float64)


class WireFormat(StrEnum):
    """How values are put on a link."""

    COMPACT = "compact"
    """float32, as the papers count: Point32 for a 3-vector, Float32MultiArray otherwise."""
    STAMPED = "stamped"
    """float64 with a header: Vector3Stamped, QuaternionStamped, WrenchStamped."""
    DOUBLE = "double"
    """float64 of any size, no header: Vector3 for a 3-vector, Float64MultiArray otherwise; so are physical links."""


_XYZ = ("x", "y", "z")
SCALAR_FIELDS: dict[str, tuple[str, ...]] = {
    "geometry_msgs/msg/Point32": _XYZ,
    "geometry_msgs/msg/Vector3": _XYZ,
    "geometry_msgs/msg/Vector3Stamped": tuple(f"vector.{axis}" for axis in _XYZ),
    "geometry_msgs/msg/QuaternionStamped": tuple(f"quaternion.{axis}" for axis in (*_XYZ, "w")),
    "geometry_msgs/msg/WrenchStamped": tuple(f"wrench.{part}.{axis}" for part in ("force", "torque") for axis in _XYZ),
}
"""Where the components of a value stand in the messages that name them, in the order of the value."""
ARRAY_DTYPES: dict[str, type[np.floating[Any]]] = {
    "std_msgs/msg/Float32MultiArray": np.float32,
    "std_msgs/msg/Float64MultiArray": np.float64,
}
"""The messages that carry a value of any size in their field ``data``, and of which numbers."""
LINK_TYPES = (*SCALAR_FIELDS, *ARRAY_DTYPES)
"""All message types that a link may have."""
NOTE_TYPE = "std_msgs/msg/String"
TABLE_TYPE = "std_msgs/msg/Float64MultiArray"
CLOCK_TYPE = "rosgraph_msgs/msg/Clock"
"""Types of the emulation plane: protocol notes, windows and committed samples, and the simulated time."""


def is_stamped(type_name: str) -> bool:
    """Whether a message type has a header with the time."""
    return type_name.endswith("Stamped")


_BARE_3 = {WireFormat.COMPACT: "geometry_msgs/msg/Point32", WireFormat.DOUBLE: "geometry_msgs/msg/Vector3"}
_ARRAYS = {WireFormat.COMPACT: "std_msgs/msg/Float32MultiArray", WireFormat.DOUBLE: "std_msgs/msg/Float64MultiArray"}
_SINGLE_PRECISION = (_BARE_3[WireFormat.COMPACT], _ARRAYS[WireFormat.COMPACT])
_STAMPED_TYPES = {len(fields): name for name, fields in SCALAR_FIELDS.items() if is_stamped(name)}


def bytes_a_component(type_name: str) -> int:
    """Bytes of one number in a message type."""
    return 4 if type_name in _SINGLE_PRECISION else 8


@dataclass(frozen=True, slots=True)
class Wire:
    """The message type of one link.

    Parameters
    ----------
    format
        Compact, stamped or double.
    size
        Components of a value.
    """

    format: WireFormat
    size: int

    def __post_init__(self) -> None:
        if self.format is WireFormat.STAMPED and self.size not in _STAMPED_TYPES:
            raise ValueError(
                f"no stamped message of the common interfaces carries {self.size} components "
                f"(only {sorted(_STAMPED_TYPES)}); use wire: double (float64 of any size, without a header) "
                "or wire: compact (float32)"
            )

    @property
    def type_name(self) -> str:
        """ROS type, for instance ``geometry_msgs/msg/Point32``."""
        if self.format is WireFormat.STAMPED:
            return _STAMPED_TYPES[self.size]
        return (_BARE_3 if self.size == 3 else _ARRAYS)[self.format]

    @property
    def payload_bytes(self) -> int:
        """Bytes of the components alone, as the papers count them."""
        return bytes_a_component(self.type_name) * self.size

    @property
    def cdr_bytes(self) -> int:
        """Length of the serialized message; checked against real subscriptions in the tests."""
        if self.format is WireFormat.STAMPED:
            stamp_and_empty_frame_id = 4 + 4 + 4 + 1
            aligned = -(-stamp_and_empty_frame_id // 8) * 8
            return _CDR_HEADER + aligned + 8 * self.size
        if self.size == 3:
            return _CDR_HEADER + self.size * (4 if self.format is WireFormat.COMPACT else 8)
        layout_and_length = 4 + 4 + 4  # empty dimensions, data offset, sequence length
        if self.format is WireFormat.COMPACT:
            return _CDR_HEADER + layout_and_length + 4 * self.size
        return _CDR_HEADER + -(-layout_and_length // 8) * 8 + 8 * self.size

    def rounded(self, value: FloatArray) -> FloatArray:
        """The value as it comes off the wire: contiguous float64, rounded to what the message holds."""
        if self.format is WireFormat.COMPACT:
            return value.astype(_FLOAT32).astype(_FLOAT64)
        return value.astype(_FLOAT64)
