"""One process of a run: some nodes, one loop, and a clean way out."""

from __future__ import annotations

import contextlib
import os
import signal
import sys
import time
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any, NoReturn

import rclpy
from rclpy.context import Context
from rclpy.impl.implementation_singleton import rclpy_implementation as _rclpy
from rclpy.signals import SignalHandlerOptions

from etac_ros.engines.ros.convener import Convener
from etac_ros.engines.ros.coordinator import CoordinatorNode, Progress
from etac_ros.engines.ros.count_check import Outcome
from etac_ros.engines.ros.domain import DOMAIN_VARIABLE
from etac_ros.engines.ros.endpoints import Spinner
from etac_ros.engines.ros.environment import may_keep_apart
from etac_ros.engines.ros.limits import limits_in_force
from etac_ros.engines.ros.liveness import LifeSigns, fresh_s
from etac_ros.engines.ros.module_node import ModuleNode, PlantNode
from etac_ros.engines.ros.plan import COORDINATOR, RECORDER, Plan
from etac_ros.engines.ros.recorder import RecorderNode, Sink
from etac_ros.engines.ros.run_node import RunNode
from etac_ros.engines.ros.scheduling import take_turns
from etac_ros.engines.ros.signals import ENDING, let_through
from etac_ros.errors import EtacError, RunError
from etac_ros.processes import flush_streams

_JOIN_WAIT_S = 0.005
_WAIT_S = 0.05
"""Longest wait for a message before signals and the parent process are looked at."""

_ROLL_CALL_S = 1.0
_END_WITHIN_S = 20
"""How long a node that is started by hand may take to end after a signal."""
_COLLECT_S = 2.0
"""How long a node that gives up still takes what comes: others may go on sending, faster than it takes."""
_GATHER_S = 0.005
"""How long the recorder lets messages gather; nobody waits for it before the end."""
_LOOK_S = 0.1
_GLANCE_S = 0.01
"""A loop that comes round more often than this looks around no more often."""


def _nothing(tick: int, fired: Any) -> None:
    """No progress is shown."""


def leave_process(code: int) -> NoReturn:
    """End this process at once.

    When a node has left, all its messages are acknowledged and nothing is left to be done. Destroying
    its participant is left to the operating system, since Fast DDS was seen to hang in it on a busy machine; and
    exit handlers are left alone, since in a forked process they belong to the parent.
    """
    flush_streams()
    os._exit(code)


class EndedByOthers(RunError):
    """A node ends because another has failed."""


@dataclass(frozen=True)
class Supervised:
    """What a process knows of the launcher that started it.

    Attributes
    ----------
    parent
        The launcher's process; its end means the end of this one.
    signs
        Where all processes of the launcher show that they live.
    place
        That of this process.
    """

    parent: int
    signs: LifeSigns
    place: int


