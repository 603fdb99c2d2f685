"""UDP datagrams in Ethernet frames, with the bytes of each layer.

IEEE 802.3 (Ethernet header, 14 bytes), RFC 791 (IPv4), RFC 768 (UDP). A capture on Linux sees neither preamble (8
bytes), nor frame check sequence (4), nor interpacket gap (12), on a real interface as little as on the loopback; so
these are in no measured figure. The loopback has no Ethernet at all: Linux gives its frames a header of the same 14
bytes, with addresses of zeros, and they stand for those of a real link.
"""

from __future__ import annotations

import struct
from typing import NamedTuple

ETHERNET_BYTES = 14
UDP_IP_BYTES = 20 + 8
"""IPv4 header without options, and UDP header."""

_IPV4 = b"\x08\x00"
_UDP = 17
_FRAGMENT = 0x3FFF
"""More fragments, or an offset: in the same 16 bits as "do not fragment", which is the bit between them."""
_PORTS_AND_LENGTH = struct.Struct("!HHH")


class Datagram(NamedTuple):
    """One UDP datagram.

    Attributes
    ----------
    source, target
        Address, as four bytes, and port.
    ethernet_bytes, udp_ip_bytes
        Headers, and what fills a short frame up.
    content
        What UDP carries.
    """

    source: tuple[bytes, int]
    target: tuple[bytes, int]
    ethernet_bytes: int
    udp_ip_bytes: int
    content: bytes


def parse(frame: bytes) -> Datagram | None:
    """The datagram in an Ethernet frame; None where there is no whole one, as in a fragment of IP."""
    if len(frame) < ETHERNET_BYTES + UDP_IP_BYTES or frame[12:14] != _IPV4 or frame[14] >> 4 != 4:
        return None
    header = 4 * (frame[14] & 0x0F)
    if frame[23] != _UDP or header < 20 or int.from_bytes(frame[20:22], "big") & _FRAGMENT & ~0x4000:
        return None
    udp = ETHERNET_BYTES + header
    if len(frame) < udp + 8:
        return None
    source, target, length = _PORTS_AND_LENGTH.unpack_from(frame, udp)
    if length < 8 or udp + length > len(frame):
        return None
    return Datagram(
        (frame[26:30], source),
        (frame[30:34], target),
        len(frame) - header - length,
        header + 8,
        frame[udp + 8 : udp + length],
    )
