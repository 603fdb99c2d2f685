"""The first ticks of a run within one process, over the same bytes, for no other purpose than to be done.

A process that was forked owns nothing yet of what a run touches: every page is copied when it is first written to, and
code that runs for the first time takes several times as long. The first trigger of a run would take eight times as long
as later ones. So each process goes through what it is going to do, while DDS looks for the others and nobody waits.
"""

from __future__ import annotations

import time
from collections import deque
from collections.abc import Callable
from functools import partial
from typing import Any

from etac_ros.bag.codec import decode
from etac_ros.engines.ros.messages import decode_window, encode, encode_window, read_note, write_note
from etac_ros.engines.ros.notes import order_note, read_order, read_report, report_note
from etac_ros.graph.graph import Graph, Link
from etac_ros.maths.ticks import nanoseconds
from etac_ros.timing import dispatcher, worker
from etac_ros.timing.dispatcher import Dispatcher
from etac_ros.timing.duties import Duties
from etac_ros.timing.master import TimeMaster
from etac_ros.timing.windows import WindowPolicy
from etac_ros.timing.worker import ModuleWorker, PlantWorker

_RUN = "rehearsal"


class Rehearsal:
    """One run whose messages are handed over here and now, each as the bytes that it would be.

    Parameters
    ----------
    graph
        Freshly built modules, which are used up by it.
    windows
        How far plants compute ahead.
    """

    def __init__(self, graph: Graph, windows: WindowPolicy) -> None:
        self.finished = False
        self._graph = graph
        self._duties = Duties(graph, windows)
        self._numbers = dict.fromkeys(graph.links, 0)
        self._under_way: deque[Callable[[], None]] = deque()
        self._workers = {name: self._worker(name) for name in graph.modules}
        acting = dict.fromkeys(self._duties.acting, windows.longest)
        self.master = TimeMaster(graph, windows, acting)
        self._dispatcher = Dispatcher(graph, self._duties, self.master, self._on_order)

    def run(self, deadline_s: float) -> None:
        """Run until it is over, or until an instant of ``time.monotonic`` [s]."""
        self._dispatcher.begin()
        while self._under_way and time.monotonic() < deadline_s:
            self._under_way.popleft()()

    def _worker(self, name: str) -> ModuleWorker:
        kind = PlantWorker if name in self._graph.plants else ModuleWorker
        return kind(self._graph, self._duties, name, lambda effect: self._on_effect(name, effect))

    def _on_effect(self, name: str, effect: worker.Effect) -> None:
        match effect:
            case worker.Send(link, value, tick):
                number = self._numbers[link.name] = self._numbers[link.name] + 1
                data = encode(link.wire, value, nanoseconds(tick, self._graph.ticks_per_second))
                for receiver in link.receivers:
                    self._under_way.append(partial(self._hear, self._workers[receiver], link, number, data, tick))
            case worker.Tell(report, tick, ahead):
                self._under_way.append(partial(self._report, name, _note(report_note(report, tick, ahead))))
            case worker.Offer(window, grant):
                data = encode_window(window, grant)
                for reader in self._graph.readers[name]:
                    self._under_way.append(partial(self._show, self._workers[reader], name, data))
            case worker.Obeyed(report):
                if name not in self._duties.remote_plants:
                    self._dispatcher.on_obeyed(name, report)
                elif report.halt:
                    self._under_way.append(partial(self._dispatcher.on_halt, name, report))
            case _:
                pass  # samples that are final: nobody keeps them

    def _on_order(self, effect: dispatcher.Effect) -> None:
        match effect:
            case dispatcher.Command(module, orders):
                note = _note([order_note(order) for order in orders])
                self._under_way.append(partial(self._order, self._workers[module], note))
            case dispatcher.Call(plant, order):
                self._workers[plant].on_orders([order])
            case dispatcher.Hint(plant, compared):
                seen = self._workers[plant]
                assert isinstance(seen, PlantWorker)
                seen.expect(compared)
            case _:
                self.finished = True

    def _hear(self, hearer: ModuleWorker, link: Link, number: int, data: bytes, tick: int) -> None:
        value = decode(link.wire.type_name, data)
        hearer.on_message(link, number, value, tick if hearer.wants_stamps else None)

    def _show(self, reader: ModuleWorker, plant: str, data: bytes) -> None:
        reader.on_window(*decode_window(data, plant))

    def _order(self, obeying: ModuleWorker, note: bytes) -> None:
        obeying.on_orders([read_order(order) for order in read_note(note, _RUN)])

    def _report(self, module: str, note: bytes) -> None:
        self._dispatcher.on_report(module, *read_report(read_note(note, _RUN)))


def _note(content: Any) -> bytes:
    return write_note(content, _RUN)
