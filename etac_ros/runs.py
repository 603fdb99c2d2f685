"""Run a scenario with either engine and get its summary: what the command line does, for programs."""

from __future__ import annotations

import contextlib
import json
import re
import secrets
import sys
import tempfile
import time
from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import dataclass, replace
from datetime import datetime
from functools import partial
from pathlib import Path
from typing import TYPE_CHECKING, Any

from etac_ros import __version__
from etac_ros.bag.contents import Contents
from etac_ros.bag.definitions import offered_qos_yaml, schema_text, type_hash
from etac_ros.bag.description import describe_run, to_json
from etac_ros.bag.from_recording import Follower, write_recording
from etac_ros.bag.layouts import foxglove, plotjuggler
from etac_ros.bag.live import LIVE_WAITS_S, LiveView, Viewer, Viewers, check_live
from etac_ros.bag.monitor import EVERY_S, Monitor, Outlet, Picture
from etac_ros.bag.read import read_bag
from etac_ros.bag.recover import recover
from etac_ros.bag.reserve import release, reserve
from etac_ros.bag.run_bag import RunBag
from etac_ros.bag.run_metadata import of_wall_clock, truth_every, wall_clock
from etac_ros.bag.state import WAITS_S, StateStreams, watchers_of
from etac_ros.bag.state_rest import StateRest
from etac_ros.bag.topics import TopicDescription, recorded_topics, truth_topic
from etac_ros.bag.write import check_writable
from etac_ros.engines.inprocess import InProcess
from etac_ros.engines.ros.liveness import QUIET_S
from etac_ros.engines.ros.several_machines import Machines
from etac_ros.errors import BagError, EtacError, RunHalted, ScenarioError
from etac_ros.graph.faults import FaultKind
from etac_ros.graph.graph import Graph
from etac_ros.graph.recording import Recording
from etac_ros.graph.spool import TruthFile
from etac_ros.graph.topics import ledger_topic, type_of, window_topic
from etac_ros.graph.wire import TABLE_TYPE
from etac_ros.maths.compiled import import_numba
from etac_ros.maths.wall_clock import WallClock, rate_of
from etac_ros.metrics.clocks import with_delayed_torques
from etac_ros.metrics.published import check as check_figures
from etac_ros.scenario.build import check_foreign
from etac_ros.scenario.document import EVERYWHERE
from etac_ros.scenario.load import Scenario, load
from etac_ros.scenario.load import baseline_of as baseline_of  # for programs, too
from etac_ros.scenario.trust import foreign_classes, own_classes_only
from etac_ros.timing.windows import WindowPolicy, check_pace, short_windows

if TYPE_CHECKING:
    from etac_ros.capture.account import WireAccount
    from etac_ros.engines.ros.plan import RealTime
    from etac_ros.metrics.summary import Summary

_WARM_UP_TICKS = 40
_REHEARSAL_S = 0.01
"""How long a process that waits for the others rehearses at most: 0.3 ms a trigger, once it has its pages."""
_NOT_IN_NAMES = re.compile(r"[^\w.+-]")
"""What a scenario's name or variant may hold, and the name of a folder should not: slashes above all."""
_LONGEST_BY_CALLS = 512
SCENARIO_ATTACHMENT = "scenario.yaml"
_warm: set[tuple[str, bool]] = set()
"""Digests of scenarios whose kernels this process has loaded, and whether in one: machine code is the process's own."""

Progress = Callable[[int, Mapping[str, int]], None]
OnPicture = Callable[[Picture], None]
"""Takes pictures of a run as it happens."""


@dataclass(frozen=True)
class Run:
    """A finished run."""

    scenario: Scenario
    summary: Summary
    recording: Recording
    bag: Path | None


def windows_of(scenario: Scenario) -> WindowPolicy:
    """The window lengths that a scenario asks for.

    Raises
    ------
    ScenarioError
        If the first is longer than the longest.
    """
    section = scenario.run.windows
    try:
        return WindowPolicy(section.first, section.longest)
    except ValueError as error:
        raise ScenarioError(f"{scenario.path}: windows", str(error)) from None


def checked_graph(scenario: Scenario) -> Graph:
    """The graph of a scenario, if it could give every figure that is to stand beside a published one.

    Raises
    ------
    ScenarioError
        If it could not, or cannot be built.
    """
    graph = scenario.graph
    check_figures(scenario, graph)
    return graph


