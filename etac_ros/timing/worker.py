"""A module's side of the time protocol: what has come, and what can be done with it. No I/O.

Orders, windows and messages come on topics of their own, and only within a topic is their order kept. A worker
takes them in whatever order they come, does what it can, and lets the rest wait. What it does is handed to ``emit``
at once, since others wait for it; whether that is a call or a message over DDS is not known here. The tests drive
workers and dispatcher through every order of arrival.
"""

from __future__ import annotations

from collections import deque
from collections.abc import Callable, Sequence
from typing import NamedTuple

import numpy as np

from etac_ros.errors import ProtocolError
from etac_ros.graph.driver import Driver, Sent
from etac_ros.graph.graph import Graph, Link
from etac_ros.graph.module import Arrival, Window
from etac_ros.graph.plant import PlantModule
from etac_ros.maths.rk4 import Stop
from etac_ros.parameters import FloatArray
from etac_ros.timing.digest import Places, acted, carried, knows_ticks, received, settled
from etac_ros.timing.duties import Duties
from etac_ros.timing.orders import Close, Deliver, Fire, Look, MessageId, Open, Order, Report, Settled


class Send(NamedTuple):
    """A message goes out on a link."""

    link: Link
    value: FloatArray
    tick: int


class Tell(NamedTuple):
    """A report for the coordinator. ``ahead`` is the module's next own act after what it did, looked up unasked."""

    report: Report
    tick: int
    ahead: int | None


class Offer(NamedTuple):
    """A plant's window for its readers, with the leave that goes with it."""

    window: Window
    grant: int


class Commit(NamedTuple):
    """Samples of a plant that have become final."""

    first_tick: int
    samples: FloatArray


class Obeyed(NamedTuple):
    """A plant has opened or closed."""

    report: Report


Effect = Send | Tell | Offer | Commit | Obeyed
Emit = Callable[[Effect], None]


class Waiting(NamedTuple):
    """What the next thing that a worker has to do waits for."""

    messages: tuple[MessageId, ...] = ()
    epoch: int = 0


