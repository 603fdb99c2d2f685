"""Frames built by hand, byte by byte as the standards have it, for tests of what reads them."""

from __future__ import annotations

import struct

PREFIX, OTHER, RECORDER = b"A" * 12, b"B" * 12, b"R" * 12
WRITER, READER = bytes.fromhex("00000103"), bytes.fromhex("00000204")
PUBLICATIONS, SUBSCRIPTIONS, SPDP = (bytes.fromhex(text) for text in ("000003c2", "000004c2", "000100c2"))
HERE = bytes([127, 0, 0, 1])
PORTS = {PREFIX: 7661, OTHER: 7663, RECORDER: 7665}
"""Where the participants listen."""


def submessage(kind: int, body: bytes, flags: int = 1) -> bytes:
    return struct.pack("<BBH", kind, flags, len(body)) + body


def info_ts() -> bytes:
    return submessage(0x09, bytes(8))


def info_dst(prefix: bytes) -> bytes:
    return submessage(0x0E, prefix)


def statistics() -> bytes:
    return submessage(0x80, bytes(56))


def data(writer: bytes, number: int, serialized: bytes, inline_qos: bytes = b"") -> bytes:
    head = struct.pack("<HH4s4siI", 0, 16, bytes(4), writer, number >> 32, number & 0xFFFFFFFF)
    return submessage(0x15, head + inline_qos + serialized, 0x05 | (0x02 if inline_qos else 0))


def heartbeat(writer: bytes) -> bytes:
    return submessage(0x07, READER + writer + bytes(20))


def acknack(reader: bytes, writer: bytes) -> bytes:
    return submessage(0x06, reader + writer + bytes(16))


def gap(writer: bytes) -> bytes:
    return submessage(0x08, READER + writer + bytes(24))


def cdr(size: int) -> bytes:
    """A serialized message of so many bytes, its encapsulation header included."""
    return b"\x00\x01\x00\x00" + bytes(size - 4)


def parameter_list(*parameters: tuple[int, bytes]) -> bytes:
    body = b"".join(struct.pack("<HH", number, len(value)) + value for number, value in parameters)
    return b"\x00\x03\x00\x00" + body + struct.pack("<HH", 1, 0)


def announcement(kind: bytes, prefix: bytes, entity: bytes, topic: str) -> bytes:
    """SEDP data about an endpoint."""
    name = topic.encode() + b"\0"
    text = struct.pack("<I", len(name)) + name + bytes(-len(name) % 4)
    return data(kind, 1, parameter_list((0x0005, text), (0x005A, prefix + entity)))


def participant(prefix: bytes) -> bytes:
    """SPDP data about a participant."""
    locator = struct.pack("<II12x4s", 1, PORTS[prefix], HERE)
    return data(SPDP, 1, parameter_list((0x0050, prefix + bytes.fromhex("000001c1")), (0x0031, locator)))


def rtps(prefix: bytes, *submessages: bytes) -> bytes:
    return b"RTPS\x02\x02\x01\x0f" + prefix + b"".join(submessages)


def frame(content: bytes, port: int = 7661, smallest: int = 0) -> bytes:
    """A frame with a UDP datagram, filled up to a smallest size."""
    udp = struct.pack("!HHHH", 40000, port, 8 + len(content), 0) + content
    ip = struct.pack("!BBHHHBBH4s4s", 0x45, 0, 20 + len(udp), 7, 0x4000, 64, 17, 0, HERE, HERE) + udp
    whole = bytes(12) + b"\x08\x00" + ip
    return whole + bytes(max(0, smallest - len(whole)))
