"""Compressed chunks: which there are, and how they are read. None expands beyond what it says or a limit."""

from __future__ import annotations

from enum import StrEnum

import lz4.frame
import zstandard

MOST_CHUNK_BYTES = 64 * 1024 * 1024
"""Writers end a chunk at about one mebibyte; a chunk that claims more than this is no recording."""

_MOST_WINDOW_BYTES = 128 * 1024 * 1024


class Compression(StrEnum):
    """How the chunks of a bag are compressed."""

    NONE = "none"
    LZ4 = "lz4"
    ZSTD = "zstd"


def expanded(compression: bytes, data: bytes, size: int) -> bytes:
    """Expand the records of a chunk.

    Parameters
    ----------
    compression
        ``lz4`` or ``zstd``, as the chunk says.
    data
        What stands in it.
    size
        How many bytes it says that come of it.

    Raises
    ------
    ValueError
        If another number of bytes comes of it, it is damaged, or the compression is not known.
    """
    if size > MOST_CHUNK_BYTES:
        raise ValueError(f"this chunk claims to expand to {size} bytes, more than {MOST_CHUNK_BYTES}")
    try:
        match compression:
            case b"lz4":
                found = _lz4(data, size + 1)
            case b"zstd":
                # A reader, since a frame that tells its size would override any limit of a single call.
                decompressor = zstandard.ZstdDecompressor(max_window_size=_MOST_WINDOW_BYTES)
                with decompressor.stream_reader(data) as reader:
                    found = reader.read(size + 1)
            case _:
                name = compression[:20].decode("ascii", "backslashreplace")
                raise ValueError(f"this chunk is compressed with '{name}', known are lz4 and zstd")
    except (RuntimeError, EOFError, zstandard.ZstdError, MemoryError) as error:
        raise ValueError(f"this chunk cannot be expanded ({error})") from None
    if len(found) != size:
        raise ValueError(f"this chunk does not expand to the {size} bytes that it claims")
    return bytes(found)


def _lz4(data: bytes, most: int) -> bytes:
    with lz4.frame.LZ4FrameDecompressor() as decompressor:
        return bytes(decompressor.decompress(data, max_length=most))
