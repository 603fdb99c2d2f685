"""The in-process engine: orders are calls."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

from etac_ros.engines.closed_loop import ClosedLoop, Ran, closed_loop_of
from etac_ros.graph.driver import Driver, Sent
from etac_ros.graph.graph import Graph
from etac_ros.graph.module import Arrival, Module
from etac_ros.graph.plant import PlantModule
from etac_ros.graph.recording import Message, Recording
from etac_ros.graph.spool import Spool
from etac_ros.parameters import FloatArray
from etac_ros.timing.master import TimeMaster
from etac_ros.timing.orders import Close, Deliver, Fire, Forward, Look, Open, Order, Report
from etac_ros.timing.relays import Relay
from etac_ros.timing.windows import USUAL_WINDOWS, WindowPolicy


class InProcess:
    """Runs a graph once. The graph's modules are used up by it: build a new graph for the next run.

    Parameters
    ----------
    graph
        Freshly built modules and their links.
    windows
        How far plants compute ahead.
    trace
        Called with every order and its report; for tests and for teaching. An attribute, too.
    before
        Called with the tick before its orders are executed: whoever wants to slow the run down waits in it. An
        attribute, too.
    in_one
        Run a graph that is one loop of compiled formulas in one kernel (:mod:`etac_ros.engines.closed_loop`), unless
        somebody looks on. No bit depends on it, but committed samples come in fewer chunks.
    trimmed
        Let windows end where their only reader acts, if plant and reader can tell beforehand: how long they are else.
        No bit depends on it. None leaves all windows to ``windows``.
    """

    def __init__(
        self,
        graph: Graph,
        windows: WindowPolicy = USUAL_WINDOWS,
        trace: Callable[[Order, Report], None] | None = None,
        before: Callable[[int], None] | None = None,
        trimmed: int | None = None,
        in_one: bool = False,
    ) -> None:
        self._drivers = {name: Driver(graph, name) for name in graph.modules}
        self._plants = {name: _plant(graph, name) for name in graph.plants}
        # By plant: whose next act its windows end with.
        self._acting: dict[str, Driver] = {}
        for name, plant in self._plants.items() if trimmed is not None else ():
            readers = graph.readers[name]
            if len(readers) == 1 and graph.modules[readers[0]].stops and plant.can_stop:
                self._acting[name] = self._drivers[readers[0]]
        self_ending = {} if trimmed is None else dict.fromkeys(self._acting, trimmed)
        self.master = TimeMaster(graph, windows, self_ending, with_history=False, forwarding=trace is None)
        self._truth = {name: Spool() for name in graph.plants}
        self.recording = Recording(messages={name: [] for name in graph.links}, truth=self._truth)
        self._graph = graph
        self._untold = windows.first
        self.trace = trace
        self.before = before
        # By link, in order of their sequence numbers.
        self._values: dict[str, list[FloatArray]] = {name: [] for name in graph.links}
        self._routes: dict[Relay, list[_Station]] = {}
        self._ports = {name: {link.name: link.receivers[name] for link in graph.hears[name]} for name in graph.modules}
        # What is asked for with every order, by plant and by module.
        self._loop = closed_loop_of(graph) if in_one else None
        self._opening = {
            name: (plant, self._acting.get(name), [self._drivers[reader] for reader in graph.readers[name]])
            for name, plant in self._plants.items()
        }
        self._looking = {
            name: (driver, self._plants.get(graph.reads.get(name, ""))) for name, driver in self._drivers.items()
        }
        self._does: dict[type[Order], Callable[[Any], Report]] = {
            Look: self._look,
            Deliver: self._deliver,
            Open: self._open,
            Fire: self._fire,
            Forward: self._forward,
            Close: self._close,
        }

    def run(self) -> Recording:
        """Run from tick 0 to the end.

        Returns
        -------
        Recording
            Everything that was sent and every committed sample.

        Raises
        ------
        ProtocolError
            If the messages of one tick go round without end.
        """
        if self.trace is not None:
            self.master.forwarding = False
        if self._loop is not None and self.trace is None and self.before is None:
            ran = self._loop.run()
            if ran is not None:
                return self._taken_from(self._loop, ran)
        batches = self.master.run()
        orders = next(batches)
        does = self._does
        while True:
            if self.before is not None:
                self.before(self.master.tick)
            reports = [does[type(order)](order) for order in orders]
            if self.trace is not None:
                for order, report in zip(orders, reports, strict=True):
                    self.trace(order, report)
            try:
                orders = batches.send(reports)
            except StopIteration:
                break
        self.log()
        return self.recording

    def _taken_from(self, loop: ClosedLoop, ran: Ran) -> Recording:
        """The recording of a run that was one kernel."""
        self.recording.messages.update(ran.messages)
        self._truth[loop.plant] = ran.truth
        self.master.skip_to_end({loop.sensor: ran.events}, dict.fromkeys(loop.links, ran.events))
        return self.recording

    def log(self) -> None:
        """Put into the recording what has been sent, and what has happened on the air, since the last time."""
        self.recording.air += self.master.take_air_log()
        values, messages = self._values, self.recording.messages
        for link, sequence, tick, step in self.master.take_message_log():
            messages[link].append(Message(sequence, tick, step, values[link][sequence - 1]))

    def obey(self, order: Order) -> Report:
        """Execute one order of the time master."""
        return self._does[type(order)](order)

    def _deliver(self, order: Deliver) -> Report:
        name, tick, _, messages, _, ends = order
        driver = self._drivers[name]
        for one in ends:
            driver.settle(tick, self._graph.links[one.link].port, one.acknowledged)
        if ends and not messages:
            return Report(halt=driver.module.halt)
        ports, values = self._ports[name], self._values
        arrivals = tuple([Arrival(ports[link], link, values[link][number - 1]) for link, number in messages])
        return Report(self._send(driver.receive(tick, arrivals)), halt=driver.module.halt)

    def _forward(self, order: Forward) -> Report:
        _, tick, relay = order
        route = self._routes.get(relay)
        if route is None:
            route = self._routes[relay] = self._routed(relay)
        values = self._values
        on_way: list[FloatArray | None] = [values[link][-1] for link, _ in relay.messages[: relay.given]]
        halt, missing = "", False
        for module, receive, takes, sends in route:
            arrivals = [
                Arrival(port, link, value) for place, port, link in takes if (value := on_way[place]) is not None
            ]
            if missing and not arrivals:
                on_way += [None] * len(sends)
                continue
            sent = receive(tick, tuple(arrivals))
            if module.halt and not halt:
                halt = f"{module.context.name}: {module.halt}"
            if len(sent) == len(sends):
                for link, value in sent:
                    values[link.name].append(value)
                    on_way.append(value)
            else:  # only a module that ends the run may break its promise
                missing = True
                of_link = {link.name: value for link, value in sent}
                for name in sends:
                    value = of_link.get(name)
                    on_way.append(value)
                    if value is not None:
                        values[name].append(value)
        if not halt and not missing:
            return _DONE
        return Report(halt=halt, missing=tuple(place for place, value in enumerate(on_way) if value is None))

    def _routed(self, relay: Relay) -> list[_Station]:
        found: list[_Station] = []
        for name, _, takes, sends in relay.hops:
            ports = self._ports[name]
            links = [relay.messages[place][0] for place in takes]
            took = [(place, ports[link], link) for place, link in zip(takes, links, strict=True)]
            driver = self._drivers[name]
            found.append((driver.module, driver.receive, took, [relay.messages[place][0] for place in sends]))
        return found

    def _fire(self, order: Fire) -> Report:
        driver = self._drivers[order.module]
        sent, concluded = self._act(driver, order.tick, order.alone)
        return Report(sent, concluded=concluded, halt=driver.module.halt)

    def _look(self, order: Look) -> Report:
        name, after, grant = order
        driver, plant = self._looking[name]
        if plant is not None and plant.halt:
            return _DONE  # there is no window any more to look at
        proposal = driver.look(after)
        if proposal is None or proposal > grant:
            return Report((), proposal)
        sent, concluded = self._act(driver, proposal, alone=True)
        return Report(sent, proposal, True, concluded, driver.module.halt)

    def _open(self, order: Open) -> Report:
        name, tick, length, _ = order
        plant, acting, readers = self._opening[name]
        self._commit(name, tick)
        if plant.halt:
            return Report(halt=plant.halt)
        if acting is None:
            window = plant.open(length)
        else:
            stop = acting.module.stop()  # where it cannot tell just now, asking again soon costs little
            window = plant.open(min(length, self._untold)) if stop is None else plant.open(length, stop)
        for reader in readers:
            reader.see(window)
        opened = len(window.samples)
        return _DONE if opened == length else Report((), None, False, None, "", window.start + opened - 1)

    def _close(self, order: Close) -> Report:
        self._commit(order.module, order.tick)
        return Report(halt=self._plants[order.module].halt)

    def _act(self, driver: Driver, tick: int, alone: bool) -> tuple[tuple[str, ...], tuple[str, ...] | None]:
        sent = self._send(driver.fire(tick))
        return sent, self._send(driver.conclude(tick)) if alone and driver.module.concludes else None

    def _commit(self, plant: str, tick: int) -> None:
        start, samples = self._plants[plant].commit(tick)
        if len(samples):
            self._truth[plant].append((start, samples))

    def _send(self, sent: Sent) -> tuple[str, ...]:
        names = []
        for link, value in sent:
            self._values[link.name].append(value)
            names.append(link.name)
        return tuple(names)


_Station = tuple[
    Module,
    Callable[[int | None, tuple[Arrival, ...]], Sent],
    list[tuple[int, str, str]],
    list[str],
]
"""A station of a relay: a module and how it is told what it takes, as (place, port, link); what it answers."""
_DONE = Report()


def _plant(graph: Graph, name: str) -> PlantModule:
    module = graph.modules[name]
    assert isinstance(module, PlantModule)
    return module
