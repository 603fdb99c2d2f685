"""What the time master tells the modules to do, and what they report: calls in process, messages over DDS.

Tuples, because a run makes thousands of them, and a frozen dataclass takes three times as long.
"""

from __future__ import annotations

from typing import NamedTuple

from etac_ros.timing.relays import Relay


class MessageId(NamedTuple):
    """A message: its link and its sequence number on it (1, 2, ...), which is also its RTPS sequence number."""

    link: str
    sequence: int


class Settled(NamedTuple):
    """The wait of a sender for the acknowledgement of a message is over."""

    link: str
    sequence: int
    acknowledged: bool
    """False where the last try was in vain."""


class Open(NamedTuple):
    """Plant: commit up to ``tick`` and compute ``length`` samples under what is held now."""

    module: str
    tick: int
    length: int
    grant: int
    """Last tick up to which the only reader may act without asking; -1 for no such leave."""


class Look(NamedTuple):
    """Name your first own act after this tick. With a grant, act at once if it lies no later than that."""

    module: str
    after: int
    grant: int


class Fire(NamedTuple):
    """Act by yourself at this tick."""

    module: str
    tick: int
    epoch: int = 0
    """The window that the module has to see first; 0 if it reads no plant."""
    alone: bool = False
    """Nobody else acts at this tick, and nothing arrives: a module that concludes does so at once."""


class Deliver(NamedTuple):
    """Take these messages, in this order, as all that arrives in one step."""

    module: str
    tick: int
    step: int
    messages: tuple[MessageId, ...]
    epoch: int = 0
    """The window that the module has to see first; 0 if it reads no plant. A passive module does not report on
    windows, so this order may overtake one."""
    settled: tuple[Settled, ...] = ()
    """What became of its own messages: known before what arrives. Alone, it is nothing to receive."""


class Forward(NamedTuple):
    """All modules that only answer: take what follows from the messages that have just been sent, in all its steps.

    It stands for an order to deliver a module and step, where all are obeyed in one process.
    """

    module: str
    """The first who has sent some of them."""
    tick: int
    relay: Relay


class Close(NamedTuple):
    """Plant: commit up to ``tick``; the run ends there."""

    module: str
    tick: int


Order = Open | Look | Fire | Deliver | Forward | Close


class Report(NamedTuple):
    """Answer to one order."""

    sent: tuple[str, ...] = ()
    """Links on which a message was sent, in order."""
    proposal: int | None = None
    """After Look: the tick of the first own act."""
    fired: bool = False
    """After Look with a grant: the proposal has been acted on already, and ``sent`` tells what came of it."""
    concluded: tuple[str, ...] | None = None
    """Links on which a module that was alone has sent in the step after; None if it has not concluded yet."""
    halt: str = ""
    """A watch asks to end the run at this tick, and why."""
    last: int | None = None
    """After Open: the last tick of the window, where it is shorter than was asked for."""
    missing: tuple[int, ...] = ()
    """After Forward: places in its messages of those that were not sent, since a watch has ended the run."""
    compared: tuple[float, ...] | None = None
    """What a module's rule compares with from now on, where a plant's windows may end by it: a hint. Empty while that
    cannot be told; None where there is nothing new. Good for one act."""


class Transit(NamedTuple):
    """A message's place in time: what the message log of a run is made of."""

    link: str
    sequence: int
    tick: int
    step: int
