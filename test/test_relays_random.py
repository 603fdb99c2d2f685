"""Whatever the graph: one order for all that follows is the same run, messages, errors and ends included."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any, ClassVar

import numpy as np
from hypothesis import example, given, settings
from hypothesis import strategies as st
from network import Network
from network import run as run_network
from toy import Ramp, RampParameters

from etac_ros.engines.inprocess import InProcess
from etac_ros.errors import EtacError
from etac_ros.graph.channel import Channel
from etac_ros.graph.graph import Graph, Link, LinkKind
from etac_ros.graph.module import Arrivals, Context, Module, Outputs, Window
from etac_ros.graph.plant import PlantModule, PlantModuleParameters
from etac_ros.graph.role import Acts, Role
from etac_ros.graph.wire import Wire, WireFormat
from etac_ros.parameters import FloatArray
from etac_ros.timing.windows import WindowPolicy

END = 12
PORTS = ("x", "y")


class Drawn(Module):
    """Acts at some ticks, answers, or listens; its values tell what it has been told, in order.

    At its ``fails``-th time it ends the run, or breaks.
    """

    roles: ClassVar[Mapping[str, Role]] = {
        "acts": Role(triggers="x"),
        "answers": Role(Acts.AT_ONCE),
        "timed": Role(Acts.AT_ONCE, timed=True),
        "listens": Role(Acts.ON_ARRIVAL),
    }

    def __init__(self, context: Context, what: str, at: frozenset[int], fails: int, how: str) -> None:
        super().__init__(context)
        self.role = self.roles[what]
        self.inputs = {"heard": 1}
        self.outputs = dict.fromkeys(PORTS, 1)
        self._at = at if what == "acts" else frozenset()
        self._fails, self._how = fails, how
        self._told = float(len(context.name))
        self._times = 0

    def scan(self, window: Window | None, after: int) -> int | None:
        return min((tick for tick in self._at if tick > after), default=None)

    def fire(self, tick: int, sample: FloatArray | None) -> Outputs:
        return self._say(tick)

    def receive(self, tick: int | None, arrivals: Arrivals, sample: FloatArray | None) -> Outputs:
        for arrival in arrivals:
            self._told = 0.5 * self._told + float(arrival.value[0]) + len(arrival.link)
        return {} if self.passive and self._told % 2 < 1 else self._say(tick if self.role.timed else None)

    def _say(self, tick: int | None) -> Outputs:
        self._times += 1
        if self._times == self._fails:
            if self._how == "breaks":
                return {"x": np.array([np.nan, 1.0]), "y": np.zeros(1)}
            if self._how == "raises":
                raise ValueError("no more")
            self.halt = "enough"
            return {"x": np.array([self._told])} if self._how == "half" else {}
        return {port: np.array([self._told + place + (tick or 0)]) for place, port in enumerate(PORTS)}


@st.composite
def graphs(draw: st.DrawFn) -> Any:
    """Some that act, then mostly some that answer, and plants; links mostly lead on."""
    acting = draw(st.integers(1, 2))
    names = [f"/m{number}" for number in range(acting + draw(st.integers(1, 4)))]
    plants = ["/p", "/q"][: draw(st.integers(1, 2))]
    fails = draw(st.sampled_from([None, *names]))
    modules = {
        name: (
            "acts" if place < acting else draw(st.sampled_from(["answers"] * 5 + ["timed", "listens", "acts"])),
            draw(st.frozensets(st.integers(0, END), min_size=1, max_size=4)),
            draw(st.integers(1, 5)) if name == fails else 0,
            draw(st.sampled_from(["none", "half", "breaks", "raises"])) if name == fails else "",
        )
        for place, name in enumerate(names)
    }
    later = [*names, *plants]
    links = []
    for place, name in enumerate(names):
        for port in draw(st.sampled_from([("x",), ("y",), ("x", "y")])):
            leads_to = later[max(acting, place + 1) :] if draw(st.integers(0, 9)) else later
            to = draw(st.lists(st.sampled_from(leads_to), min_size=1, max_size=3, unique=True))
            links.append((name, port, to, draw(st.sampled_from([0] * 9 + [2]))))
    return modules, draw(st.permutations(later)), draw(st.permutations(links))


def built(drawn: Any) -> Graph:
    what, order, drawn_links = drawn
    links = {
        f"l{number}": Link(
            f"l{number}",
            f"/l{number}",
            LinkKind.NETWORK,
            sender,
            port,
            {name: "push" if name not in what else "heard" for name in receivers},
            Wire(WireFormat.DOUBLE, 1),
            Channel(1, f"l{number}", delay),
        )
        for number, (sender, port, receivers, delay) in enumerate(drawn_links)
    }
    modules: dict[str, Module] = {}
    for name in order:
        incoming = tuple(link.name for link in links.values() if name in link.receivers)
        context = Context(name, 10, 1, incoming=incoming)
        if name in what:
            modules[name] = Drawn(context, *what[name])
        else:
            modules[name] = PlantModule(context, PlantModuleParameters(), Ramp(RampParameters(), 10))
    return Graph(modules, {}, links, 10, END, all_own=True)


def outcome(drawn: Any, forwarding: bool) -> Any:
    engine = InProcess(built(drawn), WindowPolicy(2, 8))
    engine.master.forwarding = forwarding
    try:
        digest = engine.run().digest()
    except EtacError as error:
        return str(error)
    master = engine.master
    states = {name: float(engine._plants[name].state[0]) for name in engine._plants}
    return digest, master.fired, master.sent, master.halted, master.tick, states


LATE = {
    "/m0": ("acts", frozenset({1}), 0, ""),
    "/m1": ("acts", frozenset({3}), 0, ""),
    "/m2": ("answers", frozenset(), 0, ""),
}
"""What is sent at tick 3 meets what has been under way since tick 1."""
LOOP = {"/m0": ("acts", frozenset({1, 4}), 0, "none"), "/m1": ("answers", frozenset(), 2, "half")}


@settings(max_examples=150, deadline=None)
@given(drawn=graphs())
@example(drawn=(LATE, ["/p", *LATE], [("/m0", "x", ["/m2"], 2), ("/m1", "x", ["/m2"], 0), ("/m2", "x", ["/p"], 0)]))
@example(drawn=(LOOP, ["/p", "/m1", "/m0"], [("/m0", "x", ["/m1", "/p"], 0), ("/m1", "y", ["/p"], 0)]))
@example(
    drawn=(LOOP, ["/p", "/m1", "/m0"], [("/m0", "x", ["/m1"], 0), ("/m1", "x", ["/p"], 0), ("/m1", "y", ["/p"], 0)])
)
def test_a_run_is_the_same_with_and_without_forwarding_and_by_messages(drawn: Any) -> None:
    usual = outcome(drawn, forwarding=False)
    assert outcome(drawn, forwarding=True) == usual
    if isinstance(usual, tuple) and not usual[3]:
        network = run_network(lambda: Network(built(drawn), WindowPolicy(2, 8)), lambda waiting: waiting[-1])
        assert network.recording().digest() == usual[0]
        assert (network.master.fired, network.master.sent) == usual[1:3]
