"""Where the time of a hop over DDS goes, by layer, in the running graph, and beside it a bare ping-pong.

    ./scripts/bench hop                      # wu2018, three runs
    ./scripts/bench hop --scenario qi2022 --runs 1

A hop is a message that somebody waits for: on a link, a window, an order, a report. The graph runs as always, with a
process a node; functions of each layer are timed in every process, each without what it calls of other layers. So a
layer's time is the sum over all processes, and can be more than the loop's: processes work side by side. The timing
itself costs about a microsecond a call, which is in the figures.

The floor is measured between the runs, in the same environment and over the same loop: two processes that do nothing
but send a message of the same type and length back and forth. It is half of a round trip.
"""

from __future__ import annotations

import array
import json
import multiprocessing
import os
import statistics
import tempfile
import time
from collections import defaultdict
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import Annotated, Any, NoReturn

import typer
from section import Section

from etac_ros.engines.ros import coordinator, host, launcher, module_node, run_node
from etac_ros.engines.ros.domain import take_domain
from etac_ros.engines.ros.endpoints import Publisher, Spinner, Subscription
from etac_ros.engines.ros.environment import enter_launched_run
from etac_ros.graph.cdr import ValueLayout
from etac_ros.graph.driver import Driver
from etac_ros.graph.plant import PlantModule
from etac_ros.runs import RosOptions, Run, run_over_ros
from etac_ros.scenario.load import load
from etac_ros.tables.table import Row, Table
from etac_ros.timing.dispatcher import Dispatcher

LAYERS = {
    "wait": "in the wait set, for a message or for the processor; most of it is idle",
    "take": "message out of DDS, as bytes; of the recorder all that it does with it, too",
    "decode": "message to value, window or note",
    "module": "the module's own work: rule, law, physics",
    "master": "the time master and the worker's queues",
    "encode": "value or window to message",
    "note": "order or report to text",
    "write": "bytes into DDS and onto its sockets",
}
ROUNDS = 2000
_WARM_UP = 200


class Clock:
    """Time of this process by layer, each without the layers that it calls."""

    def __init__(self) -> None:
        self.calls: dict[str, int] = defaultdict(int)
        self.seconds: dict[str, float] = defaultdict(float)
        self.on_the_way: list[int] = []
        self._within: list[float] = []

    def timed(self, layer: str, function: Callable[..., Any]) -> Callable[..., Any]:
        """A function that is timed."""

        def call(*arguments: Any, **named: Any) -> Any:
            self._within.append(0.0)
            began = time.perf_counter()
            try:
                return function(*arguments, **named)
            finally:
                took = time.perf_counter() - began
                self.calls[layer] += 1
                self.seconds[layer] += took - self._within.pop()
                if self._within:
                    self._within[-1] += took

        return call

    def clear(self) -> None:
        """Begin anew."""
        self.calls.clear()
        self.seconds.clear()
        self.on_the_way.clear()


@contextmanager
def instrumented(folder: Path) -> Iterator[None]:
    """Within: what processes of a run do is timed, since they are forked from this one; each leaves a file."""
    clock = Clock()
    places: list[tuple[Any, str, str]] = [
        (Publisher, "publish", "write"),
        (Subscription, "take_one", "take"),
        (ValueLayout, "read", "decode"),
        (module_node, "decode_window", "decode"),
        (run_node, "read_note", "decode"),
        (module_node, "encode", "encode"),
        (module_node, "encode_window", "encode"),
        (run_node, "write_note", "note"),
        (Dispatcher, "on_report", "master"),
        (Dispatcher, "on_obeyed", "master"),
        *((Driver, method, "module") for method in ("see", "look", "fire", "receive", "conclude")),
        *((PlantModule, method, "module") for method in ("open", "commit")),
        *((module_node.ModuleWorker, name, "master") for name in ("on_message", "on_orders", "on_window")),
    ]
    kept = [(owner, name, owner.__dict__[name]) for owner, name, _ in places]
    kept += [(Spinner, "once", Spinner.once), (launcher, "leave_process", launcher.leave_process)]
    kept += [(coordinator.CoordinatorNode, "on_start", coordinator.CoordinatorNode.on_start)]
    kept += [(module_node.ModuleNode, "on_start", module_node.ModuleNode.on_start)]
    once, began = Spinner.once, module_node.ModuleNode.on_start

    def waiting(spinner: Spinner, timeout_s: float) -> bool:
        return bool(clock.timed("wait", once)(spinner, timeout_s))

    def leave(code: int) -> NoReturn:
        content = {"calls": clock.calls, "seconds": clock.seconds}
        (folder / f"{os.getpid()}.json").write_text(json.dumps(content))
        host.leave_process(code)

    def start(of: Callable[[Any], None]) -> Callable[[Any], None]:
        def on_start(node: Any) -> None:
            clock.clear()  # joining is no part of the loop
            of(node)

        return on_start

    for owner, name, layer in places:
        setattr(owner, name, clock.timed(layer, owner.__dict__[name]))
    Spinner.once = waiting  # type: ignore[method-assign]
    launcher.leave_process = leave
    module_node.ModuleNode.on_start = start(began)  # type: ignore[method-assign]
    coordinator.CoordinatorNode.on_start = start(kept[-2][2])  # type: ignore[method-assign]
    try:
        yield
    finally:
        for owner, name, before in kept:
            setattr(owner, name, before)


def layers_of(folder: Path) -> dict[str, tuple[int, float]]:
    """Calls and seconds of each layer, over all processes."""
    found: dict[str, tuple[int, float]] = {}
    for path in folder.glob("*.json"):
        content = json.loads(path.read_text())
        for layer, seconds in content["seconds"].items():
            calls, so_far = found.get(layer, (0, 0.0))
            found[layer] = calls + content["calls"][layer], so_far + seconds
    return found


