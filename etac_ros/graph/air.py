"""What became of frames on the air as rows of numbers, for bags: a table laid out as truth is.

Columns: place of the link in the graph - for the acknowledgements of its first receiver as much more as there are
links, of its second twice as much - and then those of :class:`~etac_ros.media.frame.Fate`, times in nanoseconds.
float64 holds them exactly for a hundred days. The tick of such a message is the one at which it was told.
"""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from etac_ros.media.frame import COLUMNS, Fate, Outcome, answering_line, link_and_place
from etac_ros.parameters import FloatArray


def to_rows(fates: Sequence[Fate], links: Sequence[str]) -> FloatArray:
    """Rows of fates, given all links in the order of the graph."""
    places = {name: place for place, name in enumerate(links)}
    rows = [(places[link] + answers * len(links), *fate[1:]) for fate, link, answers in map(_named, fates)]
    return np.array(rows, dtype=np.float64).reshape(-1, COLUMNS)


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
        if place < 0 or not links:
            raise ValueError(f"{place} is the place of no link")
        answers, link = divmod(place, len(links))
        line = answering_line(links[link], answers) if answers else links[link]
        found.append(Fate(line, sequence, Outcome(outcome), *times))
    return found


def _named(fate: Fate) -> tuple[Fate, str, int]:
    return (fate, *link_and_place(fate.link))
