"""Starts the processes of a run, watches over them, and ends them: none is ever left behind.

They are forked after everything is imported and compiled, which saves more than a second against starting each
anew; the parent never initialises rclpy, without which a fork would not be safe. (A program that has done so, or that
runs something in a thread, gets a process of its own for the launcher: :mod:`etac_ros.engines.ros.own_process`.)

Who ends too early is seen by the operating system; who stands still is seen by the signs of life that every process
gives outside DDS (:mod:`etac_ros.engines.ros.liveness`).
"""

from __future__ import annotations

import contextlib
import gc
import math
import multiprocessing
import os
import signal
import sys
import time
import traceback
from collections import deque
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, replace
from enum import StrEnum
from multiprocessing.connection import Connection, wait
from multiprocessing.process import BaseProcess
from typing import Any, NamedTuple

from etac_ros.engines.ros.coordinator import Progress
from etac_ros.engines.ros.count_check import Outcome
from etac_ros.engines.ros.environment import MOST_PEERS, enter_launched_run
from etac_ros.engines.ros.host import EndedByOthers, Supervised, leave_process
from etac_ros.engines.ros.limits import enough_files, limits_in_force, refused_by_system
from etac_ros.engines.ros.liveness import LOOK_EVERY_S, LifeSigns, Watch, fresh_s, glimpse
from etac_ros.engines.ros.messages import preload
from etac_ros.engines.ros.plan import COORDINATOR, RECORDER, Birth, Plan
from etac_ros.engines.ros.recorder import Sink
from etac_ros.engines.ros.several_machines import Machines
from etac_ros.engines.ros.signals import ENDING, SignalGuard, held_back, let_through
from etac_ros.engines.ros.wall_host import host_of
from etac_ros.engines.ros.wall_time import Tie
from etac_ros.errors import EtacError, RunError
from etac_ros.graph.faults import Fault, FaultKind
from etac_ros.maths.ticks import NANOSECONDS
from etac_ros.maths.wall_clock import WallClock
from etac_ros.processes import flush_streams
from etac_ros.timing.membership import birth_ns, restarts_of

MOST_PROCESSES = 100
"""A little less than the ``maxInitialPeersRange`` of the Fast DDS profile: foreign tools join, too."""
_GUESTS = 8
"""Tools of ROS that may have joined the domain of a run before its last process, and have taken a place."""
_END_S = 5.0
"""How long a process may take to save what it has before it is killed."""
_LOOKS_S = 0.5
"""How often a process that sleeps looks whether the launcher is still there."""


class Processes(StrEnum):
    """How nodes are spread over processes."""

    NODE = "node"
    NAMESPACE = "namespace"
    ONE = "one"


def groups(plan: Plan, processes: Processes, names: Sequence[str]) -> list[tuple[str, ...]]:
    """The nodes of each process. The recorder always has one of its own, so that it outlives a failing node."""
    together = {COORDINATOR: plan.timekeeper_with} if plan.timekeeper_with else {}
    grouped: dict[str, list[str]] = {}
    for name in names:
        home = together.get(name, name)
        if name == RECORDER or processes is Processes.NODE:
            key = home
        elif processes is Processes.NAMESPACE:
            key = home.rpartition("/")[0]
        else:
            key = ""
        grouped.setdefault(f"{name == RECORDER}{key}", []).append(name)
    return [tuple(names) for names in grouped.values()]


def load() -> None:
    """Load what every process of a run needs: once before a fork instead of in each."""
    preload()


@dataclass
class _Child:
    place: int
    names: tuple[str, ...]
    process: BaseProcess
    pipe: Connection
    done: bool = False

    @property
    def pid(self) -> int:
        assert self.process.pid is not None
        return self.process.pid

    @property
    def label(self) -> str:
        return f"node {', '.join(self.names)} (process {self.pid})"


