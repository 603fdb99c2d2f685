"""What a terminal shows of a run as it happens, as lines of text: a pure function of a picture of it, and of a size."""

from __future__ import annotations

import math
from collections.abc import Iterable, Iterator, Sequence
from dataclasses import dataclass

import numpy as np
from rich.cells import cell_len, set_cell_size

from etac_ros.bag.monitor import AirTraffic, Flow, Picture
from etac_ros.graph.faults import Fault, FaultKind
from etac_ros.graph.graph import Graph, Link, LinkKind
from etac_ros.maths.ticks import NANOSECONDS, seconds
from etac_ros.parameters import FloatArray
from etac_ros.tables.numbers import number

BLOCKS = "▁▂▃▄▅▆▇█"
ASCII_BLOCKS = "_.-:=+*#"
"""Heights of a curve, where the terminal has no others."""
_DECADES = 3.0
"""A curve spans so many decades at least, else noise would fill it."""
_GAP = 2


@dataclass(frozen=True)
class View:
    """A run at one moment, and what it is a run of.

    Attributes
    ----------
    title
        Name of the scenario.
    graph
        What runs.
    picture
        What has happened.
    rate
        Simulated seconds a second of late; NaN where nobody knows yet.
    state
        What there is to say of it beside its time, as that it has ended; empty while it goes on.
    """

    title: str
    graph: Graph
    picture: Picture
    rate: float
    state: str = ""

    @property
    def time_s(self) -> float:
        """Simulated time [s]."""
        return self._s(self.picture.tick)

    @property
    def from_s(self) -> float:
        """Simulated time from which on it has been seen [s]."""
        return self._s(self.picture.from_tick)

    @property
    def end_s(self) -> float:
        """Simulated time at which the run ends [s]."""
        return self._s(self.graph.end_tick)

    def _s(self, tick: int) -> float:
        return float(seconds(tick, self.graph.ticks_per_second))


def lines(view: View, width: int, height: int, blocks: str = BLOCKS) -> list[str]:
    """The view for a terminal: lines that are no wider than it is, and no more than it has.

    What there is no room for is added up in a line of its own, the topics that are no network first.
    """
    above = [_head(view), *_errors(view, width, blocks), *_triggers(view, width)]
    below = [*_air(view, width), *_faults(view)]
    rows = list(_topics(view))
    room = max(1, height - len(above) - len(below) - 1)
    left_out: list[_Row] = []
    if len(rows) > room:
        rows, left_out = rows[: room - 1], rows[room - 1 :]
    made = [*above, *_table([_HEADINGS, *(row.cells for row in rows)], width)]
    if left_out:
        total = sum(row.messages for row in left_out)
        made.append(f"and {len(left_out)} more topics, {total:,} messages")
    return [_cut(line, width) for line in [*made, *below]][:height]


def plain(view: View) -> str:
    """The view in one sentence, for where there is no terminal."""
    flows = [(link, view.picture.flows[link.name]) for link in view.graph.links.values()]
    network = [flow for link, flow in flows if link.kind is LinkKind.NETWORK]
    parts = [_progress(view)]
    errors = [error for error in view.picture.errors_deg.values() if not math.isnan(error)]
    if errors:
        parts.append(f"error {max(errors):.3g} deg")
    if view.picture.fired:
        parts.append(f"{sum(view.picture.fired.values()):,} triggers")
    messages, payload = sum(flow.messages for flow in network), sum(flow.payload_bytes for flow in network)
    parts.append(f"{messages:,} messages and {payload:,} B on the network")
    parts += [f"{name}: {', '.join(_air_words(one, view))}" for name, one in view.picture.air.items()]
    parts += [words for words, is_on in _fault_words(view) if is_on]
    return f"{view.title}: {', '.join(parts)}"


def _progress(view: View) -> str:
    words = f"{view.time_s:,.1f} of {view.end_s:,g} s simulated"
    if view.state:
        return f"{words}, {view.state}"
    return words if math.isnan(view.rate) else f"{words}, {view.rate:,.3g} x real time"


def _head(view: View) -> str:
    seen = f", seen from {view.from_s:,.1f} s on" if view.picture.from_tick else ""
    return f"{view.title}: {_progress(view)}{seen}"


def _errors(view: View, width: int, blocks: str) -> Iterator[str]:
    errors = view.picture.errors_deg
    if not errors:
        return
    yield "attitude error [deg] from start to end, by decades"
    names = max(cell_len(name) for name in errors)
    room = width - names - 2 * _GAP - 10
    for name, error in errors.items():
        curve = sparkline(view.picture.histories_deg[name], max(0, room), blocks)
        shown = "" if math.isnan(error) else f"{error:.4g}"
        yield f"{name:<{names}}{' ' * _GAP}{shown:>10}{' ' * _GAP}{curve}"