class Host:
    """Runs nodes in this process until the run is over.

    Parameters
    ----------
    plan
        The run.
    names
        Full names of the nodes to play here.
    open_sink
        Creates the bag; needed where the recorder is played.
    on_progress
        Told the tick and the triggers so far, where the coordinator is played.
    patient
        Others of the run are started by hand, which may take its time, and nobody sees them die but their peers.
    supervised
        How the launcher that started this process sees it; None for a node started by hand.
    on_begin
        In real time: told the instant of tick 0 on the wall clock [ns], where the coordinator is played.
    ready_sink
        Readies what ``open_sink`` needs, where the recorder is played; called before it joins.

    Attributes
    ----------
    ended_by
        The signal that told this process to end, if one did.
    """

    def __init__(
        self,
        plan: Plan,
        names: Sequence[str],
        open_sink: Callable[..., Sink] | None = None,
        on_progress: Progress = _nothing,
        patient: bool = True,
        supervised: Supervised | None = None,
        on_begin: Callable[[int], None] = lambda start_ns: None,
        ready_sink: Callable[[], None] = lambda: None,
    ) -> None:
        self._plan = plan
        self._names = names
        self._open_sink = open_sink
        self._on_progress = on_progress
        self._patient = patient
        self._supervised = supervised
        self._on_begin = on_begin
        self._ready_sink = ready_sink
        self.ended_by: int | None = None
        self._roll_call = 0.0
        self._next_look = 0.0
        self._last_round = time.monotonic()
        self._excused = 0.0
        self._nodes: list[RunNode] = []
        self._coordinator: Convener | None = None
        self._spinner: Spinner

    def run(self) -> Outcome | None:
        """Join, take part, leave. Afterwards the process has to end by :func:`leave_process`.

        Returns
        -------
        Outcome or None
            The outcome of the run, where the coordinator is played.

        Raises
        ------
        EtacError
            If this node failed, or was told of another's failure.
        """
        self._hear_signals()
        if RECORDER in self._names:
            self._ready_sink()  # as long as it has the same share of the processors as the others
        self._before_threads()
        context = Context()
        try:
            # Without log files: nobody reads them, and there may be no folder for them.
            quietly = ["--ros-args", "--disable-external-lib-logs", "--disable-stdout-logs", *self._plan.ros_args]
            rclpy.init(args=quietly, context=context, signal_handler_options=SignalHandlerOptions.NO)
            self._create(context)
        except _rclpy.RCLError as error:
            raise RunError(
                f"node {', '.join(self._names)}",
                f"cannot be created: {error}{limits_in_force()}",
                "",
                may_keep_apart(os.environ, Path.cwd()),
            ) from None
        try:
            self._make_ready()
            self._join()
            self._take_part()
        except BaseException as error:
            self._give_up(error)
            raise
        return self._outcome()

    def _hear_signals(self) -> None:
        for number in ENDING:
            if self._supervised is not None and number != signal.SIGTERM:
                # A terminal sends these to all processes, but the launcher ends them, the recorder last.
                signal.signal(number, signal.SIG_IGN)
            elif signal.getsignal(number) != signal.SIG_IGN:
                signal.signal(number, self._on_signal)
        let_through()

    def _create(self, context: Context) -> None:
        only_listens = list(self._names) == [RECORDER]
        self._spinner = Spinner(context, _GATHER_S if only_listens else 0.0)
        plants: dict[str, PlantNode] = {}
        names = list(self._names)
        together = self._plan.timekeeper_with
        if together in names and COORDINATOR not in names:
            names.append(COORDINATOR)
        # The coordinator comes last: it talks to the plant beside it directly.
        for name in sorted(names, key=lambda name: name == COORDINATOR):
            if name == COORDINATOR:
                local = plants if together else {}
                self._coordinator = CoordinatorNode(self._plan, self._spinner, context, local, self._on_progress)
                self._nodes.append(self._coordinator)
            elif name == RECORDER:
                assert self._open_sink is not None
                self._nodes.append(RecorderNode(self._plan, self._spinner, context, self._open_sink))
            elif name in self._plan.graph.plants:
                plants[name] = PlantNode(self._plan, name, self._spinner, context)
                self._nodes.append(plants[name])
            else:
                self._nodes.append(ModuleNode(self._plan, name, self._spinner, context))

    def _make_ready(self) -> None:
        """Called while DDS looks for the others, when there is nothing else to do."""
        if self._plan.rehearse is not None and not {RECORDER}.issuperset(self._names):
            with contextlib.suppress(Exception):  # which the run will meet itself, and tell, with its bag
                self._plan.rehearse()

    def _join(self) -> None:
        waiting = list(self._nodes)
        for node in waiting:
            node.log(f"ready in ROS domain {os.environ.get(DOMAIN_VARIABLE, '0')}; the run begins when all are there")
        began = told = time.monotonic()
        patience_s = self._plan.quiet_s
        while waiting:
            self._spinner.once(_JOIN_WAIT_S)
            self._look_around()
            for node in [node for node in waiting if node.matched]:
                node.announce()
                waiting.remove(node)
            now = time.monotonic()
            if not waiting or now - max(told, self._excused) < patience_s:
                continue
            told = now
            patience_s *= 2.0  # each node of a part says so: at once that would be a screen full every 20 s
            topics = ", ".join(waiting[0].missing())
            if not self._patient:
                raise RunError(
                    f"node {waiting[0].name}", f"found no other end for {topics} within {self._plan.quiet_s:g} s"
                )
            cause = may_keep_apart(os.environ, Path.cwd())
            waiting[0].say(
                f"{now - began:.0f} s in ROS domain {os.environ.get(DOMAIN_VARIABLE, '0')}, "
                f"still no other end for {topics}{cause and f' ({cause})'}"
            )

    def _before_threads(self) -> None:
        """Called before DDS starts its threads, which inherit how this process is scheduled."""
        if self._supervised is not None:
            take_turns(only_listens=list(self._names) == [RECORDER])

    def _take_part(self) -> None:
        while not all(node.finished for node in self._nodes):
            if not self._spinner.once(_WAIT_S):
                self._be_idle()
            elif self._coordinator is not None and not self._coordinator.started:
                self._coordinator.idle(self._patient)  # a foreign node may send all the time
            self._look_around()

    def _be_idle(self) -> None:
        if self._coordinator is not None:
            self._coordinator.idle(self._patient)
        now = time.monotonic()
        if not self._patient or now < self._roll_call:
            return  # a parent of all sees at once when a process ends
        self._roll_call = now + _ROLL_CALL_S
        for node in self._nodes:
            if node.stop is not None and node.stop["fault"]:
                raise EndedByOthers(f"node {node.name}", f"the run was ended: {node.stop['fault']}")
            if node.has_left and node.deserted():
                node.finished = True  # the end was told, and missed
            if node.started and node.stop is None and (gone := node.deserted()):
                raise RunError(
                    f"node {', '.join(gone)}",
                    f"has gone, which {node.name} listens to",
                    "every node lives until the run is over",
                    "see what it printed",
                )

    def _look_around(self) -> None:
        now = time.monotonic()
        if now - self._last_round < _GLANCE_S and self.ended_by is None:
            return
        if now - self._last_round > fresh_s(self._plan.quiet_s):
            self._excuse(now)  # this process itself was stopped, or has computed
        self._last_round = now
        if self._supervised is not None:
            self._supervised.signs.give(self._supervised.place)
        if self.ended_by is not None:
            if all(node.has_left for node in self._nodes):
                for node in self._nodes:
                    node.finished = True  # nothing was left to do but to hear of the end
                return
            raise RunError(f"node {', '.join(self._names)}", "was told to end before the run was over")
        if now < self._next_look:
            return
        self._next_look = now + _LOOK_S
        if self._supervised is not None:
            if os.getppid() != self._supervised.parent:
                raise RunError(f"node {', '.join(self._names)}", "lost the process that started it")
            if not self._supervised.signs.all_fresh():
                self._excuse(now)
        for node in self._nodes:
            fault = (node.stop or {}).get("fault")
            # The recorder stays until nothing comes any more, the coordinator knows it anyway.
            if fault and node.name not in (COORDINATOR, RECORDER):
                raise EndedByOthers(f"node {node.name}", f"the run was ended: {fault}")

    def _excuse(self, now: float) -> None:
        """Nobody can be expected to have answered while a process of the run was stopped, or computed.

        If that goes on for too long it is the launcher who says so; what is named here are answers that are owed
        while everybody listens.
        """
        self._excused = now
        if self._coordinator is not None:
            self._coordinator.excuse()

    def _give_up(self, error: BaseException) -> None:
        """Save what can be saved, and tell the others. Never hides the error it is called for."""
        text = str(error) if isinstance(error, EtacError) else f"{type(error).__name__}: {error}"
        deadline = time.monotonic() + _COLLECT_S
        try:
            while self._spinner.once(0.0) and time.monotonic() < deadline:
                pass  # what has already arrived belongs into the bag
        except Exception as secondary:
            print(f"while collecting what has arrived: {secondary}", file=sys.stderr, flush=True)
        for node in self._nodes:
            node.log(text, error=True)
            try:
                if self.ended_by is None and node.stop is None:
                    node.say_fault(text)
                if isinstance(node, Convener):
                    node.fault = text
                node.abort()
            except Exception as secondary:
                print(f"while saving {node.name}: {secondary}", file=sys.stderr, flush=True)

    def _outcome(self) -> Outcome | None:
        if not isinstance(self._coordinator, CoordinatorNode):
            return None
        master = self._coordinator.master
        return Outcome(
            tick=master.tick,
            halted=self._coordinator.halted,
            fired=dict(master.fired),
            sent=dict(master.sent),
            done=dict(master.done),
            leave_notes=dict(self._coordinator.leave_notes),
            began_s=self._coordinator.began,
            loop_s=self._coordinator.loop_s,
        )

    def _on_signal(self, number: int, frame: Any) -> None:
        self.ended_by = number
        if self._supervised is None:
            # Nobody ends it if it cannot: what it says may be read by nobody, or DDS may hang. An alarm, which is left
            # to the system, needs neither this loop nor Python.
            signal.alarm(_END_WITHIN_S)
