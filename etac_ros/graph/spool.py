"""Committed samples of a run that may be longer than memory: parts of it are loaded when they are asked for."""

from __future__ import annotations

import os
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

    @property
    def first_tick(self) -> int:
        """Tick of the first sample; 0 where there is none."""
        return self._firsts[0] if self._firsts else 0

    @property
    def ticks(self) -> int:
        """How many samples there are."""
        return self._firsts[-1] + self._rows[-1] - self._firsts[0] if self._firsts else 0

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
            self._file, path = tempfile.mkstemp(prefix="etac_ros_", dir=_folder())
            os.unlink(path)  # it lives as long as it is open
            self._offsets = array("q")
            self._end = 0
            self._width = self._kept[0].shape[1]
        for samples in self._kept:
            data = np.ascontiguousarray(samples).tobytes()
            self._offsets.append(self._end)
            written = 0
            while written < len(data):
                written += os.pwrite(self._file, data[written:], self._end + written)
            self._end += len(data)
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


def _folder() -> str | None:
    """Where the file lies: where the user says, else where it is not in memory."""
    said = any(os.environ.get(name) for name in ("TMPDIR", "TEMP", "TMP"))
    return None if said or not os.access(_LASTING, os.W_OK | os.X_OK) else _LASTING
