"""Nodes started by hand, each in its own terminal: ``etac node``, and the executables of ``ros2 run etac_ros``.

ros2 run etac_ros sensor --ros-args --params-file wu2018.yaml [-r __ns:=/pm -r __node:=other]
"""

from __future__ import annotations

import argparse
import os
import sys
import traceback
from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING, NoReturn

from etac_ros.bag.live import check_live
from etac_ros.bag.write import check_writable
from etac_ros.cli.joining import join
from etac_ros.cli.shared_options import check_quiet, port_of_live, rate_in_real_time
from etac_ros.cli.streams import hold_standard_streams
from etac_ros.engines.ros.domain import domain_of_environment
from etac_ros.engines.ros.liveness import QUIET_S
from etac_ros.engines.ros.several_machines import machines_of
from etac_ros.errors import EtacError, RunError, ScenarioError
from etac_ros.graph.topics import emulation_topics
from etac_ros.runs import (
    RosOptions,
    anew_in_real_time,
    free_bag_directory,
    open_bag,
    parameters_of,
    real_time,
    state_streams,
    warm_up,
    windows_of,
)
from etac_ros.scenario.load import Scenario, load_files
from etac_ros.timing.windows import check_pace

if TYPE_CHECKING:
    from etac_ros.engines.ros.arguments import RosArguments
    from etac_ros.engines.ros.count_check import Outcome
    from etac_ros.engines.ros.plan import Plan


def join_domain(peers: str | None = None, interface: str | None = None) -> int:
    """Prepare the environment of a node that is started by hand: it decides how DDS behaves, before rclpy is loaded.

    Parameters
    ----------
    peers, interface
        As for :func:`~etac_ros.engines.ros.several_machines.machines_of`.

    Returns
    -------
    int
        The ROS domain.

    Raises
    ------
    ScenarioError
        If with these settings no node could find another.
    """
    domain = domain_of_environment(os.environ) or 0
    join(domain, machines_of(peers, interface))
    return domain


def play(
    name: str,
    scenario: Scenario,
    domain: int,
    bag: Path | None = None,
    quiet_s: float = QUIET_S,
    rate: float | None = None,
    strict: bool = False,
    priority: int = 0,
    pace: float | None = None,
    live: int | None = None,
    ros_args: Sequence[str] = (),
) -> NoReturn:
    """Play one node of a run until the run is over, and end the process with it.

    Parameters
    ----------
    name
        Full name of the node; ``/recorder`` and ``/coordinator`` are in every scenario.
    scenario
        The same for all nodes of a run.
    domain
        What :func:`join_domain` has found.
    bag
        Directory of the bag, for the recorder.
    quiet_s
        How long a node may owe an answer before it is reported [s].
    rate, strict, priority
        As for :class:`~etac_ros.runs.RosOptions`; the same for all nodes of a run.
    pace
        As for :class:`~etac_ros.runs.RosOptions`, for the node that keeps time.
    live
        Likewise, for the recorder.
    ros_args
        What is for the node's own logging and security, as behind ``--ros-args``.

    Raises
    ------
    EtacError
        If the scenario has no such node, or the environment does not let it meet others; nothing has been started.
    """
    from etac_ros.engines.ros.host import leave_process
    from etac_ros.engines.ros.plan import COORDINATOR, RECORDER, Plan
    from etac_ros.engines.ros.wall_host import host_of

    # Nobody here has started the others, or could stop them: only=name.
    wall = real_time(RosOptions(only=name, rate=rate, strict=strict, priority=priority), scenario)
    windows = windows_of(scenario)
    shown = parameters_of(scenario)
    plan = Plan(
        scenario.name,
        scenario.digest,
        scenario.build(),
        windows,
        quiet_s=quiet_s,
        wall=wall,
        pace=pace,
        parameters=shown,
        told=scenario.told,
        ros_args=tuple(ros_args),
        anew=anew_in_real_time(scenario, wall),
    )
    name = "/" + name.strip("/")
    if name not in plan.nodes:
        raise ScenarioError(
            f"{scenario.path}", f"has no node '{name}'", f"one of: {', '.join(plan.nodes)}",
            "choose with -r __ns:=/NAMESPACE -r __node:=NAME",
        )  # fmt: skip
    if name == COORDINATOR and plan.timekeeper_with:
        raise ScenarioError(
            f"{scenario.path}: {COORDINATOR}", f"lives in the process of {plan.timekeeper_with}, the only plant",
            "", f"start {plan.timekeeper_with}; a coordinator of its own is for several plants",
        )  # fmt: skip
    _check_who_can(plan, name, pace, live, bag)
    directory = Path()
    if name == RECORDER:
        directory = bag or free_bag_directory(scenario)
        check_writable(directory)
    warm_up(scenario)
    print(f"{name}: ready in ROS domain {domain}; the run begins when all nodes are there", flush=True)
    state = state_streams(scenario, live=live is not None) if name == RECORDER else None
    host = host_of(plan)(plan, [name], lambda wall=None: open_bag(scenario, directory, "ros", (), state, wall, live))
    try:
        outcome = host.run()
        _show_outcome(scenario, plan, name, directory, outcome)
    except EtacError as error:
        print(f"{name}: {error}", file=sys.stderr)
        leave_process(1 if host.ended_by is None else 128 + host.ended_by)
    except BaseException:
        # Not by way of Python's own end: there Fast DDS was seen to hang, with signals that nobody hears any more.
        traceback.print_exc()
        leave_process(1)
    leave_process(0)