def hops(run: Run) -> dict[str, int]:
    """Messages that somebody waits for, by topic."""
    kinds = ("/window", "/next", "/go")
    return {
        name: topic.messages
        for name, topic in run.summary.topics.items()
        if topic.kind != "emulation" or name.endswith(kinds)
    }


def ping_pong(domain: int, kind: type, message: Any) -> float:
    """Half of a round trip between two processes [s], the median."""
    fork = multiprocessing.get_context("fork")
    ours, theirs = fork.Pipe(duplex=False)
    players = [fork.Process(target=_play, args=(domain, kind, message, first, theirs)) for first in (True, False)]
    for player in players:
        player.start()
    half = float(ours.recv())
    for player in players:
        player.join()
    return half


def _play(domain: int, kind: type, message: Any, first: bool, pipe: Any) -> None:
    import rclpy
    from rclpy.context import Context

    enter_launched_run(os.environ, domain, private=True)
    context = Context()
    rclpy.init(context=context)
    own, other = ("ping", "pong") if first else ("pong", "ping")
    node = rclpy.create_node(own, context=context, start_parameter_services=False, enable_rosout=False)
    spinner, trips, left = Spinner(context), [], [ROUNDS + _WARM_UP]
    sender = Publisher(node, kind, f"/{own}", (f"/{other}",))
    sent = [0]

    def send() -> None:
        sent[0] = time.perf_counter_ns()
        sender.publish(message)

    def on_message(content: Any, sequence: int) -> None:
        if first:
            trips.append(time.perf_counter_ns() - sent[0])
        left[0] -= 1
        if left[0] or not first:
            send()

    spinner.add(heard := Subscription(node, kind, f"/{other}", on_message))
    while not (sender.matched and heard.matched):
        spinner.once(0.01)
    if first:
        send()
    while left[0]:
        spinner.once(0.5)
        if first and not trips:
            send()  # the other side may not have been ready for the first
    sender.drain(1.0)
    if first:
        pipe.send(statistics.median(trips[_WARM_UP:]) / 2e9)
    os._exit(0)


def main(
    scenario: Annotated[str, typer.Option(help="Which scenario.")] = "wu2018",
    runs: Annotated[int, typer.Option(min=1, help="Runs, with a ping-pong after each.")] = 3,
    write: Annotated[bool, typer.Option("--write", help="Into docs/performance.md.")] = False,
) -> None:
    """Measure and print."""
    # Not before etac_ros: a program that has loaded these may be using them, and a run would take a process of its own.
    from geometry_msgs.msg import Point32
    from std_msgs.msg import Float64MultiArray, String

    section = Section("hop", "A hop over DDS", f"./scripts/bench hop --scenario {scenario} --runs {runs}")
    loaded = load(scenario)
    floors: dict[str, list[float]] = defaultdict(list)
    plain, timed, layers = [], [], []
    run = None
    for number in range(runs):
        with tempfile.TemporaryDirectory() as name:
            folder = Path(name)
            run = run_over_ros(loaded, folder / "plain", RosOptions())
            plain.append(run.summary.timing.loop_s)
            with instrumented(folder):
                timed.append(run_over_ros(loaded, folder / f"bag{number}", RosOptions()).summary.timing.loop_s)
            layers.append(layers_of(folder))
        window = run.summary.topics[next(topic for topic in run.summary.topics if topic.endswith("/window"))]
        numbers = window.cdr_bytes // max(window.messages, 1) // 8
        kinds = {
            "Point32, 12 bytes": (Point32, Point32(x=1.0)),
            "a note, 100 bytes": (String, String(data="n" * 100)),
            f"a window of {numbers} numbers": (
                Float64MultiArray, Float64MultiArray(data=array.array("d", [0.0] * numbers))
            ),
        }  # fmt: skip
        for label, (kind, message) in kinds.items():
            lease = take_domain()
            try:
                floors[label].append(ping_pong(lease.domain, kind, message))
            finally:
                lease.release()
    assert run is not None
    counted = sum(hops(run).values())
    least, middle = min(plain), statistics.median(plain)
    point = min(next(iter(floors.values())))
    section.say(
        f"{scenario}, a process a node, {runs} rounds: the loop takes {least:.3f} s at least, {middle:.3f} s in the "
        f"median, {statistics.median(timed):.3f} s while its layers are timed. It has {counted:,} hops, messages that "
        f"somebody waits for: {1e6 * least / counted:.0f} us of the loop each (hops may run side by side), "
        f"{least / counted / point:.1f} times a bare one."
    )
    rows = []
    for layer, what in LAYERS.items():
        calls = statistics.median(found.get(layer, (0, 0.0))[0] for found in layers)
        seconds = statistics.median(found.get(layer, (0, 0.0))[1] for found in layers)
        rows.append(Row((layer, f"{calls:,.0f}", f"{1e3 * seconds:.1f}", f"{1e6 * seconds / counted:.1f}", what)))
    heads = ("layer", "calls", "of all processes [ms]", "a hop [us]", "what it is")
    title = "Where the time goes, added up over all processes, which work side by side"
    section.show(Table(title, heads, tuple(rows), texts=frozenset({"what it is"})))
    rows = [
        Row((label, f"{1e6 * min(halves):.0f}", f"{1e6 * statistics.median(halves):.0f}"))
        for label, halves in floors.items()
    ]
    title = "The floor: one way of a bare ping-pong of two processes, in the same environment, between the runs"
    section.show(Table(title, ("message", "least [us]", "median [us]"), tuple(rows)))
    if write:
        section.write()


if __name__ == "__main__":
    typer.run(main)