def warm_up(scenario: Scenario, in_one: bool = False) -> None:
    """Compile every kernel that the scenario needs, by running its first ticks in process; once in a process.

    Compiling takes seconds the first time; afterwards the machine code comes from the cache.

    Parameters
    ----------
    scenario
        What is to be run.
    in_one
        As for :func:`engine_by_calls`.
    """
    if (scenario.digest, in_one) in _warm:
        return
    _warm.add((scenario.digest, in_one))
    import_numba()
    graph = scenario.build()
    begun = replace(graph, end_tick=min(graph.end_tick, _WARM_UP_TICKS))
    InProcess(begun, WindowPolicy(8, 8), trimmed=8, in_one=in_one).run()


def _rehearsal(scenario: Scenario) -> Callable[[], None] | None:
    """What each process of a run in simulated time goes through before it joins.

    Classes of a user are built and called for their run alone: they may print, or move hardware.
    """
    if foreign_classes(scenario.classes):
        return None
    from etac_ros.engines.ros.rehearsal import Rehearsal

    def rehearse() -> None:
        deadline_s = time.monotonic() + _REHEARSAL_S
        Rehearsal(scenario.build(), windows_of(scenario)).run(deadline_s)

    return rehearse


def _played_in_real_time(graph: Graph) -> Graph:
    """What the processes of a real-time run play: faults are the launcher's to do."""
    return replace(graph.in_real_time(), faults=(), spares={})


def anew_in_real_time(scenario: Scenario, wall: RealTime | None) -> Callable[[], Graph] | None:
    """What builds the modules of a real-time run once more, for who rehearses with them; None where nobody does.

    Not classes of a user: they may print, or move hardware.
    """
    if wall is None or not wall.priority or foreign_classes(scenario.classes):
        return None
    return lambda: _played_in_real_time(scenario.build())


def free_bag_directory(scenario: Scenario, folder: Path = Path("bags")) -> Path:
    """A directory for the bag of a run that starts now, reserved: no other run gets the same.

    Whoever does not come to write a bag there gives it back with :func:`etac_ros.bag.reserve.release`.

    Raises
    ------
    BagError
        If nothing can be made there.
    """
    variant = f"_{scenario.variant}" if scenario.variant else ""
    stem = f"{scenario.name}{variant}_{datetime.now():%Y_%m_%d-%H_%M_%S}"
    return reserve(folder, _NOT_IN_NAMES.sub("_", stem))


def bag_metadata(scenario: Scenario, engine: str) -> dict[str, str]:
    """What a bag says of its run."""
    return {
        "scenario": scenario.name,
        "variant": scenario.variant or "",
        "overrides": json.dumps(dict(scenario.overrides)),
        "seed": str(scenario.run.seed),
        "engine": engine,
        "version": __version__,
        "digest": scenario.digest,
        "ticks_per_second": str(scenario.run.ticks_per_second),
    }


def open_bag(
    scenario: Scenario,
    directory: Path,
    engine: str,
    extra: tuple[TopicDescription, ...] = (),
    state: StateStreams | None = None,
    wall: WallClock | None = None,
    live: int | None = None,
    whole: TruthFile | None = None,
    on_picture: OnPicture | None = None,
) -> RunBag:
    """Create the bag of a run, with the complete parameter file inside.

    ``state`` shows the state of its bodies, ``wall`` is the clock of a run in real time, ``live`` the
    port on which the run is shown while it is recorded, ``whole`` takes all committed samples where the bag does not;
    ``on_picture`` is given pictures of it, in this process.
    """
    attachments = {SCENARIO_ATTACHMENT: scenario.text.encode()}
    # A graph of its own: laws with memory are folded over the samples in it.
    derive_with = scenario.build() if foreign_classes(scenario.classes) else None
    metadata = bag_metadata(scenario, engine)
    if wall is not None:
        metadata |= of_wall_clock(wall)
        extra += ledger_topics(scenario.graph)
        state = None if state is None else state_streams(scenario, wall, live is not None)
    show = _viewers(scenario, live, on_picture, wall)
    return RunBag(
        directory,
        scenario.graph,
        attachments,
        metadata,
        extra,
        derive_with,
        state,
        wall,
        show,
        scenario.run.bag_compression,
        scenario.run.truth_every,
        whole,
    )


