"""A path between two network namespaces that loses datagrams: DDS's own retransmissions, counted as they are sent."""

from __future__ import annotations

import contextlib
import importlib.util
import itertools
import json
import socket
import subprocess
import sys
from collections.abc import Iterator
from pathlib import Path
from types import ModuleType
from typing import Any

import pytest
from frames import frame

BENCH = Path(__file__).resolve().parent.parent / "bench"
INSIDE = """
import json, sys
sys.path.insert(0, sys.argv[1])
from wire_rig import Setting, measure
from etac_ros.graph.graph import Qos, Reliability
from etac_ros.graph.wire import Wire, WireFormat

found = {}
for reliability in Reliability:
    setting = Setting(Wire(WireFormat.COMPACT, 3), Qos(reliability), messages=25, pause_s=0.03, loss=0.3)
    one = measure(setting)
    found[reliability] = [one.delivered[0], one.topic.model_dump(mode="json")]
print(json.dumps(found))
"""


def bench(name: str) -> ModuleType:
    spec = importlib.util.spec_from_file_location(name, BENCH / f"{name}.py")
    assert spec is not None
    assert spec.loader is not None
    module = importlib.util.module_from_spec(spec)
    sys.modules[name] = module
    spec.loader.exec_module(module)
    return module


PATH = bench("wire_path")
WHY_NOT: str = PATH.why_not()


@pytest.mark.skipif(bool(WHY_NOT), reason=WHY_NOT)
def test_dds_sends_again_what_the_path_has_lost() -> None:
    """Three of ten datagrams are lost: reliable delivers all, for more; best effort loses some, for a frame each."""
    command = [*PATH.private(), sys.executable, "-c", INSIDE, str(BENCH)]
    done = subprocess.run(command, capture_output=True, text=True, timeout=100, check=False)
    assert done.returncode == 0, done.stderr
    found: dict[str, Any] = json.loads(done.stdout)
    delivered, topic = found["reliable"]
    assert delivered == topic["messages"] == 25
    assert topic["resent"] > 0
    assert topic["causes"]["data"]["payload_bytes"] == 12 * (25 + topic["resent"])
    assert topic["causes"]["data"]["frames"] <= 25 + topic["resent"]  # several may go again in one frame
    assert topic["causes"].keys() == {"data", "heartbeat", "acknack"}
    delivered, topic = found["best_effort"]
    assert 0 < delivered < topic["messages"] == 25
    assert topic["resent"] == 0
    assert topic["causes"].keys() == {"data"}
    assert topic["causes"]["data"]["total_bytes"] == 25 * 190


@pytest.fixture
def ends() -> Iterator[list[socket.socket]]:
    """Two ends as sockets that keep frames apart: a kernel's side and the path's side of each."""
    pairs = [socket.socketpair(socket.AF_UNIX, socket.SOCK_SEQPACKET) for _ in range(2)]
    for end in (flat := [end for pair in pairs for end in pair]):
        end.setblocking(False)
    yield flat
    for end in flat:
        end.close()


def sent(count: int) -> list[bytes]:
    return [frame(bytes([number]) * 100, port=7700) for number in range(count)]


def path_of(ends: list[socket.socket], **options: Any) -> Any:
    return PATH.LossyPath((ends[1].fileno(), ends[3].fileno()), range(7650, 7900), **options)


def carried(ends: list[socket.socket], path: Any) -> list[bytes]:
    """What comes out at the other end of 60 frames."""
    got = []
    for one in sent(60):
        ends[0].send(one)
        path.carry(0.0)
        with contextlib.suppress(BlockingIOError):
            got.append(ends[2].recv(2048))
    return got


def test_path_loses_by_its_seed_alone(ends: list[socket.socket]) -> None:
    path = path_of(ends, loss=0.3, seed=5, lossy=True)
    got = carried(ends, path)
    assert len(got) == 60 - path.dropped
    assert 5 < path.dropped < 35
    assert [kept for _, kept in path.frames] == sent(60)  # counted before anything is lost
    assert carried(ends, path_of(ends, loss=0.3, seed=5, lossy=True)) == got
    assert carried(ends, path_of(ends, loss=0.3, seed=6, lossy=True)) != got
    assert carried(ends, path_of(ends, loss=0.3)) == sent(60)  # both ends have to meet before it is lossy


def test_path_delays_and_limits(ends: list[socket.socket]) -> None:
    """Frames of 142 bytes leave one behind the other at 100 kbit/s, and arrive a delay later."""
    path = path_of(ends, delay_s=1000.0, rate_bit_s=100_000.0, lossy=True)
    for one in sent(3):
        ends[0].send(one)
    path.carry(0.0)
    arrivals = [when for when, *_ in sorted(path.under_way)]
    assert [b - a for a, b in itertools.pairwise(arrivals)] == pytest.approx([8 * 142 / 100_000.0] * 2)
    assert arrivals[0] - path.frames[0][0] == pytest.approx(1000.0 + 8 * 142 / 100_000.0)
