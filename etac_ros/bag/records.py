"""The records of an MCAP file, one after the other, each checked before it is handed out.

mcap's own readers start from the index at the end of a file, or trust every length they meet. A bag that was
cut off has no index, and one that was damaged has lengths that lie; so the records are walked here, and mcap
only reads what is in them. Nothing that a file says makes it take more memory or time than the limits below.
"""

from __future__ import annotations

import os
import struct
import zlib
from collections.abc import Iterator
from pathlib import Path
from typing import BinaryIO, NamedTuple

from mcap.opcode import Opcode
from mcap.writer import MCAP0_MAGIC

from etac_ros.bag.compression import MOST_CHUNK_BYTES, expanded
from etac_ros.errors import BagError

_HEAD = struct.Struct("<BQ")
_CHUNK = struct.Struct("<QQQI")
_INDEX = struct.Struct("<HI")
_INDEX_ENTRY_BYTES = 16
_LENGTH32 = struct.Struct("<I")
_LENGTH64 = struct.Struct("<Q")
_MOST_RECORD_BYTES = 256 * 1024 * 1024
_MOST_EXPANSION = 1000
"""So many times the size of its file all chunks may come to, beyond one chunk: what does not end is no recording."""


class DamagedBagError(BagError):
    """From some byte on, a bag cannot be trusted; what stands before it is whole."""


class Record(NamedTuple):
    """One record.

    Attributes
    ----------
    in_chunk
        It stood in a chunk, so the checksum of the chunk vouches for it.
    chunk
        Where that chunk begins in the file; -1 without one.
    """

    opcode: int
    offset: int
    content: bytes
    in_chunk: bool
    chunk: int = -1


def records(path: Path) -> Iterator[Record]:
    """Read all records of a file in order, those inside of chunks included.

    A chunk is handed out only if its checksum is right. The checksums of the data section and of the summary
    come behind what they cover, so it is only the end of the iteration that says that every byte was right.

    Raises
    ------
    DamagedBagError
        At the first place that is not whole, after all records before it.
    BagError
        If the file cannot be read or is no MCAP file at all.
    """
    try:
        with path.open("rb") as file:
            yield from _walk(file, os.fstat(file.fileno()).st_size, path)
    except OSError as error:
        raise BagError(str(path), f"cannot be read: {error.strerror}") from None


def record_at(file: BinaryIO, path: Path, offset: int, chunk: int) -> Record:
    """Read one record again, of a file that :func:`records` has gone through.

    Parameters
    ----------
    file, path
        The open file, and its name for messages.
    offset, chunk
        As the record had them.

    Raises
    ------
    DamagedBagError
        If it does not stand there any more.
    """
    if chunk < 0:
        return _record_here(file, path, offset)
    data, start = _unpacked(_record_here(file, path, chunk), path)
    place = offset - start
    if not 0 <= place <= len(data) - _HEAD.size:
        raise damaged(path, offset, "this is not what stood here before")
    opcode, length = _HEAD.unpack_from(data, place)
    first = place + _HEAD.size
    return Record(opcode, offset, data[first : first + length], True, chunk)


def _record_here(file: BinaryIO, path: Path, offset: int) -> Record:
    file.seek(offset)
    head = file.read(_HEAD.size)
    if len(head) < _HEAD.size:
        raise damaged(path, offset, "the file was cut off here")
    opcode, length = _HEAD.unpack(head)
    if length > _MOST_RECORD_BYTES:
        raise damaged(path, offset, f"this record has {length} bytes, more than {_MOST_RECORD_BYTES}")
    content = file.read(length)
    if len(content) < length:
        raise damaged(path, offset, "the file was cut off within this record")
    return Record(opcode, offset, content, in_chunk=False)


def damaged(path: Path, offset: int, found: str) -> DamagedBagError:
    """Make the error for a place in a file."""
    return DamagedBagError(str(path), f"byte {offset}: {found}", "a bag that was closed", f"etac recover {path.parent}")


