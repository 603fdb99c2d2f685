"""Captures the frames of one ROS domain on one interface, in a process of its own, into a pcapng file.

A packet socket of Linux (packet(7)) with a filter in the kernel, so that nothing of other domains and other programs is
copied or kept. It opens before the run's processes start, and is emptied after they have ended: what it has not got by
then, the kernel has counted as dropped.
"""

from __future__ import annotations

import ctypes
import errno
import multiprocessing
import os
import select
import signal
import socket
import struct
import sys
import time
from collections.abc import Iterator
from multiprocessing.connection import Connection
from pathlib import Path

from etac_ros.capture.pcapng import SNAP_BYTES, write
from etac_ros.errors import EtacError, RunError

LOOPBACK = "lo"
_FIRST_PORT, _PORTS_A_DOMAIN = 7400, 250
"""PB and DG of DDSI-RTPS 2.5, 9.6.2.3: the UDP ports of a domain."""
_BUFFER_BYTES = 64 * 1024 * 1024
_LONGEST_BYTES = 65549
"""An Ethernet header, and the longest IPv4 datagram."""
_GATHER_S = 0.002
"""Frames are left to gather, which leaves the processor to those that send them."""
_LOOK_S = 0.1
_END_S = 10.0

# linux/if_packet.h, linux/if_arp.h, asm-generic/socket.h, linux/if_ether.h
_SOL_PACKET, _PACKET_STATISTICS, _PACKET_IGNORE_OUTGOING = 263, 6, 23
_PACKET_OUTGOING, _ARPHRD_LOOPBACK = 4, 772
_SO_ATTACH_FILTER, _SO_RCVBUFFORCE, _SO_TIMESTAMPNS = 26, 33, 35
_ETH_P_ALL = 0x0003


class CannotCapture(EtacError):
    """Something that it takes to capture is not there; a run can go on without."""


def ports_of(domain: int) -> range:
    """The UDP ports to which the participants of a domain listen."""
    first = _FIRST_PORT + _PORTS_A_DOMAIN * domain
    return range(first, first + _PORTS_A_DOMAIN)


def open_socket(ports: range, interface: str = LOOPBACK) -> socket.socket:
    """A packet socket that gets every frame with a UDP datagram to one of some ports.

    Raises
    ------
    CannotCapture
        Saying what is missing.
    """
    if not hasattr(socket, "AF_PACKET"):
        raise CannotCapture("--capture", f"{sys.platform} has no packet sockets", "Linux")
    try:
        opened = socket.socket(socket.AF_PACKET, socket.SOCK_RAW, 0)
    except PermissionError:
        raise CannotCapture(
            "--capture",
            "this process may not open a packet socket",
            "the capability CAP_NET_RAW",
            "run as root, or in a container with --cap-add=NET_RAW",
        ) from None
    except OSError as error:
        raise CannotCapture("--capture", f"no packet socket: {error.strerror}") from None
    try:
        _filter(opened, ports)
        _make_room(opened)
        opened.setsockopt(socket.SOL_SOCKET, _SO_TIMESTAMPNS, 1)
        if interface == LOOPBACK:
            _without_outgoing(opened)
        opened.bind((interface, _ETH_P_ALL))  # only now do frames come in
    except OSError as error:
        opened.close()
        found = "there is no such interface" if error.errno == errno.ENODEV else str(error.strerror)
        raise CannotCapture("--capture", f"{interface}: {found}", "an interface that is up") from None
    opened.setblocking(False)
    return opened


def _filter(opened: socket.socket, ports: range) -> None:
    """Classic BPF: IPv4, UDP, and a target port in the range; the rest is dropped in the kernel."""
    program = [
        (0x28, 0, 0, 12),  # ldh [12]: type of the Ethernet frame
        (0x15, 0, 7, 0x0800),  # jeq IPv4
        (0x30, 0, 0, 23),  # ldb [23]: protocol
        (0x15, 0, 5, 17),  # jeq UDP
        (0xB1, 0, 0, 14),  # ldxb 4 * ([14] & 0xf): length of the IP header
        (0x48, 0, 0, 16),  # ldh [x + 16]: target port
        (0x35, 0, 2, ports.start),  # jge
        (0x25, 1, 0, ports.stop - 1),  # jgt
        (0x06, 0, 0, SNAP_BYTES),  # ret: keep
        (0x06, 0, 0, 0),  # ret: drop
    ]
    code = b"".join(struct.pack("HBBI", *instruction) for instruction in program)
    kept = ctypes.create_string_buffer(code)  # struct sock_fprog wants its address
    opened.setsockopt(socket.SOL_SOCKET, _SO_ATTACH_FILTER, struct.pack("HL", len(program), ctypes.addressof(kept)))


