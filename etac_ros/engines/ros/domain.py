"""Which ROS domain a run uses, and how its processes find each other.

Two runs in one domain would corrupt each other, so a run takes a free one for itself. "Free" means that no process
on this machine, of whatever ROS program, has a UDP port of the domain open, and that no other run has locked it.
"""

from __future__ import annotations

import fcntl
import os
import tempfile
from importlib.resources import files
from pathlib import Path
from typing import IO

from etac_ros.errors import RunError

DOMAINS = range(1, 102)
"""Domains whose ports lie below the range from which the system hands out ephemeral ports."""

_FIRST_PORT = 7400
_PORTS_A_DOMAIN = 250


class DomainLease:
    """A ROS domain taken for one run; released by :meth:`release` or by the end of the process."""

    def __init__(self, domain: int, lock: IO[str]) -> None:
        self.domain = domain
        self._lock = lock

    def release(self) -> None:
        """Let others have the domain."""
        self._lock.close()


def take_domain(wanted: int | None = None, shared: bool = False) -> DomainLease:
    """Take a free domain.

    Parameters
    ----------
    wanted
        The user's own choice; None takes the first free one.
    shared
        A wanted domain may be in use by others than runs: foreign nodes of this run wait there.

    Raises
    ------
    RunError
        If the wanted domain is in use, or none is free.
    """
    if wanted is not None and not 0 <= wanted <= DOMAINS[-1]:
        raise RunError(f"ROS domain {wanted}", "is out of range", f"0 to {DOMAINS[-1]}")
    busy = set() if wanted is not None and shared else _busy_domains()
    # Starting at a place of one's own keeps runs that start together from racing for the same domain.
    start = os.getpid() % len(DOMAINS)
    candidates = [wanted] if wanted is not None else [*DOMAINS[start:], *DOMAINS[:start]]
    for domain in candidates:
        if domain in busy:
            continue
        lease = _lock(domain)
        if lease is not None:
            return lease
    if wanted is not None:
        raise RunError(
            f"ROS domain {wanted}",
            "is in use by another run or another ROS program on this machine",
            "a domain of its own for each run",
            "leave --domain out to have a free one chosen, or end the other program",
        )
    raise RunError("ROS domains", f"none of {DOMAINS[0]} to {DOMAINS[-1]} is free", "a free domain")


def dds_environment(domain: int) -> dict[str, str]:
    """Environment variables with which a process joins a run in the domain on this machine."""
    profile = Path(str(files("etac_ros.engines.ros").joinpath("fastdds_profile.xml")))
    return {
        "ROS_DOMAIN_ID": str(domain),
        "ROS_AUTOMATIC_DISCOVERY_RANGE": "SYSTEM_DEFAULT",  # leave it to the profile: this machine only
        "RMW_IMPLEMENTATION": "rmw_fastrtps_cpp",
        "FASTRTPS_DEFAULT_PROFILES_FILE": str(profile),
    }


def _lock(domain: int) -> DomainLease | None:
    path = Path(tempfile.gettempdir()) / f"etac_ros_domain_{domain}.lock"
    try:
        lock = path.open("a")
    except OSError:
        return None  # another user's lock file: take it for in use
    try:
        fcntl.flock(lock, fcntl.LOCK_EX | fcntl.LOCK_NB)
    except OSError:
        lock.close()
        return None
    return DomainLease(domain, lock)


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
