"""Which ROS domain a run uses.

Two runs in one domain would corrupt each other, so a run takes a free one for itself. "Free" means that no process
on this machine, of whatever ROS program, has a UDP port of the domain open, and that no other run has leased it.
"""

from __future__ import annotations

import os
import socket
from collections.abc import Mapping
from pathlib import Path

from etac_ros.errors import RunError, ScenarioError

LAST_DOMAIN = 101
"""The ports of the domains up to here lie below the range from which the system hands out ephemeral ports."""
DOMAINS = range(1, LAST_DOMAIN + 1)
"""The domains of which a run takes one; 0 is everybody's."""
DOMAIN_VARIABLE = "ROS_DOMAIN_ID"

_FIRST_PORT = 7400
_PORTS_A_DOMAIN = 250
_LEASES = "@etac_ros/domain/"
"""How the system shows the names of leases, which begin with a zero byte."""


def last_port(domain: int) -> int:
    """The last UDP port of a domain, which no participant of it takes."""
    return _FIRST_PORT + _PORTS_A_DOMAIN * (domain + 1) - 1


class DomainLease:
    """A ROS domain taken for one run; released by :meth:`release` or by the end of the process.

    It is a name in Linux's abstract socket namespace: it is the machine's, whoever the user is, it ends with the
    last process that holds it, and nothing of it can stay behind. Like UDP ports it belongs to the network namespace.
    """

    def __init__(self, domain: int, name: socket.socket) -> None:
        self.domain = domain
        self._name = name

    def release(self) -> None:
        """Let others have the domain."""
        self._name.close()


def check_domain(domain: int, given_by: str) -> int:
    """The domain, if there is one of that number.

    Parameters
    ----------
    domain
        The number.
    given_by
        Where it stands, for the error.

    Raises
    ------
    ScenarioError
        If it is out of range.
    """
    if not 0 <= domain <= LAST_DOMAIN:
        raise ScenarioError(
            f"{given_by} {domain}",
            "is out of range",
            f"a ROS domain from 0 to {LAST_DOMAIN}; the ports of higher ones may be any program's",
        )
    return domain


def domain_of_environment(environment: Mapping[str, str]) -> int | None:
    """The domain that ROS_DOMAIN_ID names; None where it is not set, or empty, which is the same to ROS.

    Raises
    ------
    ScenarioError
        If it is no number, or out of range.
    """
    text = environment.get(DOMAIN_VARIABLE, "").strip()
    if not text:
        return None
    try:
        domain = int(text)
    except ValueError:
        raise ScenarioError(
            f"{DOMAIN_VARIABLE} '{text}' in the environment",
            "is no whole number",
            f"a ROS domain from 0 to {LAST_DOMAIN}",
            f"unset {DOMAIN_VARIABLE}, or set it to a number",
        ) from None
    return check_domain(domain, DOMAIN_VARIABLE)


def take_domain(wanted: int | None = None) -> DomainLease:
    """Take a free domain.

    Parameters
    ----------
    wanted
        The user's own choice, which only another run may keep: foreign nodes, and tools that listen, are welcome.
        None takes the first one that no program uses.

    Raises
    ------
    RunError
        If the wanted domain is in use, or none is free.
    ScenarioError
        If there is no such domain.
    """
    if wanted is not None:
        check_domain(wanted, "ROS domain")
    busy = _busy_domains() if wanted is None else set()
    # Starting at a place of one's own keeps runs that start together from racing for the same domain.
    start = os.getpid() % len(DOMAINS)
    candidates = [wanted] if wanted is not None else [*DOMAINS[start:], *DOMAINS[:start]]
    for domain in candidates:
        if domain in busy:
            continue
        lease = _lease(domain)
        if lease is not None:
            return lease
    if wanted is not None:
        raise RunError(
            f"ROS domain {wanted}",
            "is in use by another run on this machine",
            "a domain of its own for each run",
            f"leave --domain out and {DOMAIN_VARIABLE} unset to have a free one chosen, or end the other run",
        )
    raise RunError("ROS domains", f"none of {DOMAINS[0]} to {DOMAINS[-1]} is free", "a free domain")


def _lease(domain: int) -> DomainLease | None:
    name = socket.socket(socket.AF_UNIX, socket.SOCK_DGRAM)
    try:
        name.bind(f"\0etac_ros/domain/{domain}")
    except OSError:
        name.close()
        return None
    return DomainLease(domain, name)


def leased_domains() -> list[int]:
    """The domains of the runs that are going on on this machine."""
    try:
        names = [line.rpartition(" ")[2] for line in Path("/proc/net/unix").read_text().splitlines()]
    except OSError:
        return []
    return sorted({int(name.removeprefix(_LEASES)) for name in names if name.startswith(_LEASES)})


def _busy_domains() -> set[int]:
    busy: set[int] = set()
    for table in ("/proc/net/udp", "/proc/net/udp6"):
        try:
            lines = Path(table).read_text().splitlines()[1:]
        except OSError:
            continue
        for line in lines:
            port = int(line.split()[1].rpartition(":")[2], 16)
            busy.add((port - _FIRST_PORT) // _PORTS_A_DOMAIN)
    return busy
