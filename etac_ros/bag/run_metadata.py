"""The record in which a bag keeps what is known of its run: text by key."""

from __future__ import annotations

import zlib
from collections.abc import Mapping

RECORD_NAME = "etac_ros"
TICKS_PER_SECOND = "ticks_per_second"
RECOVERED = "recovered"
"""Only in a repaired bag: what had been wrong with it."""

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
