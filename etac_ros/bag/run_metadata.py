"""The record in which a bag keeps what is known of its run: text by key."""

from __future__ import annotations

import zlib
from collections.abc import Mapping
from fractions import Fraction

from etac_ros.maths.wall_clock import WallClock

RECORD_NAME = "etac_ros"
TICKS_PER_SECOND = "ticks_per_second"
RECOVERED = "recovered"
"""Only in a repaired bag: what had been wrong with it."""
TRUTH_EVERY = "truth_every"
"""Only where a bag does not hold all committed samples: those at multiples of so many ticks, and the last; 0: none."""
CLOCK, START_NS, RATE = "clock", "start_ns", "rate"
"""Only in the bag of a real-time run: that it is one (``wall``), when tick 0 was on the wall clock [ns], and simulated
seconds a second."""
WALL = "wall"

_CHECKSUM = "crc32"


def ticks_per_second(metadata: Mapping[str, str]) -> int:
    """Look up the rate of the tick grid [1/s].

    Raises
    ------
    ValueError
        If it is not there, or is no rate.
    """
    text = metadata.get(TICKS_PER_SECOND, "")
    if not text.isdecimal() or int(text) < 1:
        raise ValueError(f"{TICKS_PER_SECOND} is '{text}' in the metadata of the run")
    return int(text)


def truth_every(metadata: Mapping[str, str]) -> int:
    """Which of the committed samples a bag holds: those at multiples of so many ticks, and the last; 0: none.

    Raises
    ------
    ValueError
        If that is no whole number.
    """
    text = metadata.get(TRUTH_EVERY, "1")
    if not text.isdecimal():
        raise ValueError(f"{TRUTH_EVERY} is '{text}' in the metadata of the run")
    return int(text)


def wall_clock(metadata: Mapping[str, str]) -> WallClock | None:
    """The instants of ticks on the wall clock; None of a run in simulated time.

    Raises
    ------
    ValueError
        If something of it is missing, or makes no sense.
    """
    if CLOCK not in metadata:
        return None
    rate = Fraction(metadata.get(RATE, "0"))
    if metadata[CLOCK] != WALL or rate <= 0:
        raise ValueError(f"{CLOCK} is '{metadata[CLOCK]}' and {RATE} '{rate}' in the metadata of the run")
    return WallClock(int(metadata.get(START_NS, "")), ticks_per_second(metadata), rate)


def of_wall_clock(wall: WallClock) -> dict[str, str]:
    """What the metadata of a real-time run say of its clock: the inverse of :func:`wall_clock`."""
    return {CLOCK: WALL, START_NS: str(wall.start_ns), RATE: str(wall.rate)}


def sealed(metadata: Mapping[str, str]) -> dict[str, str]:
    """Add a checksum: a metadata record is the only one of ours for which MCAP itself has none."""
    return {**metadata, _CHECKSUM: _crc(metadata)}


def unsealed(record: Mapping[str, str]) -> dict[str, str]:
    """Check and remove the checksum: the inverse of :func:`sealed`.

    Raises
    ------
    ValueError
        If it is wrong.
    """
    metadata = {key: value for key, value in record.items() if key != _CHECKSUM}
    if record.get(_CHECKSUM) != _crc(metadata):
        raise ValueError("the checksum of the run's metadata is wrong")
    return metadata


def _crc(metadata: Mapping[str, str]) -> str:
    text = "\0".join(part for item in metadata.items() for part in item)
    return f"{zlib.crc32(text.encode()):08x}"
