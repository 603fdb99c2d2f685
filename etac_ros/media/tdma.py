"""Time slots by sender: each has the air to himself for a slot of every cycle, used or not."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from fractions import Fraction

from pydantic import PositiveFloat

from etac_ros.media.access import Air, Turn, Waiting, WithoutCollisions
from etac_ros.media.frame import Line
from etac_ros.parameters import Parameters


class TdmaParameters(Parameters):
    """Parameters of :class:`Tdma`."""

    slot_s: PositiveFloat
    """Length of a slot [s], in whole nanoseconds."""
    senders: tuple[str, ...] = ()
    """Whose the slots of a cycle are, in their order; default: one for each sender, in the order of the scenario."""


class Tdma(WithoutCollisions):
    """A frame begins in a slot of its sender, and only where it ends before the slot does. A cycle begins at time 0."""

    Parameters = TdmaParameters

    def __init__(self, parameters: TdmaParameters, lines: Mapping[str, Line]) -> None:
        self._slot = int(Fraction(repr(parameters.slot_s)) * 1_000_000_000)
        senders = tuple(dict.fromkeys(line.sender for line in lines.values()))
        slots = tuple("/" + name.strip("/") for name in parameters.senders) or senders
        left_out = [sender for sender in senders if sender not in slots]
        if left_out:
            raise ValueError(f"the slots leave out {', '.join(left_out)}; write senders: [{', '.join(senders)}]")
        for link, line in lines.items():
            if line.duration_ns > self._slot:
                least = line.duration_ns * 1e-9
                raise ValueError(
                    f"a frame of link {link} takes {least:.6g} s, longer than a slot; write slot_s: {least:.6g} or more"
                )
        self._starts = {
            sender: [place * self._slot for place, owner in enumerate(slots) if owner == sender] for sender in senders
        }
        self._cycle = len(slots) * self._slot

    def turn(self, air: Air, waiting: Sequence[Waiting]) -> Turn:
        """Who can begin first; of those who can at the same time the oldest."""
        start, _, place = min(
            (self._earliest(one, max(air.idle_ns, one.since_ns)), one.order, place) for place, one in enumerate(waiting)
        )
        return Turn(start, (place,))

    def _earliest(self, frame: Waiting, after: int) -> int:
        """The first instant from then on at which a frame fits into a slot of its sender."""
        found = []
        for first in self._starts[frame.sender]:
            inside = (after - first) % self._cycle
            fits = inside + frame.duration_ns <= self._slot
            found.append(after if fits else after + self._cycle - inside)
        return min(found)