def _check_who_can(plan: Plan, name: str, pace: float | None, live: int | None, bag: Path | None = None) -> None:
    """Refuse what only another node of the run can do."""
    from etac_ros.engines.ros.plan import COORDINATOR, RECORDER

    keeper = plan.timekeeper_with or COORDINATOR
    if pace is not None:
        if name != keeper:
            found = "in simulated time is for the node that keeps it, which the others follow"
            raise ScenarioError(
                f"{name}: --rate {pace:g}", found, "", f"give it to {keeper}, or add --clock wall to all"
            )
        check_pace(pace)
    if live is not None:
        if name != RECORDER:
            raise ScenarioError(f"{name}: --live", "shows what the recorder writes", "", f"give it to {RECORDER}")
        check_live(live)
    if bag is not None and name != RECORDER:
        raise ScenarioError(f"{name}: --bag {bag}", "is written by the recorder", "", f"give it to {RECORDER}")


def _show_outcome(scenario: Scenario, plan: Plan, name: str, directory: Path, outcome: Outcome | None) -> None:
    from etac_ros.engines.ros.count_check import check_outcome
    from etac_ros.engines.ros.plan import RECORDER
    from etac_ros.engines.ros.wall_check import check_wall_outcome

    if name == RECORDER:
        print(f"{name}: bag {directory}")
    if outcome is None:
        return
    written = outcome.leave_notes[RECORDER]["written"]
    check = check_outcome if plan.wall is None else check_wall_outcome
    check(plan, outcome, {topic: messages for topic, (messages, _) in written.items()})
    for module, count in outcome.fired.items():
        print(f"{module}: {count} triggering instants")
    print(f"simulated {scenario.run.duration_s:g} s in {outcome.loop_s:.3f} s")
    if outcome.halted:
        raise RunError(f"scenario '{scenario.name}'", f"halted: {outcome.halted}")


def plant() -> None:
    """Executable ``plant``."""
    _main("plant")


def sensor() -> None:
    """Executable ``sensor``."""
    _main("sensor")


def controller() -> None:
    """Executable ``controller``."""
    _main("controller")


def actuator() -> None:
    """Executable ``actuator``."""
    _main("actuator")


def recorder() -> None:
    """Executable ``recorder``."""
    _main("recorder")


def coordinator() -> None:
    """Executable ``coordinator``."""
    _main("coordinator")


def _main(executable: str) -> None:
    hold_standard_streams()
    try:
        if {"-h", "--help"} & set(sys.argv[1:]):
            print(_USAGE.format(executable=executable))
        else:
            play_by_arguments(executable, sys.argv[1:])
    except EtacError as error:
        text = str(error)  # what concerns a single option says already whose it is
        print(text if text.startswith(f"{executable} ") else f"{executable}: {text}", file=sys.stderr)
        sys.exit(2 if isinstance(error, ScenarioError) else 1)
    except KeyboardInterrupt:
        sys.exit(130)


_USAGE = """\
{executable}: plays a node of a scenario, until the run is over

  {executable} [--bag DIR] [--clock wall] [--rate R] [--live] [...] --ros-args --params-file FILE [...] [ROS options]

  --params-file FILE   what `etac resolve NAME` printed, the same for all nodes of a run; of several, each is laid over
                       those before
  -r __ns:=, __node:=  which node of the scenario, with or without NODE: before them
  --log-level LEVEL    and the other logging options of ROS: of what this node tells /rosout
  --enclave PATH       as of any ROS node
  -r FROM:=TO, -p      refused where they concern this node alone: the nodes of a run agree on topics and parameters

  --bag DIR            for the recorder: folder of the bag
  --live [--live-port PORT]  for the recorder: show the run to Foxglove
  --clock wall         real time, with --rate R simulated seconds a second; the same for all nodes of a run
  --rate R             in simulated time, for the node that keeps it: so fast at most
  --strict             with --clock wall: end at the first missed tick of this node
  --priority N         with --clock wall: real-time priority of this process (SCHED_FIFO), 1 to 99
  --quiet-s S          a node that stands still or owes an answer for so long ends the run [s]; 20 unless given
  --peers A,B, --interface I
                       other machines of the run, and by which address this one takes part

  The domain is ROS_DOMAIN_ID."""


