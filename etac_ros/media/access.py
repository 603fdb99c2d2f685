"""Who may send next on a medium: the contract of an access rule. One rule is one class in one file.

A rule has no memory. It is asked whenever something has changed, and its answer holds until something is offered
before it begins; what it needs to know of the past, it is told.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import Any, ClassVar, NamedTuple, Protocol

from etac_ros.maths.noise import uniform
from etac_ros.media.frame import Line

_MOST_FRAMES = 2**40
"""Of a link: draws of a turn stand side by side, where those of neighbours come cheap."""


class Waiting(NamedTuple):
    """The first frame in the queue of a link."""

    link: str
    sender: str
    since_ns: int
    """When it was offered."""
    duration_ns: int
    """Its time on the air."""
    order: int
    """Place among all that was ever offered to the medium."""
    turns: int
    """How often it has had to see others begin, or collided, since it was the first."""
    collisions: int
    key: int
    sequence: int
    answers: bool = False
    """Whether it acknowledges another frame: the sender of that one waits for it."""

    def drawn(self) -> float:
        """A uniform deviate in (0, 1) of this frame in this turn: the same whenever it is asked for."""
        return uniform(self.key, self.turns * _MOST_FRAMES + self.sequence)


class Air(NamedTuple):
    """What there is to know of the medium."""

    idle_ns: int
    """Since when, or from when on, nobody sends."""
    last_sender: str
    """Who sent last; empty before anybody has."""
    now_ns: int = 0
    """Up to when all is settled: nothing begins before. It matters to a rule by which a frame waits of its own will, so
    that one which has just become the first in its queue might have begun already."""


class Turn(NamedTuple):
    """Who sends next."""

    start_ns: int
    """Not before the air is idle, nor before the frames were offered, nor before now."""
    places: tuple[int, ...]
    """Places of the frames in what was waiting; several collide."""


class Access(Protocol):
    """An access rule.

    Parameters
    ----------
    parameters
        Of its class ``Parameters``.
    lines
        What the medium carries, by link, in the order of the scenario.

    Raises
    ------
    ValueError
        If it cannot serve these, with the reason in words.
    """

    Parameters: ClassVar[type[Any]]

    def __init__(self, parameters: Any, lines: Mapping[str, Line]) -> None: ...

    def turn(self, air: Air, waiting: Sequence[Waiting]) -> Turn:
        """Who of those that wait, one or more, sends next, and when."""
        ...

    def may_retry(self, collisions: int) -> bool:
        """Whether a frame that has collided so often tries again."""
        ...


class WithoutCollisions:
    """The base of rules under which nothing collides."""

    def may_retry(self, collisions: int) -> bool:
        """Yes; it never comes to that."""
        return True


def ready(air: Air, waiting: Sequence[Waiting]) -> tuple[int, list[int]]:
    """The first instant at which the air is idle and somebody waits, and who does then."""
    start = max(air.idle_ns, min(one.since_ns for one in waiting))
    return start, [place for place, one in enumerate(waiting) if one.since_ns <= start]
