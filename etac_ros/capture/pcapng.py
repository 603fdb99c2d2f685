"""Captured frames in a pcapng file, which Wireshark opens (draft-ietf-opsawg-pcapng)."""

from __future__ import annotations

from collections.abc import Iterable, Iterator
from pathlib import Path
from typing import BinaryIO

from etac_ros.errors import RunError

SNAP_BYTES = 262144
"""Longest frame that is kept whole; the loopback's are at most 65,549."""


def write(file: BinaryIO, frames: Iterable[tuple[float, bytes]]) -> None:
    """Write Ethernet frames as they come.

    Parameters
    ----------
    file
        Opened for writing.
    frames
        Each with its time [s] since the epoch, kept to a microsecond.
    """
    from dpkt import pcapng  # not above: dpkt comes with all its protocols, which is a tenth of what commands import

    pcapng.Writer(file, snaplen=SNAP_BYTES).writepkts(frames)


def read(path: Path) -> Iterator[tuple[float, bytes]]:
    """The frames of a file, each with its time [s].

    Raises
    ------
    RunError
        If it is none, or is cut off.
    """
    import dpkt

    try:
        with path.open("rb") as file:
            yield from dpkt.pcapng.Reader(file)
    except OSError as error:
        raise RunError(str(path), f"cannot be read: {error.strerror}") from None
    except (ValueError, dpkt.Error) as error:
        raise RunError(str(path), f"is damaged: {error}", "a whole pcapng file with Ethernet frames") from None
