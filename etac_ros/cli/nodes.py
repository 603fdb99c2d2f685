"""Nodes started by hand, each in its own terminal: ``etac node``, and the executables of ``ros2 run etac_ros``.

ros2 run etac_ros sensor --ros-args --params-file wu2018.yaml [-r __ns:=/pm -r __node:=other]
"""

from __future__ import annotations

import os
import sys
from collections.abc import Sequence
from pathlib import Path
from typing import TYPE_CHECKING, NoReturn

from etac_ros.bag.write import check_writable
from etac_ros.cli.streams import hold_standard_streams
from etac_ros.engines.ros.domain import domain_of_environment
from etac_ros.engines.ros.environment import join_by_hand
from etac_ros.engines.ros.liveness import QUIET_S
from etac_ros.errors import EtacError, RunError, ScenarioError
from etac_ros.runs import free_bag_directory, open_bag, state_streams, warm_up, windows_of
from etac_ros.scenario.load import Scenario, load_files

if TYPE_CHECKING:
    from etac_ros.engines.ros.count_check import Outcome
    from etac_ros.engines.ros.plan import Plan


def play(name: str, params_files: Sequence[str], bag: Path | None = None, quiet_s: float = QUIET_S) -> NoReturn:
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

    Raises
    ------
    EtacError
        If the scenario has no such node, or the environment does not let it meet others; nothing has been started.
    """
    domain = domain_of_environment(os.environ) or 0
    # The environment decides how DDS behaves, and it has to be set before rclpy is loaded.
    join_by_hand(os.environ, domain)
    scenario = load_files(params_files)
    from etac_ros.engines.ros.host import Host, leave_process
    from etac_ros.engines.ros.plan import COORDINATOR, RECORDER, Plan

    plan = Plan(scenario.name, scenario.digest, scenario.build(), windows_of(scenario), quiet_s=quiet_s)
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
    host = Host(plan, [name], lambda: open_bag(scenario, directory, "ros", (), state_streams(scenario)))
    try:
        outcome = host.run()
        _show_outcome(scenario, plan, name, directory, outcome)
    except EtacError as error:
        print(f"{name}: {error}", file=sys.stderr)
        leave_process(1 if host.ended_by is None else 128 + host.ended_by)
    leave_process(0)


def _show_outcome(scenario: Scenario, plan: Plan, name: str, directory: Path, outcome: Outcome | None) -> None:
    from etac_ros.engines.ros.count_check import check_outcome
    from etac_ros.engines.ros.plan import RECORDER

    if name == RECORDER:
        print(f"{name}: bag {directory}")
    if outcome is None:
        return
    written = outcome.leave_notes[RECORDER]["written"]
    check_outcome(plan, outcome, {topic: messages for topic, (messages, _) in written.items()})
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
        name, params_files, bag = parse_arguments(executable, sys.argv[1:])
        play(name, params_files, bag)
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
  -r __ns:=, __node:=  which node of the scenario

  The domain is ROS_DOMAIN_ID. Logging options of ROS and --enclave are taken, and of no consequence."""


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
