"""What the nodes of a real-time run note down of their own doing: a table, for bags and for everything measured later.

In simulated time the order of a run is laid down; in real time it is found out. Three things can happen at a node, each
a row of the same columns: it takes a message, it sends one, it wakes for an act of its own. Times are nanoseconds since
the instant of tick 0; float64 holds them, and all else, exactly for a hundred days.
"""

from __future__ import annotations

from collections.abc import Iterable
from enum import IntEnum
from typing import NamedTuple

import numpy as np

from etac_ros.parameters import FloatArray

NOTHING = -1
"""Place of the link where there is none."""


class Event(IntEnum):
    """What a row is about."""

    TAKEN = 1
    """A message was taken. ``tick``: from when on it counts at a plant, and else in which it came."""
    SENT = 2
    """A message was sent. ``tick``: for which it was meant; an act that is late was meant for an earlier one."""
    WOKEN = 3
    """The node woke for an act of its own. ``tick``: of the act."""
    STALE = 4
    """The node had acted at a tick whose sample then turned out to be another: its window came late."""
    STARVED = 5
    """The node needed a sample of a tick that no window had brought yet."""
    JOINED = 6
    """A process was in the run that took the place of one that a fault had killed. ``tick``: in which it was."""


class Entry(NamedTuple):
    """One row.

    Attributes
    ----------
    event
        What happened.
    link, sequence
        Place of the message's link in the graph, and its number; :data:`NOTHING` and 0 where there is none.
    tick
        See :class:`Event`.
    time_ns
        When, since the instant of tick 0 [ns].
    other_ns
        TAKEN: when the message was sent, by its source timestamp. WOKEN: the instant of the tick. JOINED: that of the
        tick at which the node was to go on. Else 0.
    cause, cause_sequence
        SENT: the message that made the node send; :data:`NOTHING` where it acted by itself.
        WOKEN: ``cause_sequence`` is how many ticks were missed.
    """

    event: Event
    link: int
    sequence: int
    tick: int
    time_ns: int
    other_ns: int = 0
    cause: int = NOTHING
    cause_sequence: int = 0


COLUMNS = len(Entry._fields)


def to_rows(entries: Iterable[Entry]) -> FloatArray:
    """Rows of numbers, shape (n, COLUMNS)."""
    return np.array(list(entries), dtype=np.float64).reshape(-1, COLUMNS)


def from_rows(rows: FloatArray) -> list[Entry]:
    """The inverse of :func:`to_rows`.

    Raises
    ------
    ValueError
        If these are rows of something else.
    """
    if rows.ndim != 2 or rows.shape[1] != COLUMNS or not (np.isfinite(rows).all() and (rows == np.floor(rows)).all()):
        raise ValueError(f"no rows of {COLUMNS} whole numbers")
    return [Entry(Event(event), *rest) for event, *rest in rows.astype(np.int64).tolist()]
