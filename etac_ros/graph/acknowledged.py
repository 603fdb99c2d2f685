"""Acknowledged links: what is sent again and when, what a receiver takes, and what the sender knows of that.

The protocol is stop and wait with the newest value: a message that is acknowledged in time is done, one that is not is
sent again, and one that has been followed by another is not sent again, since what counts is what is held. A receiver
takes a message once and none that is older than what it has taken; it acknowledges the newest as often as it comes.
(M. Guinaldo et al., CDC 2012, call the sender's part "wait for acknowledgment".)

All this is a function of when messages were sent and of what became of frames on the air. The time master runs it
ahead, and whoever replays a recording runs it over the fates that the recording holds: so both have the same events.
Times are integer nanoseconds. At one instant the older message comes first, and of one message :class:`_Rank` decides.
"""

from __future__ import annotations

import heapq
from collections.abc import Callable, Iterable, Sequence
from dataclasses import dataclass, field
from enum import IntEnum, StrEnum
from typing import NamedTuple

from etac_ros.graph.channel import Way
from etac_ros.graph.graph import Link
from etac_ros.maths.ticks import nanoseconds
from etac_ros.media.frame import Fate, Outcome, landing_tick


class End(StrEnum):
    """How the wait for the acknowledgement of a message ended."""

    ACKNOWLEDGED = "acknowledged"
    GIVEN_UP = "given up"
    """The last try has not been acknowledged in time."""
    SUPERSEDED = "superseded"
    """A newer message has taken its place."""


class Taken(NamedTuple):
    """A receiver has got a message for the first time."""

    link: str
    receiver: str
    sequence: int
    at_ns: int


class Ended(NamedTuple):
    """The sender waits no longer."""

    link: str
    sequence: int
    end: End
    at_ns: int


Event = Taken | Ended
Transmit = Callable[[str, int, int, int], None]
"""Puts a frame on its way: line, sequence number, attempt, time [ns]."""


class _Rank(IntEnum):
    """Order of what happens to a message at one instant: what has been received counts before time is up."""

    SENT = 0
    ARRIVES = 1
    ANSWERED = 2
    TIMEOUT = 3


@dataclass(slots=True)
class _State:
    """Of a link: what waits for its acknowledgement, and what each receiver has taken last."""

    link: Link
    ways: dict[str, Way]
    backs: dict[str, Way]
    taken: dict[str, int]
    waiting: int = 0
    attempt: int = 0
    answered: set[str] = field(default_factory=set)