class Launcher:
    """Runs a plan in processes of its own.

    Parameters
    ----------
    plan
        The run.
    processes
        How nodes are spread.
    domain
        The ROS domain.
    only
        Namespace of the part of the run that is played here; None plays all of it.
    open_sink
        Creates the bag, in the recorder's process; in real time it is told the instants of ticks.
    on_progress
        Told the tick and the triggers so far.
    on_start
        Told the process of each node once all are started.
    guard
        Keeps signals for the moments at which a run can be ended; None where nobody does.
    machines
        Those that the run is spread over; None keeps to this one.
    ready_sink
        Readies what ``open_sink`` needs, in the recorder's process, while the others join.
    own_domain
        Whether the domain was taken for this run, so that nobody else was there first.

    Attributes
    ----------
    started_s
        When the first window was opened, on the clock of ``time.perf_counter``, which all processes share.
    """

    def __init__(
        self,
        plan: Plan,
        processes: Processes,
        domain: int,
        only: str | None,
        open_sink: Callable[..., Sink],
        on_progress: Progress,
        on_start: Callable[[dict[str, int]], None],
        guard: SignalGuard | None = None,
        machines: Machines | None = None,
        ready_sink: Callable[[], None] = lambda: None,
        own_domain: bool = False,
    ) -> None:
        self.started_s = 0.0
        self._guard = guard or SignalGuard()
        self._on_start = on_start
        self._plan = plan
        names = plan.nodes if only is None else plan.part(only)
        self._groups = groups(plan, processes, names)
        if len(self._groups) > MOST_PROCESSES:
            raise RunError(
                f"--processes {processes.value}",
                f"would start {len(self._groups)} processes",
                f"at most {MOST_PROCESSES}: so many DDS participants find each other on one machine",
                "--processes namespace, or one",
            )
        self._keeps_time = COORDINATOR in names
        # The others of a run in parts, and foreign nodes, are started by hand.
        self._patient = only is not None or bool(plan.graph.external)
        self._domain = domain
        self._machines = machines
        self._own_domain = own_domain
        self._deeds: deque[_Deed] = deque()
        self._wall: WallClock
        self._stand_ins: dict[str, _Child] = {}
        self._open_sink = open_sink
        self._ready_sink = ready_sink
        self._on_progress = on_progress
        self._children: list[_Child] = []
        self._signs = LifeSigns(len(self._groups), fresh_s(plan.quiet_s))
        self._living = Watch(plan.quiet_s)
        self._ended_by_others: EndedByOthers | None = None
        self._tick = 0

    def run(self) -> Outcome | None:
        """Run to the end.

        Returns
        -------
        Outcome or None
            None where another part of the run keeps time.

        Raises
        ------
        RunError
            If a node failed, died, stood still or was not heard of; all processes have ended by then, and the bag is
            closed.
        KeyboardInterrupt, EndedBySignal
            If the guard has heard a signal; likewise.
        """
        try:
            self._start()
            outcome = self._watch()
        except BaseException:
            self._end()
            raise
        deadline = time.monotonic() + _END_S
        for child in self._children:
            if child.done:
                child.process.join(max(0.0, deadline - time.monotonic()))
        self._end()
        return outcome

    def _start(self) -> None:
        load()
        flush_streams()
        gc.freeze()  # what is there now is shared with the children; the collector need not touch its pages
        names: tuple[str, ...] = ()
        try:
            with enough_files(len(self._groups)):
                # The recorder first: it has most to ready, and can do so while the others are being forked.
                for place, names in sorted(enumerate(self._groups), key=lambda group: RECORDER not in group[1]):
                    self._guard.check()
                    self._children.append(self._fork(place, names))
                for fault in self._plan.faults:
                    if fault.kind is FaultKind.RESTART:
                        self._guard.check()
                        self._prepare(fault)
        except (OSError, MemoryError, RuntimeError) as error:
            raise refused_by_system(error, f"starting node {', '.join(names)}") or error from error
        finally:
            gc.unfreeze()
        self._on_start({name: child.pid for child in self._children for name in child.names})

    def _prepare(self, fault: Fault) -> None:
        """Fork the process that will take the place of one that is killed, and let it sleep until then.

        Now, with all others: later this process may have threads (a display, a capture), and could not fork safely.
        """
        place = next(place for place, names in enumerate(self._groups) if fault.node in names)
        self._stand_ins[fault.name] = self._fork(place, (fault.node,), fault)

    def _fork(self, place: int, names: tuple[str, ...], fault: Fault | None = None) -> _Child:
        fork = multiprocessing.get_context("fork")
        ours, theirs = fork.Pipe(duplex=fault is not None)
        supervised = Supervised(os.getpid(), self._signs, place)
        sink = (self._open_sink, self._ready_sink)
        # In a domain that somebody has chosen there may be others, who were there first.
        peers = len(self._groups) + _GUESTS if self._own_domain else MOST_PEERS
        task = _Task(self._plan, names, *sink, self._domain, self._patient, supervised, self._machines, peers, fault)
        process = fork.Process(target=_play, args=(task, theirs))
        process.daemon = True
        with held_back():
            process.start()
            theirs.close()
            return _Child(place, names, process, ours)

    def _watch(self) -> Outcome | None:
        outcome: Outcome | None = None
        deadline = math.inf
        while (pending := [child for child in self._children if not child.done]) and time.monotonic() < deadline:
            ready = wait(
                [
                    *(child.pipe for child in pending),
                    *(child.process.sentinel for child in pending),
                    *self._guard.wakes,
                ],
                self._next_look_s(),
            )
            self._guard.check()
            self._do_to_processes()
            for child in pending:
                if not child.done and (child.pipe in ready or child.process.sentinel in ready):
                    outcome = self._listen(child) or outcome
            if math.isinf(deadline) and (outcome is not None or self._ended_by_others is not None):
                # All have left, with their counts, or are about to. Who does not hear of it need not be waited for.
                deadline = time.monotonic() + _END_S
            self._look_for_life()
        if self._ended_by_others is not None:
            raise self._ended_by_others
        if outcome is None and self._keeps_time:
            raise RunError("node " + COORDINATOR, "ended without an outcome")
        return outcome

    def _on_begin(self, start_ns: int) -> None:
        """The run has begun: from now on it is known when each fault is due."""
        assert self._plan.wall is not None
        self._wall = WallClock(start_ns, self._plan.graph.ticks_per_second, self._plan.wall.rate)
        self._deeds = deque(deeds_of(self._plan.faults, Tie().monotonic(self._wall)))

    def _next_look_s(self) -> float:
        due = math.inf if not self._deeds else (self._deeds[0].due_ns - time.monotonic_ns()) / NANOSECONDS
        return min(LOOK_EVERY_S, max(0.0, due))

    def _do_to_processes(self) -> None:
        """What faults do to processes, when it is due."""
        while self._deeds and self._deeds[0].due_ns <= time.monotonic_ns():
            deed = self._deeds.popleft()
            if deed.signal is None:
                self._let_take_its_place(deed.fault)
                continue
            for child in self._children:
                if deed.fault.node in child.names and not child.done and child.process.is_alive():
                    os.kill(child.pid, deed.signal)
                    if deed.signal == signal.SIGKILL:
                        self._bury(child)

    def _bury(self, child: _Child) -> None:
        """It was killed, as the scenario wants it: that is no error."""
        child.process.join(_END_S)
        while child.pipe.poll():
            try:
                kind, content = child.pipe.recv()
            except (EOFError, OSError):
                break
            if kind == "fault":  # it had failed before
                raise content
        child.done = True
        self._signs.take_leave(child.place)

    def _let_take_its_place(self, fault: Fault) -> None:
        child = self._stand_ins.pop(fault.name)
        before = restarts_of(self._plan.faults, fault.node).index(fault)
        self._children.append(child)
        with contextlib.suppress(OSError):  # it has died meanwhile, and its end is seen by :meth:`_watch`
            child.pipe.send(Birth(before + 1, fault, self._wall))

    def _look_for_life(self) -> None:
        """Name who stands still; say who takes long."""
        pending = {child.place: child for child in self._children if not child.done}
        self._living.look(
            time.monotonic(),
            {place: self._signs.last(place) for place in pending},
            {place: glimpse(child.pid) for place, child in pending.items()},
        )
        for place in self._living.computing_long():
            print(
                f"etac: {pending[place].label} has been computing for {self._living.still[place].computing_s:.0f} s "
                f"near simulated time {self._seconds():.6g} s; the run waits for it",
                file=sys.stderr,
            )
        if places := self._living.standing_still():
            manners = sorted({self._living.still[place].manner for place in places})
            raise RunError(
                "; ".join(pending[place].label for place in places),
                f"has stood still for {self._plan.quiet_s:g} s near simulated time {self._seconds():.6g} s: "
                + ", ".join(manners),
                "every process of a run keeps going; a shorter pause only costs time",
                "let it go on in time, or allow more with --quiet-s",
            )

    def _listen(self, child: _Child) -> Outcome | None:
        outcome: Outcome | None = None
        while child.pipe.poll():
            try:
                kind, content = child.pipe.recv()
            except (EOFError, OSError):
                break
            if kind == "progress":
                self._tick = content[0]
                self._on_progress(*content)
            elif kind == "begin":
                self._on_begin(content)
            elif kind == "fault":
                if not isinstance(content, EndedByOthers):
                    raise content
                # Who failed has a tale of its own, which may be on its way.
                child.done = True
                self._ended_by_others = content
            elif kind == "outcome":
                child.done = True
                outcome = content
                if outcome is not None:
                    self.started_s = outcome.began_s
                    self._give_up_late_comers(outcome)
        if not child.done and not child.process.is_alive():
            raise RunError(
                child.label,
                f"{_ending(child.process.exitcode)}{limits_in_force()} near simulated time {self._seconds():.6g} s",
                "every node lives until the run is over",
                "what had happened until then is in the bag",
            )
        return outcome

    def _give_up_late_comers(self, outcome: Outcome) -> None:
        """The run is over: who was about to take a dead one's place, and has not, need not come any more."""
        self._deeds.clear()
        for child in self._children:
            name = child.names[0]
            if name in self._plan.revived and outcome.leave_notes.get(name, {}).get("pid") != child.pid:
                child.done = True

    def _seconds(self) -> float:
        return self._tick / self._plan.graph.ticks_per_second

    def _end(self) -> None:
        """End what still runs: the recorder last, since the others have things to tell it."""
        every = [*self._children, *self._stand_ins.values()]
        recorders = [child for child in every if RECORDER in child.names]
        others = [child for child in every if RECORDER not in child.names]
        for child in every:
            if child.process.is_alive():
                os.kill(child.pid, signal.SIGCONT)  # who is stopped could neither save nor take what others have
        for group in (others, recorders):
            for child in group:
                if child.process.is_alive():
                    child.process.terminate()
            deadline = time.monotonic() + _END_S
            for child in group:
                child.process.join(max(0.0, deadline - time.monotonic()))
                if child.process.is_alive():
                    child.process.kill()
                    child.process.join()
        for child in every:
            child.pipe.close()