def _walk(file: BinaryIO, size: int, path: Path) -> Iterator[Record]:
    magic = file.read(len(MCAP0_MAGIC))
    if magic != MCAP0_MAGIC[: len(magic)]:
        raise BagError(str(path), "is no MCAP file", "a bag that etac_ros recorded")
    crc = zlib.crc32(magic)
    offset = len(magic)
    not_indexed = 0
    allowance = MOST_CHUNK_BYTES + _MOST_EXPANSION * size
    while True:
        head = file.read(_HEAD.size)
        if len(head) < _HEAD.size:
            raise damaged(path, offset, "the file was cut off here")
        opcode, length = _HEAD.unpack(head)
        if opcode == 0:
            raise damaged(path, offset, "no record begins here")
        if length > size - offset - _HEAD.size:
            raise damaged(path, offset, "the file was cut off within this record")
        if length > _MOST_RECORD_BYTES:
            raise damaged(path, offset, f"this record has {length} bytes, more than {_MOST_RECORD_BYTES}")
        record = Record(opcode, offset, file.read(length), in_chunk=False)
        if len(record.content) < length:  # shortened while it was read
            raise damaged(path, offset, "the file was cut off within this record")
        if opcode == Opcode.DATA_END:
            _compare(record, 0, crc, path)
            crc = 0
        elif opcode == Opcode.FOOTER:
            _compare(record, 16, zlib.crc32(record.content[:16], zlib.crc32(head, crc)), path)
            if file.read() != MCAP0_MAGIC:
                raise damaged(path, offset, "the file does not end where its footer says")
            return
        else:
            crc = zlib.crc32(record.content, zlib.crc32(head, crc))
        if opcode == Opcode.CHUNK:
            not_indexed = 0
            data, start = _unpacked(record, path)
            allowance -= len(data)
            if allowance < 0:
                raise damaged(path, offset, f"its chunks expand to more than {_MOST_EXPANSION} times its size")
            for inner in _inner(data, start, path, offset):
                not_indexed += inner.opcode == Opcode.MESSAGE
                yield inner
        else:
            if opcode == Opcode.MESSAGE_INDEX:
                # A chunk whose opcode was changed would be passed over, and leave a gap. Its index gives it away.
                not_indexed -= _indexed(record, path)
                if not_indexed < 0:
                    raise damaged(path, offset, "the chunk of this index is missing")
            yield record
        offset += _HEAD.size + length


def _indexed(record: Record, path: Path) -> int:
    """Count the messages that a message index points to."""
    if len(record.content) < _INDEX.size:
        raise damaged(path, record.offset, "this record is too short")
    _, length = _INDEX.unpack_from(record.content)
    return int(length // _INDEX_ENTRY_BYTES)


def _compare(record: Record, place: int, crc: int, path: Path) -> None:
    """Compare a checksum; 0 stands for none."""
    if len(record.content) < place + _LENGTH32.size:
        raise damaged(path, record.offset, "this record is too short")
    (expected,) = _LENGTH32.unpack_from(record.content, place)
    if expected not in (0, crc):
        raise damaged(path, record.offset, "the checksum of what stands before is wrong")


def _unpacked(chunk: Record, path: Path) -> tuple[bytes, int]:
    """The records in a chunk, expanded and checked, and their place in the file for messages about them."""
    try:
        _, _, size, crc = _CHUNK.unpack_from(chunk.content)
        (named,) = _LENGTH32.unpack_from(chunk.content, _CHUNK.size)
        place = _CHUNK.size + _LENGTH32.size
        compression = chunk.content[place : place + named]
        (length,) = _LENGTH64.unpack_from(chunk.content, place + named)
    except (struct.error, OverflowError):
        raise damaged(path, chunk.offset, "this chunk is too short") from None
    place += named + _LENGTH64.size
    data = chunk.content[place : place + length]
    if compression:
        try:
            data = expanded(compression, data, size)
        except ValueError as error:
            raise damaged(path, chunk.offset, str(error)) from None
    if crc not in (0, zlib.crc32(data)):
        raise damaged(path, chunk.offset, "the checksum of this chunk is wrong")
    return data, chunk.offset + _HEAD.size + place


def _inner(data: bytes, start: int, path: Path, chunk: int) -> Iterator[Record]:
    place = 0
    while place < len(data):
        if len(data) - place < _HEAD.size:
            raise damaged(path, start + place, "this chunk ends within a record")
        opcode, length = _HEAD.unpack_from(data, place)
        first = place + _HEAD.size
        if length > len(data) - first:
            raise damaged(path, start + place, "this chunk ends within a record")
        yield Record(opcode, start + place, data[first : first + length], True, chunk)
        place = first + length
