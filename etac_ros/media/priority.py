"""Arbitration by priority without loss of time, as on a CAN bus (ISO 11898-1): the most important waits least."""

from __future__ import annotations

from collections.abc import Mapping, Sequence

from etac_ros.media.access import Air, Turn, Waiting, WithoutCollisions, ready
from etac_ros.media.frame import Line, link_and_place
from etac_ros.parameters import Parameters


class PriorityParameters(Parameters):
    """Parameters of :class:`Priority`."""

    order: tuple[str, ...] = ()
    """Links, the most important first; others follow in the order of the scenario."""


class Priority(WithoutCollisions):
    """The most important frame goes first; one that is on the air is not interrupted."""

    Parameters = PriorityParameters

    def __init__(self, parameters: PriorityParameters, lines: Mapping[str, Line]) -> None:
        unknown = [link for link in parameters.order if link not in lines]
        if unknown:
            raise ValueError(f"order names {', '.join(unknown)}; links on this medium are {', '.join(lines)}")
        ranks = {link: rank for rank, link in enumerate(dict.fromkeys([*parameters.order, *lines]))}
        # An acknowledgement is as important as its link: the oldest of both goes first.
        self._rank = {line: ranks[link_and_place(line)[0] if lines[line].answers else line] for line in lines}

    def turn(self, air: Air, waiting: Sequence[Waiting]) -> Turn:
        """The most important of those that wait when the air is idle."""
        start, places = ready(air, waiting)
        return Turn(start, (min(places, key=lambda place: (self._rank[waiting[place].link], waiting[place].order)),))