def sparkline(history: FloatArray, width: int, blocks: str = BLOCKS) -> str:
    """A curve of positive numbers by the logarithm, of so many characters; blank where nothing is known.

    Parameters
    ----------
    history
        NaN where nothing is known.
    width
        Characters.
    blocks
        Heights, the lowest first.
    """
    known = history[np.isfinite(history) & (history > 0.0)]
    if not known.size or width < 1:
        return ""
    top = float(np.log10(known.max()))
    bottom = min(float(np.log10(known.min())), top - _DECADES)
    curve = ""
    count = min(width, history.size)
    for place in range(count):
        part = history[place * history.size // count : (place + 1) * history.size // count]
        part = part[np.isfinite(part)]
        if not part.size:
            curve += " "
            continue
        value = float(part[-1])
        share = 0.0 if value <= 0.0 else (math.log10(value) - bottom) / (top - bottom)
        curve += blocks[min(len(blocks) - 1, max(0, int(share * len(blocks))))]
    return curve.rstrip()


def _triggers(view: View, width: int) -> Iterator[str]:
    fired = view.picture.fired
    if fired:
        yield from _packed("triggers", [f"{name} {count:,}" for name, count in fired.items()], width)


def _packed(head: str, items: Iterable[str], width: int) -> Iterator[str]:
    """Items beside each other behind a word, in as many lines as they take."""
    line = head
    for item in items:
        if len(line) + _GAP + cell_len(item) > width and line.strip() not in ("", head):
            yield line
            line = " " * len(head)
        line += " " * _GAP + item
    yield line


@dataclass(frozen=True)
class _Row:
    cells: tuple[str, ...]
    messages: int


_HEADINGS = ("topic", "", "messages", "payload [B]", "CDR [B]", "last [s]")
_SPARE = (_HEADINGS.index("CDR [B]"), _HEADINGS.index("last [s]"))
"""Columns that are left out where there is no room, in this order."""


def _topics(view: View) -> Iterator[_Row]:
    order = list(LinkKind)
    for link in sorted(view.graph.links.values(), key=lambda link: order.index(link.kind)):
        flow = view.picture.flows[link.name]
        yield _Row((link.topic, link.kind.value, *_flow_cells(flow, link, view)), flow.messages)


def _flow_cells(flow: Flow, link: Link, view: View) -> tuple[str, ...]:
    last = "" if flow.last_tick < 0 else f"{float(seconds(flow.last_tick, view.graph.ticks_per_second)):,.3f}"
    return f"{flow.messages:,}", f"{flow.payload_bytes:,}", f"{flow.cdr_bytes:,}", last


def _table(rows: Sequence[Sequence[str]], width: int) -> Iterator[str]:
    """Rows that leave out columns where they are too wide, and then cut the first one."""
    widths = [max(map(cell_len, column)) for column in zip(*rows, strict=True)]
    shown = list(range(len(widths)))
    for spare in _SPARE:
        if sum(widths[place] + _GAP for place in shown) - _GAP > width:
            shown.remove(spare)
    others = sum(widths[place] + _GAP for place in shown[1:])
    first = max(1, min(widths[0], width - others))
    for row in rows:
        kind = f"{row[1]:<{widths[1]}}"
        numbers = (f"{row[place]:>{widths[place]}}" for place in shown[2:])
        yield (" " * _GAP).join([_cut(row[0], first).ljust(first), kind, *numbers])


def _air(view: View, width: int) -> Iterator[str]:
    for name, traffic in view.picture.air.items():
        yield from _packed(name, _air_words(traffic, view), width)


def _air_words(traffic: AirTraffic, view: View) -> tuple[str, ...]:
    passed_ns = (view.time_s - view.from_s) * NANOSECONDS
    busy = 100.0 * traffic.busy_ns / passed_ns if passed_ns else 0.0
    return (
        f"{busy:.3g} % busy",
        f"{traffic.frames:,} frames",
        f"{traffic.collided:,} collided",
        f"{traffic.lost:,} lost",
        f"{traffic.waiting:,} waiting",
        f"last in the queue for {number(1e3 * traffic.waited_ns / NANOSECONDS)} ms",
    )


def _faults(view: View) -> Iterator[str]:
    for words, is_on in _fault_words(view):
        yield f"{'! ' if is_on else '  '}{words}"


def _fault_words(view: View) -> Iterator[tuple[str, bool]]:
    """What happens to processes, and whether it is happening; what is still to come is not told."""
    for fault in view.graph.faults:
        if fault.from_tick <= view.picture.tick:
            yield _fault_sentence(fault, view.graph.ticks_per_second), view.picture.tick < fault.until_tick


def _fault_sentence(fault: Fault, ticks_per_second: int) -> str:
    what = {FaultKind.KILL: "is dead", FaultKind.STALL: "stands still", FaultKind.RESTART: "is down, to start anew"}
    begins = f"{fault.node} {what[fault.kind]} from {float(seconds(fault.from_tick, ticks_per_second)):g} s on"
    if fault.kind is FaultKind.KILL:
        return f"{begins} ({fault.name})"
    return f"{begins}, until {float(seconds(fault.until_tick, ticks_per_second)):g} s ({fault.name})"


def _cut(text: str, width: int) -> str:
    """A text that is no wider than it may be."""
    return text if cell_len(text) <= width else set_cell_size(text, max(0, width - 1)) + "…"
