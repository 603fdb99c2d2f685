"""A frame on a medium, and what became of it. Times are integer nanoseconds of simulated time."""

from __future__ import annotations

from enum import IntEnum
from typing import NamedTuple


class Line(NamedTuple):
    """What every frame of a line has in common: of a link, or of a receiver's acknowledgements of its messages."""

    sender: str
    payload_bytes: int
    frame_bytes: int
    duration_ns: int
    answers: bool = False
    """Whether these are acknowledgements."""


class Outcome(IntEnum):
    """How a frame's wait or its time on the air ended."""

    SENT = 1
    """It was on the air alone: whether a receiver gets it is up to the link's channel."""
    COLLIDED = 2
    """It was on the air together with another; it tries again."""
    GIVEN_UP = 3
    """The last such try."""
    DROPPED = 4
    """It never was on the air: its queue had no place for it."""


class Fate(NamedTuple):
    """One row of what a medium did."""

    link: str
    sequence: int
    outcome: Outcome
    offered_ns: int
    start_ns: int
    end_ns: int
    """Of its time on the air; both the time of the drop where it never was there."""
    landed_ns: int
    """When it has reached the receivers, after the propagation delay."""
    attempt: int = 1
    """Of a message that is sent again; of an acknowledgement, the attempt that it answers."""


COLUMNS = len(Fate._fields)


_ANSWERS = "<-"


def answering_line(link: str, place: int) -> str:
    """The line of the acknowledgements of a link's receiver, by its place among the receivers: 1, 2, ..."""
    return f"{link}{_ANSWERS}{place}"


def link_and_place(line: str) -> tuple[str, int]:
    """The inverse: the link, and the place of the receiver that acknowledges; 0 for the link's own messages."""
    link, found, place = line.rpartition(_ANSWERS)
    return (link, int(place)) if found and place.isdecimal() else (line, 0)


def landing_tick(landed_ns: int, ticks_per_second: int) -> int:
    """The first tick that is not before a time: what lands between two ticks is there at the later one."""
    return -(-landed_ns * ticks_per_second // 1_000_000_000)