@dataclass(frozen=True)
class _Task:
    """What a child process is for."""

    plan: Plan
    names: tuple[str, ...]
    open_sink: Callable[..., Sink]
    ready_sink: Callable[[], None]
    domain: int
    patient: bool
    supervised: Supervised
    machines: Machines | None
    peers: int
    fault: Fault | None = None
    """That which makes room for this process; None of one that is there from the start."""


class _Deed(NamedTuple):
    """Something that a fault does to a process: a signal; None starts the one that takes its place."""

    due_ns: int
    fault: Fault
    signal: int | None


def deeds_of(faults: Sequence[Fault], clock: WallClock) -> list[_Deed]:
    """What faults do to processes, in the order in which it is due on that clock."""
    found = []
    for fault in faults:
        begins = signal.SIGSTOP if fault.kind is FaultKind.STALL else signal.SIGKILL
        found.append(_Deed(clock.instant_ns(fault.from_tick), fault, begins))
        if fault.kind is FaultKind.STALL:
            found.append(_Deed(clock.instant_ns(fault.until_tick), fault, signal.SIGCONT))
        elif fault.kind is FaultKind.RESTART:
            found.append(_Deed(birth_ns(fault, clock), fault, None))
    return sorted(found, key=lambda deed: deed.due_ns)


