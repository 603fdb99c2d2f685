"""What follows from messages that meet nobody but modules that answer at once, and plants: known before the run.

Such a module answers what arrives in a step with one message on each of its links, whatever the tick. So who is told
what in which step of a tick is a function of the links on which something was sent, and one order says all of it.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from itertools import count
from typing import NamedTuple

from etac_ros.graph.graph import Graph

MOST_STEPS_A_TICK = 100
"""More have no end: the messages go round."""


class Hop(NamedTuple):
    """One module takes all that arrives at it in one step, and answers."""

    module: str
    step: int
    takes: tuple[int, ...]
    """Places of the messages in :attr:`Relay.messages`, in the order of the bag."""
    sends: tuple[int, ...]
    """Places of its answers, in the order of its links."""


@dataclass(frozen=True, slots=True, eq=False)
class Relay:
    """All that follows within a tick from some messages.

    Attributes
    ----------
    given
        How many messages it follows from.
    messages
        Link and step of each message, in the order of sending; those that are given come first.
    hops
        Who takes and answers, in order.
    touched
        Who takes something.
    """

    given: int
    messages: tuple[tuple[str, int], ...]
    hops: tuple[Hop, ...]
    touched: frozenset[str]


class Relays:
    """The relays of a graph, each made when it is first asked for.

    Parameters
    ----------
    graph
        Modules and links.
    """

    def __init__(self, graph: Graph) -> None:
        self._graph = graph
        self._place = {name: place for place, name in enumerate(graph.modules)}
        self._link_place = {name: place for place, name in enumerate(graph.links)}
        plants = frozenset(graph.plants)
        self._answering = frozenset(
            name for name, module in graph.modules.items() if module.answers or name in plants
        ) - frozenset(graph.told)
        self._found: dict[tuple[str, ...], Relay | None] = {}
        # Who is down takes nothing, and is another one afterwards.
        self._none = bool(graph.faults)

    def of(self, sent: tuple[str, ...]) -> Relay | None:
        """What follows from a message on each of these links, sent in step 0; None where it is not known beforehand."""
        if sent not in self._found:
            self._found[sent] = None if self._none or len(set(sent)) < len(sent) else self._made(sent)
        return self._found[sent]

    def _made(self, sent: Sequence[str]) -> Relay | None:
        messages = [(link, 0) for link in sent]
        hops: list[Hop] = []
        touched: set[str] = set()
        flying = list(range(len(messages)))
        for step in count(1):
            if not flying:
                return Relay(len(sent), tuple(messages), tuple(hops), frozenset(touched))
            if step > MOST_STEPS_A_TICK:
                return None
            bags: dict[str, list[int]] = {}
            for place in flying:
                link = self._graph.links[messages[place][0]]
                if not link.is_ideal or not self._answering.issuperset(link.receivers):
                    return None
                for receiver in link.receivers:
                    bags.setdefault(receiver, []).append(place)
            flying = []
            for name in sorted(bags, key=self._place.__getitem__):
                takes = sorted(bags[name], key=lambda place: self._link_place[messages[place][0]])
                first = len(messages)
                messages += [(link.name, step) for link in self._graph.sends[name]]
                sends = tuple(range(first, len(messages)))
                hops.append(Hop(name, step, tuple(takes), sends))
                flying += sends
            touched.update(bags)
        return None
