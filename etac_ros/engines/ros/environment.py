"""What of the environment decides how DDS behaves, and who has the last word on it.

A launched run keeps to the loopback of this machine with settings of its own, whatever the shell says: its processes
get :func:`dds_environment` and lose :data:`SET_ASIDE`. Nodes that are started by hand may have to meet on other terms
(several machines, a discovery server), so there the shell has the last word, and what may keep nodes from finding
each other is named while they wait.
"""

from __future__ import annotations

import os
from collections.abc import Mapping, MutableMapping
from importlib.resources import files
from pathlib import Path

from etac_ros.engines.ros.domain import DOMAIN_VARIABLE
from etac_ros.engines.ros.several_machines import Machines, profiles_folder
from etac_ros.errors import ScenarioError

RMW = "rmw_fastrtps_cpp"
_RMW_VARIABLE = "RMW_IMPLEMENTATION"
_RANGE = "ROS_AUTOMATIC_DISCOVERY_RANGE"
_PROFILES = "FASTRTPS_DEFAULT_PROFILES_FILE"
_SKIP_LOCAL_PROFILE = "SKIP_DEFAULT_XML_FILE"
_PEERS = "ETAC_ROS_PEERS"
MOST_PEERS = 110
"""Participants on one machine that find each other where nobody knows how many there are."""
_LOCAL_PROFILE = "DEFAULT_FASTRTPS_PROFILES.xml"
_SECURITY = "ROS_SECURITY_ENABLE"

SET_ASIDE = (
    "FASTDDS_BUILTIN_TRANSPORTS",
    "FASTDDS_ENVIRONMENT_FILE",
    "FASTDDS_STATISTICS",
    "RMW_FASTRTPS_PUBLICATION_MODE",
    "RMW_FASTRTPS_USE_QOS_FROM_XML",
    "ROS_DISCOVERY_SERVER",
    "ROS_LOCALHOST_ONLY",
    _SECURITY,
    "ROS_SECURITY_ENCLAVE_OVERRIDE",
    "ROS_SECURITY_KEYSTORE",
    "ROS_SECURITY_STRATEGY",
    "ROS_STATIC_PEERS",
    "ROS_SUPER_CLIENT",
)
"""Variables that the processes of a launched run do not get."""


def dds_environment(
    domain: int, private: bool = False, machines: Machines | None = None, peers: int = MOST_PEERS
) -> dict[str, str]:
    """Environment variables with which a process joins a run in the domain.

    Parameters
    ----------
    domain
        The ROS domain.
    private
        One parent sees all processes of the run. Then a peer that does not answer is merely late, and DDS must not
        forget it; elsewhere it is forgotten after four seconds, which is how its end is noticed.
    machines
        Those that the run is spread over; None keeps to this one.
    peers
        Places on a machine at which a private run looks for participants.
    """
    name = "fastdds_profile_launched.xml" if private else "fastdds_profile.xml"
    return {
        DOMAIN_VARIABLE: str(domain),
        _RANGE: "SYSTEM_DEFAULT",  # leave it to the profile
        _RMW_VARIABLE: RMW,
        _PROFILES: str(files("etac_ros.engines.ros").joinpath(name)) if machines is None else machines.profile(name),
        _SKIP_LOCAL_PROFILE: "1",
        **({_PEERS: str(min(peers, MOST_PEERS))} if private else {}),
    }


def enter_launched_run(
    environment: MutableMapping[str, str],
    domain: int,
    private: bool,
    machines: Machines | None = None,
    peers: int = MOST_PEERS,
) -> None:
    """Make the environment of a process that of a launched run. Before rclpy is initialised there."""
    for name in SET_ASIDE:
        environment.pop(name, None)
    environment.update(dds_environment(domain, private, machines, peers))


def without_effect(environment: Mapping[str, str], folder: Path) -> list[str]:
    """Settings, as NAME=VALUE, that somebody made on purpose and that a launched run does not heed.

    Parameters
    ----------
    environment
        That of the user's shell.
    folder
        The working directory, in which Fast DDS looks for a profile.
    """
    ours = dds_environment(0)
    own = {ours[_PROFILES], dds_environment(0, private=True)[_PROFILES]}
    found = [f"{name}={environment[name]}" for name in SET_ASIDE if _is_set(environment, name)]
    if environment.get(_RMW_VARIABLE, RMW) not in ("", RMW):
        found.append(f"{_RMW_VARIABLE}={environment[_RMW_VARIABLE]}")
    if environment.get(_RANGE, "").upper() == "OFF":
        found.append(f"{_RANGE}=OFF")
    written = Path(environment.get(_PROFILES) or ".").parent == profiles_folder()  # for --peers
    if _is_set(environment, _PROFILES) and environment[_PROFILES] not in own and not written:
        found.append(f"{_PROFILES}={environment[_PROFILES]}")
    if _SKIP_LOCAL_PROFILE not in environment and (folder / _LOCAL_PROFILE).exists():
        found.append(f"{_LOCAL_PROFILE} in {folder}")
    return found


def join_by_hand(environment: MutableMapping[str, str], domain: int, machines: Machines | None = None) -> None:
    """Complete the environment of a node that is started by hand: what the shell says stands.

    But for the profile, where it is said which machines the run is spread over.

    Raises
    ------
    ScenarioError
        If with these settings no node could find another.
    """
    vendor = environment.get(_RMW_VARIABLE, "")
    if vendor not in ("", RMW):
        raise ScenarioError(
            f"{_RMW_VARIABLE}={vendor} in the environment",
            "is another DDS than the nodes of etac_ros use",
            RMW,
            f"unset {_RMW_VARIABLE}",
        )
    if environment.get(_RANGE, "").upper() == "OFF":
        raise ScenarioError(
            f"{_RANGE}=OFF in the environment",
            "keeps every node to itself",
            "LOCALHOST, SUBNET, SYSTEM_DEFAULT or nothing",
            f"unset {_RANGE}",
        )
    if machines is not None:
        environment.pop(_PROFILES, None)
    for name, value in dds_environment(domain, machines=machines).items():
        if name == _SKIP_LOCAL_PROFILE:
            continue
        if not environment.get(name):
            environment[name] = value
    environment[DOMAIN_VARIABLE] = str(domain)


def may_keep_apart(environment: Mapping[str, str], folder: Path) -> str:
    """What in the environment of a node that waits in vain may be the cause; empty if nothing is known."""
    found = without_effect(environment, folder)
    if _is_set(environment, _RANGE) and environment[_RANGE].upper() not in ("SYSTEM_DEFAULT", "OFF"):
        found.append(f"{_RANGE}={environment[_RANGE]}")
    return f"set here, and a possible cause: {', '.join(found)}" if found else ""


def uses_another_dds(environment: Mapping[str, str] = os.environ) -> bool:
    """Whether rclpy, loaded in this environment, would be bound to the DDS of another vendor."""
    return environment.get(_RMW_VARIABLE, "") not in ("", RMW)


def _is_set(environment: Mapping[str, str], name: str) -> bool:
    value = environment.get(name, "")
    off = {"ROS_LOCALHOST_ONLY": "0", _SECURITY: "false"}
    return bool(value) and value.lower() != off.get(name)