class Conversations:
    """The state of acknowledged links in one run.

    Parameters
    ----------
    links
        Those of a graph that are acknowledged.
    ticks_per_second
        Rate of its grid.
    transmit
        Called for each frame of theirs; without it they are taken from a recording, by :meth:`hear`.
    """

    def __init__(self, links: Iterable[Link], ticks_per_second: int, transmit: Transmit | None = None) -> None:
        self._rate = ticks_per_second
        self._transmit = transmit
        self._states: dict[str, _State] = {}
        self._receivers: dict[str, tuple[str, str]] = {}
        self._heap: list[tuple[int, int, int, int, tuple[str, str, int]]] = []
        self._count = 0
        for link in links:
            assert link.acknowledged is not None
            ways = {name: Way(link.channel, name) for name in link.receivers}
            backs = {name: Way(link.channel, name, back=True) for name in link.acknowledged.by}
            self._states[link.name] = _State(link, ways, backs, dict.fromkeys(link.receivers, 0))
            self._receivers |= {line: (link.name, name) for name, line in link.acknowledged.by.items()}

    def say(self, link: str, sequence: int, now_ns: int) -> None:
        """A message is sent, the newest of its link; :meth:`advance` makes the first try of it."""
        self._push(now_ns, _Rank.SENT, link, "", sequence, 0)

    def hear(self, fate: Fate) -> None:
        """Take what became of a frame, in the order in which it did; frames of other links are passed over."""
        if fate.outcome is Outcome.COLLIDED:
            return
        answered = self._receivers.get(fate.link)
        if answered is not None:
            self._answer_flies(*answered, fate)
            return
        state = self._states.get(fate.link)
        if state is None:
            return
        assert state.link.acknowledged is not None
        if fate.outcome is Outcome.SENT:
            for receiver, way in state.ways.items():
                self._arrive(_Rank.ARRIVES, way, fate.link, receiver, fate)
        self._push(
            fate.end_ns + state.link.acknowledged.timeout_ns, _Rank.TIMEOUT, fate.link, "", fate.sequence, fate.attempt
        )

    def next_ns(self) -> int | None:
        """When something happens next, as far as is known; None for never."""
        return self._heap[0][0] if self._heap else None

    def advance(self, until_ns: int) -> list[Event]:
        """All that happens up to a time, in order."""
        events: list[Event] = []
        while self._heap and self._heap[0][0] <= until_ns:
            now, sequence, rank, _, (link, receiver, attempt) = heapq.heappop(self._heap)
            state = self._states[link]
            if rank == _Rank.SENT:
                self._begin(state, sequence, now, events)
            elif rank == _Rank.TIMEOUT:
                self._time_is_up(state, sequence, attempt, now, events)
            elif rank == _Rank.ARRIVES:
                self._take(state, receiver, sequence, attempt, now, events)
            else:
                self._answered(state, receiver, sequence, now, events)
        return events

    def _begin(self, state: _State, sequence: int, now: int, events: list[Event]) -> None:
        if state.waiting:
            events.append(Ended(state.link.name, state.waiting, End.SUPERSEDED, now))
        state.waiting, state.attempt = sequence, 1
        state.answered.clear()
        self._send(state.link.name, sequence, 1, now)

    def _time_is_up(self, state: _State, sequence: int, attempt: int, now: int, events: list[Event]) -> None:
        if (state.waiting, state.attempt) != (sequence, attempt):
            return
        assert state.link.acknowledged is not None
        if attempt > state.link.acknowledged.retries:
            state.waiting = 0
            events.append(Ended(state.link.name, sequence, End.GIVEN_UP, now))
            return
        state.attempt += 1
        self._send(state.link.name, sequence, state.attempt, now)

    def _take(self, state: _State, receiver: str, sequence: int, attempt: int, now: int, events: list[Event]) -> None:
        if sequence < state.taken[receiver]:
            return
        if sequence > state.taken[receiver]:
            state.taken[receiver] = sequence
            events.append(Taken(state.link.name, receiver, sequence, now))
        assert state.link.acknowledged is not None
        if receiver in state.backs:
            self._send(state.link.acknowledged.by[receiver], sequence, attempt, now)

    def _answered(self, state: _State, receiver: str, sequence: int, now: int, events: list[Event]) -> None:
        if sequence != state.waiting:
            return
        assert state.link.acknowledged is not None
        state.answered.add(receiver)
        if state.link.acknowledged.any_suffices or len(state.answered) == len(state.backs):
            state.waiting = 0
            events.append(Ended(state.link.name, sequence, End.ACKNOWLEDGED, now))

    def _answer_flies(self, link: str, receiver: str, fate: Fate) -> None:
        if fate.outcome is Outcome.SENT:
            self._arrive(_Rank.ANSWERED, self._states[link].backs[receiver], link, receiver, fate)

    def _arrive(self, rank: _Rank, way: Way, link: str, receiver: str, fate: Fate) -> None:
        """What has landed goes through the channel, whose delays are whole ticks; without one it is there at once."""
        landed = landing_tick(fate.landed_ns, self._rate)
        for tick in way.arrivals(fate.sequence, landed, fate.attempt):
            at = fate.landed_ns if tick == landed else nanoseconds(tick, self._rate)
            self._push(at, rank, link, receiver, fate.sequence, fate.attempt)

    def _send(self, line: str, sequence: int, attempt: int, now: int) -> None:
        if self._transmit is not None:
            self._transmit(line, sequence, attempt, now)

    def _push(self, at: int, rank: _Rank, link: str, receiver: str, sequence: int, attempt: int) -> None:
        self._count += 1
        heapq.heappush(self._heap, (at, sequence, rank, self._count, (link, receiver, attempt)))


def replayed(link: Link, sent: Sequence[tuple[int, int]], fates: Iterable[Fate], ticks_per_second: int) -> list[Event]:
    """All that happened on an acknowledged link.

    Parameters
    ----------
    link
        Of the graph.
    sent
        Sequence number and tick of each of its messages, in order.
    fates
        What became of frames, of all links, in the order in which it did.
    ticks_per_second
        Rate of the grid.

    Returns
    -------
    list
        In order; also what lies behind the end of the run.
    """
    conversation = Conversations([link], ticks_per_second)
    for sequence, tick in sent:
        conversation.say(link.name, sequence, nanoseconds(tick, ticks_per_second))
    for fate in fates:
        conversation.hear(fate)
    last = conversation.next_ns()
    events: list[Event] = []
    while last is not None:
        events += conversation.advance(last)
        last = conversation.next_ns()
    return events
