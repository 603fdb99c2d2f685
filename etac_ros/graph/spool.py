"""Committed samples of a run that may be longer than memory: parts of it are loaded when they are asked for."""

from __future__ import annotations

import os
import struct
import tempfile
from abc import ABC, abstractmethod
from array import array
from collections.abc import Sequence
from typing import overload

import numpy as np

from etac_ros.parameters import FloatArray

Chunk = tuple[int, FloatArray]
"""Tick of the first sample, and samples of shape (ticks, states)."""
KEPT_BYTES = 64 * 1024 * 1024
"""Samples of one plant up to this size stay in memory: about a million ticks of a rigid body."""
_LASTING = "/var/tmp"
"""Where large temporary files belong; ``/tmp`` may itself be memory."""


class StoredChunks(Sequence[Chunk], ABC):
    """Chunks of samples that lie elsewhere, ascending and without gaps; each is loaded when it is asked for."""

    def __init__(self) -> None:
        self._firsts, self._rows = array("q"), array("q")
        self.every = 1
        """Ticks from one sample to the next."""

    @property
    def first_tick(self) -> int:
        """Tick of the first sample; 0 where there is none."""
        return self._firsts[0] if self._firsts else 0

    @property
    def ticks(self) -> int:
        """How many ticks they cover."""
        return self._firsts[-1] + self.every * (self._rows[-1] - 1) + 1 - self._firsts[0] if self._firsts else 0

    def __len__(self) -> int:
        return len(self._firsts)

    @overload
    def __getitem__(self, place: int) -> Chunk: ...

    @overload
    def __getitem__(self, place: slice) -> Sequence[Chunk]: ...

    def __getitem__(self, place: int | slice) -> Chunk | Sequence[Chunk]:
        if isinstance(place, slice):
            return [self[number] for number in range(*place.indices(len(self)))]
        number = range(len(self))[place]
        return self._firsts[number], self._load(number)

    @abstractmethod
    def _load(self, number: int) -> FloatArray:
        """The samples of a chunk."""


class Spool(StoredChunks):
    """Chunks as they come: in memory as long as they are few, then in a file that nobody sees and that ends with them.

    Parameters
    ----------
    kept_bytes
        Up to which size they stay in memory.
    """

    def __init__(self, kept_bytes: int = KEPT_BYTES) -> None:
        super().__init__()
        self._most = kept_bytes
        self._kept: list[FloatArray] = []
        self._kept_bytes = 0
        self._file: int | None = None
        self._width = 0

    def append(self, chunk: Chunk) -> None:
        """Add the samples that follow."""
        first, samples = chunk
        self._firsts.append(first)
        self._rows.append(samples.shape[0])
        self._kept.append(samples)
        self._kept_bytes += samples.nbytes
        if self._kept_bytes > self._most:
            self._put_away()

    def _put_away(self) -> None:
        if self._file is None:
            self._file = _nameless_file()
            self._offsets = array("q")
            self._end = 0
            self._width = self._kept[0].shape[1]
        for samples in self._kept:
            self._offsets.append(self._end)
            self._end = _write(self._file, np.ascontiguousarray(samples).tobytes(), self._end)
        self._kept.clear()
        self._kept_bytes = 0

    def _load(self, number: int) -> FloatArray:
        away = 0 if self._file is None else len(self._offsets)
        if number >= away:
            return self._kept[number - away]
        assert self._file is not None
        rows = self._rows[number]
        data = os.pread(self._file, rows * self._width * 8, self._offsets[number])
        return np.frombuffer(data).reshape(rows, self._width)

    def __del__(self) -> None:
        if getattr(self, "_file", None) is not None:
            os.close(self._file)  # type: ignore[arg-type]


class TruthFile:
    """All committed samples of a run on their way from the process that records to the one that sums up.

    Made before the first is forked of the second. Nobody else sees it, and it ends with them.

    Parameters
    ----------
    plants
        Names of the plants.
    """

    def __init__(self, plants: Sequence[str]) -> None:
        self._plants = tuple(plants)
        self._file = _nameless_file()
        self._end = 0

    def append(self, plant: str, first: int, samples: FloatArray) -> None:
        """Add the samples of a plant that follow."""
        head = _HEAD.pack(self._plants.index(plant), first, *samples.shape)
        self._end = _write(self._file, head + np.ascontiguousarray(samples).tobytes(), self._end)

    def truth(self) -> dict[str, StoredChunks]:
        """What has been added, by plant, in whichever process."""
        found = {plant: _FileChunks(self) for plant in self._plants}
        offset, size = 0, os.fstat(self._file).st_size
        while offset < size:
            place, first, rows, width = _HEAD.unpack(os.pread(self._file, _HEAD.size, offset))
            found[self._plants[place]].add(first, rows, width, offset + _HEAD.size)
            offset += _HEAD.size + 8 * rows * width
        return dict(found)

    def read(self, offset: int, rows: int, width: int) -> FloatArray:
        """The samples at a place."""
        return np.frombuffer(os.pread(self._file, 8 * rows * width, offset)).reshape(rows, width)

    def __del__(self) -> None:
        os.close(self._file)


class _FileChunks(StoredChunks):
    def __init__(self, file: TruthFile) -> None:
        super().__init__()
        self._file = file
        self._offsets = array("q")
        self._width = 0

    def add(self, first: int, rows: int, width: int, offset: int) -> None:
        self._firsts.append(first)
        self._rows.append(rows)
        self._offsets.append(offset)
        self._width = width

    def _load(self, number: int) -> FloatArray:
        return self._file.read(self._offsets[number], self._rows[number], self._width)


_HEAD = struct.Struct("<4q")
"""Before the samples in the file: number of the plant, first tick, samples, states."""


def _nameless_file() -> int:
    """A file that lies where the user says, else where it is not in memory, and lives as long as it is open."""
    said = any(os.environ.get(name) for name in ("TMPDIR", "TEMP", "TMP"))
    lasting = _LASTING if not said and os.access(_LASTING, os.W_OK | os.X_OK) else None
    file, path = tempfile.mkstemp(prefix="etac_ros_", dir=lasting)
    os.unlink(path)
    return file


def _write(file: int, data: bytes, offset: int) -> int:
    """Write all of it; returns where it ends."""
    written = 0
    while written < len(data):
        written += os.pwrite(file, data[written:], offset + written)
    return offset + written
