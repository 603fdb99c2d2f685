"""One process of a run: some stations, one loop, and a clean way out."""

from __future__ import annotations

import os
import signal
import sys
import time
from collections.abc import Callable, Sequence
from typing import Any, NoReturn

import rclpy
from rclpy.context import Context
from rclpy.signals import SignalHandlerOptions

from etac_ros.engines.ros.coordinator import QUIET_S, CoordinatorStation, Progress
from etac_ros.engines.ros.endpoints import Spinner
from etac_ros.engines.ros.module_station import ModuleStation, PlantStation
from etac_ros.engines.ros.plan import COORDINATOR, RECORDER, Plan
from etac_ros.engines.ros.recorder import RecorderStation, Sink
from etac_ros.engines.ros.station import Station
from etac_ros.engines.ros.tally import Outcome
from etac_ros.errors import EtacError, RunError

_JOIN_WAIT_S = 0.005
_WAIT_S = 0.05
"""Longest wait for a message before signals and the parent process are looked at."""

_ROLL_CALL_S = 1.0
_GATHER_S = 0.005
"""How long the recorder lets messages gather; nobody waits for it before the end."""
_LOOK_S = 0.1


def _nothing(tick: int, fired: Any) -> None:
    """No progress is shown."""


def leave_process(code: int) -> NoReturn:
    """End this process at once.

    When a station has said goodbye, all its messages are acknowledged and nothing is left to be done. Destroying
    its participant is left to the operating system, since Fast DDS was seen to hang in it on a busy machine; and
    exit handlers are left alone, since in a forked process they belong to the parent.
    """
    sys.stdout.flush()
    sys.stderr.flush()
    os._exit(code)


class Host:
    """Runs stations in this process until the run is over.

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
    parent
        Process whose end means the end of this one; None for a node started by hand.
    patient
        Others of the run are started by hand, which may take its time, and nobody sees them die but their peers.
    """

    def __init__(
        self,
        plan: Plan,
        names: Sequence[str],
        open_sink: Callable[[], Sink] | None = None,
        on_progress: Progress = _nothing,
        parent: int | None = None,
        patient: bool = True,
    ) -> None:
        self._plan = plan
        self._names = names
        self._open_sink = open_sink
        self._on_progress = on_progress
        self._parent = parent
        self._patient = patient
        self._told_to_end = False
        self._roll_call = 0.0
        self._next_look = 0.0
        self._stations: list[Station] = []
        self._coordinator: CoordinatorStation | None = None
        self._spinner: Spinner

    def run(self) -> Outcome | None:
        """Join, take part, say goodbye. Afterwards the process has to end by :func:`leave_process`.

        Returns
        -------
        Outcome or None
            The outcome of the run, where the coordinator is played.

        Raises
        ------
        EtacError
            If this node failed, or was told of another's failure.
        """
        for number in (signal.SIGTERM, signal.SIGINT):
            signal.signal(number, self._on_signal)
        context = Context()
        rclpy.init(args=[], context=context, signal_handler_options=SignalHandlerOptions.NO)
        self._create(context)
        try:
            self._join()
            self._take_part()
        except BaseException as error:
            self._give_up(error)
            raise
        return self._outcome()

    def _create(self, context: Context) -> None:
        only_listens = list(self._names) == [RECORDER]
        self._spinner = Spinner(context, _GATHER_S if only_listens else 0.0)
        plants: dict[str, PlantStation] = {}
        names = list(self._names)
        together = self._plan.timekeeper_with
        if together in names and COORDINATOR not in names:
            names.append(COORDINATOR)
        # The coordinator comes last: it talks to the plant beside it directly.
        for name in sorted(names, key=lambda name: name == COORDINATOR):
            if name == COORDINATOR:
                local = plants if together else {}
                self._coordinator = CoordinatorStation(self._plan, self._spinner, context, local, self._on_progress)
                self._stations.append(self._coordinator)
            elif name == RECORDER:
                assert self._open_sink is not None
                self._stations.append(RecorderStation(self._plan, self._spinner, context, self._open_sink))
            elif name in self._plan.graph.plants:
                plants[name] = PlantStation(self._plan, name, self._spinner, context)
                self._stations.append(plants[name])
            else:
                self._stations.append(ModuleStation(self._plan, name, self._spinner, context))

    def _join(self) -> None:
        waiting = list(self._stations)
        began = told = time.monotonic()
        while waiting:
            self._spinner.once(_JOIN_WAIT_S)
            self._look_around()
            for station in [station for station in waiting if station.matched]:
                station.say_hello()
                waiting.remove(station)
            now = time.monotonic()
            if not waiting or now - told < QUIET_S:
                continue
            told = now
            topics = ", ".join(waiting[0].missing())
            if not self._patient:
                raise RunError(f"node {waiting[0].name}", f"found no other end for {topics} within {QUIET_S:g} s")
            print(f"{waiting[0].name}: {now - began:.0f} s, still no other end for {topics}", flush=True)

    def _take_part(self) -> None:
        while not all(station.finished for station in self._stations):
            if not self._spinner.once(_WAIT_S):
                self._be_idle()
            self._look_around()

    def _be_idle(self) -> None:
        if self._coordinator is not None:
            self._coordinator.idle(self._patient)
        now = time.monotonic()
        if not self._patient or now < self._roll_call:
            return  # a parent of all sees at once when a process ends
        self._roll_call = now + _ROLL_CALL_S
        for station in self._stations:
            if station.said_bye and station.deserted():
                station.finished = True  # the end was told, and missed
            elif station.stop is not None and station.stop["fault"]:
                raise RunError(f"node {station.name}", f"the run was ended: {station.stop['fault']}")
            if station.started and station.stop is None and (gone := station.deserted()):
                raise RunError(
                    f"node {', '.join(gone)}",
                    f"has gone, which {station.name} listens to",
                    "every node lives until the run is over",
                    "see what it printed",
                )

    def _look_around(self) -> None:
        if self._told_to_end:
            raise RunError(f"node {', '.join(self._names)}", "was told to end before the run was over")
        now = time.monotonic()
        if now < self._next_look:
            return
        self._next_look = now + _LOOK_S
        if self._parent is not None and os.getppid() != self._parent:
            raise RunError(f"node {', '.join(self._names)}", "lost the process that started it")
        for station in self._stations:
            fault = (station.stop or {}).get("fault")
            # The recorder stays until nothing comes any more, the coordinator knows it anyway.
            if fault and not isinstance(station, CoordinatorStation | RecorderStation):
                raise RunError(f"node {station.name}", f"the run was ended: {fault}")

    def _give_up(self, error: BaseException) -> None:
        """Save what can be saved, and tell the others. Never hides the error it is called for."""
        text = str(error) if isinstance(error, EtacError) else f"{type(error).__name__}: {error}"
        while self._spinner.once(0.0):
            pass  # what has already arrived belongs into the bag
        for station in self._stations:
            try:
                if not self._told_to_end and station.stop is None:
                    station.say_fault(text)
                if isinstance(station, CoordinatorStation):
                    station.fault = text
                station.abort()
            except Exception as secondary:
                print(f"while saving {station.name}: {secondary}", flush=True)

    def _outcome(self) -> Outcome | None:
        if self._coordinator is None:
            return None
        master = self._coordinator.master
        return Outcome(
            tick=master.tick,
            halted=self._coordinator.halted,
            fired=dict(master.fired),
            sent=dict(master.sent),
            farewells=dict(self._coordinator.farewells),
            began_s=self._coordinator.began,
            loop_s=self._coordinator.loop_s,
        )

    def _on_signal(self, number: int, frame: Any) -> None:
        self._told_to_end = True