def _make_room(opened: socket.socket) -> None:
    try:
        opened.setsockopt(socket.SOL_SOCKET, _SO_RCVBUFFORCE, _BUFFER_BYTES)
    except PermissionError:  # without CAP_NET_ADMIN up to the system's limit; what does not fit is counted
        opened.setsockopt(socket.SOL_SOCKET, socket.SO_RCVBUF, _BUFFER_BYTES)


def _without_outgoing(opened: socket.socket) -> None:
    """The loopback shows each frame twice, on its way out and on its way in: only the second is taken."""
    try:
        opened.setsockopt(_SOL_PACKET, _PACKET_IGNORE_OUTGOING, 1)
    except OSError:
        return  # before Linux 4.20; frames() leaves them out as well


def frames(opened: socket.socket) -> Iterator[tuple[float, bytes]]:
    """What waits in a packet socket, each frame once, with its time [s]."""
    while True:
        try:
            frame, details, _, address = opened.recvmsg(_LONGEST_BYTES, socket.CMSG_SPACE(16))
        except BlockingIOError:
            return
        if address[2] == _PACKET_OUTGOING and address[3] == _ARPHRD_LOOPBACK:
            continue
        seconds, nanoseconds = struct.unpack("ll", details[0][2]) if details else (int(time.time()), 0)
        yield seconds + nanoseconds / 1e9, frame


class Capture:
    """Captures from its creation until :meth:`stop`.

    Parameters
    ----------
    path
        The pcapng file to write.
    ports
        UDP ports of the ROS domain.
    interface
        Where.

    Raises
    ------
    CannotCapture
        If this process may not capture; nothing has been started.
    RunError
        If the file cannot be written.
    """

    def __init__(self, path: Path, ports: range, interface: str = LOOPBACK) -> None:
        self.path = path
        opened = open_socket(ports, interface)
        try:
            path.open("wb").close()
        except OSError as error:
            opened.close()
            raise RunError(f"--capture {path}", f"cannot be written: {error.strerror}") from None
        fork = multiprocessing.get_context("fork")
        self._pipe, theirs = fork.Pipe()
        self._process = fork.Process(target=_capture, args=(opened, path, theirs, os.getpid()), daemon=True)
        self._process.start()
        theirs.close()
        opened.close()

    def stop(self) -> int:
        """Take what is still to be taken, close the file, and end the process.

        Returns
        -------
        int
            Frames that were missed, since their buffer was full.

        Raises
        ------
        RunError
            If the file could not be written.
        """
        try:
            self._pipe.send("stop")
            answer = self._pipe.recv() if self._pipe.poll(_END_S) else "the process that captures does not answer"
        except (OSError, EOFError):
            answer = "the process that captures has ended"
        self.abandon()
        if isinstance(answer, int):
            return answer
        raise RunError(f"--capture {self.path}", str(answer), "a whole capture", "the run itself is in the bag")

    def abandon(self) -> None:
        """End the process, whatever it does. A second call does nothing."""
        self._process.kill()
        self._process.join()
        self._pipe.close()


def _capture(opened: socket.socket, path: Path, pipe: Connection, parent: int) -> None:
    """What the process does. A terminal's Ctrl-C is for its parent, with which it ends."""
    for number in (signal.SIGINT, signal.SIGHUP, signal.SIGQUIT):
        signal.signal(number, signal.SIG_IGN)
    signal.signal(signal.SIGTERM, signal.SIG_DFL)
    try:
        with path.open("wb") as file:
            write(file, _until_told(opened, pipe, parent))
        dropped = struct.unpack("II", opened.getsockopt(_SOL_PACKET, _PACKET_STATISTICS, 8))[1]
        pipe.send(dropped)
    except OSError as error:
        pipe.send(f"cannot be written: {error.strerror or error}")
    os._exit(0)


def _until_told(opened: socket.socket, pipe: Connection, parent: int) -> Iterator[tuple[float, bytes]]:
    while not pipe.poll() and os.getppid() == parent:
        if select.select([opened.fileno(), pipe.fileno()], [], [], _LOOK_S)[0]:
            time.sleep(_GATHER_S)
            yield from frames(opened)
    yield from frames(opened)
