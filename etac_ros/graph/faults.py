"""Faults of a run: which module is dead or stands still, between which ticks. A pure function of the tick.

A module that is down at a tick does not act at it, and nothing arrives at it then. What would have arrived is lost to a
process that is dead; the queue of one that is merely stopped keeps it, so it comes when the module goes on.
"""

from __future__ import annotations

from dataclasses import dataclass
from enum import StrEnum


class FaultKind(StrEnum):
    """What happens to a process."""

    KILL = "kill"
    """It dies, for good."""
    STALL = "stall"
    """It stands still for a while, and goes on with what it knew and what came meanwhile (SIGSTOP, SIGCONT)."""
    RESTART = "restart"
    """It dies, and after a while another one takes its place, which knows nothing of what was before."""


@dataclass(frozen=True, slots=True)
class Fault:
    """One fault.

    Attributes
    ----------
    name
        Its key in the scenario.
    node
        Full name of the module.
    kind
        What happens to it.
    from_tick, until_tick
        It is down at the ticks from the one to before the other; a kill lasts until the end of the run.
    """

    name: str
    node: str
    kind: FaultKind
    from_tick: int
    until_tick: int

    def covers(self, tick: int) -> bool:
        """Whether the module is down at a tick because of it."""
        return self.from_tick <= tick < self.until_tick


def reaches(faults: tuple[Fault, ...], tick: int) -> int | None:
    """When what arrives at a module at a tick really reaches it; None if never.

    Parameters
    ----------
    faults
        Of the module, in order; they do not overlap.
    tick
        At which it arrives.
    """
    for fault in faults:
        if fault.covers(tick):
            if fault.kind is not FaultKind.STALL:
                return None
            tick = fault.until_tick  # at which the next fault may begin
    return tick