def _viewers(
    scenario: Scenario, live: int | None, on_picture: OnPicture | None, wall: WallClock | None = None
) -> Callable[[Sequence[TopicDescription]], Viewer] | None:
    """Makes who is shown what is recorded, of all topics; None if nobody looks."""
    if live is None and on_picture is None:
        return None

    def make(topics: Sequence[TopicDescription]) -> Viewer:
        viewers: list[Viewer] = []
        if live is not None:
            viewers.append(LiveView(topics, scenario.name, live))
        if on_picture is not None:
            viewers.append(Monitor(scenario.graph, wall, on_picture))
        return Viewers(viewers)

    return make


def parameters_of(scenario: Scenario) -> dict[str, dict[str, Any]]:
    """What each node shows to ROS tools: the section of the whole run, and its own."""
    from etac_ros.engines.ros.plan import COORDINATOR, RECORDER
    from etac_ros.engines.ros.public import flattened

    sections = scenario.sections
    of_all = dict(flattened(sections[EVERYWHERE]))
    names = [*scenario.nodes, COORDINATOR, RECORDER]
    return {name: of_all | dict(flattened(sections.get(name, {}))) for name in names}


def state_streams(scenario: Scenario, wall: WallClock | None = None, live: bool = False) -> StateStreams | None:
    """What shows the state of the bodies in the bag of a scenario's run; None if it asks for none.

    ``wall`` is the clock of a run in real time, ``live`` whether somebody may be looking.
    """
    rate_hz = scenario.run.state_rate_hz
    if rate_hz == 0.0:
        return None
    graph = scenario.graph
    # In real time a law's triggering instants do not follow from the samples alone.
    watched = wall is None and any(watchers_of(graph, plant) for plant in graph.plants)
    waits_s = LIVE_WAITS_S if live else WAITS_S
    return StateStreams(graph, rate_hz, wall, waits_s, scenario.build() if watched else None)


def state_rest(contents: Contents) -> StateRest | None:
    """What completes the state in a bag that was cut off; None where it cannot be: no class of others is imported."""
    text = contents.attachments.get(SCENARIO_ATTACHMENT)
    try:
        if text is None or truth_every(contents.metadata) != 1:
            return None
        wall = wall_clock(contents.metadata)
        with own_classes_only(), tempfile.TemporaryDirectory(prefix="etac_ros_") as folder:
            file = Path(folder, SCENARIO_ATTACHMENT)
            file.write_bytes(text)
            scenario = load(str(file))
            state = state_streams(scenario, wall)
    except (EtacError, ValueError):  # of another version, or not ours
        return None
    if state is None:
        return None
    rest = StateRest(state, scenario.graph, wall)
    return rest if rest.fits(list(contents.topics.values())) else None


def layouts_of(scenario: Scenario) -> dict[str, str]:
    """Layouts for bags of a scenario's runs, by file name: for Foxglove, and for PlotJuggler.

    Raises
    ------
    ScenarioError
        If its bags show no state.
    """
    state = state_streams(scenario)
    if state is None:
        raise ScenarioError("state_rate_hz", "is 0, so its bags show no state", "a rate, or no such key")
    return {
        f"{scenario.name}.foxglove.json": foxglove(scenario.graph, state.topics),
        f"{scenario.name}.plotjuggler.xml": plotjuggler(scenario.graph, state.topics),
    }


def ledger_topics(graph: Graph) -> tuple[TopicDescription, ...]:
    """What the bag of a run in real time holds besides: what each node noted down."""
    own = [name for name in graph.modules if name not in graph.external]
    return tuple(TopicDescription(ledger_topic(name), TABLE_TYPE, "emulation") for name in own)


class Pace:
    """Lets simulated time go no faster than a rate.

    Parameters
    ----------
    rate
        Simulated seconds a second; None never waits.
    ticks_per_second
        Rate of the tick grid [1/s].
    """

    def __init__(self, rate: float | None, ticks_per_second: int) -> None:
        self._ticks_a_second = None if rate is None else rate * ticks_per_second
        self._began = time.perf_counter()

    def wait(self, tick: int) -> None:
        """Wait until a tick's time has come."""
        if self._ticks_a_second is not None:
            time.sleep(max(0.0, self._began + tick / self._ticks_a_second - time.perf_counter()))