class ModuleWorker:
    """Drives a module with what comes in.

    Parameters
    ----------
    graph, duties
        The run.
    name
        Full name of the module.
    emit
        Takes what the module does, at once and in order.

    Attributes
    ----------
    done
        A running digest of what the module did and when.
    wants_stamps
        Whether a message has to come with the tick that it carries.
    values
        By link that is heard: a running digest of the values that came.
    """

    def __init__(self, graph: Graph, duties: Duties, name: str, emit: Emit) -> None:
        self.name = name
        self.done = 0
        self.values: dict[str, int] = {link.name: 0 for link in graph.hears[name]}
        self.sent_values: dict[str, int] = {link.name: 0 for link in graph.sends[name]}
        self._links = graph.links
        self._emit = emit
        self._driver = Driver(graph, name)
        self._reports = duties.reports(name)
        self._passive = self._driver.module.passive
        self._sees_plant = name in graph.reads and name in graph.reporters
        self._acts_on_arrival = duties.acts_on_arrival(name)
        self.wants_stamps = self._acts_on_arrival and graph.needs_time(name)
        self._knows_ticks = knows_ticks(self._driver.module)
        self._numbers = Places(graph.links)
        self._inbox: dict[MessageId, FloatArray] = {}
        self._copies: dict[MessageId, int] = {}
        self._orders: deque[Order] = deque()
        self._arrived: deque[tuple[MessageId, int | None]] = deque()
        self._windows: deque[tuple[Window, int]] = deque()
        self._proposal: int | None = None
        self._ends_windows = name in duties.acting.values()
        self._compared: tuple[float, ...] = ()

    def on_message(self, link: Link, sequence: int, value: FloatArray, tick: int | None = None) -> None:
        """Take a message; the channel decides whether it counts."""
        self.values[link.name] = carried(self.values[link.name], value)
        identity = MessageId(link.name, sequence)
        if link.acknowledged is None:  # else it may be sent again: an order tells when it has arrived, if ever
            if link.channel.drops(self.name, sequence):
                return
            copies = link.channel.copies(self.name, sequence)
            if copies > 1:
                self._copies[identity] = copies
        self._inbox[identity] = value
        if self._acts_on_arrival:
            self._arrived.append((identity, tick))
        self._work()

    def on_orders(self, orders: Sequence[Order]) -> None:
        """Take orders; each is obeyed as soon as what it names is here."""
        self._orders.extend(orders)
        self._work()

    def on_window(self, window: Window, grant: int) -> None:
        """Take a window of the plant that the module sees."""
        self._windows.append((window, grant))
        self._work()

    def is_idle(self) -> bool:
        """Whether nothing that has come waits to be dealt with."""
        return not self._orders and not self._arrived and not self._windows

    def waits_for(self) -> Waiting:
        """What is not here yet that the next order names."""
        if not self._orders or not isinstance(self._orders[0], Fire | Deliver):
            return Waiting()
        order = self._orders[0]
        named = order.messages if isinstance(order, Deliver) else ()
        return Waiting(tuple(message for message in named if message not in self._inbox), order.epoch)

    def _work(self) -> None:
        """Do all that can be done with what is here; the rest waits for what is still under way."""
        while True:
            if self._arrived and self._has_sample(self._arrived[0][1]):
                identity, tick = self._arrived.popleft()
                sent = self._receive(tick, (identity,))
                self._acted(tick or 0, self._send(sent, tick or 0))
            elif self._orders and self._can_take(self._orders[0]):
                self._obey(self._orders.popleft())
            elif self._windows and self._may_see(self._windows[0][0]):
                window, grant = self._windows.popleft()
                self._driver.see(window)
                if not self._passive:
                    self._look(window.start - 1, grant)
            else:
                return

    def _may_see(self, window: Window) -> bool:
        """Whether nothing is left to do in the windows before.

        A window that begins after a tick that this module has named tells that the tick is over. So the order to fire
        at it is under way, on another topic, and has to be obeyed first.
        """
        return self._proposal is None or self._proposal >= window.start

    def _has_sample(self, tick: int | None) -> bool:
        """Whether the window with the sample of a tick is here, if the module sees windows at all."""
        if not self._sees_plant:
            return True
        window = self._driver.window
        assert tick is not None  # it is passive, and the graph lets it act on arrival only where the message tells
        if window is None or tick > window.last:
            return False
        if tick < window.start:
            raise ProtocolError(
                f"node {self.name}",
                f"a message of tick {tick} came after the window that begins with tick {window.start}",
                "no window before all of a tick is done",
                "this is a fault of etac_ros: please report it with the bag",
            )
        return True

    def _can_take(self, order: Order) -> bool:
        """Whether all that an order names is here: messages, and the window that was opened before it."""
        if not isinstance(order, Fire | Deliver):
            return True
        named = order.messages if isinstance(order, Deliver) else ()
        return self._epoch() >= order.epoch and all(message in self._inbox for message in named)

    def _epoch(self) -> int:
        window = self._driver.window
        return 0 if window is None else window.epoch

    def _obey(self, order: Order) -> None:
        match order:
            case Look(_, after, grant):
                self._look(after, grant)
            case Fire(_, tick, _, alone):
                sent, concluded = self._act(tick, alone)
                self._proposal = None  # of a module that always fires alike, until it is asked again
                if self._driver.module.fires_on is None:
                    self._tell_act(Report(sent, concluded=concluded, halt=self._driver.module.halt), tick)
            case Deliver(_, tick, _, messages, _, ends):
                if ends:
                    self._settle(tick, ends)
                answers = self._receive(tick, messages) if messages or not ends else []
                self._acted(tick, self._send(answers, tick))
            case _:
                raise TypeError(f"{self.name} is no plant, and cannot obey {order}")

    def _look(self, after: int, grant: int) -> None:
        proposal = self._driver.look(after)
        if proposal is None or proposal > grant:
            self._proposal = proposal
            self._tell(Report(proposal=proposal), after, proposal)
            return
        sent, concluded = self._act(proposal, alone=True)
        report = Report(sent, proposal, fired=True, concluded=concluded, halt=self._driver.module.halt)
        self._tell_act(report, proposal)

    def _act(self, tick: int, alone: bool) -> tuple[tuple[str, ...], tuple[str, ...] | None]:
        """Fire, and conclude at once where nothing can arrive."""
        self.done = acted(self.done, tick, self._epoch())
        fired = self._driver.fire(tick)
        if not alone or not self._driver.module.concludes:
            return self._send(fired, tick), None
        # The conclusion is the head of the longer way, to the plant and back; the topics differ, so order is free.
        self.done = received(self.done, tick, self._epoch(), ())
        concluded = self._send(self._driver.conclude(tick), tick)
        return self._send(fired, tick), concluded

    def _receive(self, tick: int | None, messages: tuple[MessageId, ...]) -> Sent:
        told = tick if self._knows_ticks else None
        self.done = received(self.done, told, self._epoch(), self._numbers.of(messages))
        return self._driver.receive(tick, self._arrivals(messages))

    def _settle(self, tick: int, ends: tuple[Settled, ...]) -> None:
        self.done = settled(self.done, tick, self._epoch(), self._numbers.of_settled(ends))
        for one in ends:
            self._driver.settle(tick, self._links[one.link].port, one.acknowledged)

    def _acted(self, tick: int, sent: tuple[str, ...]) -> None:
        if self._reports:
            self._tell_act(Report(sent, halt=self._driver.module.halt), tick)

    def _tell_act(self, report: Report, tick: int) -> None:
        """Report what was done, together with the next own act."""
        self._proposal = None if self._passive else self._driver.look(tick)
        self._tell(report, tick, self._proposal)

    def _tell(self, report: Report, tick: int, ahead: int | None) -> None:
        if self._reports:  # else the coordinator knows it beforehand
            if self._ends_windows:
                report = self._with_hint(report)
            self._emit(Tell(report, tick, ahead))

    def _with_hint(self, report: Report) -> Report:
        """A report that says what the module compares with, where it has acted or that is not as before."""
        stop = self._driver.module.stop()
        compared = () if stop is None else tuple(stop.compared.tolist())
        if compared == self._compared and not report.sent:
            return report
        self._compared = compared
        return report._replace(compared=compared)

    def _arrivals(self, messages: tuple[MessageId, ...]) -> tuple[Arrival, ...]:
        return tuple(
            Arrival(self._links[message.link].receivers[self.name], message.link, self._taken(message))
            for message in messages
        )

    def _taken(self, message: MessageId) -> FloatArray:
        """A message out of the inbox, where one that is duplicated stays until its last copy."""
        if self._copies:
            left = self._copies.pop(message, 1) - 1
            if left:
                self._copies[message] = left
                return self._inbox[message]
        return self._inbox.pop(message)

    def _send(self, sent: Sent, tick: int) -> tuple[str, ...]:
        for link, value in sent:
            self.sent_values[link.name] = carried(self.sent_values[link.name], value)
            self._emit(Send(link, value, tick))
        return tuple(link.name for link, _ in sent)


