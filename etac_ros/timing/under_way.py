"""All that is under way on the air: frames on shared media, and what acknowledged links wait for. No I/O.

Media and acknowledgements have a time of their own, in nanoseconds, which runs on between ticks: a frame lands, it is
acknowledged, it is sent again. The time master looks at it once a tick, and is told what has come of it.
"""

from __future__ import annotations

from typing import NamedTuple

from etac_ros.graph.acknowledged import Conversations, End, Ended, Event
from etac_ros.graph.channel import Way
from etac_ros.graph.graph import Graph
from etac_ros.maths.ticks import nanoseconds
from etac_ros.media.frame import Fate, Outcome, landing_tick
from etac_ros.media.medium import Medium
from etac_ros.timing.orders import MessageId


class Arrival(NamedTuple):
    """A message reaches a receiver."""

    receiver: str
    message: MessageId
    tick: int


News = Arrival | Ended


class UnderWay:
    """What is on the air in one run.

    Parameters
    ----------
    graph
        Its media and links.

    Attributes
    ----------
    log
        What has become of frames since it was last taken.
    """

    def __init__(self, graph: Graph) -> None:
        self.log: list[Fate] = []
        self._rate = graph.ticks_per_second
        media = {name: Medium(plan) for name, plan in graph.media.items()}
        self._in_order = tuple(media.values())
        self._on = {line: media[name] for name, plan in graph.media.items() for line in plan.lines}
        self._acknowledged = frozenset(link.name for link in graph.acknowledged)
        self._ways = {
            link.name: tuple((name, None if link.channel.ideal else Way(link.channel, name)) for name in link.receivers)
            for link in graph.links.values()
            if link.medium and link.acknowledged is None
        }
        self._talk = Conversations(graph.acknowledged, graph.ticks_per_second, self._transmit)
        self._talks = bool(self._acknowledged)
        self._next: int | None = None
        self._is_stale = True

    def next_tick(self) -> int | None:
        """The tick at which something happens next, unless something is offered before; None for never."""
        if self._is_stale:
            earliest = self._next_event()
            self._next = None if earliest is None else landing_tick(earliest, self._rate)
            self._is_stale = False
        return self._next

    def offer(self, message: MessageId, tick: int) -> list[News]:
        """Take a message of a link that crosses a medium or is acknowledged; what comes of it within this tick."""
        self._is_stale = True
        now = nanoseconds(tick, self._rate)
        if message.link not in self._acknowledged:
            self._on[message.link].offer(message.link, message.sequence, now)
            return []
        self._talk.say(message.link, message.sequence, now)
        return self._news(self._talk.advance(now))

    def advance(self, tick: int) -> list[News]:
        """Move on to a tick, and tell what has happened until then."""
        until = nanoseconds(tick, self._rate)
        self._is_stale = True
        if not self._talks:
            return self._move(until)
        news: list[News] = []
        while (event := self._next_event()) is not None and event <= until:
            news += self._move(event)
            news += self._news(self._talk.advance(event))
        return news + self._move(until)

    def take_log(self) -> list[Fate]:
        """What has become of frames since the last call, in the order in which it did."""
        taken, self.log = self.log, []
        return taken

    def _next_event(self) -> int | None:
        earliest = self._talk.next_ns() if self._talks else None
        for medium in self._in_order:
            event = medium.next_ns()
            if event is not None and (earliest is None or event < earliest):
                earliest = event
        return earliest

    def _move(self, until_ns: int) -> list[News]:
        """Move the media on. What has landed goes through its channel: now, later or never."""
        news: list[News] = []
        for medium in self._in_order:
            for fate in medium.advance(until_ns):
                landed = landing_tick(fate.landed_ns, self._rate)
                for receiver, way in self._ways.get(fate.link, ()):
                    for when in (landed,) if way is None else way.arrivals(fate.sequence, landed):
                        news.append(Arrival(receiver, MessageId(fate.link, fate.sequence), when))
            if medium.has_log:
                self._hear(medium.take_log())
        return news

    def _hear(self, fates: list[Fate]) -> None:
        self.log += fates
        if self._talks:
            for fate in fates:
                self._talk.hear(fate)

    def _transmit(self, line: str, sequence: int, attempt: int, now_ns: int) -> None:
        medium = self._on.get(line)
        if medium is not None:
            medium.offer(line, sequence, now_ns, attempt)
            self._hear(medium.take_log())  # what the queue has dropped
        else:
            self._hear([Fate(line, sequence, Outcome.SENT, now_ns, now_ns, now_ns, now_ns, attempt)])

    def _news(self, events: list[Event]) -> list[News]:
        news: list[News] = []
        for event in events:
            if isinstance(event, Ended):
                if event.end is not End.SUPERSEDED:
                    news.append(event)
            else:
                tick = landing_tick(event.at_ns, self._rate)
                news.append(Arrival(event.receiver, MessageId(event.link, event.sequence), tick))
        return news
