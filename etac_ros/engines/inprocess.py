"""The in-process engine: orders are calls."""

from __future__ import annotations

from collections.abc import Callable

from etac_ros.graph.driver import Driver, Sent
from etac_ros.graph.graph import Graph
from etac_ros.graph.module import Arrival
from etac_ros.graph.plant import PlantModule
from etac_ros.graph.recording import Message, Recording
from etac_ros.graph.spool import Spool
from etac_ros.parameters import FloatArray
from etac_ros.timing.master import TimeMaster
from etac_ros.timing.orders import Deliver, Fire, Look, MessageId, Open, Order, Report
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
        Called with every order and its report; for tests and for teaching.
    before
        Called with the tick before its orders are executed: whoever wants to slow the run down waits in it. An
        attribute, too.
    """

    def __init__(
        self,
        graph: Graph,
        windows: WindowPolicy = USUAL_WINDOWS,
        trace: Callable[[Order, Report], None] | None = None,
        before: Callable[[int], None] = lambda tick: None,
    ) -> None:
        self.master = TimeMaster(graph, windows)
        self._truth = {name: Spool() for name in graph.plants}
        self.recording = Recording(messages={name: [] for name in graph.links}, truth=self._truth)
        self._graph = graph
        self._trace = trace
        self.before = before
        self._drivers = {name: Driver(graph, name) for name in graph.modules}
        self._values: dict[MessageId, FloatArray] = {}
        self._numbers = dict.fromkeys(graph.links, 0)

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
        batches = self.master.run()
        orders = next(batches)
        while True:
            self.before(self.master.tick)
            reports = [self._execute(order) for order in orders]
            try:
                orders = batches.send(reports)
            except StopIteration:
                break
        self.log()
        return self.recording

    def log(self) -> None:
        """Put into the recording what has been sent, and what has happened on the air, since the last time."""
        self.recording.air += self.master.take_air_log()
        for link, sequence, tick, step in self.master.take_message_log():
            value = self._values[MessageId(link, sequence)]
            self.recording.messages[link].append(Message(sequence, tick, step, value))

    def _execute(self, order: Order) -> Report:
        report = self._obey(order)
        if self._trace is not None:
            self._trace(order, report)
        return report

    def _obey(self, order: Order) -> Report:
        if isinstance(order, Look):
            return self._look(order)
        if isinstance(order, Deliver):
            driver = self._drivers[order.module]
            for one in order.settled:
                driver.settle(order.tick, self._graph.links[one.link].port, one.acknowledged)
            if order.settled and not order.messages:
                return Report(halt=driver.module.halt)
            arrivals = tuple(self._arrival(order.module, message) for message in order.messages)
            return Report(self._send(driver.receive(order.tick, arrivals)), halt=driver.module.halt)
        if isinstance(order, Open):
            return self._open(order)
        if isinstance(order, Fire):
            driver = self._drivers[order.module]
            sent, concluded = self._act(driver, order.tick, order.alone)
            return Report(sent, concluded=concluded, halt=driver.module.halt)
        self._commit(order.module, order.tick)
        return Report(halt=self._plant(order.module).halt)

    def _look(self, order: Look) -> Report:
        plant = self._graph.reads.get(order.module)
        if plant is not None and self._plant(plant).halt:
            return Report()  # there is no window any more to look at
        driver = self._drivers[order.module]
        proposal = driver.look(order.after)
        if proposal is None or proposal > order.grant:
            return Report(proposal=proposal)
        sent, concluded = self._act(driver, proposal, alone=True)
        return Report(sent, proposal, fired=True, concluded=concluded, halt=driver.module.halt)

    def _open(self, order: Open) -> Report:
        self._commit(order.module, order.tick)
        plant = self._plant(order.module)
        if plant.halt:
            return Report(halt=plant.halt)
        window = plant.open(order.length)
        for reader in self._graph.readers[order.module]:
            self._drivers[reader].see(window)
        return Report()

    def _act(self, driver: Driver, tick: int, alone: bool) -> tuple[tuple[str, ...], tuple[str, ...] | None]:
        sent = self._send(driver.fire(tick))
        return sent, self._send(driver.conclude(tick)) if alone and driver.module.concludes else None

    def _plant(self, name: str) -> PlantModule:
        module = self._graph.modules[name]
        assert isinstance(module, PlantModule)
        return module

    def _commit(self, plant: str, tick: int) -> None:
        start, samples = self._plant(plant).commit(tick)
        if samples.shape[0]:
            self._truth[plant].append((start, samples))

    def _arrival(self, receiver: str, message: MessageId) -> Arrival:
        return Arrival(self._graph.links[message.link].receivers[receiver], message.link, self._values[message])

    def _send(self, sent: Sent) -> tuple[str, ...]:
        for link, value in sent:
            self._numbers[link.name] += 1
            self._values[MessageId(link.name, self._numbers[link.name])] = value
        return tuple(link.name for link, _ in sent)