def run_in_process(
    scenario: Scenario,
    bag: Path | None = None,
    pace: float | None = None,
    live: int | None = None,
    on_picture: OnPicture | None = None,
) -> Run:
    """Run a scenario by calls, in this process.

    Parameters
    ----------
    scenario
        What to run.
    bag
        Directory of a bag to write; None writes none.
    pace
        Simulated seconds a second at most; None lets it run. No bit depends on it.
    live
        As for :class:`RosOptions`.
    on_picture
        Given pictures of the run as it happens; None takes none.

    Raises
    ------
    RunHalted
        If a watch ended the run.
    """
    began = time.perf_counter()
    windows_of(scenario)
    if bag is not None:
        check_writable(bag)
    checked_graph(scenario)
    if live is not None:
        check_live(live)
    warm_up(scenario, in_one=bag is None and pace is None and live is None and on_picture is None)
    run, tick = _simulated(scenario, scenario.build(), began, bag, pace, _viewers(scenario, live, on_picture))
    _raise_if_halted(scenario, run.summary.halted, tick)
    return run


def baseline_summary(scenario: Scenario, known: dict[str, Summary | None]) -> Summary | None:
    """What a run's own baseline did, by calls.

    Parameters
    ----------
    scenario
        The run whose baseline it is.
    known
        Those that have been run already, by digest; many variants share one.

    Returns
    -------
    Summary or None
        None where the run has no baseline, or a watch ended it.
    """
    baseline = baseline_of(scenario)
    if baseline is None:
        return None
    if baseline.digest not in known:
        try:
            known[baseline.digest] = run_in_process(baseline).summary
        except RunHalted:
            known[baseline.digest] = None
    return known[baseline.digest]


def simulate(scenario: Scenario) -> Run:
    """Run a scenario by calls, and do nothing else: for many runs of scenarios that have been checked and warmed up.

    Returns
    -------
    Run
        Also that of a run which a watch ended: ``summary.halted`` says so.

    Raises
    ------
    ScenarioError
        If it cannot be built.
    """
    began = time.perf_counter()
    return _simulated(scenario, scenario.build(), began, None)[0]


def simulate_delayed(scenario: Scenario, ticks: int) -> Run:
    """Run a scenario by calls with torques that act so many ticks later, as they do in real time."""
    began = time.perf_counter()
    return _simulated(scenario, with_delayed_torques(scenario.build(), ticks), began, None)[0]


def engine_by_calls(scenario: Scenario, graph: Graph, pace: float | None = None, in_one: bool = True) -> InProcess:
    """What runs a graph of a scenario by calls, with the windows that suit calls.

    Parameters
    ----------
    scenario
        What is run.
    graph
        Built from it, and not used yet.
    pace
        Simulated seconds a second at most; None lets it run.
    in_one
        In one kernel, where the graph is one loop of compiled formulas.
    """
    asked = windows_of(scenario)
    # A window costs no message here, so a long one only computes more samples that are then dropped.
    windows = replace(asked, first=min(asked.first, _LONGEST_BY_CALLS), longest=min(asked.longest, _LONGEST_BY_CALLS))
    windows = short_windows(windows, pace, graph.ticks_per_second)
    wait = None if pace is None else Pace(pace, graph.ticks_per_second).wait
    trimmed = asked.longest if pace is None else windows.longest
    return InProcess(graph, windows, before=wait, trimmed=trimmed, in_one=in_one and pace is None)


def _simulated(
    scenario: Scenario,
    graph: Graph,
    began: float,
    bag: Path | None,
    pace: float | None = None,
    viewers: Callable[[Sequence[TopicDescription]], Viewer] | None = None,
) -> tuple[Run, int]:
    """The run, and the tick at which it ended."""
    from etac_ros.metrics.kept import keep_in_bag
    from etac_ros.metrics.summary import Timing, summarise

    # A bag keeps committed samples as they come, so it shows how a run went on.
    engine = engine_by_calls(scenario, graph, pace, in_one=bag is None)
    with contextlib.ExitStack() as shown:
        if viewers is not None:
            shown.callback(_show(scenario, engine, viewers).close)
        started = time.perf_counter()
        recording = engine.run()
        ended = time.perf_counter()
    if bag is not None:
        attachments = {SCENARIO_ATTACHMENT: scenario.text.encode()}
        derive_with = scenario.build() if foreign_classes(scenario.classes) else None
        metadata = bag_metadata(scenario, "inprocess")
        write_recording(
            bag,
            graph,
            recording,
            metadata,
            attachments,
            derive_with,
            state_streams(scenario),
            scenario.run.bag_compression,
            scenario.run.truth_every,
        )
    summary = summarise(
        scenario,
        graph,
        recording,
        "inprocess",
        Timing(startup_s=started - began, loop_s=ended - started, total_s=time.perf_counter() - began),
        halted=engine.master.halted,
        bag=None if bag is None else str(bag),
    )
    if bag is not None and scenario.run.truth_every != 1:
        keep_in_bag(bag, summary)
    return Run(scenario, summary, recording, bag), engine.master.tick


