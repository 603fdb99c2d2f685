"""A shared medium: queues, the access rule, and what is on the air. A state machine in integer nanoseconds, no I/O."""

from __future__ import annotations

from collections import deque
from collections.abc import Mapping
from dataclasses import dataclass, field
from enum import StrEnum
from typing import Any

from etac_ros.errors import ProtocolError
from etac_ros.maths.noise import stream_key
from etac_ros.media.access import Access, Air, Turn, Waiting
from etac_ros.media.frame import Fate, Line, Outcome


class Full(StrEnum):
    """What is dropped when the queue of a sender is full."""

    NEWEST = "newest"
    """What has just been offered."""
    OLDEST = "oldest"
    """What has waited longest."""
    REPLACE = "replace"
    """Full or not: of each link only its latest value waits, in the place of the one before."""


@dataclass(frozen=True, slots=True)
class MediumPlan:
    """What a medium is: all that does not change in a run.

    Attributes
    ----------
    name
        As links join it.
    seed
        Of its draws.
    rate_bit_s
        What it carries [bit/s].
    propagation_ns
        From the end of a frame to its arrival [ns].
    queue_length, queue_full
        Frames that wait at a sender at most, and what is dropped then.
    lines
        What it carries, by link.
    access
        The access rule; None of a medium in a bag, which has been run.
    powers_w
        Of a radio that sends, and of one that receives [W]; None where nobody said.
    """

    name: str
    seed: int
    rate_bit_s: float
    propagation_ns: int
    queue_length: int
    queue_full: Full
    lines: Mapping[str, Line]
    access: Access | Any | None
    powers_w: tuple[float, float] | None = None


@dataclass(slots=True)
class _Queued:
    link: str
    sequence: int
    offered_ns: int
    order: int
    attempt: int
    line: Line
    key: int
    turns: int = 0
    collisions: int = 0


