"""A lossy path between two network namespaces: a forwarder in user space between two TAP ends.

Each end is the only interface of its namespace. What the kernel of one namespace sends comes out of its TAP as an
Ethernet frame, is kept (frames are counted as they were sent, before the path has its say), and goes into the other
TAP, later or not at all. Datagrams of UDP are lost by a seeded draw each; ARP always gets through, since it is none of
DDS's business. The draws are those of the n-th datagram of a direction; which datagram that is, is up to DDS and to
wall time, so counts differ a little from run to run.
"""

from __future__ import annotations

import fcntl
import heapq
import os
import select
import shutil
import struct
import subprocess
import time
from dataclasses import dataclass, field
from pathlib import Path

import numpy as np

TUN = Path("/dev/net/tun")
_TUNSETIFF, _IFF_TAP, _IFF_NO_PI = 0x400454CA, 0x0002, 0x1000
_LONGEST_BYTES = 2048
"""An Ethernet frame of 1,514 bytes, and some."""


def why_not() -> str:
    """Why there is no private network here; empty if there may be one."""
    for program in ("unshare", "ip"):
        if shutil.which(program) is None:
            return f"there is no program {program}"
    done = subprocess.run([*private(), "true"], capture_output=True, text=True, check=False)
    if done.returncode:
        return f"this machine forbids network namespaces: {done.stderr.strip()}"
    if not os.access(TUN, os.R_OK | os.W_OK):
        return f"{TUN} is not there, or not for this user"
    return ""


def private() -> list[str]:
    """The command in front of another that gives it a network of its own; who is not root needs a user namespace."""
    return ["unshare", "-n"] if os.geteuid() == 0 else ["unshare", "-Urn"]


def set_up_loopback() -> None:
    """In a new namespace: a loopback that carries multicast, too."""
    _ip("link", "set", "lo", "up", "multicast", "on")
    _ip("route", "add", "224.0.0.0/4", "dev", "lo")


def open_tap(name: str, address: str) -> int:
    """Make a TAP interface in this process's namespace; returns the file from which its frames come."""
    tap = os.open(TUN, os.O_RDWR | os.O_NONBLOCK)
    fcntl.ioctl(tap, _TUNSETIFF, struct.pack("16sH22x", name.encode(), _IFF_TAP | _IFF_NO_PI))
    for family in ("all", "default", name):
        switch = Path(f"/proc/sys/net/ipv6/conf/{family}/disable_ipv6")
        if switch.exists() and os.access(switch, os.W_OK):
            switch.write_text("1")
    _ip("addr", "add", f"{address}/24", "dev", name)
    _ip("link", "set", name, "up")
    return tap


def _ip(*arguments: str) -> None:
    subprocess.run(["ip", *arguments], check=True, capture_output=True)


@dataclass
class LossyPath:
    """The path between two ends.

    Attributes
    ----------
    ends
        Files of the two TAPs.
    ports
        UDP ports whose frames are kept.
    loss
        Probability of each datagram.
    delay_s
        How late each arrives.
    rate_bit_s
        At which frames of a direction leave one behind the other; 0 for no limit.
    seed
        Of the draws.
    under_way
        When each frame arrives, a count, the end that it goes to, and itself; the next one first.
    lossy
        Nothing is lost or late before this is set: both ends have to meet first.
    """

    ends: tuple[int, int]
    ports: range
    loss: float = 0.0
    delay_s: float = 0.0
    rate_bit_s: float = 0.0
    seed: int = 1
    lossy: bool = False
    frames: list[tuple[float, bytes]] = field(default_factory=list)
    dropped: int = 0

    def __post_init__(self) -> None:
        # Philox: a generator of its own for each direction.
        self._draws = [np.random.Generator(np.random.Philox(key=[self.seed, side])) for side in (0, 1)]
        self.under_way: list[tuple[float, int, int, bytes]] = []
        self._free = [0.0, 0.0]
        self._count = 0

    def carry(self, timeout_s: float, *others: int) -> list[int]:
        """Carry frames until something else can be read, or for so long; returns what can be read."""
        end = time.monotonic() + timeout_s
        while True:
            now = time.monotonic()
            due = self.under_way[0][0] if self.under_way else end
            ready = select.select([*self.ends, *others], [], [], max(0.0, min(due, end) - now))[0]
            for side, tap in enumerate(self.ends):
                if tap in ready:
                    self._take(side, tap)
            self._deliver()
            found = [one for one in others if one in ready]
            if found or time.monotonic() >= end:
                return found

    def _take(self, side: int, tap: int) -> None:
        while True:
            try:
                frame = os.read(tap, _LONGEST_BYTES)
            except BlockingIOError:
                return
            now = time.monotonic()
            is_udp = frame[12:14] == b"\x08\x00" and frame[23] == 17
            first = not int.from_bytes(frame[20:22], "big") & 0x1FFF  # of the fragments of IP only this one has ports
            if is_udp and (not first or int.from_bytes(frame[36:38], "big") in self.ports):
                self.frames.append((now, frame))
            if is_udp and self.lossy and self._draws[side].random() < self.loss:
                self.dropped += 1
                continue
            leaves = max(now, self._free[side])
            if self.rate_bit_s and self.lossy:
                leaves += 8 * len(frame) / self.rate_bit_s
                self._free[side] = leaves
            self._count += 1
            arrives = leaves + (self.delay_s if self.lossy else 0.0)
            heapq.heappush(self.under_way, (arrives, self._count, self.ends[1 - side], frame))

    def _deliver(self) -> None:
        while self.under_way and self.under_way[0][0] <= time.monotonic():
            _, _, tap, frame = heapq.heappop(self.under_way)
            os.write(tap, frame)