def _show(scenario: Scenario, engine: InProcess, viewers: Callable[[Sequence[TopicDescription]], Viewer]) -> Follower:
    """Let viewers see what an engine does, while it waits for the next tick."""
    follower = Follower(scenario.graph, engine.recording, viewers, state_streams(scenario, live=True))
    told = time.perf_counter()
    before = engine.before

    def look(tick: int) -> None:
        nonlocal told
        if time.perf_counter() - told >= EVERY_S / 2:
            engine.log()
            follower.follow(tick)
            told = time.perf_counter()
        if before is not None:
            before(tick)

    engine.before = look
    return follower


@dataclass(frozen=True)
class RosOptions:
    """How a run over DDS is spread and recorded.

    Attributes
    ----------
    processes
        One process a ``node``, a ``namespace``, or ``one`` for all (the recorder always has its own).
    domain
        ROS domain; None takes a free one.
    record_windows
        Put the windows of the emulation plane into the bag, too.
    only
        Namespace of the part of the run that is played here; the others join the same ``domain``.
    quiet_s
        How long a process may stand still, or a node owe an answer, before the run fails and names it [s]. A shorter
        pause costs time and nothing else.
    rate
        Simulated seconds a second, for a run in real time; None runs in simulated time.
    strict
        In real time: the first missed tick ends the run.
    pace
        In simulated time: simulated seconds a second at most; None lets it run. No bit depends on it.
    capture
        Capture the frames of the run, and account for them. Where this process may not, the run goes on without.
    keep_capture
        Keep what was captured in this pcapng file.
    priority
        In real time: of its processes among those with a real-time priority (SCHED_FIFO, 1 to 99); 0 for an ordinary
        one.
    machines
        Those that the run is spread over; None keeps to this one.
    live
        Port on which the run is shown to Foxglove while it goes on, on this machine; None shows nothing.
    parameters
        Whether ROS tools may read the parameters of the nodes and hear on /rosout what they say, as of nodes that are
        started by hand. Their services make the start slower.
    """

    processes: str = "node"
    domain: int | None = None
    record_windows: bool = False
    only: str | None = None
    quiet_s: float = QUIET_S
    rate: float | None = None
    strict: bool = False
    capture: bool = False
    keep_capture: Path | None = None
    pace: float | None = None
    priority: int = 0
    machines: Machines | None = None
    live: int | None = None
    parameters: bool = False


def real_time(options: RosOptions, scenario: Scenario) -> RealTime | None:
    """How a run goes in real time; None for simulated time.

    Raises
    ------
    ScenarioError
        If it cannot, or foreign nodes play roles that they can only play in real time.
    """
    if options.rate is None:
        check_foreign(scenario.graph, str(scenario.path))
        return None
    from etac_ros.engines.ros.plan import RealTime
    from etac_ros.engines.ros.wall_time import check_priority

    if not 0.0 < options.rate < float("inf"):
        raise ScenarioError(f"--rate {options.rate:g}", "is no rate", "simulated seconds a second, more than 0")
    _check_faults_in_real_time(options, scenario)
    emulated = [link.name for link in scenario.graph.in_real_time().links.values() if not link.is_ideal]
    if emulated:
        raise ScenarioError(
            f"--clock wall: links {', '.join(emulated)}",
            "have an emulated delay, loss, medium or acknowledgement, whose outcome is in simulated time",
            "ideal links: in real time the network is what delays and loses",
            "leave these keys out, or run in simulated time",
        )
    check_priority(options.priority)
    return RealTime(rate_of(options.rate), options.strict, options.priority)


def _check_faults_in_real_time(options: RosOptions, scenario: Scenario) -> None:
    assert options.rate is not None
    rate = scenario.run.ticks_per_second * options.rate
    for fault in scenario.graph.faults:
        where = f"--clock wall: fault {fault.name}"
        away = f"--set faults.{fault.name}=null, or simulated time"
        if options.only is not None or options.processes != "node":
            found = f"is done to the process of {fault.node}, which has to have one of its own, started with all others"
            raise ScenarioError(where, found, "--processes node, no --only, and no nodes started by hand", away)
        lasts = (fault.until_tick - fault.from_tick) / rate
        if fault.kind is FaultKind.STALL and lasts >= options.quiet_s:
            found = f"would stand still for {lasts:g} s, which ends a run after {options.quiet_s:g} s"
            raise ScenarioError(where, found, "a shorter one", f"--quiet-s {lasts + 10:g}")


