"""``etac watch``: a run that goes on elsewhere, in this terminal. It listens only."""

from __future__ import annotations

import os
import time
from collections.abc import Sequence
from functools import partial
from typing import TYPE_CHECKING

from rich.console import Console

from etac_ros.cli.interrupts import keeping
from etac_ros.cli.joining import join
from etac_ros.cli.progress import lines_now_and_then, steps
from etac_ros.cli.screen import Screen
from etac_ros.cli.view import plain
from etac_ros.engines.ros.domain import check_domain, domain_of_environment, leased_domains
from etac_ros.engines.ros.several_machines import machines_of
from etac_ros.errors import ScenarioError
from etac_ros.plain_text import one_line
from etac_ros.scenario.classes import ForeignClassError
from etac_ros.scenario.load import Scenario, load, load_told
from etac_ros.scenario.trust import own_classes_only

if TYPE_CHECKING:
    from etac_ros.engines.ros.listener import RunListener, Told

_LOOK_S = 0.05
_LINE_EVERY_S = 1.0


def watch_run(
    scenario: str | None,
    variant: str | None,
    overrides: Sequence[str],
    domain: int | None,
    console: Console,
    peers: str | None = None,
    interface: str | None = None,
) -> None:
    """Show a run that goes on elsewhere until it is over.

    Parameters
    ----------
    scenario
        What runs; None takes what the run says of itself, for which classes of others are not imported.
    variant, overrides
        As the run was given them.
    domain
        ROS domain; None takes that of the environment, or that of the one run that goes on on this machine.
    console
        For people.
    peers, interface
        As for :func:`~etac_ros.engines.ros.several_machines.machines_of`.

    Raises
    ------
    EtacError
        If there are several runs of which none was named, the scenario is not the run's, or the run fails.
    """
    given = None if scenario is None else load(scenario, variant, overrides)
    if given is None and (variant is not None or overrides):
        raise ScenarioError("--variant, --set", "are of a scenario, and none is named", "etac watch SCENARIO ...")
    chosen = domain_of_environment(os.environ) if domain is None else check_domain(domain, "--domain")
    machines = machines_of(peers, interface)
    with keeping("the run goes on; this only listened"):
        while True:  # a run may be over before it could be joined
            with steps(console, "waiting for a run on this machine; nodes that are started by hand: --domain N"):
                found = _found(chosen)
            join(found, machines)
            from etac_ros.engines.ros.listener import RunListener

            listener = RunListener(found)
            try:
                with steps(console, f"waiting for a run in ROS domain {found}"):
                    told = listener.wait(partial(_may_come, found, chosen))
                if told is not None:
                    return _follow(listener, told, given, console)
            finally:
                listener.close()


def _may_come(domain: int, chosen: int | None) -> bool:
    """Whether a run that was found is still there, or one that was named may yet begin."""
    return chosen is not None or domain in leased_domains()


def _follow(listener: RunListener, told: Told, given: Scenario | None, console: Console) -> None:
    seen = _scenario_of(told, given)
    console.print(f"{one_line(told.scenario)}: listening", soft_wrap=True)
    say = lines_now_and_then(console.quiet, every_s=_LINE_EVERY_S)
    with Screen(console, one_line(told.scenario), seen.graph, say) as screen:
        listener.follow(seen.graph, screen.show)
    console.print(f"{plain(screen.view)}; the run is over", soft_wrap=True)


def _found(chosen: int | None) -> int:
    """The domain of the run that is meant; waits until there is one."""
    while chosen is None:
        domains = leased_domains()
        if len(domains) > 1:
            found = f"in ROS domains {', '.join(map(str, domains))} are runs on this machine"
            raise ScenarioError("etac watch", found, "one of them", "--domain N")
        if domains:
            return domains[0]
        time.sleep(_LOOK_S)
    return chosen


def _scenario_of(told: Told, given: Scenario | None) -> Scenario:
    """The scenario of the run: the one that was given, if it is, or the one that the run tells."""
    if given is not None:
        if given.digest != told.digest:
            raise ScenarioError(
                str(given.path),
                f"is not what runs there: '{one_line(told.scenario)}', {one_line(told.digest)}",
                "the run's file, --variant and --set",
                "give them, or leave the scenario out",
            )
        return given
    where = f"the run of '{one_line(told.scenario)}'"
    try:
        with own_classes_only():
            seen = load_told(told.text, where)
            assert seen.graph  # built in here, where no class of others is imported
            return seen
    except ForeignClassError:
        raise ScenarioError(
            where,
            "has classes of others, which are not imported on a run's word",
            "its scenario, if you trust it",
            "etac watch FILE, with the run's --variant and --set",
        ) from None
