"""The coordinator: drives the time master with messages, keeps the message log, begins and ends the run."""

from __future__ import annotations

import time
from collections import defaultdict, deque
from collections.abc import Callable, Mapping, Sequence
from typing import Any

from builtin_interfaces.msg import Time
from rclpy.context import Context
from rosgraph_msgs.msg import Clock
from std_msgs.msg import String

from etac_ros.engines.ros.endpoints import Publisher, Spinner
from etac_ros.engines.ros.messages import note, read_note
from etac_ros.engines.ros.module_node import PlantNode
from etac_ros.engines.ros.notes import order_note, read_report
from etac_ros.engines.ros.plan import COORDINATOR, Plan
from etac_ros.engines.ros.run_node import RunNode
from etac_ros.errors import RunError
from etac_ros.graph.topics import CLOCK, END, FAULT, JOIN, LEAVE, MESSAGE_LOG, START, STOP, go_topic, next_topic
from etac_ros.maths.ticks import NANOSECONDS, nanoseconds
from etac_ros.timing.master import TimeMaster
from etac_ros.timing.orders import Close, Deliver, Fire, Look, Open, Order, Report

_TELL_EVERY_S = 0.1  # wall time between message logs, clock ticks and progress: none of it bears on a result
QUIET_S = 20.0
"""A node that owes an answer for this long is reported; only failures ever wait so long."""

Progress = Callable[[int, Mapping[str, int]], None]


