"""The time master's side of the protocol: orders out, reports in. No I/O.

The master yields batches of orders and wants a report on each. Much of that needs no message: what a module will do
is known beforehand, or it has reported already because it needed no order. A dispatcher knows which; whether an order
is a call or a message over DDS it does not. The tests drive it, with the workers, through every order of arrival.
"""

from __future__ import annotations

from collections import defaultdict, deque
from collections.abc import Callable, Sequence
from typing import NamedTuple

from etac_ros.errors import ProtocolError
from etac_ros.graph.graph import Graph
from etac_ros.timing.duties import Duties
from etac_ros.timing.master import TimeMaster
from etac_ros.timing.orders import Close, Deliver, Fire, Look, Open, Order, Report


class Command(NamedTuple):
    """Orders for a module, in one message."""

    module: str
    orders: tuple[Order, ...]


class Call(NamedTuple):
    """An order for a plant in the coordinator's own process, by a call."""

    plant: str
    order: Order


class Hint(NamedTuple):
    """What the reader of a plant in the coordinator's own process compares with from now on."""

    plant: str
    compared: tuple[float, ...]


class Finished(NamedTuple):
    """The run is over."""


Effect = Command | Call | Hint | Finished


class Dispatcher:
    """Drives the time master with reports.

    Parameters
    ----------
    graph, duties, master
        The run.
    emit
        Takes orders as they are due. A call to a plant may come back with :meth:`on_obeyed` before it returns.
    on_step
        Called after each batch, before the next.

    Attributes
    ----------
    steps
        Batches done so far: it grows as long as the run gets on.
    finished
        Whether the run is over.
    """

    def __init__(
        self,
        graph: Graph,
        duties: Duties,
        master: TimeMaster,
        emit: Callable[[Effect], None],
        on_step: Callable[[], None] = lambda: None,
    ) -> None:
        self.steps = 0
        self.finished = False
        self._graph = graph
        self._duties = duties
        self._master = master
        self._emit = emit
        self._on_step = on_step
        self._local = frozenset(graph.plants) - frozenset(duties.remote_plants)
        self._batches = master.run()
        self._orders: Sequence[Order] = ()
        self._reports: list[Report | None] = []
        self._awaited: dict[str, int] = {}
        self._ahead: dict[str, int | None] = {}
        self._early: dict[str, deque[tuple[Report, int]]] = defaultdict(deque)
        self._dispatching = False
        self._paused = False
        self._held_back: dict[str, list[Order]] = defaultdict(list)

    def begin(self) -> None:
        """Hand out the master's first orders."""
        self._dispatch(next(self._batches))

    def on_report(self, module: str, report: Report, tick: int, ahead: int | None) -> None:
        """Take what a module reports.

        Parameters
        ----------
        module
            Who.
        report, tick
            What it did, and the tick that it was asked about.
        ahead
            Its next own act, as far as it sees.

        Raises
        ------
        ProtocolError
            If it was not asked, or about another tick.
        """
        if report.compared is not None:
            self._emit(Hint(self._graph.reads[module], report.compared))
        if module in self._awaited:
            self._check_tick(module, self._orders[self._awaited[module]], report, tick)
            self._ahead[module] = ahead
            self._answered(module, report)
        elif self._duties.acts_on_arrival(module):
            self._early[module].append((report, tick))  # it did not wait for the order, which is still to come
        else:
            raise ProtocolError(f"node {module}", "has reported without being asked", "one report an order")

    def on_obeyed(self, plant: str, report: Report) -> None:
        """Take what a plant in this process says when it has opened or closed."""
        if report.halt and any(isinstance(order, Open) for order in self._orders):
            self.on_halt(plant, report)
        else:
            self._answered(plant, report)

    def on_halt(self, plant: str, report: Report) -> None:
        """A plant ends the run. Go on without the others: there is no window that anybody could look at."""
        self._reports = [
            report if isinstance(order, Open) and order.module == plant else known or Report()
            for order, known in zip(self._orders, self._reports, strict=True)
        ]
        self._awaited.clear()
        self._proceed_if_complete()

    def pause(self) -> None:
        """Hand out nothing more: somebody has fallen behind."""
        self._paused = True

    def resume(self) -> None:
        """Go on after a pause."""
        if self._paused:
            self._paused = False
            self._proceed_if_complete()

    def owing(self) -> list[str]:
        """Who owes a report."""
        return sorted(self._awaited)

    def is_idle(self) -> bool:
        """Whether no report waits for its order."""
        return not any(self._early.values())

    def _answered(self, module: str, report: Report) -> None:
        self._reports[self._awaited.pop(module)] = report
        self._proceed_if_complete()

    def _dispatch(self, orders: Sequence[Order]) -> None:
        """Hand out a batch; go on to the next while nothing has to be waited for."""
        while True:
            self._orders = orders
            opened = {order.module for order in orders if isinstance(order, Open)}
            self._reports = [None] * len(orders)
            for place, order in enumerate(orders):
                report = self._known(order, opened)
                if report is None:
                    self._awaited[order.module] = place
                else:
                    self._reports[place] = report
            self._dispatching = True  # a plant in this process may answer at once
            for order in orders:
                self._hand_over(order, opened)
            self._dispatching = False
            if self._awaited or self._paused:
                return
            following = self._step()
            if following is None:
                return
            orders = following

    def _proceed_if_complete(self) -> None:
        if self._dispatching or self._awaited or self._paused or self.finished:
            return
        orders = self._step()
        if orders is not None:
            self._dispatch(orders)

    def _step(self) -> Sequence[Order] | None:
        self.steps += 1
        self._on_step()
        reports = [report for report in self._reports if report is not None]
        try:
            return self._batches.send(reports)
        except StopIteration:
            self.finished = True
            self._emit(Finished())
            return None

    def _known(self, order: Order, opened: set[str]) -> Report | None:
        """The report on an order where it is known beforehand; None where it has to be waited for."""
        graph = self._graph
        match order:
            case Open(module) | Close(module):
                return None if module in self._local else Report()
            case Deliver(module) if module in graph.plants:
                return Report()
            case Deliver(module) if graph.modules[module].answers:
                return self._sends_all(module)
            case Deliver(module) if self._early[module]:
                report, tick = self._early[module].popleft()
                self._check_tick(module, order, report, tick)
                return report
            case Look(module, after, grant) if not self._duties.reports(module):
                # Leave to act comes with a window; without one the module knows nothing of this look.
                return self._regular(module, after, grant if graph.reads.get(module) in opened else -1)
            case Fire(module) if graph.modules[module].fires_on is not None:
                self._ahead.pop(module, None)
                return self._fires(module, order.alone)
            case Fire(module) if not self._duties.reports(module):
                return self._sends_all(module)
            case Look(module) if graph.reads.get(module) not in opened and module in self._ahead:
                return Report(proposal=self._ahead[module])
            case _:
                return None

    def _check_tick(self, module: str, order: Order, report: Report, tick: int) -> None:
        """A report has to be about the tick of its order; a grant lets a module act later than it was asked about."""
        asked = order.after if isinstance(order, Look) else order.tick
        if tick == asked or (isinstance(order, Look) and report.fired and asked < tick <= order.grant):
            return
        raise ProtocolError(
            f"node {module}",
            f"has reported on tick {tick} when it was told '{type(order).__name__}' about tick {asked}",
            "reports in the order of the orders",
        )

    def _sends_all(self, module: str) -> Report:
        return Report(sent=tuple(link.name for link in self._graph.sends[module]))

    def _fires(self, module: str, alone: bool) -> Report:
        """What a module does that always sends the same when it fires."""
        node = self._graph.modules[module]
        assert node.fires_on is not None
        ports = {link.name: link.port for link in self._graph.sends[module]}
        sent = tuple(name for name, port in ports.items() if port in node.fires_on)
        concluded = tuple(name for name, port in ports.items() if port == node.triggers)
        return Report(sent, concluded=concluded if alone and node.concludes else None)

    def _regular(self, module: str, after: int, grant: int) -> Report:
        """What a module that acts at regular ticks answers to a look."""
        every = self._graph.modules[module].every
        assert every is not None
        proposal = (after // every + 1) * every
        if proposal > grant:
            return Report(proposal=proposal)
        return Report(self._sends_all(module).sent, proposal, fired=True)

    def _hand_over(self, order: Order, opened: set[str]) -> None:
        graph = self._graph
        name = order.module
        if name in self._local:
            self._emit(Call(name, order))
        elif isinstance(order, Look) and (graph.reads.get(name) in opened or name not in self._awaited):
            return  # it looks as soon as it sees the window, or has looked already
        elif name in graph.plants and isinstance(order, Deliver):
            self._held_back[name].append(order)  # goes with the next window, which is when the plant needs it
        elif self._duties.needs_orders(name) and name not in graph.external:
            self._emit(Command(name, (*self._held_back.pop(name, []), order)))
