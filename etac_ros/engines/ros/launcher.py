"""Starts the processes of a run, watches over them, and ends them: none is ever left behind.

They are forked after everything is imported and compiled, which saves more than a second against starting each
anew; the parent never initialises rclpy, without which a fork would not be safe.
"""

from __future__ import annotations

import contextlib
import gc
import multiprocessing
import os
import signal
import sys
import time
import traceback
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from enum import StrEnum
from multiprocessing.connection import Connection, wait
from multiprocessing.process import BaseProcess
from typing import Any

from etac_ros.engines.ros.coordinator import Progress
from etac_ros.engines.ros.count_check import Outcome
from etac_ros.engines.ros.domain import dds_environment
from etac_ros.engines.ros.host import Host, leave_process
from etac_ros.engines.ros.messages import preload
from etac_ros.engines.ros.plan import COORDINATOR, RECORDER, Plan
from etac_ros.engines.ros.recorder import Sink
from etac_ros.errors import EtacError, RunError

MOST_PROCESSES = 100
"""A little less than the ``maxInitialPeersRange`` of the Fast DDS profile: foreign tools join, too."""
_END_S = 5.0
"""How long a process may take to save what it has before it is killed."""


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


@dataclass
class _Child:
    names: tuple[str, ...]
    process: BaseProcess
    pipe: Connection
    done: bool = False

    @property
    def label(self) -> str:
        return f"node {', '.join(self.names)} (process {self.process.pid})"


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
        Creates the bag, in the recorder's process.
    on_progress
        Told the tick and the triggers so far.
    on_start
        Told the process of each node once all are started.

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
        open_sink: Callable[[], Sink],
        on_progress: Progress,
        on_start: Callable[[dict[str, int]], None],
    ) -> None:
        self.started_s = 0.0
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
        self._open_sink = open_sink
        self._on_progress = on_progress
        self._children: list[_Child] = []
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
            If a node failed, died or was not heard of; all processes have ended by then, and the bag is closed.
        KeyboardInterrupt
            If the user interrupted; likewise.
        """
        try:
            self._start()
            outcome = self._watch()
        except BaseException:
            self._end()
            raise
        for child in self._children:
            child.process.join(_END_S)
        self._end()
        return outcome

    def _start(self) -> None:
        os.environ.update(dds_environment(self._domain))
        preload()
        sys.stdout.flush()
        sys.stderr.flush()
        fork = multiprocessing.get_context("fork")
        gc.freeze()  # what is there now is shared with the children; the collector need not touch its pages
        for names in self._groups:
            ours, theirs = fork.Pipe(duplex=False)
            process = fork.Process(
                target=_play, args=(self._plan, names, self._open_sink, theirs, os.getpid(), self._patient)
            )
            process.daemon = True
            process.start()
            theirs.close()
            self._children.append(_Child(names, process, ours))
        gc.unfreeze()
        self._on_start({name: child.process.pid or 0 for child in self._children for name in child.names})

    def _watch(self) -> Outcome | None:
        outcome: Outcome | None = None
        while not all(child.done for child in self._children):
            pending = [child for child in self._children if not child.done]
            ready = wait([child.pipe for child in pending] + [child.process.sentinel for child in pending])
            for child in pending:
                if child.pipe in ready or child.process.sentinel in ready:
                    found = self._listen(child)
                    outcome = found or outcome
        if outcome is None and self._keeps_time:
            raise RunError("node " + COORDINATOR, "ended without an outcome")
        return outcome

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
            elif kind == "fault":
                raise content
            elif kind == "outcome":
                child.done = True
                outcome = content
                if outcome is not None:
                    self.started_s = outcome.began_s
        if not child.done and not child.process.is_alive():
            raise RunError(
                child.label,
                f"{_ending(child.process.exitcode)} near simulated time {self._seconds():.6g} s",
                "every node lives until the run is over",
                "what had happened until then is in the bag",
            )
        return outcome

    def _seconds(self) -> float:
        return self._tick / self._plan.graph.ticks_per_second

    def _end(self) -> None:
        """End what still runs: the recorder last, since the others have things to tell it."""
        recorders = [child for child in self._children if RECORDER in child.names]
        others = [child for child in self._children if RECORDER not in child.names]
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
        for child in self._children:
            child.pipe.close()


def _ending(exitcode: int | None) -> str:
    if exitcode is not None and exitcode < 0:
        return f"was killed by {signal.Signals(-exitcode).name}"
    return f"ended with exit code {exitcode}"


def _play(
    plan: Plan, names: Sequence[str], open_sink: Callable[[], Sink], pipe: Connection, parent: int, patient: bool
) -> None:
    """What a child process does."""

    def on_progress(tick: int, fired: Mapping[str, int]) -> None:
        _tell(pipe, "progress", (tick, dict(fired)))

    try:
        outcome = Host(plan, names, open_sink, on_progress, parent, patient).run()
    except EtacError as error:
        _tell(pipe, "fault", error)
        leave_process(1)
    except BaseException as error:
        text = traceback.format_exc()
        _tell(pipe, "fault", RunError(f"node {', '.join(names)}", f"{type(error).__name__}: {error}\n{text}"))
        leave_process(1)
    _tell(pipe, "outcome", outcome)
    leave_process(0)


def _tell(pipe: Connection, kind: str, content: Any) -> None:
    with contextlib.suppress(OSError):  # the parent is gone: nobody is left to be told
        pipe.send((kind, content))
