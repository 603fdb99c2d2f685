"""One queue for all: who was offered first is sent first."""

from __future__ import annotations

from collections.abc import Mapping, Sequence

from etac_ros.media.access import Air, Turn, Waiting, WithoutCollisions, ready
from etac_ros.media.frame import Line
from etac_ros.parameters import Parameters


class FifoParameters(Parameters):
    """None."""


class Fifo(WithoutCollisions):
    """First in, first out, over all senders: a point-to-point link, or a perfectly coordinated medium."""

    Parameters = FifoParameters

    def __init__(self, parameters: FifoParameters, lines: Mapping[str, Line]) -> None:
        pass

    def turn(self, air: Air, waiting: Sequence[Waiting]) -> Turn:
        """The oldest."""
        start, places = ready(air, waiting)
        return Turn(start, (min(places, key=lambda place: waiting[place].order),))
