"""A module in real time: what has come, what is due, and what is too late. No I/O; the time is told.

In simulated time a coordinator says when each module acts. In real time nobody does: a module waits for the instant of
the tick at which it acts next, takes what arrives when it arrives, and never waits for anybody. What is late is late,
and is noted. All modules have agreed on the instants: those of one :class:`~etac_ros.maths.wall_clock.WallClock`.

A sensor gets its plant's samples ahead, in windows, as in simulated time, so that the emulation plane carries messages
at events and not at every tick. It acts on the newest window that has come.
"""

from __future__ import annotations

from collections import deque
from collections.abc import Callable
from typing import NamedTuple

import numpy as np

from etac_ros.errors import ProtocolError, RunError
from etac_ros.graph.driver import Driver, Sent
from etac_ros.graph.graph import Graph, Link
from etac_ros.graph.ledger import NOTHING, Entry, Event
from etac_ros.graph.module import Arrival, Window
from etac_ros.graph.plant import PlantModule
from etac_ros.maths.wall_clock import WallClock
from etac_ros.parameters import FloatArray
from etac_ros.timing.digest import knows_ticks
from etac_ros.timing.membership import NUMBERS
from etac_ros.timing.windows import WindowPolicy
from etac_ros.timing.worker import Commit, Offer, Send


class Overrun(NamedTuple):
    """A module was too late for a tick.

    Attributes
    ----------
    tick, now
        The tick that it was late for, and the one in which it found out.
    found
        What happened, in words.
    """

    tick: int
    now: int
    found: str


class Halt(NamedTuple):
    """A watch asks to end the run at a tick."""

    tick: int
    why: str


Effect = Send | Offer | Commit | Overrun | Halt
Emit = Callable[[Effect], None]

_AHEAD_S = 0.1
"""How far the window of a plant reaches at least, as time of the wall: what a node may sleep through unharmed."""
_LONGEST_S = 0.5
"""How far it reaches at most. A plant that computes a window takes no torque meanwhile."""
_LEAST, _MOST = 4, 256
"""Samples of a window at least and at most."""


class Windows(NamedTuple):
    """Lengths of the windows of a plant in real time, in samples; no result depends on them, unless they come late."""

    least: int
    most: int

    def after_quiet(self, length: int) -> int:
        """Length of the window after one in which nothing arrived."""
        return min(4 * length, self.most)

    def after_hit(self, used: int) -> int:
        """Length of the window after one that was replaced."""
        return max(self.least, min(2 * used, self.most))


def windows_in_real_time(policy: WindowPolicy, clock: WallClock) -> Windows:
    """How far plants compute ahead: as the scenario says, within what real time needs."""
    least = min(_MOST, max(_LEAST, clock.ticks_in(_AHEAD_S)))
    return Windows(least, max(least, min(_MOST, policy.longest, clock.ticks_in(_LONGEST_S))))


