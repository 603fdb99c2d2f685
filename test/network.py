"""A run without processes and DDS: workers and dispatcher joined by queues whose order of delivery a test chooses.

Within a queue (one topic, one receiver) the order is kept, as DDS keeps it; between queues everything is possible.
"""

from __future__ import annotations

from collections import deque
from collections.abc import Callable, Iterator
from typing import Any

from etac_ros.graph.graph import Graph
from etac_ros.graph.recording import Message, Recording
from etac_ros.parameters import FloatArray
from etac_ros.timing.dispatcher import Call, Command, Dispatcher, Finished, Hint
from etac_ros.timing.dispatcher import Effect as Order
from etac_ros.timing.duties import Duties
from etac_ros.timing.master import TimeMaster
from etac_ros.timing.orders import MessageId
from etac_ros.timing.windows import WindowPolicy
from etac_ros.timing.worker import Commit, Effect, ModuleWorker, Offer, PlantWorker, Send, Tell

COORDINATOR = "coordinator"
Queue = tuple[str, str]
"""Receiver and topic."""


class Network:
    """One run; :meth:`deliver` hands over the head of a queue."""

    def __init__(self, graph: Graph, windows: WindowPolicy) -> None:
        self.graph = graph
        self.duties = Duties(graph, windows)
        self.master = TimeMaster(graph, windows, dict.fromkeys(self.duties.acting, windows.longest))
        self.queues: dict[Queue, deque[Any]] = {}
        self.delivered: dict[Queue, int] = {}
        self.finished = False
        self.values: dict[MessageId, FloatArray] = {}
        self.truth: dict[str, list[tuple[int, FloatArray]]] = {name: [] for name in graph.plants}
        self._numbers = dict.fromkeys(graph.links, 0)
        self.workers: dict[str, ModuleWorker] = {}
        for name in graph.modules:
            kind = PlantWorker if name in graph.plants else ModuleWorker
            self.workers[name] = kind(graph, self.duties, name, self._of(name))
        self.dispatcher = Dispatcher(graph, self.duties, self.master, self._on_order)
        self.dispatcher.begin()

    def waiting(self) -> list[Queue]:
        """Queues from which something can be delivered."""
        return sorted(queue for queue, content in self.queues.items() if content)

    def deliver(self, queue: Queue) -> None:
        """Hand the head of a queue to its receiver."""
        receiver, topic = queue
        self.delivered[queue] = self.delivered.get(queue, 0) + 1
        kind, content = self.queues[queue].popleft()
        if kind == "message":
            sequence, value, tick = content
            worker = self.workers[receiver]
            worker.on_message(self.graph.links[topic], sequence, value, tick)
        elif kind == "window":
            self.workers[receiver].on_window(*content)
        elif kind == "orders":
            self.workers[receiver].on_orders(content)
        elif kind == "halt":
            self.dispatcher.on_halt(topic, content)
        else:
            self.dispatcher.on_report(topic, *content)

    def recording(self) -> Recording:
        """What the run left behind, with the places in time that the master gave it."""
        messages: dict[str, list[Message]] = {name: [] for name in self.graph.links}
        for link, sequence, tick, step in self.master.take_message_log():
            messages[link].append(Message(sequence, tick, step, self.values[MessageId(link, sequence)]))
        return Recording(messages, self.truth, self.master.take_air_log())

    def check_done(self) -> None:
        """All that was laid down was done, by everybody, and nothing else."""
        assert self.finished
        assert not self.waiting()
        assert self.dispatcher.is_idle()
        for name, worker in self.workers.items():
            assert worker.is_idle(), name
            assert worker.done == self.master.done[name], name
        for link in self.graph.links.values():
            for receiver in link.receivers:
                assert self.workers[receiver].values[link.name] == self.workers[link.sender].sent_values[link.name]

    def state(self) -> tuple[Any, ...]:
        """What the future depends on: two histories that meet in it need not be told apart from there on."""
        workers = tuple(
            (
                worker.done,
                worker._proposal,
                worker._epoch(),
                tuple(worker._orders),
                tuple(worker._arrived),
                tuple(window.epoch for window, _ in worker._windows),
                tuple(sorted(worker._inbox)),
            )
            for worker in self.workers.values()
        )
        early = tuple(len(reports) for reports in self.dispatcher._early.values())
        queued = tuple(sorted((queue, len(content)) for queue, content in self.queues.items() if content))
        return queued, workers, early, self.dispatcher.steps, tuple(sorted(self.dispatcher._awaited))

    def _put(self, receiver: str, topic: str, kind: str, content: Any) -> None:
        self.queues.setdefault((receiver, topic), deque()).append((kind, content))

    def _of(self, name: str) -> Callable[[Effect], None]:
        def emit(effect: Effect) -> None:
            match effect:
                case Send(link, value, tick):
                    self._numbers[link.name] += 1
                    number = self._numbers[link.name]
                    self.values[MessageId(link.name, number)] = value
                    for receiver in link.receivers:
                        self._put(receiver, link.name, "message", (number, value, tick))
                case Tell(report, tick, ahead):
                    self._put(COORDINATOR, name, "report", (report, tick, ahead))
                case Offer(window, grant):
                    for reader in self.graph.readers[name]:
                        self._put(reader, f"window of {name}", "window", (window, grant))
                case Commit(first, samples):
                    self.truth[name].append((first, samples))
                case _:
                    if name not in self.duties.remote_plants:
                        self.dispatcher.on_obeyed(name, effect.report)
                    elif effect.report.halt:
                        self._put(COORDINATOR, name, "halt", effect.report)

        return emit

    def _on_order(self, effect: Order) -> None:
        match effect:
            case Command(module, orders):
                self._put(module, "orders", "orders", orders)
            case Call(plant, order):
                self.workers[plant].on_orders([order])
            case Hint(plant, compared):
                worker = self.workers[plant]
                assert isinstance(worker, PlantWorker)
                worker.expect(compared)
            case Finished():
                self.finished = True


Build = Callable[[], Network]


def run(build: Build, choose: Callable[[list[Queue]], Queue]) -> Network:
    """Run to the end, each delivery as ``choose`` says."""
    network = build()
    while waiting := network.waiting():
        network.deliver(choose(waiting))
    network.check_done()
    return network


def every_interleaving(build: Build, most: int) -> Iterator[Network]:
    """Every finished run that another order of deliveries makes different from the others.

    A depth-first search that starts anew for each branch, since a run cannot be copied, and turns back where it meets
    a state that it has seen.

    Parameters
    ----------
    most
        Runs, finished or cut short, after which the search gives up.
    """
    seen: set[int] = set()
    prefixes: list[list[Queue]] = [[]]
    runs = 0
    while prefixes:
        path = prefixes.pop()
        runs += 1
        assert runs <= most, f"more than {most} branches"
        network = build()
        for queue in path:
            network.deliver(queue)
        while waiting := network.waiting():
            state = hash(network.state())
            if state in seen:
                break
            seen.add(state)
            prefixes += [[*path, other] for other in waiting[1:]]
            path = [*path, waiting[0]]
            network.deliver(waiting[0])
        else:
            network.check_done()
            yield network


def starved(victims: list[str]) -> Callable[[list[Queue]], Queue]:
    """Deliver what concerns a victim (a receiver, a topic) only when nothing else is left; the first suffers most."""

    def rank(queue: Queue) -> tuple[int, ...]:
        return tuple(int(victim in queue) for victim in victims)

    def choose(waiting: list[Queue]) -> Queue:
        return min(waiting, key=rank)

    return choose