def load_ros() -> None:
    """Import what a run over DDS needs: it has to be done before the run, and can be while something else goes on."""
    from etac_ros.engines.ros import own_process

    if not own_process.is_needed():
        from etac_ros.engines.ros.launcher import load

        load()


def load_summary() -> None:
    """Import what sums a run up: only once it is over is it needed."""
    import etac_ros.metrics.kept
    import etac_ros.metrics.summary  # noqa: F401


def play_part(scenario: Scenario, options: RosOptions, on_join: Callable[[], None] = lambda: None) -> bool:
    """Play the part of a run that ``options.only`` names, if another part keeps time.

    Parameters
    ----------
    scenario, options
        The run.
    on_join
        Called when nothing is wrong with them.

    Returns
    -------
    bool
        False if this part is the one with plant, time and recorder: :func:`run_over_ros` plays that.

    Raises
    ------
    EtacError
        If there is no such part, or the run failed.
    """
    from etac_ros.engines.ros.domain import check_domain
    from etac_ros.engines.ros.launcher import Launcher, Processes
    from etac_ros.engines.ros.plan import COORDINATOR, Plan
    from etac_ros.engines.ros.signals import SignalGuard

    assert options.only is not None
    if options.domain is None:
        raise ScenarioError(f"--only {options.only}", "has no run to join", "--join ID, the same for all parts")
    check_domain(options.domain, "--join")
    wall = real_time(options, scenario)
    windows = windows_of(scenario)
    shown = parameters_of(scenario) if options.parameters else None
    plan = Plan(
        scenario.name,
        scenario.digest,
        scenario.graph,
        windows,
        quiet_s=options.quiet_s,
        wall=wall,
        parameters=shown,
        anew=anew_in_real_time(scenario, wall),
    )
    part = plan.part(options.only)
    on_join()
    if COORDINATOR in part:
        return False
    warm_up(scenario)
    processes = Processes(options.processes)
    with SignalGuard() as guard:
        mute = (_no_bag, lambda *_: None, lambda _: None)
        Launcher(plan, processes, options.domain, options.only, *mute, guard, options.machines).run()
    return True