class WallWorker:
    """What modules and plants in real time have in common.

    Parameters
    ----------
    graph
        The run.
    name
        Full name of the module.
    emit
        Takes what it does, at once and in order.
    incarnation
        Which of its node's processes this is.

    Attributes
    ----------
    clock
        Set by :meth:`begin`.
    missed
        Ticks for which it was too late so far.
    acts, late_ns, most_late_ns
        Own acts so far, how late the last one was, and the latest of all [ns].
    last_sent, last_taken
        Tick of the last message on each link.
    """

    def __init__(self, graph: Graph, name: str, emit: Emit, incarnation: int = 0) -> None:
        self.name = name
        self.clock: WallClock | None = None
        self.missed = 0
        self.acts = self.late_ns = self.most_late_ns = 0
        self.last_sent: dict[str, int] = {}
        self.last_taken: dict[str, int] = {}
        self._graph = graph
        self._emit = emit
        self._end = graph.end_tick
        self._places = {link: place for place, link in enumerate(graph.links)}
        self._numbers = {link.name: incarnation * NUMBERS for link in graph.sends[name]}
        self._entries: list[Entry] = []

    def begin(self, clock: WallClock, now_ns: int, since: int | None = None) -> None:
        """All have agreed on the instants of ticks.

        Parameters
        ----------
        clock
            The instants of ticks.
        now_ns
            What time it is there [ns].
        since
            Of a process that takes the place of a dead one: the tick at which its node was to go on. None for one that
            is there from the start.
        """
        self.clock = clock
        if since is not None:
            self._entries.append(
                Entry(
                    Event.JOINED, NOTHING, 0, self._now(now_ns), self._since(now_ns),
                    self._since(clock.instant_ns(since)),
                )
            )  # fmt: skip

    def next_wake_ns(self) -> int | None:
        """The next instant at which there is something to do unasked [ns]; None if there is none."""
        raise NotImplementedError

    def progress(self, now_ns: int) -> None:
        """Do all that is due."""
        raise NotImplementedError

    def take_ledger(self) -> list[Entry]:
        """What happened since the last call."""
        taken, self._entries = self._entries, []
        return taken

    def _now(self, now_ns: int) -> int:
        assert self.clock is not None
        return self.clock.tick_at(now_ns)

    def _since(self, time_ns: int) -> int:
        assert self.clock is not None
        return time_ns - self.clock.start_ns

    def _taken(self, link: Link, sequence: int, tick: int, now_ns: int, sent_ns: int) -> None:
        place = self._places[link.name]
        self.last_taken[link.name] = self._now(now_ns)
        self._entries.append(Entry(Event.TAKEN, place, sequence, tick, self._since(now_ns), self._since(sent_ns)))

    def _late(self, event: Event, tick: int, now: int, now_ns: int, found: str) -> None:
        self.missed += 1
        self._entries.append(Entry(event, NOTHING, 0, tick, self._since(now_ns)))
        self._emit(Overrun(tick, now, found))

    def _refuse_what_is_no_number(self, link: Link, value: FloatArray, now: int) -> None:
        if np.isfinite(value).all():
            return
        raise RunError(
            f"node {link.sender}, topic {link.topic}",
            f"has sent {value.tolist()} in tick {now}",
            "finite numbers",
            "see what it computes them from",
        )


