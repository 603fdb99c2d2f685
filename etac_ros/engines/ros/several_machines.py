"""A run over several machines: which address of this one it uses, whom it seeks, and the DDS profile for that.

Discovery over a network is by unicast to the peers that are named, so that no multicast has to cross it. Everything of
this machine goes over that one address, too: the system hands on what is sent to itself without a wire.
"""

from __future__ import annotations

import errno
import fcntl
import hashlib
import os
import select
import socket
import struct
import sys
import time
from dataclasses import dataclass
from importlib.resources import files
from pathlib import Path
from typing import NamedTuple
from xml.etree import ElementTree

from etac_ros.engines.ros.domain import last_port
from etac_ros.errors import RunError, ScenarioError
from etac_ros.whole_files import write_at_once

ANSWERS_WITHIN_S = 4.0
"""How long a peer may take to answer or to be missed: resolving an address in vain takes Linux three seconds."""
_NAMESPACE = "http://www.eprosima.com/XMLSchemas/fastRTPS_Profiles"
_GET_ADDRESS = 0x8915  # SIOCGIFADDR
_GET_FLAGS = 0x8913  # SIOCGIFFLAGS
_UP, _RUNNING = 0x1, 0x40  # IFF_UP, IFF_RUNNING
_LINK_WITHIN_S = 10.0
_LOOK_EVERY_S = 0.02
_TELL_ERRORS = 11  # IP_RECVERR: also those that may pass
_UNREACHABLE = (errno.EHOSTUNREACH, errno.ENETUNREACH, errno.EHOSTDOWN)


@dataclass(frozen=True)
class Machines:
    """Which machines a run is spread over, as one of them sees it.

    Attributes
    ----------
    address
        IPv4 address of this one.
    peers
        Those of the others.
    """

    address: str
    peers: tuple[str, ...] = ()

    def profile(self, name: str) -> str:
        """The path of a DDS profile like the one of that name, for these machines.

        It is kept in the user's cache, named by what stands in it: every run over the same machines reads the same.
        """
        content = _profile(files("etac_ros.engines.ros").joinpath(name).read_text(), self)
        folder = profiles_folder()
        path = folder / f"{hashlib.sha256(content).hexdigest()[:16]}.xml"
        try:
            if not path.exists():
                folder.mkdir(parents=True, exist_ok=True)
                write_at_once(path, content)
        except OSError as error:
            raise RunError(
                f"DDS profile {path}", f"cannot be written: {error.strerror}", "a folder that may be written",
                "set XDG_CACHE_HOME to one",
            ) from None  # fmt: skip
        return str(path)

    def known(self) -> tuple[str, ...]:
        """All addresses, its own first."""
        return tuple(dict.fromkeys((self.address, *self.peers)))


def profiles_folder() -> Path:
    """Where profiles for several machines are kept."""
    home = os.environ.get("XDG_CACHE_HOME")
    return (Path(home) if home else Path.home() / ".cache") / "etac_ros" / "profiles"


def machines_of(peers: str | None, interface: str | None) -> Machines | None:
    """What ``--peers`` and ``--interface`` say; None where neither is given: then a run keeps to the loopback.

    Parameters
    ----------
    peers
        Names or addresses of other machines, with commas between.
    interface
        Name of a network interface, or an address of this machine; default: from where the first peer is reached.

    Raises
    ------
    ScenarioError
        If a name is unknown, there is no such interface, it has no link, or no way leads to a peer.
    """
    if peers is None and interface is None:
        return None
    names = [] if peers is None else [name.strip() for name in peers.split(",")]
    if not all(names) or (peers is not None and not names):
        raise ScenarioError(f"--peers {peers}", "names nobody", "addresses with commas between, and no spaces")
    found = [_resolved(name) for name in names]
    address = _address_towards(found[0]) if interface is None else _address_of(interface)
    _check_link(address)
    return Machines(address, tuple(peer for peer in dict.fromkeys(found) if peer != address))


def find_peers(machines: Machines | None, domain: int | None) -> None:
    """Make sure that every peer can be reached, and say who does not answer.

    Raises
    ------
    ScenarioError
        If the network says that one cannot be reached.
    """
    if machines is None:
        return
    for peer in silent_peers(machines, domain or 0):
        print(
            f"etac: peer {peer} does not answer within {ANSWERS_WITHIN_S:g} s: switched off, or behind a firewall; "
            "the run waits for its nodes",
            file=sys.stderr,
        )


