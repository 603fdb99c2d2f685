"""Nodes started by hand, each in its own terminal: ``etac node``, and the executables of ``ros2 run etac_ros``.

ros2 run etac_ros sensor --ros-args --params-file wu2018.yaml [-r __ns:=/pm -r __node:=other]
"""

from __future__ import annotations

import os
import sys
import traceback
from collections.abc import Callable, Sequence
from pathlib import Path
from typing import TYPE_CHECKING, Any, NamedTuple, NoReturn, TypeVar

import yaml

from etac_ros.bag.write import check_writable
from etac_ros.cli.streams import hold_standard_streams
from etac_ros.engines.ros.domain import domain_of_environment
from etac_ros.engines.ros.environment import join_by_hand
from etac_ros.engines.ros.liveness import QUIET_S
from etac_ros.engines.ros.several_machines import find_peers, machines_of
from etac_ros.errors import EtacError, RunError, ScenarioError
from etac_ros.runs import (
    RosOptions,
    free_bag_directory,
    open_bag,
    real_time,
    state_streams,
    warm_up,
    windows_of,
)
from etac_ros.scenario.document import EVERYWHERE
from etac_ros.scenario.load import Scenario, load_files

_KEY = "ros__parameters"
_Number = TypeVar("_Number", int, float)

if TYPE_CHECKING:
    from etac_ros.engines.ros.count_check import Outcome
    from etac_ros.engines.ros.plan import Plan


def play(
    name: str,
    params_files: Sequence[str],
    bag: Path | None = None,
    quiet_s: float = QUIET_S,
    rate: float | None = None,
    strict: bool = False,
    priority: int = 0,
    peers: str | None = None,
    interface: str | None = None,
) -> NoReturn:
    """Play one node of a run until the run is over, and end the process with it.

    Parameters
    ----------
    name
        Full name of the node; ``/recorder`` and ``/coordinator`` are in every scenario.
    params_files
        A scenario's file or name, or several files, each laid over those before. All nodes of a run need the same.
    bag
        Directory of the bag, for the recorder.
    quiet_s
        How long a node may owe an answer before it is reported [s].
    rate, strict, priority
        As for :class:`~etac_ros.runs.RosOptions`; the same for all nodes of a run.
    peers, interface
        As for :func:`~etac_ros.engines.ros.several_machines.machines_of`.

    Raises
    ------
    EtacError
        If the scenario has no such node, or the environment does not let it meet others; nothing has been started.
    """
    domain = domain_of_environment(os.environ) or 0
    # The environment decides how DDS behaves, and it has to be set before rclpy is loaded.
    machines = machines_of(peers, interface)
    find_peers(machines, domain)
    join_by_hand(os.environ, domain, machines)
    scenario = load_files(params_files)
    from etac_ros.engines.ros.host import leave_process
    from etac_ros.engines.ros.plan import COORDINATOR, RECORDER, Plan
    from etac_ros.engines.ros.wall_host import host_of

    # Nobody here has started the others, or could stop them: only=name.
    wall = real_time(RosOptions(only=name, rate=rate, strict=strict, priority=priority), scenario)
    windows = windows_of(scenario)
    shown = parameters_of(scenario)
    plan = Plan(scenario.name, scenario.digest, scenario.build(), windows, quiet_s=quiet_s, wall=wall, parameters=shown)
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
    directory = bag or Path()
    if name == RECORDER:
        directory = bag or free_bag_directory(scenario)
        check_writable(directory)
    warm_up(scenario)
    print(f"{name}: ready in ROS domain {domain}; the run begins when all nodes are there", flush=True)
    host = host_of(plan)(
        plan, [name], lambda wall=None: open_bag(scenario, directory, "ros", (), state_streams(scenario), wall)
    )
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


def parameters_of(scenario: Scenario) -> dict[str, dict[str, Any]]:
    """What each node shows to ROS tools: the section of the whole run, and its own."""
    from etac_ros.engines.ros.plan import COORDINATOR, RECORDER
    from etac_ros.engines.ros.public import flattened

    sections = {name: section[_KEY] for name, section in yaml.safe_load(scenario.text).items()}
    of_all = dict(flattened(sections.get(EVERYWHERE, {})))
    names = [*scenario.nodes, COORDINATOR, RECORDER]
    return {name: of_all | dict(flattened(sections.get(name, {}))) for name in names}


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
        options, arguments = parse_options(executable, sys.argv[1:])
        name, params_files, bag = parse_arguments(executable, arguments)
        play(name, params_files, bag, **options._asdict())
    except EtacError as error:
        print(f"{executable}: {error}", file=sys.stderr)
        sys.exit(2 if isinstance(error, ScenarioError) else 1)
    except KeyboardInterrupt:
        sys.exit(130)