@dataclass
class Medium:
    """The state of a medium in one run.

    Parameters
    ----------
    plan
        What it is.
    """

    plan: MediumPlan
    _queues: dict[str, deque[_Queued]] = field(init=False)
    _keys: dict[tuple[str, int], int] = field(default_factory=dict)
    _waiting_at: dict[str, int] = field(init=False)
    _flying: list[Fate] = field(default_factory=list)
    _log: list[Fate] = field(default_factory=list)
    _offered: int = 0
    _waits: int = 0
    """Frames in all queues."""
    _now: int = 0
    _air: Air = field(default_factory=lambda: Air(0, ""))
    _turn: Turn | None = None
    _is_planned: bool = False
    _event_ns: int | None = None
    _heads: list[_Queued] = field(default_factory=list)

    def __post_init__(self) -> None:
        plan = self.plan
        self._queues = {link: deque() for link in plan.lines}
        self._waiting_at = {line.sender: 0 for line in plan.lines.values()}

    def offer(self, link: str, sequence: int, now_ns: int, attempt: int = 1) -> None:
        """Take a message that wants to be sent now; whatever was to begin before has begun (:meth:`advance`)."""
        line = self.plan.lines[link]
        sender = line.sender
        frame = _Queued(link, sequence, now_ns, self._offered, attempt, line, self._key(link, attempt))
        self._offered += 1
        self._is_planned = False
        full = self.plan.queue_full
        if full is Full.REPLACE and self._queues[link]:
            self._drop(self._queues[link].pop(), now_ns)
        elif self._waiting_at[sender] >= self.plan.queue_length:
            if full is not Full.OLDEST:
                self._log.append(_never_sent(frame, now_ns))
                return
            of_sender = (queue[0] for name, queue in self._queues.items() if queue and self._sender(name) == sender)
            oldest = min(of_sender, key=lambda queued: queued.order)
            self._queues[oldest.link].popleft()
            self._drop(oldest, now_ns)
        self._queues[link].append(frame)
        self._waiting_at[sender] += 1
        self._waits += 1

    def next_ns(self) -> int | None:
        """When something happens next that others have to know, unless something is offered before; None for never."""
        if not self._is_planned:
            self._plan()
        return self._event_ns

    def advance(self, until_ns: int) -> list[Fate]:
        """Begin all that begins before a time, and hand out what has landed up to it."""
        while (turn := self._next_turn()) is not None and turn.start_ns < until_ns:
            self._begin(turn)
        self._now = until_ns
        if not self._flying:
            return []
        landed = [fate for fate in self._flying if fate.landed_ns <= until_ns]
        if landed:
            self._flying = [fate for fate in self._flying if fate.landed_ns > until_ns]
            self._is_planned = False
        return landed

    @property
    def has_log(self) -> bool:
        """Whether anything has become of a frame since the log was last taken."""
        return bool(self._log)

    def take_log(self) -> list[Fate]:
        """What has become of frames since the last call, in the order in which it did."""
        taken, self._log = self._log, []
        return taken

    def _key(self, link: str, attempt: int) -> int:
        """Of the draws of a frame: each attempt has its own."""
        known = self._keys.get((link, attempt))
        if known is None:
            which = "" if attempt == 1 else f" again {attempt}"
            known = stream_key(self.plan.seed, f"medium/{self.plan.name}/{link}{which}")
            self._keys[link, attempt] = known
        return known

    def _sender(self, link: str) -> str:
        return self.plan.lines[link].sender

    def _drop(self, frame: _Queued, now_ns: int) -> None:
        self._waiting_at[frame.line.sender] -= 1
        self._waits -= 1
        self._log.append(_never_sent(frame, now_ns))

    def _next_turn(self) -> Turn | None:
        if not self._is_planned:
            self._plan()
        return self._turn

    def _plan(self) -> None:
        """Ask the access rule who is next: once for every change, however often others want to know."""
        self._is_planned = True
        if self._waits:
            self._heads = [queue[0] for queue in self._queues.values() if queue]
            self._turn = self._asked()
            self._event_ns = self._end(self._turn) + self.plan.propagation_ns
        else:  # quickly: most frames wait for nobody, and nobody for them
            self._heads, self._turn, self._event_ns = [], None, None
        for fate in self._flying:
            if self._event_ns is None or fate.landed_ns < self._event_ns:
                self._event_ns = fate.landed_ns

    def _asked(self) -> Turn:
        assert self.plan.access is not None
        waiting = [
            Waiting(
                head.link, head.line.sender, head.offered_ns, head.line.duration_ns, head.order, head.turns,
                head.collisions, head.key, head.sequence, head.line.answers,
            )
            for head in self._heads
        ]  # fmt: skip
        return self._checked(self.plan.access.turn(Air(*self._air[:2], self._now), waiting))

    def _checked(self, turn: Turn) -> Turn:
        """Hold the rule to its promise: anybody's class may be one."""
        if turn.places == (0,) and turn.start_ns >= max(self._air.idle_ns, self._now, self._heads[0].offered_ns):
            return turn  # quickly: the usual case
        chosen = [self._heads[place] for place in turn.places if 0 <= place < len(self._heads)]
        if not chosen or len(chosen) != len(turn.places) or len(set(turn.places)) != len(turn.places):
            raise self._broken(f"places {turn.places} of {len(self._heads)}", "one or more of those that wait, once")
        earliest = max(self._air.idle_ns, self._now, *(frame.offered_ns for frame in chosen))
        if turn.start_ns < earliest:
            raise self._broken(f"a start at {turn.start_ns} ns", f"{earliest} ns or later: idle, offered, and not past")
        return turn

    def _broken(self, found: str, expected: str) -> ProtocolError:
        name = type(self.plan.access).__name__
        return ProtocolError(f"medium {self.plan.name}", f"{name}.turn returned {found}", expected)

    def _end(self, turn: Turn) -> int:
        if len(turn.places) == 1:
            return turn.start_ns + self._heads[turn.places[0]].line.duration_ns
        return turn.start_ns + max(self._heads[place].line.duration_ns for place in turn.places)

    def _begin(self, turn: Turn) -> None:
        """Put the frames of a turn on the air, to the end: what has begun is not interrupted."""
        assert self.plan.access is not None
        chosen = [self._heads[place] for place in turn.places]
        for head in self._heads:
            head.turns += 1
        alone = len(chosen) == 1
        for frame in chosen:
            line = frame.line
            end = turn.start_ns + line.duration_ns
            outcome = Outcome.SENT
            if not alone:
                frame.collisions += 1
                retry = self.plan.access.may_retry(frame.collisions)
                outcome = Outcome.COLLIDED if retry else Outcome.GIVEN_UP
            if outcome is not Outcome.COLLIDED:
                self._queues[frame.link].popleft()
                self._waiting_at[line.sender] -= 1
                self._waits -= 1
            fate = Fate(
                frame.link, frame.sequence, outcome, frame.offered_ns, turn.start_ns, end,
                end + self.plan.propagation_ns, frame.attempt,
            )  # fmt: skip
            self._log.append(fate)
            if alone:
                self._flying.append(fate)
        self._air = Air(self._end(turn), chosen[-1].line.sender)
        self._is_planned = False


def _never_sent(frame: _Queued, now_ns: int) -> Fate:
    return Fate(frame.link, frame.sequence, Outcome.DROPPED, frame.offered_ns, now_ns, now_ns, now_ns, frame.attempt)