def run_over_ros(
    scenario: Scenario,
    bag: Path,
    options: RosOptions = RosOptions(),
    on_progress: Progress = lambda tick, fired: None,
    on_start: Callable[[dict[str, int]], None] = lambda pids: None,
    on_picture: OnPicture | None = None,
) -> Run:
    """Run a scenario as a node graph over DDS, record it, and compare all counts.

    Parameters
    ----------
    scenario
        What to run.
    bag
        Directory of the bag to write.
    options
        How it is spread and recorded.
    on_progress
        Told the tick and the triggers so far.
    on_start
        Told the process of each node.
    on_picture
        Given pictures of the run as it happens, which its recorder takes; None takes none.

    Raises
    ------
    EtacError
        If the run could not be finished; what had happened until then is in the bag, which is readable.
    KeyboardInterrupt, EndedBySignal
        If a signal ended it; likewise.

    Notes
    -----
    It forks, and leaves the environment, the signals and the ROS domain of the calling program as they are. In a
    program that uses rclpy itself, or in a thread, it takes a Python process of its own, for about a second.
    """
    from etac_ros.engines.ros import own_process

    if own_process.is_needed():
        return _run_in_own_process(scenario, bag, options, on_progress, on_start, on_picture)
    # Only here, so that everything else works without ROS.
    from etac_ros.engines.ros.count_check import check_outcome
    from etac_ros.engines.ros.domain import take_domain
    from etac_ros.engines.ros.launcher import Launcher, Processes
    from etac_ros.engines.ros.plan import Plan
    from etac_ros.engines.ros.signals import SignalGuard
    from etac_ros.engines.ros.wall_check import check_wall_outcome

    began = time.perf_counter()
    windows = windows_of(scenario)
    if options.pace is not None:
        check_pace(options.pace)
    check_writable(bag)
    graph = checked_graph(scenario)
    wall = real_time(options, scenario)
    warm_up(scenario)
    token = secrets.token_hex(6) if options.only is None else ""  # else parts that others start could not know it
    faults = () if wall is None else graph.faults
    played = graph
    if wall is not None:
        graph = graph.in_real_time()
        played = _played_in_real_time(graph)
    plan = Plan(
        scenario.name,
        scenario.digest,
        played,
        windows,
        options.record_windows,
        token,
        options.quiet_s,
        wall,
        options.pace,
        faults,
        parameters=parameters_of(scenario) if options.parameters else None,
        told=scenario.told,
        rehearse=None if wall is not None else _rehearsal(scenario),
        anew=anew_in_real_time(scenario, wall),
    )
    extra: tuple[TopicDescription, ...] = ()
    if options.record_windows:
        extra = tuple(TopicDescription(window_topic(plant), TABLE_TYPE, "emulation") for plant in graph.plants)
    if options.live is not None:
        check_live(options.live)
    whole = None if scenario.run.truth_every == 1 else TruthFile(graph.plants)  # before the fork: the recorder fills it
    lease = take_domain(options.domain)
    outlet = Outlet(on_picture)

    def began_all(pids: dict[str, int]) -> None:
        on_start(pids)
        load_summary()  # while they find each other

    opener = _Opener(scenario, graph, bag, extra, options.live, whole, outlet.take)
    try:
        with _captured(options, lease.domain, graph) as wire, SignalGuard() as guard:
            launcher = Launcher(
                plan,
                Processes(options.processes),
                lease.domain,
                options.only,
                opener.open,
                outlet.after(on_progress),
                began_all,
                guard,
                options.machines,
                opener.ready,
                options.domain is None,
            )
            try:
                outcome = launcher.run()
            except BaseException:
                make_readable(bag)
                if wall is not None and not any(bag.glob("*.mcap")):
                    print("etac: the run ended before anything was recorded; there is no bag", file=sys.stderr)
                raise
            assert outcome is not None  # this part keeps time
            outlet.hand_on()
    finally:
        outlet.close()
        lease.release()
    if wire:
        from etac_ros.capture.kept import write_to_bag

        write_to_bag(bag, wire[0])
    recorded = read_bag(bag)
    counts = {topic.name: count for topic, count in recorded.topics.items()}
    check = check_outcome if wall is None else check_wall_outcome
    in_bag = {name: count.messages for name, count in counts.items()}
    recording = recorded.recording()
    if whole is not None:
        recording = replace(recording, truth=whole.truth(), every=1)
        # Of these the bag has others than were sent: what the recorder has thinned out is what it has written.
        in_bag |= {truth_topic(plant).name: outcome.written(truth_topic(plant).name) for plant in graph.plants}
    check(plan, outcome, in_bag)
    from etac_ros.metrics.kept import keep_in_bag
    from etac_ros.metrics.summary import Timing, summarise

    sizes = {name: count.cdr_bytes for name, count in counts.items()}
    total = time.perf_counter() - began
    summary = summarise(
        scenario,
        graph,
        recording,
        "ros",
        Timing(startup_s=launcher.started_s - began, loop_s=outcome.loop_s, total_s=total),
        plane=_plane(outcome.sent_by_topic()),
        measured_cdr=sizes,
        memory_kib=outcome.memory_kib(),
        strangers=outcome.strangers(),
        wire=wire[0] if wire else None,
        halted=outcome.halted,
        bag=str(bag),
        stepped_s=_stepped_s(outcome.leave_notes),
    )
    if whole is not None:
        keep_in_bag(bag, summary)
    _raise_if_halted(scenario, outcome.halted, outcome.tick)
    return Run(scenario, summary, recording, bag)


@dataclass
class _Opener:
    """Opens the bag of a run over DDS, in the recorder's process, which alone needs message definitions for it."""

    scenario: Scenario
    graph: Graph
    bag: Path
    extra: tuple[TopicDescription, ...]
    live: int | None
    whole: TruthFile | None
    on_picture: OnPicture | None
    _state: StateStreams | None = None

    def ready(self) -> None:
        """Load and make what a bag needs, while the nodes find each other: when it is opened they wait for it."""
        self._state = state_streams(self.scenario, live=self.live is not None)
        shown = () if self._state is None else self._state.topics
        for topic in (*recorded_topics(self.graph), *self.extra, *shown):
            schema_text(topic.type_name)
            type_hash(topic.type_name)
            offered_qos_yaml(topic.reliability.value, topic.latched)
        to_json(describe_run(self.graph, {}))

    def open(self, wall: WallClock | None = None) -> RunBag:
        """Create it."""
        extra, state, live = self.extra, self._state, self.live
        return open_bag(self.scenario, self.bag, "ros", extra, state, wall, live, self.whole, self.on_picture)


