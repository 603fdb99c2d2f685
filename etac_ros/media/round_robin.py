"""Senders in turn, each a frame; who has nothing to send is passed over without loss of time."""

from __future__ import annotations

from collections.abc import Mapping, Sequence

from etac_ros.media.access import Air, Turn, Waiting, WithoutCollisions, ready
from etac_ros.media.frame import Line
from etac_ros.parameters import Parameters


class RoundRobinParameters(Parameters):
    """None: the order is that of the scenario."""


class RoundRobin(WithoutCollisions):
    """Senders in the order of the scenario, beginning behind the one who sent last."""

    Parameters = RoundRobinParameters

    def __init__(self, parameters: RoundRobinParameters, lines: Mapping[str, Line]) -> None:
        senders = dict.fromkeys(line.sender for line in lines.values())
        self._places = {sender: place for place, sender in enumerate(senders)}

    def turn(self, air: Air, waiting: Sequence[Waiting]) -> Turn:
        """The next sender of those that wait when the air is idle, and his oldest frame."""
        start, places = ready(air, waiting)
        after = self._places.get(air.last_sender, -1) + 1
        count = len(self._places)
        return Turn(
            start,
            (
                min(
                    places,
                    key=lambda place: (
                        (self._places[waiting[place].sender] - after) % count,
                        waiting[place].order,
                    ),
                ),
            ),
        )