class WallModule(WallWorker):
    """A module that is no plant.

    Notes
    -----
    A window may be looked at when its first tick has come. Before that, samples of earlier ticks may still be needed:
    by an act of its own, or by a message. Who hears nobody and acts no earlier looks at once, when there is time.

    A process that takes the place of a dead one acts from the first tick after that in which it begins, knows of no
    sample from before its first window, and of no message from before it.
    """

    def __init__(self, graph: Graph, name: str, emit: Emit, incarnation: int = 0) -> None:
        super().__init__(graph, name, emit, incarnation)
        self._driver = Driver(graph, name)
        module = self._driver.module
        self._sees_plant = name in graph.reads and name in graph.reporters
        self._looks = not (module.answers or module.passive)
        self._told_ticks = knows_ticks(module)
        self._hears_nobody = not graph.hears[name]
        self._windows: deque[Window] = deque()
        self._waiting: deque[tuple[Link, int, FloatArray, int]] = deque()
        self._proposal: int | None = None
        self._looked = -1
        self._acted = -1
        self._slept_until = -1
        self._joined = False

    def begin(self, clock: WallClock, now_ns: int, since: int | None = None) -> None:
        """All have agreed on the instants of ticks; do what is due."""
        super().begin(clock, now_ns, since)
        if since is not None:
            self._joined = True
            self._slept_until = self._now(now_ns)
        if self._looks and not self._sees_plant:
            self._look(self._slept_until)
        self.progress(now_ns)

    def next_wake_ns(self) -> int | None:
        """The next instant at which there is something to do unasked [ns]; None if there is none."""
        if self.clock is None:
            return None
        ticks = [] if self._proposal is None else [self._proposal]
        if self._windows:
            ticks.append(self._windows[0].start)
        due = min(ticks, default=None)
        return None if due is None or due >= self._end else self.clock.instant_ns(due)

    def on_window(self, window: Window, now_ns: int) -> None:
        """Take a window of the plant that the module sees."""
        self._windows.append(window)
        self.progress(now_ns)

    def on_message(self, link: Link, sequence: int, value: FloatArray, sent_ns: int, now_ns: int) -> None:
        """Take a message."""
        self._waiting.append((link, sequence, value, sent_ns))
        self.progress(now_ns)

    def progress(self, now_ns: int) -> None:
        """Do all that is due: acts and windows first, in the order of their ticks, then what has arrived."""
        if self.clock is None:
            return
        now = self._now(now_ns)
        while self._step(now, now_ns):
            pass
        while self._waiting and (not self._sees_plant or self._driver.window is not None or now >= self._end):
            self._receive(*self._waiting.popleft(), now, now_ns)

    def _step(self, now: int, now_ns: int) -> bool:
        """Act, or look at the next window, whichever comes first; False if neither is due."""
        following = self._windows[0] if self._windows else None
        acts = self._proposal
        if acts is not None and acts <= now and (following is None or acts < following.start):
            self._act(acts, now, now_ns)
            return True
        if following is None:
            return False
        early = self._hears_nobody and (acts is None or acts >= following.start)
        if following.start <= now or early or self._driver.window is None:
            self._see(self._windows.popleft(), now, now_ns)
            return True
        return False

    def _see(self, window: Window, now: int, now_ns: int) -> None:
        before = self._driver.window
        due = 0 if before is None else before.last + 1
        if window.start > due and not (self._joined and before is None):
            raise ProtocolError(
                f"window of {window.plant}",
                f"it begins with tick {window.start}, and samples are known until tick {due - 1}",
                "windows without gaps: each begins at the latest where the one before has ended",
            )
        acted = self._acted
        if (
            before is not None
            and window.start <= acted <= min(before.last, window.last)
            and not np.array_equal(before.at(acted), window.at(acted))
        ):
            found = f"has acted on a sample of tick {acted} that a torque had changed: its window came late"
            self._late(Event.STALE, acted, now, now_ns, found)
        self._driver.see(window)
        if self._looks:
            after = max(window.start - 1, self._looked, min(self._slept_until, window.last))
            self._driver.pass_over(after)
            self._look(after)

    def _look(self, after: int) -> None:
        window = self._driver.window
        self._looked = after
        self._proposal = None
        if window is not None and after >= window.last:
            return
        proposal = self._driver.look(after)
        self._proposal = None if proposal is None or proposal >= self._end else proposal

    def _act(self, tick: int, now: int, now_ns: int) -> None:
        assert self.clock is not None
        instant = self.clock.instant_ns(tick)
        late = min(now, self._end) - tick  # a run has no ticks behind its end that could be missed
        self.acts += 1
        self.late_ns = now_ns - instant
        self.most_late_ns = max(self.most_late_ns, self.late_ns)
        self._entries.append(
            Entry(Event.WOKEN, NOTHING, 0, tick, self._since(now_ns), self._since(instant), NOTHING, late)
        )
        sent = self._driver.fire(tick)
        concluded = self._driver.conclude(tick) if self._driver.module.concludes else []
        self._send([*concluded, *sent], tick, now_ns, None)
        self._acted = tick
        self._check_halt(tick)
        last = tick
        if late > 0:
            # At most one act a tick: what it slept through is over.
            self.missed += late
            self._emit(Overrun(tick, now, f"woke {(now_ns - instant) / 1e6:.3g} ms late, {late} ticks"))
            window = self._driver.window
            self._slept_until = now
            known = now if window is None else min(now, window.last)
            following = self._windows[0].start - 1 if self._windows else known
            last = max(tick, min(known, following))
            self._driver.pass_over(last)
        self._look(last)

    def _receive(self, link: Link, sequence: int, value: FloatArray, sent_ns: int, now: int, now_ns: int) -> None:
        self._taken(link, sequence, now, now_ns, sent_ns)
        if now >= self._end:
            return  # nobody acts at the end tick or later
        self._refuse_what_is_no_number(link, value, now)
        tick = now
        if self._sees_plant:
            window = self._driver.window
            assert window is not None
            tick = max(window.start, min(now, window.last))
            if tick != now and self._told_ticks:
                found = f"had a message and no sample of tick {now}: that of tick {tick} took its place"
                self._late(Event.STARVED, now, now, now_ns, found)
        arrival = Arrival(link.receivers[self.name], link.name, value)
        sent = self._driver.receive(tick if self._told_ticks else None, (arrival,))
        self._send(sent, tick, now_ns, (self._places[link.name], sequence))
        self._check_halt(tick)
        if self._looks:
            self._look(max(tick, self._looked) if self._sees_plant else now)

    def _send(self, sent: Sent, tick: int, now_ns: int, cause: tuple[int, int] | None) -> None:
        place, number = cause or (NOTHING, 0)
        for link, value in sent:
            self._numbers[link.name] += 1
            self.last_sent[link.name] = tick
            self._emit(Send(link, value, tick))
            self._entries.append(
                Entry(
                    Event.SENT, self._places[link.name], self._numbers[link.name], tick, self._since(now_ns), 0,
                    place, number,
                )
            )  # fmt: skip

    def _check_halt(self, tick: int) -> None:
        if self._driver.module.halt:
            self._emit(Halt(tick, self._driver.module.halt))


