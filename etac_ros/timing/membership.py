"""Who is part of a run in real time whose faults kill processes and start others in their places. No I/O.

The processes of one node that follow each other are its **incarnations**: 0 is the one that was there from the start,
k the one that takes the place of the k-th that died. A new one knows nothing, so it numbers its messages from 1 again.
Numbers of an incarnation begin behind all those of the one before, so that a message has one number everywhere: in the
ledgers of those who sent and took it, and in the bag.
"""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from dataclasses import dataclass, field

from etac_ros.graph.faults import Fault, FaultKind
from etac_ros.maths.ticks import NANOSECONDS
from etac_ros.maths.wall_clock import WallClock

NUMBERS = 2**24
"""Numbers that each incarnation has on a topic; those of 256 of them fit into what a bag has for a number."""
_DEAD_NS = NANOSECONDS // 20
"""How long a node is without a process at least [wall ns]: by then, what the old one had sent has been stamped."""


def deaths_of(faults: Iterable[Fault], node: str) -> tuple[Fault, ...]:
    """The faults that kill a process of a node, in order."""
    return tuple(fault for fault in faults if fault.node == node and fault.kind is not FaultKind.STALL)


def restarts_of(faults: Iterable[Fault], node: str) -> tuple[Fault, ...]:
    """Those after which another takes its place: the k-th makes room for incarnation k."""
    return tuple(fault for fault in deaths_of(faults, node) if fault.kind is FaultKind.RESTART)


def mortals(faults: Iterable[Fault]) -> frozenset[str]:
    """Nodes of which a fault kills a process."""
    return frozenset(fault.node for fault in faults if fault.kind is not FaultKind.STALL)


def birth_ns(fault: Fault, clock: WallClock) -> int:
    """When the process is started that takes the place of one that was killed, on that clock [ns]."""
    return max(clock.instant_ns(fault.until_tick), clock.instant_ns(fault.from_tick) + _DEAD_NS)


def births_ns(faults: Iterable[Fault], node: str, clock: WallClock) -> tuple[int, ...]:
    """From when on incarnations 1, 2, ... of a node may have sent something, on that clock [ns]."""
    return tuple(birth_ns(fault, clock) for fault in restarts_of(faults, node))


def surely_there(faults: Iterable[Fault], node: str, born: Fault, clock: WallClock, within_ns: int) -> bool:
    """Whether a node has a process all the while in which another one is born and looks for it.

    Parameters
    ----------
    faults
        Of the run.
    node
        Who is looked for.
    born
        After which the other one is started.
    clock
        The instants of ticks.
    within_ns
        How long before and after its birth counts [ns].
    """
    birth = birth_ns(born, clock)
    for death in deaths_of(faults, node):
        back = birth_ns(death, clock) if death.kind is FaultKind.RESTART else None
        if clock.instant_ns(death.from_tick) <= birth + within_ns and (back is None or birth - within_ns <= back):
            return False
    return True


class Membership:
    """Who is there, who may come back, and who owes the run a last word.

    Parameters
    ----------
    faults
        What happens to processes, in the order in which it begins.
    """

    def __init__(self, faults: Sequence[Fault]) -> None:
        self._faults = tuple(faults)
        self.present: dict[str, int] = {}
        """By node that has come back: its newest incarnation that was let in."""

    def refuses(self, node: str, incarnation: int, tick: int) -> str:
        """Why a process is not let in; empty if it is, and from then on it is the node.

        Parameters
        ----------
        node, incarnation
            Who it says it is.
        tick
            The tick that it is.
        """
        restarts = restarts_of(self._faults, node)
        if not 1 <= incarnation <= len(restarts):
            return "comes back, and no fault of this scenario has made room for it"
        if self.present.get(node, 0) >= incarnation:
            return "is there twice"
        due = restarts[incarnation - 1].until_tick
        if tick < due:
            return f"comes back in tick {tick}, and is dead until tick {due}"
        self.present[node] = incarnation
        return ""

    def owes(self, node: str, tick: int) -> bool:
        """Whether the run waits at its end for the counts of a node: it has a process that was let in.

        Parameters
        ----------
        node
            Its name.
        tick
            The tick that it would be now, also behind the end of the run.
        """
        begun = [fault for fault in deaths_of(self._faults, node) if fault.from_tick <= tick]
        if not begun:
            return True
        restarts = [fault for fault in begun if fault.kind is FaultKind.RESTART]
        return begun[-1].kind is FaultKind.RESTART and self.present.get(node, 0) >= len(restarts)


@dataclass
class Succession:
    """The numbers of what one node's incarnations send on one topic, as one receiver gets them.

    Each incarnation's messages come once each, in order, and from the first one on. Only who was not there from the
    start, or may have been dead when the sender came back, may have missed the first ones.

    Parameters
    ----------
    births_ns
        From when on incarnations 1, 2, ... of the sender may have sent something, by the clock of source timestamps.
    may_miss
        Whether the receiver may have missed first messages.

    Attributes
    ----------
    spans
        By incarnation of which something came: its first and last message here, by its own numbers 1, 2, ...
    """

    births_ns: tuple[int, ...] = ()
    may_miss: bool = False
    spans: dict[int, tuple[int, int]] = field(default_factory=dict)
    _newest: int = 0

    def number(self, sequence: int, source_ns: int) -> int | None:
        """The number of the next message; None if it cannot be the next one.

        Parameters
        ----------
        sequence
            Its number at its own publisher: 1, 2, ...
        source_ns
            When it was published [ns].
        """
        incarnation = sum(birth <= source_ns for birth in self.births_ns)
        if incarnation < self._newest or not 0 < sequence < NUMBERS:
            return None
        span = self.spans.get(incarnation)
        if span is None:
            if sequence != 1 and not self.may_miss:
                return None
            span = sequence, sequence
        elif sequence != span[1] + 1:
            return None
        self._newest = incarnation
        self.spans[incarnation] = span[0], sequence
        return incarnation * NUMBERS + sequence

    def noted(self) -> list[list[int]]:
        """As notes have it: incarnation, first and last."""
        return [[incarnation, *span] for incarnation, span in self.spans.items()]