@dataclass(frozen=True)
class OwnOptions:
    """What of an executable's command line is not ROS's."""

    bag: Path | None = None
    clock: str = "sim"
    rate: float | None = None
    strict: bool = False
    priority: int = 0
    peers: str | None = None
    interface: str | None = None
    live: bool = False
    live_port: int | None = None
    quiet_s: float = QUIET_S


def own_options(executable: str, arguments: Sequence[str]) -> OwnOptions:
    """The options of ours on a ROS command line, as ``etac node`` has them.

    Parameters
    ----------
    executable
        Who is called.
    arguments
        What of it is none of ROS's.

    Raises
    ------
    ScenarioError
        If one is unknown, or has no value or a wrong one.
    """
    found, unknown = _parser(executable).parse_known_args(arguments)
    if unknown:
        where = f"{executable} {' '.join(unknown)}"
        raise ScenarioError(where, "is not understood", "what --help says", "options of ROS stand behind --ros-args")
    own = OwnOptions(**vars(found))
    check_quiet(own.quiet_s)
    port_of_live(own.live, own.live_port)
    rate_in_real_time(own.clock == "wall", own.rate, own.strict, own.priority)
    return own


def _parser(executable: str) -> _Parser:
    parser = _Parser(prog=executable, add_help=False, allow_abbrev=False)
    parser.add_argument("--bag", type=Path)
    parser.add_argument("--clock", choices=("sim", "wall"), default="sim")
    parser.add_argument("--rate", type=float)
    parser.add_argument("--strict", action="store_true")
    parser.add_argument("--priority", type=int, default=0)
    parser.add_argument("--peers")
    parser.add_argument("--interface")
    parser.add_argument("--live", action="store_true")
    parser.add_argument("--live-port", type=int)
    parser.add_argument("--quiet-s", type=float, default=QUIET_S)
    return parser


class _Parser(argparse.ArgumentParser):
    def error(self, message: str) -> NoReturn:
        """Say it as everything else is said."""
        raise ScenarioError(self.prog, message, "what --help says")


def play_by_arguments(executable: str, arguments: Sequence[str]) -> NoReturn:
    """Play the node that a ROS command line says.

    Parameters
    ----------
    executable
        Gives the node its name unless it is remapped.
    arguments
        As behind ``ros2 run etac_ros EXECUTABLE``.

    Raises
    ------
    ScenarioError
        If ROS does not understand them, or something is given that would make one node different from what the others
        know.
    EtacError
        As :func:`play` does.
    """
    # Which machines take part decides how DDS behaves, so it has to be known before rclpy reads the rest.
    first, _ = _parser(executable).parse_known_args(arguments)
    domain = join_domain(first.peers, first.interface)
    from etac_ros.engines.ros.arguments import RosArguments

    with RosArguments(executable, arguments, domain) as given:
        own = own_options(executable, given.others)
        if not given.params_files:
            raise ScenarioError(executable, "has no parameter file", "--ros-args --params-file FILE")
        scenario = load_files(given.params_files)
        check_same_for_all(executable, scenario, given)
    wall = own.clock == "wall"
    play(
        given.name,
        scenario,
        domain,
        own.bag,
        own.quiet_s,
        rate_in_real_time(wall, own.rate, own.strict, own.priority),
        strict=own.strict,
        priority=own.priority,
        pace=None if wall else own.rate,
        live=port_of_live(own.live, own.live_port),
        ros_args=given.passed_on,
    )


def check_same_for_all(executable: str, scenario: Scenario, given: RosArguments) -> None:
    """Refuse what would make one node of a run different from what the others know.

    Raises
    ------
    ScenarioError
        Naming it, and what to do instead.
    """
    for name, value in given.overridden().items():
        raise ScenarioError(
            f"{executable} -p {name}:={value}",
            "would change one node only",
            "the same parameters for all nodes of a run",
            "make a file with `etac resolve NAME --set KEY=VALUE` and give it to all of them",
        )
    links = {link.topic: link.name for link in scenario.graph.links.values()}
    for topic, other in given.remapped([*links, *emulation_topics(scenario.graph)]).items():
        link = links.get(topic)
        raise ScenarioError(
            f"{executable} -r {topic}:={other}",
            "would move a topic for one node only",
            "the same topics for all nodes of a run",
            f"make a file with `etac resolve NAME --set links.{link}.topic={other}` and give it to all of them"
            if link
            else "leave it out: this topic is between the nodes of a run",
        )