_LOG_FLAGS = {
    f"--{what}-{kind}-logs" for what in ("enable", "disable") for kind in ("rosout", "stdout", "external-lib")
}
_USAGE = """\
{executable}: plays a node of a scenario, until the run is over

  {executable} --ros-args --params-file FILE [--params-file FILE ...] [-r __ns:=/NAMESPACE] [-r __node:=NAME]

  --params-file FILE   what `etac resolve NAME` printed, the same for all nodes of a run; of several, each is laid over
                       those before
  --bag DIR            for the recorder: folder of the bag
  --clock wall         real time, with --rate R simulated seconds a second; the same for all nodes of a run
  --strict             with --clock wall: end at the first missed tick of this node
  --priority N         with --clock wall: real-time priority of this process (SCHED_FIFO), 1 to 99
  --peers A,B, --interface I
                       other machines of the run, and by which address this one takes part
  -r __ns:=, __node:=  which node of the scenario

  The domain is ROS_DOMAIN_ID. Logging options of ROS and --enclave are taken, and of no consequence."""


class Options(NamedTuple):
    """What an executable takes besides what ROS gives to any node; as :func:`play` has it."""

    rate: float | None = None
    strict: bool = False
    priority: int = 0
    peers: str | None = None
    interface: str | None = None


_OPTIONS = ("--clock", "--rate", "--priority", "--peers", "--interface")
_FOR_REAL_TIME = ("--rate", "--strict", "--priority")


def parse_options(executable: str, arguments: Sequence[str]) -> tuple[Options, list[str]]:
    """The options that are not ROS's, the same as those of ``etac node``; and the other arguments.

    Raises
    ------
    ScenarioError
        If a value is missing or makes no sense.
    """
    given: dict[str, str] = {}
    others: list[str] = []
    words = iter(arguments)
    for word in words:
        if word == "--strict":
            given[word] = ""
        elif word not in _OPTIONS:
            others.append(word)
        elif (value := next(words, None)) is None:
            raise ScenarioError(f"{executable} {word}", "has no value")
        else:
            given[word] = value
    machines = given.get("--peers"), given.get("--interface")
    clock = given.get("--clock", "sim")
    if clock not in ("sim", "wall"):
        raise ScenarioError(f"{executable} --clock {clock}", "is no clock", "sim or wall")
    if clock == "sim":
        for option in _FOR_REAL_TIME:
            if option in given:
                shown = f"{executable} {option} {given[option]}".rstrip()
                raise ScenarioError(shown, "is for --clock wall", "", "add --clock wall")
        return Options(None, False, 0, *machines), others
    rate = _number(executable, "--rate", given.get("--rate", "1"), float, "simulated seconds a second")
    priority = _number(executable, "--priority", given.get("--priority", "0"), int, "a whole one from 1 to 99")
    return Options(rate, "--strict" in given, priority, *machines), others


def _number(executable: str, option: str, value: str, kind: Callable[[str], _Number], expected: str) -> _Number:
    try:
        return kind(value)
    except ValueError:
        raise ScenarioError(f"{executable} {option} {value}", "is no number", expected) from None


def parse_arguments(executable: str, arguments: Sequence[str]) -> tuple[str, tuple[str, ...], Path | None]:
    """Node name, parameter files and bag from a ROS command line.

    Parameters
    ----------
    executable
        Gives the node its name unless it is remapped.
    arguments
        As behind ``ros2 run etac_ros EXECUTABLE``.

    Raises
    ------
    ScenarioError
        If the parameter file is missing, or something is given that would silently be ignored.
    SystemExit
        After help has been printed.
    """
    namespace, base, bag = "", executable, None
    params_files: list[str] = []
    words = iter(word for word in arguments if word not in ("--ros-args", "--"))
    for word in words:
        if word in ("-h", "--help"):
            print(_USAGE.format(executable=executable))
            sys.exit(0)
        if word in _LOG_FLAGS:
            continue
        value = next(words, None)
        if value is None:
            raise ScenarioError(f"{executable} {word}", "has no value")
        if word in ("-r", "--remap"):
            value = value.removeprefix(f"{executable}:")  # ROS lets a rule say for which node it is
        match word:
            case "--params-file":
                params_files.append(value)
            case "--log-level" | "--log-config-file" | "--log-file-name" | "-e" | "--enclave":
                pass  # as `ros2 launch` hands them to any node; these log nothing by ROS, and use no security
            case "--bag":
                bag = Path(value)
            case "-r" | "--remap" if value.startswith("__ns:="):
                namespace = value.removeprefix("__ns:=").rstrip("/")
            case "-r" | "--remap" if value.startswith(("__node:=", "__name:=")):
                base = value.partition(":=")[2]
            case "-r" | "--remap" if ":=" in value and not value.startswith("__"):
                raise ScenarioError(
                    f"{executable} -r {value}",
                    "would move a topic for one node only",
                    "the same topics for all nodes of a run",
                    "make a file with `etac resolve NAME --set links.LINK.topic=/TOPIC` and give it to all of them",
                )
            case "-p" | "--param":
                raise ScenarioError(
                    f"{executable} -p {value}",
                    "would change one node only",
                    "the same parameters for all nodes of a run",
                    "make a file with `etac resolve NAME --set KEY=VALUE` and give it to all of them",
                )
            case _:
                raise ScenarioError(
                    f"{executable} {word} {value}", "is not understood", "--params-file FILE, --bag DIR, -r"
                )
    if not params_files:
        raise ScenarioError(executable, "has no parameter file", "--ros-args --params-file FILE")
    return f"{namespace}/{base}", tuple(params_files), bag
