"""Fewer points for drawing, with every peak kept."""

from __future__ import annotations

import numpy as np
import numpy.typing as npt

from etac_ros.parameters import FloatArray

_EACH = 4
"""Points that are kept of a column."""


def decimated(times_s: FloatArray, values: FloatArray, columns: int) -> tuple[FloatArray, FloatArray]:
    """Keep first, smallest, largest and last value of each column of equal time.

    Where a column is no wider than a pixel, what is drawn through these is what all samples together draw (M4: Jugel
    and others, PVLDB 7, 2014). That holds for staircases too, whose steps may lie anywhere in time.

    Parameters
    ----------
    times_s
        Times of the samples of one curve, ascending, shape (n,).
    values
        The samples, shape (n,).
    columns
        About one a pixel. A curve of at most four points a column is returned as it is.

    Returns
    -------
    times_s, values
        At most ``4 (columns + 1)`` points; the first and the last one are always among them.
    """
    if values.size <= _EACH * columns or times_s[-1] <= times_s[0]:
        return times_s, values
    column = np.floor((times_s - times_s[0]) * (columns / (times_s[-1] - times_s[0]))).astype(np.int64)
    starts = np.flatnonzero(np.diff(column, prepend=-1))
    place = np.repeat(np.arange(starts.size), np.diff(starts, append=values.size))
    lows, highs = np.minimum.reduceat(values, starts), np.maximum.reduceat(values, starts)
    ends = np.append(starts[1:], values.size) - 1
    kept = [starts, first_of_each(values == lows[place], place), first_of_each(values == highs[place], place), ends]
    chosen = np.unique(np.concatenate(kept))
    return times_s[chosen], values[chosen]


def first_of_each(marked: npt.NDArray[np.bool_], place: npt.NDArray[np.int64]) -> npt.NDArray[np.intp]:
    """Row of the first mark in each group; ``place`` is the number of the group of each row, ascending."""
    found = np.flatnonzero(marked)
    return found[np.unique(place[found], return_index=True)[1]]
