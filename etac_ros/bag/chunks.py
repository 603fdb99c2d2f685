"""The truth of a bag that is too large to be read at once: its messages are found again when they are asked for."""

from __future__ import annotations

from array import array
from pathlib import Path

from etac_ros.bag.codec import decode_truth
from etac_ros.bag.contents import read_again
from etac_ros.errors import BagError
from etac_ros.graph.spool import StoredChunks
from etac_ros.parameters import FloatArray


class BagChunks(StoredChunks):
    """Committed samples of one plant in a bag, of which only the places are kept.

    Parameters
    ----------
    path
        The MCAP file, every byte of which has been checked.
    every
        Ticks from one sample to the next.
    """

    def __init__(self, path: Path, every: int = 1) -> None:
        super().__init__()
        self.every = every
        self._path = path
        self._offsets, self._chunks = array("q"), array("q")

    def add(self, first: int, rows: int, place: tuple[int, int]) -> None:
        """Take note of the samples that follow, and of their place in the file."""
        self._firsts.append(first)
        self._rows.append(rows)
        self._offsets.append(place[0])
        self._chunks.append(place[1])

    def _load(self, number: int) -> FloatArray:
        try:
            with self._path.open("rb") as file:
                cdr = read_again(file, self._path, (self._offsets[number], self._chunks[number]))
                first, samples = decode_truth(cdr)
        except (OSError, ValueError) as error:
            raise BagError(str(self._path), f"cannot be read any more: {error}", "the bag as it was opened") from None
        if (first, samples.shape[0]) != (self._firsts[number], self._rows[number]):
            raise BagError(str(self._path), "has changed since it was opened", "the bag as it was opened")
        return samples