@contextlib.contextmanager
def _captured(options: RosOptions, domain: int, graph: Graph) -> Iterator[list[WireAccount]]:
    """Captures meanwhile; what was captured is in the list afterwards, if something was."""
    accounts: list[WireAccount] = []
    if not options.capture:
        yield accounts
        return
    from etac_ros.capture.kept import account_of
    from etac_ros.capture.live import CannotCapture, Capture, ports_of

    with tempfile.TemporaryDirectory(prefix="etac_ros_") as folder:
        path = options.keep_capture or Path(folder, "run.pcapng")
        try:
            capture = Capture(path, ports_of(domain))
        except CannotCapture as error:
            print(f"etac: {error}\netac: the run goes on, and nothing is captured", file=sys.stderr)
            yield accounts
            return
        try:
            yield accounts
        except BaseException:
            with contextlib.suppress(EtacError):  # what is captured of a run that failed is kept, too
                capture.stop()
            raise
        accounts.append(account_of(path, graph, capture.stop()))


def _run_in_own_process(
    scenario: Scenario,
    bag: Path,
    options: RosOptions,
    on_progress: Progress,
    on_start: Callable[[dict[str, int]], None],
    on_picture: OnPicture | None,
) -> Run:
    from etac_ros.engines.ros import own_process

    def on_event(kind: str, content: Any) -> None:
        if kind == "start":
            on_start(content)
        elif kind == "picture":
            assert on_picture is not None
            on_picture(content)
        else:
            on_progress(*content)

    overrides = tuple(f"{key}={json.dumps(value)}" for key, value in scenario.overrides.items())
    arguments = {
        "path": str(scenario.path.absolute()),
        "variant": scenario.variant,
        "overrides": overrides,
        "digest": scenario.digest,
        "bag": bag.absolute(),
        "options": options,
        "watched": on_picture is not None,
    }
    summary: Summary = own_process.call(f"{__name__}:_serve_run", arguments, on_event)
    return Run(scenario, summary.model_copy(update={"bag": str(bag)}), read_bag(bag).recording(), bag)


def _serve_run(
    tell: Callable[[str, Any], None],
    path: str,
    variant: str | None,
    overrides: tuple[str, ...],
    digest: str,
    bag: Path,
    options: RosOptions,
    watched: bool,
) -> Summary:
    """What the process of its own does: the whole run."""
    scenario = load(path, variant, overrides)
    if scenario.digest != digest:
        raise ScenarioError(path, "has changed since it was loaded", "the scenario that was loaded", "load it again")

    def on_progress(tick: int, fired: Mapping[str, int]) -> None:
        tell("progress", (tick, dict(fired)))

    on_picture = partial(tell, "picture") if watched else None
    return run_over_ros(scenario, bag, options, on_progress, lambda pids: tell("start", pids), on_picture).summary


def _stepped_s(notes: Mapping[str, Mapping[str, Any]]) -> float:
    """How far the wall clock was set during a run in real time [s], at the node that saw the most."""
    furthest = 0.0
    for note in notes.values():
        seen = float(note.get("stepped_s", 0.0))
        furthest = seen if abs(seen) > abs(furthest) else furthest
    return round(furthest, 3)


def _no_bag() -> RunBag:
    raise AssertionError("only the part with the recorder writes a bag")


def make_readable(bag: Path) -> None:
    """Repair the bag of a failed run if its recorder could not complete it."""
    if release(bag) or not bag.is_dir():
        return
    try:
        recover(bag, completing=state_rest)
    except BagError as error:
        print(f"etac: the bag of the failed run could not be repaired: {error}", file=sys.stderr)


def _plane(sent: dict[str, tuple[int, int]]) -> dict[str, tuple[str, int, int]]:
    return {topic: (type_of(topic), messages, size) for topic, (messages, size) in sent.items()}


def _raise_if_halted(scenario: Scenario, halted: str, tick: int) -> None:
    if halted:
        at = tick / scenario.run.ticks_per_second
        raise RunHalted(f"scenario '{scenario.name}'", f"halted at simulated time {at:.6g} s: {halted}")