_OPENED = Report()


class PlantWorker(ModuleWorker):
    """Drives a plant: opens windows and hands out what is committed.

    Attributes
    ----------
    closed
        Whether the last order has been obeyed.
    """

    def __init__(self, graph: Graph, duties: Duties, name: str, emit: Emit) -> None:
        super().__init__(graph, duties, name, emit)
        module = graph.modules[name]
        assert isinstance(module, PlantModule)
        self.plant = module
        self.closed = False
        self._reader = graph.modules[duties.acting[name]] if name in duties.acting else None
        self._stop: Stop | None = None
        self._untold = duties.untold

    def expect(self, compared: Sequence[float]) -> None:
        """Take a hint of what the reader compares with from now on, and so where the next window may end."""
        assert self._reader is not None
        self._stop = self._reader.stop_at(np.array(compared)) if compared else None

    def _obey(self, order: Order) -> None:
        match order:
            case Open(_, tick, length, grant):
                self._commit(tick)
                if self.plant.halt:
                    self._emit(Obeyed(Report(halt=self.plant.halt)))
                    return
                if self._reader is not None and self._stop is None:
                    window = self.plant.open(min(length, self._untold))  # whoever cannot tell just now soon may
                else:
                    window = self.plant.open(length, self._stop)
                report = _OPENED
                if len(window.samples) < length:
                    report = Report(last=window.last)
                    self._stop = None  # good for one act: else a reader that does not act would see one sample a window
                self._emit(Offer(window, grant))
                self._emit(Obeyed(report))
            case Close(_, tick):
                self._commit(tick)
                self.closed = True
                self._emit(Obeyed(Report(halt=self.plant.halt)))
            case Deliver(_, tick, _, messages):
                self.done = received(self.done, tick, 0, self._numbers.of(messages))
                self.plant.receive(tick, self._arrivals(messages), None)
            case _:
                raise TypeError(f"{self.name} is a plant, and cannot obey {order}")

    def _commit(self, tick: int) -> None:
        start, samples = self.plant.commit(tick)
        if samples.shape[0]:
            self._emit(Commit(start, samples))