def _ending(exitcode: int | None) -> str:
    if exitcode is not None and exitcode < 0:
        return f"was killed by {signal.Signals(-exitcode).name}"
    return f"ended with exit code {exitcode}"


def _play(task: _Task, pipe: Connection) -> None:
    """What a child process does."""
    enter_launched_run(os.environ, task.domain, not task.patient, task.machines, task.peers)
    label = f"node {', '.join(task.names)}"
    plan = task.plan if task.fault is None else replace(task.plan, birth=_sleep_until_born(task.supervised, pipe))

    def on_begin(start_ns: int) -> None:
        _tell(pipe, "begin", start_ns)

    def on_progress(tick: int, fired: Mapping[str, int]) -> None:
        _tell(pipe, "progress", (tick, dict(fired)))

    try:
        kind = host_of(plan)
        told = (on_progress, task.patient, task.supervised, on_begin)
        host = kind(plan, task.names, task.open_sink, *told, task.ready_sink)
        outcome = host.run()
    except EtacError as error:
        _tell(pipe, "fault", error)
        leave_process(1)
    except BaseException as error:
        text = traceback.format_exc()
        refused = refused_by_system(error, label)
        _tell(pipe, "fault", refused or RunError(label, f"{type(error).__name__}: {error}\n{text}"))
        leave_process(1)
    task.supervised.signs.take_leave(task.supervised.place)
    _tell(pipe, "outcome", outcome)
    leave_process(0)


def _sleep_until_born(supervised: Supervised, pipe: Connection) -> Birth:
    """Wait until there is a dead process whose place is to be taken; end with the launcher, or when it says so."""
    for number in ENDING:
        # As in any process of a run: a terminal sends all to everybody, but the launcher ends them, by SIGTERM.
        signal.signal(number, signal.SIG_DFL if number == signal.SIGTERM else signal.SIG_IGN)
    let_through()
    try:
        while not pipe.poll(_LOOKS_S):
            if os.getppid() != supervised.parent:
                leave_process(1)
        birth: Birth = pipe.recv()
    except (EOFError, OSError):
        leave_process(1)
    return birth


def _tell(pipe: Connection, kind: str, content: Any) -> None:
    with contextlib.suppress(OSError):  # the parent is gone: nobody is left to be told
        pipe.send((kind, content))