class WallPlant(WallWorker):
    """A plant: computes windows ahead under the torque that it holds, and a new one when another arrives.

    Parameters
    ----------
    graph, name, emit
        As for :class:`WallWorker`.
    policy
        How far the scenario lets it compute ahead.

    Attributes
    ----------
    closed
        Whether the run is over here.
    """

    def __init__(self, graph: Graph, name: str, emit: Emit, policy: WindowPolicy) -> None:
        super().__init__(graph, name, emit)
        module = graph.modules[name]
        assert isinstance(module, PlantModule)
        self.plant = module
        self.closed = False
        self._policy = policy
        self._windows: Windows | None = None
        self._first = -1
        self._last = -1
        self._length = 0
        self._renewed = False

    def begin(self, clock: WallClock, now_ns: int, since: int | None = None) -> None:
        """All have agreed on the instants of ticks; do what is due."""
        super().begin(clock, now_ns, since)
        self._windows = windows_in_real_time(self._policy, clock)
        self._open(self._windows.least)

    def next_wake_ns(self) -> int | None:
        """The next instant at which there is something to do unasked [ns]; None if there is none."""
        if self.clock is None or self.closed:
            return None
        if self._renewed:
            return 0  # at once: a torque has come
        return self.clock.instant_ns(self._end if self._last >= self._end else self._renewal())

    def on_message(self, link: Link, sequence: int, value: FloatArray, sent_ns: int, now_ns: int) -> None:
        """Take a torque; it acts from the first tick after now on."""
        now = self._now(now_ns)
        tick = max(0, now + 1)
        if tick >= self._end or self.closed:
            self._taken(link, sequence, self._end, now_ns, sent_ns)
            return
        self._refuse_what_is_no_number(link, value, now)
        self._taken(link, sequence, tick, now_ns, sent_ns)
        self._reach(tick, now, now_ns)
        self._commit(tick)
        self.plant.receive(tick, (Arrival(link.receivers[self.name], link.name, value),), None)
        self._last = tick
        self._renewed = True

    def progress(self, now_ns: int) -> None:
        """Open a new window: after a torque, or when the old one is nearly used up."""
        if self.clock is None or self.closed:
            return
        assert self._windows is not None
        now = self._now(now_ns)
        if now >= self._end:
            self._close(now, now_ns)
        elif self._renewed:
            self._open(self._windows.after_hit(max(1, self.plant.tick - self._first)))
        elif self._last < self._end and now >= self._renewal():
            # What is held is the same, and so are the samples: nobody has to look again at what it has seen.
            self._renew(now, now_ns)

    def show_again(self, now_ns: int) -> None:
        """Open a new window at once: somebody has come to see it who has not seen the one before."""
        if self.clock is None or self.closed or self._renewed:
            return
        now = self._now(now_ns)
        if 0 <= now < self._end:
            self._renew(now, now_ns)

    def _renew(self, now: int, now_ns: int) -> None:
        assert self._windows is not None
        self._reach(now, now, now_ns)
        self._commit(max(now, self.plant.tick))
        self._open(self._windows.after_quiet(self._length))

    def _renewal(self) -> int:
        assert self._windows is not None
        return max(0, self._last - self._windows.least // 2)

    def _close(self, now: int, now_ns: int) -> None:
        self._reach(self._end, now, now_ns)
        self._commit(self._end)
        self.closed = True

    def _reach(self, tick: int, now: int, now_ns: int) -> None:
        """Make sure that the window reaches a tick; if the time has overtaken it, say so."""
        assert self._windows is not None
        while self._last < tick and not self.plant.halt:
            if now > self._last and not self._renewed:
                self._late(Event.STARVED, now, now, now_ns, f"had computed no further than tick {self._last}")
            self._commit(self._last)
            self._open(max(tick - self._last, self._windows.least))

    def _open(self, length: int) -> None:
        self._renewed = False
        if self.plant.halt:
            return
        fresh = self._last < 0
        start = 0 if fresh else self.plant.tick + 1
        length = min(length, self._end + 1 - start)
        if length < 1:
            return
        window = self.plant.open(length)
        self._first, self._last, self._length = window.start, window.last, length
        self._emit(Offer(window, -1))

    def _commit(self, tick: int) -> None:
        start, samples = self.plant.commit(tick)
        if samples.shape[0]:
            self._emit(Commit(start, samples))
        if self.plant.halt and not self.closed:
            self.closed = True
            self._emit(Halt(tick, self.plant.halt))
