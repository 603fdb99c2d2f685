"""What became of frames on shared media as rows of numbers, for bags: a table laid out as truth is.

Columns: place of the link in the graph, and then those of :class:`~etac_ros.media.frame.Fate`, times in nanoseconds.
float64 holds them exactly for a hundred days. The tick of such a message is the one at which it was told.
"""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from etac_ros.media.frame import COLUMNS, Fate, Outcome
from etac_ros.parameters import FloatArray


def to_rows(fates: Sequence[Fate], links: Sequence[str]) -> FloatArray:
    """Rows of fates, given all links in the order of the graph."""
    places = {name: place for place, name in enumerate(links)}
    return np.array([(places[fate.link], *fate[1:]) for fate in fates], dtype=np.float64).reshape(-1, COLUMNS)


def from_rows(rows: FloatArray, links: Sequence[str]) -> list[Fate]:
    """The inverse of :func:`to_rows`.

    Raises
    ------
    ValueError
        If these are rows of something else.
    """
    if rows.shape[1] != COLUMNS or not (np.isfinite(rows).all() and (rows == np.floor(rows)).all()):
        raise ValueError(f"no rows of {COLUMNS} whole numbers")
    found = []
    for place, sequence, outcome, *times in rows.astype(np.int64).tolist():
        if not 0 <= place < len(links):
            raise ValueError(f"{place} is the place of no link")
        found.append(Fate(links[place], sequence, Outcome(outcome), *times))
    return found
