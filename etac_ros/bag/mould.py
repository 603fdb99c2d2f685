"""Many serialized messages of one shape at once: one is serialized, whose numbers are then replaced.

Messages of one type with the same texts and array lengths have their numbers at the same places. So a template is
serialized with marks for numbers, and where the marks stand is where the numbers belong; nothing here knows CDR.
"""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

import numpy as np
import numpy.typing as npt

from etac_ros.bag.message import serialized
from etac_ros.maths.ticks import NANOSECONDS
from etac_ros.parameters import FloatArray

_SECONDS, _NANOSECONDS = 0x5A17C0DE, 0x2B0BCAFE
_FIRST_MARK = 1.2345e201
"""Marks are numbers that no constant of a template is."""


def mark(number: int) -> float:
    """The mark of a float64 in a template: where it stands, column ``number`` of the values is written."""
    return _FIRST_MARK * (1.0 + number)


def marked_stamp() -> dict[str, int]:
    """A time in a template: where it stands, the time of the message is written."""
    return {"sec": _SECONDS, "nanosec": _NANOSECONDS}


class Mould:
    """Casts messages of one shape.

    Parameters
    ----------
    type_name
        Message type, as ``geometry_msgs/msg/PoseStamped``.
    template
        Values of a message of this type, with :func:`mark` and :func:`marked_stamp` in the places of what changes.
    columns
        How many marks there are. A mark may stand in several places.
    """

    def __init__(self, type_name: str, template: Mapping[str, Any], columns: int) -> None:
        data = serialized(type_name, template)
        self._template = np.frombuffer(data, dtype=np.uint8)
        self._places = [_places(data, np.float64(mark(number)).tobytes()) for number in range(columns)]
        if not all(self._places):
            raise ValueError(f"a template of {type_name} lacks one of its {columns} marks")
        stamp = np.array([_SECONDS, _NANOSECONDS], dtype="<u4").tobytes()
        self._stamps = _places(data, stamp)

    def cast(self, times_ns: npt.NDArray[np.int64], values: FloatArray) -> list[bytes]:
        """Serialize a message for each row.

        Parameters
        ----------
        times_ns
            What stands in the stamps, shape (n,).
        values
            Shape (n, columns).
        """
        count = times_ns.size
        rows = np.tile(self._template, (count, 1))
        for number, places in enumerate(self._places):
            column = np.ascontiguousarray(values[:, number], dtype="<f8").view(np.uint8).reshape(count, 8)
            for place in places:
                rows[:, place : place + 8] = column
        if self._stamps:
            stamps = np.stack(np.divmod(times_ns, NANOSECONDS), axis=1).astype("<u4").view(np.uint8)
            for place in self._stamps:
                rows[:, place : place + 8] = stamps
        size = self._template.size
        everything = rows.tobytes()
        return [everything[start : start + size] for start in range(0, count * size, size)]


def _places(data: bytes, wanted: bytes) -> list[int]:
    found, start = [], data.find(wanted)
    while start >= 0:
        found.append(start)
        start = data.find(wanted, start + 1)
    return found
