"""UDP datagrams in Ethernet frames, with the bytes of each layer.

IEEE 802.3 (Ethernet header, 14 bytes), RFC 791 (IPv4), RFC 768 (UDP). A capture on Linux sees neither preamble (8
bytes), nor frame check sequence (4), nor interpacket gap (12), on a real interface as little as on the loopback; so
these are in no measured figure. The loopback has no Ethernet at all: Linux gives its frames a header of the same 14
bytes, with addresses of zeros, and they stand for those of a real link.
"""

from __future__ import annotations

import struct
from collections import defaultdict
from collections.abc import Iterable, Iterator
from typing import NamedTuple

ETHERNET_BYTES = 14
UDP_IP_BYTES = 20 + 8
"""IPv4 header without options, and UDP header."""

_IPV4 = b"\x08\x00"
_UDP = 17
_MORE, _OFFSET = 0x2000, 0x1FFF
_PORTS_AND_LENGTH = struct.Struct("!HHH")


class Datagram(NamedTuple):
    """One UDP datagram, which IP may have sent in several frames.

    Attributes
    ----------
    source, target
        Address, as four bytes, and port.
    frames
        In which it came.
    ethernet_bytes, udp_ip_bytes
        Their headers, and what fills a short frame up.
    content
        What UDP carries.
    """

    source: tuple[bytes, int]
    target: tuple[bytes, int]
    frames: int
    ethernet_bytes: int
    udp_ip_bytes: int
    content: bytes

    @property
    def size(self) -> int:
        """Bytes of its frames."""
        return self.ethernet_bytes + self.udp_ip_bytes + len(self.content)


class _Part(NamedTuple):
    """What one frame brings of a datagram: all of it, where nothing comes before or behind it."""

    key: bytes
    """Identification, and addresses (RFC 791, 3.2)."""
    start: int
    more: bool
    ethernet_bytes: int
    header_bytes: int
    content: bytes


def datagrams(frames: Iterable[bytes]) -> Iterator[Datagram | bytes]:
    """Every frame once: as a part of the datagram that it brings, or, where there is no whole one, as it is."""
    waiting: defaultdict[bytes, list[tuple[bytes, _Part]]] = defaultdict(list)
    for frame in frames:
        part = _part(frame)
        if part is None:
            yield frame
            continue
        parts = [part]
        if part.more or part.start:
            waiting[part.key].append((frame, part))
            parts = [each for _, each in waiting[part.key]]
            if not _complete(parts):
                continue
            kept = waiting.pop(part.key)
        else:
            kept = [(frame, part)]
        whole = _joined(parts)
        if whole is None:
            yield from (each for each, _ in kept)
        else:
            yield whole
    for rest in waiting.values():
        yield from (frame for frame, _ in rest)


def parse(frame: bytes) -> Datagram | None:
    """The datagram in an Ethernet frame; None where there is no whole one."""
    (found,) = datagrams([frame])
    return found if isinstance(found, Datagram) else None


def _part(frame: bytes) -> _Part | None:
    if len(frame) < ETHERNET_BYTES + 20 or frame[12:14] != _IPV4 or frame[14] >> 4 != 4 or frame[23] != _UDP:
        return None
    header = 4 * (frame[14] & 0x0F)
    total = int.from_bytes(frame[16:18], "big")
    if header < 20 or total < header or ETHERNET_BYTES + total > len(frame):
        return None
    flags = int.from_bytes(frame[20:22], "big")
    return _Part(
        frame[18:20] + frame[26:34],
        8 * (flags & _OFFSET),
        bool(flags & _MORE),
        len(frame) - total,
        header,
        frame[ETHERNET_BYTES + header : ETHERNET_BYTES + total],
    )


def _complete(parts: list[_Part]) -> bool:
    end = 0
    for part in sorted(parts, key=lambda part: part.start):
        if part.start != end:
            return False
        end += len(part.content)
        if not part.more:
            return True
    return False


def _joined(parts: list[_Part]) -> Datagram | None:
    udp = b"".join(part.content for part in sorted(parts, key=lambda part: part.start))
    if len(udp) < 8:
        return None
    source, target, length = _PORTS_AND_LENGTH.unpack_from(udp)
    if length != len(udp):
        return None
    key = parts[0].key
    return Datagram(
        (key[2:6], source),
        (key[6:10], target),
        len(parts),
        sum(part.ethernet_bytes for part in parts),
        sum(part.header_bytes for part in parts) + 8,
        udp[8:],
    )