class CoordinatorNode(RunNode):
    """The node that advances time.

    Parameters
    ----------
    plan, spinner, context
        As for :class:`RunNode`.
    plants
        Plants in this process; they take orders as calls.
    on_progress
        Told the tick and the triggers so far, now and then.
    """

    def __init__(
        self,
        plan: Plan,
        spinner: Spinner,
        context: Context,
        plants: Mapping[str, PlantNode],
        on_progress: Progress,
    ) -> None:
        super().__init__(plan, COORDINATOR, spinner, context)
        self.master = TimeMaster(plan.graph, plan.windows)
        self.leave_notes: dict[str, dict[str, Any]] = {}
        self.fault = ""
        self.loop_s = 0.0
        self._plants = plants
        self._on_progress = on_progress
        self._greeted: dict[str, int] = {}
        self.began = 0.0
        self._told = 0.0
        self._heard = time.monotonic()
        self._batches = self.master.run()
        self._orders: Sequence[Order] = ()
        self._reports: list[Report | None] = []
        self._awaited: dict[str, int] = {}
        self._ahead: dict[str, int | None] = {}
        self._early: dict[str, deque[Report]] = defaultdict(deque)
        self._dispatching = False
        self._held_back: dict[str, list[Order]] = defaultdict(list)
        self._go: dict[str, Publisher] = {name: self.publisher(String, go_topic(name), 1) for name in plan.ordered}
        self._message_log = self.publisher(String, MESSAGE_LOG, 1)
        self._start = self.publisher(String, START, 0, latched=True)
        self._stop = self.publisher(String, STOP, 0, latched=True)
        self._end = self.publisher(String, END, 0, latched=True)
        self._clock = self.publisher(Clock, CLOCK, 0)
        for name in plan.modules:
            if plan.reports(name):
                self._hear_next(name)
        for name in plan.remote_plants:
            self._hear_halt(name)
        for name, plant in plants.items():
            self._be_told_by(name, plant)
        self.subscription(String, JOIN, self._on_join, latched=True)
        self.subscription(String, FAULT, self._on_fault, latched=True)
        self.subscription(String, LEAVE, self._on_leave, shared=True)

    def idle(self, patient: bool) -> None:
        """Called while nothing arrives: notices who has gone quiet.

        Parameters
        ----------
        patient
            Wait without end for nodes to appear, and say for whom; they are started by hand.

        Raises
        ------
        RunError
            Naming the nodes that owe an answer.
        """
        if time.monotonic() - self._heard < QUIET_S:
            return
        self._heard = time.monotonic()
        if not self.started:
            missing = [name for name in self.plan.nodes if name not in self._greeted]
            if patient:
                print(f"{self.name}: still waiting for {', '.join(missing)}", flush=True)
                return
            raise RunError(
                f"node {', '.join(missing)}",
                f"has not appeared within {QUIET_S:g} s",
                "all nodes of the scenario, started with the same parameter file",
                "start it, or see what it printed",
            )
        if self.stop is None:
            raise RunError(
                f"node {', '.join(self._silent())}",
                f"has gone quiet at simulated time {self._seconds():.6g} s: no answer for {QUIET_S:g} s",
                "an answer to every order",
                "is its process still there? see what it printed",
            )
        missing = [name for name in self.plan.nodes if name not in self.leave_notes]
        raise RunError(f"node {', '.join(missing)}", f"has not left within {QUIET_S:g} s")

    def end(self, fault: str) -> None:
        """End the run, now that it is over or has failed; all others hear of it."""
        self._tell()
        self.fault = fault
        self.loop_s = time.perf_counter() - self.began if self.began else 0.0
        orders = {name: publisher.count.messages for name, publisher in self._go.items()}
        content = {
            "tick": self.master.tick, "fault": fault, "sent": self.master.sent, "orders": orders,
        }  # fmt: skip
        self._stop.publish(note(content))

    def abort(self) -> None:
        """Tell the recorder what is known, and everybody that it is over."""
        if self.stop is None:
            self.end(self.fault or "aborted")
            self._message_log.drain(1.0)
            self._stop.drain(1.0)

    def drained(self) -> bool:
        """Whether all other nodes have left."""
        others = [name for name in self.plan.nodes if name != COORDINATOR]
        return all(name in self.leave_notes for name in others)

    def leave(self) -> None:
        """All counts are in: let everybody go."""
        self.leave_notes[self.name] = self.leave_note()
        self._end.publish(note({"tick": self.master.tick}))
        self.finished = True

    @property
    def halted(self) -> str:
        """Why a watch ended the run; empty otherwise."""
        last = [f"{name}: {leave['halted']}" for name, leave in self.leave_notes.items() if leave.get("halted")]
        return self.master.halted or (last[0] if last else "")

    def on_start(self) -> None:
        """Begin: the master's first orders."""
        self.began = self._told = time.perf_counter()
        self._dispatch(next(self._batches))

    def _hear_next(self, module: str) -> None:
        def on_next(message: Any, sequence: int) -> None:
            report, ahead = read_report(read_note(message))
            self._heard = time.monotonic()
            self._ahead[module] = ahead
            if module in self._awaited:
                self._answered(module, report)
            elif self.plan.acts_on_arrival(module):
                self._early[module].append(report)  # it did not wait for the order, which is still to come
            else:
                raise RunError(f"node {module}", "has reported without being asked", "one report an order")

        self.subscription(String, next_topic(module), on_next)

    def _be_told_by(self, name: str, plant: PlantNode) -> None:
        def on_obeyed(report: Report) -> None:
            if report.halt and any(isinstance(order, Open) for order in self._orders):
                self._halted(name, report)
            else:
                self._answered(name, report)

        plant.on_obeyed = on_obeyed

    def _answered(self, module: str, report: Report) -> None:
        self._reports[self._awaited.pop(module)] = report
        self._proceed_if_complete()

    def _halted(self, plant: str, report: Report) -> None:
        """Go on without the others: there is no window that anybody could look at."""
        self._reports = [
            report if isinstance(order, Open) and order.module == plant else known or Report()
            for order, known in zip(self._orders, self._reports, strict=True)
        ]
        self._awaited.clear()
        self._proceed_if_complete()

    def _hear_halt(self, plant: str) -> None:
        def on_halt(message: Any, sequence: int) -> None:
            report, _ = read_report(read_note(message))
            self._halted(plant, report)

        self.subscription(String, next_topic(plant), on_halt)

    def _on_join(self, message: Any, sequence: int) -> None:
        join = read_note(message)
        name = join["node"]
        self._heard = time.monotonic()
        if name not in self.plan.nodes:
            raise RunError(
                f"node {name}", f"of scenario '{join['scenario']}' is in this ROS domain", "only this run's nodes",
                "give each run a domain of its own",
            )  # fmt: skip
        if join["digest"] != self.plan.digest:
            raise RunError(
                f"node {name}",
                f"was started with another scenario ('{join['scenario']}', {join['digest']})",
                f"'{self.plan.scenario}', {self.plan.digest}",
                "start all nodes with the file that `etac resolve` prints",
            )
        if self._greeted.setdefault(name, join["pid"]) != join["pid"]:
            raise RunError(
                f"node {name}", "is there twice in this ROS domain", "every node once",
                "give each run a domain of its own",
            )  # fmt: skip
        if len(self._greeted) == len(self.plan.nodes) and not self.started:
            self.started = True
            self._start.publish(note({"scenario": self.plan.scenario, "digest": self.plan.digest}))
            self.on_start()

    def _on_fault(self, message: Any, sequence: int) -> None:
        content = read_note(message)
        if self.stop is None and not self.fault and content["node"] != self.name:
            raise RunError(f"node {content['node']}", content["fault"])

    def _on_leave(self, message: Any, sequence: int) -> None:
        content = read_note(message)
        self._heard = time.monotonic()
        self.leave_notes[content["node"]] = content
        self.settle()

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
            if self._awaited:
                return
            following = self._step()
            if following is None:
                return
            orders = following

    def _proceed_if_complete(self) -> None:
        if self._dispatching or self._awaited:
            return
        orders = self._step()
        if orders is not None:
            self._dispatch(orders)

    def _step(self) -> Sequence[Order] | None:
        if time.perf_counter() - self._told > _TELL_EVERY_S:
            self._tell()
        reports = [report for report in self._reports if report is not None]
        try:
            return self._batches.send(reports)
        except StopIteration:
            self.end("")
            return None

    def _known(self, order: Order, opened: set[str]) -> Report | None:
        """The report on an order where it is known beforehand; None where it has to be waited for."""
        graph = self.plan.graph
        match order:
            case Open(module) | Close(module):
                return None if module in self._plants else Report()
            case Deliver(module) if module in graph.plants:
                return Report()
            case Deliver(module) if graph.modules[module].answers:
                return self._sends_all(module)
            case Deliver(module) if self._early[module]:
                return self._early[module].popleft()
            case Look(module, after, grant) if not self.plan.reports(module):
                # Leave to act comes with a window; without one the module knows nothing of this look.
                return self._regular(module, after, grant if graph.reads.get(module) in opened else -1)
            case Fire(module) if graph.modules[module].fires_on is not None:
                self._ahead.pop(module, None)
                return self._fires(module, order.alone)
            case Fire(module) if not self.plan.reports(module):
                return self._sends_all(module)
            case Look(module) if graph.reads.get(module) not in opened and module in self._ahead:
                return Report(proposal=self._ahead[module])
            case _:
                return None

    def _sends_all(self, module: str) -> Report:
        return Report(sent=tuple(link.name for link in self.plan.graph.sends[module]))

    def _fires(self, module: str, alone: bool) -> Report:
        """What a module does that always sends the same when it fires."""
        node = self.plan.graph.modules[module]
        assert node.fires_on is not None
        ports = {link.name: link.port for link in self.plan.graph.sends[module]}
        sent = tuple(name for name, port in ports.items() if port in node.fires_on)
        concluded = tuple(name for name, port in ports.items() if port == node.triggers)
        return Report(sent, concluded=concluded if alone and node.concludes else None)

    def _regular(self, module: str, after: int, grant: int) -> Report:
        """What a module that acts at regular ticks answers to a look."""
        every = self.plan.graph.modules[module].every
        assert every is not None
        proposal = (after // every + 1) * every
        if proposal > grant:
            return Report(proposal=proposal)
        return Report(self._sends_all(module).sent, proposal, fired=True)

    def _hand_over(self, order: Order, opened: set[str]) -> None:
        graph = self.plan.graph
        name = order.module
        if name in self._plants:
            self._plants[name].enqueue(order)
        elif isinstance(order, Look) and (graph.reads.get(name) in opened or name not in self._awaited):
            return  # it looks as soon as it sees the window, or has looked already
        elif name in graph.plants and isinstance(order, Deliver):
            self._held_back[name].append(order)  # goes with the next window, which is when the plant needs it
        elif name in self._go:
            orders = [*self._held_back.pop(name, []), order]
            self._go[name].publish(note([order_note(each) for each in orders]))

    def _tell(self) -> None:
        """Ledger for the recorder, clock for ROS tools, progress for people."""
        self._told = time.perf_counter()
        transits = self.master.take_message_log()
        if transits:
            self._message_log.publish(note(transits))
        now = nanoseconds(self.master.tick, self.plan.graph.ticks_per_second)
        self._clock.publish(Clock(clock=Time(sec=now // NANOSECONDS, nanosec=now % NANOSECONDS)))
        self._on_progress(self.master.tick, self.master.fired)

    def _silent(self) -> list[str]:
        """Who owes a report; if a plant waits for a torque, the whole chain is meant."""
        return sorted(self._awaited) or list(self.plan.modules)

    def _seconds(self) -> float:
        return self.master.tick / self.plan.graph.ticks_per_second