def silent_peers(machines: Machines, domain: int) -> tuple[str, ...]:
    """Peers that do not answer, as behind a firewall.

    Raises
    ------
    ScenarioError
        If the network says that one cannot be reached.
    """
    asked: dict[socket.socket, str] = {}
    try:
        for peer in machines.peers:
            asking = socket.socket(socket.AF_INET, socket.SOCK_DGRAM)
            asked[asking] = peer
            try:
                asking.setsockopt(socket.IPPROTO_IP, _TELL_ERRORS, 1)
                asking.bind((machines.address, 0))
                # Nobody listens there, so who is there says so.
                asking.connect((peer, last_port(domain)))
                asking.send(b"")
            except OSError as error:
                raise _not_reached(peer, machines.address, error) from None
        silent, ready = dict(asked), list(asked)
        while silent and ready:
            ready, _, _ = select.select(list(silent), [], [], ANSWERS_WITHIN_S)
            for answered in ready:
                peer = silent.pop(answered)
                code = answered.getsockopt(socket.SOL_SOCKET, socket.SO_ERROR)
                if code in _UNREACHABLE:
                    raise _not_reached(peer, machines.address, OSError(code, os.strerror(code)))
        return tuple(silent.values())
    finally:
        for asking in asked:
            asking.close()


def _not_reached(peer: str, address: str, error: OSError) -> ScenarioError:
    return ScenarioError(
        f"--peers {peer}",
        f"cannot be reached from {address}: {os.strerror(error.errno or 0)}",
        "a machine that is there",
        f"`ping {peer}`; --interface says which address of this machine is used",
    )


def _resolved(name: str) -> str:
    try:
        return str(socket.getaddrinfo(name, None, socket.AF_INET, socket.SOCK_DGRAM)[0][4][0])
    except (OSError, UnicodeError):
        raise ScenarioError(
            f"--peers {name}", "is unknown", "an IPv4 address, or the name of a machine that has one"
        ) from None


def _address_towards(peer: str) -> str:
    with socket.socket(socket.AF_INET, socket.SOCK_DGRAM) as asking:
        try:
            asking.connect((peer, 9))
        except OSError as error:
            raise ScenarioError(
                f"--peers {peer}", f"no way leads there: {os.strerror(error.errno or 0)}", "a machine that is there"
            ) from None
        return str(asking.getsockname()[0])


def _address_of(interface: str) -> str:
    """The address of an interface that is named, or the address itself if this machine has it."""
    names = [name for _, name in socket.if_nameindex()]
    with socket.socket(socket.AF_INET, socket.SOCK_DGRAM) as asking:
        if interface in names:
            try:
                return _ipv4_address(asking, _request(interface))
            except OSError:
                raise ScenarioError(f"--interface {interface}", "has no IPv4 address", "one that has") from None
        try:
            socket.inet_pton(socket.AF_INET, interface)
            asking.bind((interface, 0))
        except OSError:
            known = ", ".join(names)
            raise ScenarioError(
                f"--interface {interface}", "is no interface or address of this machine", f"an address, or {known}"
            ) from None
        return interface


def _request(interface: str) -> bytes:
    """What the system is asked with about an interface."""
    return struct.pack("256s", interface.encode()[:15])


def _ipv4_address(asking: socket.socket, request: bytes) -> str:
    return socket.inet_ntoa(fcntl.ioctl(asking, _GET_ADDRESS, request)[20:24])


def _check_link(address: str) -> None:
    """Wait until something can be sent from an address: DDS would leave it out, and its nodes wait for ever.

    Linux says late of a link that has just come up that it runs: a second, or more on a busy machine.
    """
    deadline = time.monotonic() + _LINK_WITHIN_S
    while (down := _without_link(address)) is not None:
        if not down.may_come or time.monotonic() > deadline:
            raise ScenarioError(
                f"interface {down.interface} ({address})", "is down, or has no link", "a network that is there",
                f"`ip link set {down.interface} up`, the cable, or --interface with another one",
            )  # fmt: skip
        time.sleep(_LOOK_EVERY_S)


class _Down(NamedTuple):
    interface: str
    may_come: bool
    """It is set up, and has no link yet."""


def _without_link(address: str) -> _Down | None:
    """The interface with that address, if nothing can be sent from it."""
    with socket.socket(socket.AF_INET, socket.SOCK_DGRAM) as asking:
        for _, name in socket.if_nameindex():
            request = _request(name)
            try:
                if _ipv4_address(asking, request) != address:
                    continue
                (flags,) = struct.unpack_from("H", fcntl.ioctl(asking, _GET_FLAGS, request), 16)
            except OSError:  # without an IPv4 address, or gone
                continue
            if not flags & _RUNNING:
                return _Down(name, bool(flags & _UP))
    return None


def _profile(text: str, machines: Machines) -> bytes:
    """A profile for the loopback, written anew for these machines."""
    ElementTree.register_namespace("", _NAMESPACE)
    root = ElementTree.fromstring(text)
    allowed = _only(root, "interfaceWhiteList")
    _only(allowed, "address").text = machines.address
    peers = _only(root, "initialPeersList")
    peers.clear()
    for address in machines.known():
        locator = ElementTree.SubElement(ElementTree.SubElement(peers, _tag("locator")), _tag("udpv4"))
        ElementTree.SubElement(locator, _tag("address")).text = address
    written: bytes = ElementTree.tostring(root, encoding="utf-8", xml_declaration=True)
    return written


def _only(below: ElementTree.Element, name: str) -> ElementTree.Element:
    found = next(below.iter(_tag(name)), None)
    assert found is not None
    return found


def _tag(name: str) -> str:
    return f"{{{_NAMESPACE}}}{name}"
