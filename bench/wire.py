"""What a message costs on the wire, measured: by what carries it, by QoS, by receivers, and over a lossy path.

    ./scripts/bench wire                          # about four minutes
    ./scripts/bench wire --messages 10 --only loss
    ./scripts/bench wire --write docs/wire.md

Everything runs in a network of its own (a network namespace), with a loopback that carries multicast, and for losses
with a second namespace behind a forwarder in user space. Where the machine forbids that, it says so and ends.
"""

from __future__ import annotations

import os
import statistics
import sys
import tempfile
import textwrap
from collections.abc import Callable
from dataclasses import replace
from pathlib import Path
from typing import Annotated

import typer
from wire_path import private, set_up_loopback, why_not
from wire_rig import Measured, Setting, measure

from etac_ros.capture.account import Cause
from etac_ros.capture.model import data_frames
from etac_ros.cli.show import make_console, show
from etac_ros.graph.graph import Qos, Reliability
from etac_ros.graph.wire import Wire, WireFormat
from etac_ros.metrics.wire import wire_table
from etac_ros.runs import RosOptions, run_in_process, run_over_ros
from etac_ros.scenario.load import load
from etac_ros.tables.markdown import markdown_lines
from etac_ros.tables.numbers import type_words
from etac_ros.tables.table import Row, Table

INSIDE = "ETAC_ROS_BENCH_WIRE_INSIDE"
BEST_EFFORT, RELIABLE = Qos(Reliability.BEST_EFFORT), Qos()
POINT = Wire(WireFormat.COMPACT, 3)
CARRIERS = [(WireFormat.COMPACT, size) for size in (3, 4, 6, 10, 15)]
CARRIERS += [(WireFormat.STAMPED, size) for size in (3, 4, 6)] + [(WireFormat.DOUBLE, size) for size in (3, 15)]
RARE_S = (0.2, 3.0)
"""Periods of rarer heartbeats."""
LOSSES = (0.0, 0.01, 0.05, 0.1, 0.3)
RUNS = (
    ("wu2018", None), ("wu2018", "periodic"), ("qi2022", "case1"), ("qi2022", "measurement"), ("qi2022", "smc"),
    ("xie2021", None),
)  # fmt: skip


def carriers(messages: int) -> Table:
    """By message type and size, to one receiver."""
    rows = []
    for form, size in CARRIERS:
        wire = Wire(form, size)
        bare = _each(measure(Setting(wire, BEST_EFFORT, messages=messages)))
        safe = _each(measure(Setting(wire, RELIABLE, messages=messages)))
        modelled = data_frames(wire.cdr_bytes, wire.payload_bytes, receivers=1).total_bytes
        cells = (f"{size}", form.value, type_words(wire.type_name), f"{wire.payload_bytes}", f"{wire.cdr_bytes}")
        rows.append(Row((*cells, f"{modelled}", f"{bare:.0f}", f"{safe:.0f}", f"{bare / wire.payload_bytes:.1f}")))
    columns = ("numbers", "wire", "type", "payload", "CDR", "model", "best effort", "reliable", "best effort / payload")
    return Table("By what carries it", columns, tuple(rows), _NOTE, frozenset({"wire", "type"}))


def choices(messages: int) -> Table:
    """By QoS: three numbers to one receiver."""
    last = Qos(history=1)
    settings = {
        "best effort": Setting(POINT, BEST_EFFORT),
        "reliable, as here: heartbeats every 20 ms": Setting(POINT, RELIABLE),
        "reliable, heartbeats every 3 s (Fast DDS's default)": Setting(POINT, RELIABLE, heartbeat_s=3.0),
        "reliable, history 1: a heartbeat on each message": Setting(POINT, last),
        "the same, piggyback off": Setting(POINT, last, piggyback=False),
        "the same, heartbeats every 3 s": Setting(POINT, last, heartbeat_s=3.0),
    }
    rows = []
    for name, setting in settings.items():
        found = measure(replace(setting, messages=messages))
        rows.append(Row((name, *_by_cause(found), f"{_each(found):.0f}")))
    columns = ("QoS", "data", "heartbeat", "acknack", "frames", "all bytes")
    return Table("By QoS", columns, tuple(rows), ("A message: bytes by cause, frames and bytes in all. " + _NOTE[0],))


def receivers(messages: int) -> Table:
    """By the number of receivers, unicast and multicast."""
    rows = []
    for count in (1, 2, 4, 8):
        cells = [f"{count}"]
        for qos in (BEST_EFFORT, RELIABLE):
            for multicast in (False, True):
                found = measure(Setting(POINT, qos, count, messages, multicast=multicast))
                cells.append(f"{_each(found):.0f} ({found.topic.all_causes.frames / messages:.1f})")
        rows.append(Row(tuple(cells)))
    columns = (
        "receivers",
        *(f"{qos}, {way}" for qos in ("best effort", "reliable") for way in ("unicast", "multicast")),
    )
    note = "A message: bytes, and frames in brackets, all receivers together. " + _NOTE[0]
    return Table("By receivers", columns, tuple(rows), (note,))


def losses(messages: int) -> Table:
    """By loss of the path between two network namespaces."""
    paths = [(loss, 0.0, 0.0) for loss in LOSSES] + [(0.1, 0.05, 0.0), (0.1, 0.05, 128_000.0)]
    rows = []
    for loss, delay_s, rate in paths:
        heartbeats = RARE_S if (loss, rate) == (0.1, 0.0) else ()
        for qos, heartbeat_s in [(BEST_EFFORT, 0.02), (RELIABLE, 0.02), *((RELIABLE, period) for period in heartbeats)]:
            setting = Setting(
                POINT, qos, 1, 5 * messages, heartbeat_s=heartbeat_s, loss=loss, delay_s=delay_s, rate_bit_s=rate
            )
            found = measure(setting)
            delays = [1e3 * delay for delay in found.delays_s]
            path = f"{100 * loss:g} %" + (f", {1e3 * delay_s:g} ms" if delay_s else "")
            path += f", {rate / 1e3:g} kbit/s" if rate else ""
            cells = (
                path,
                "best effort" if qos == BEST_EFFORT else f"reliable, {1e3 * heartbeat_s:g} ms",
                f"{found.delivered[0]} of {setting.messages}",
                f"{found.topic.resent}",
                f"{found.topic.all_causes.frames / setting.messages:.2f}",
                f"{_each(found):.0f}",
                f"{statistics.median(delays):.1f}",
                f"{max(delays):.0f}",
            )
            rows.append(Row(cells))
    columns = ("path", "QoS", "delivered", "sent again", "frames", "bytes", "median delay [ms]", "largest")
    note = (
        "Reliable: with its heartbeat period. Frames and bytes a message, as both ends sent them, before the path lost "
        "any. Each datagram of either direction is lost by a seeded draw; which one the n-th is goes by wall time, so "
        "another run differs a little."
    )
    return Table("Over a lossy path", columns, tuple(rows), (note,), frozenset({"QoS"}))


def runs(messages: int) -> Table:
    """What runs send over their network links, by the model."""
    rows = []
    for name, variant in RUNS:
        summary = run_in_process(load(name, variant)).summary
        topics = [topic for topic in summary.topics.values() if topic.kind == "network"]
        payload, wire = summary.network.payload_bytes, sum(topic.model_wire_bytes or 0 for topic in topics)
        cells = (f"{name} {variant or ''}".strip(), f"{summary.network.messages:,}", f"{payload:,}", f"{wire:,}")
        rows.append(Row((*cells, f"{wire / payload:.1f}")))
    columns = ("run", "messages", "payload", "on Ethernet", "on Ethernet / payload")
    note = "A model: frames with data to all receivers, as `etac run` and `etac info` show it."
    return Table("What it makes of the papers' figures", columns, tuple(rows), (note,))


def captured(messages: int) -> Table:
    """One whole run over DDS."""
    with tempfile.TemporaryDirectory() as folder:
        run = run_over_ros(load("wu2018"), Path(folder, "bag"), RosOptions(capture=True))
    assert run.summary.wire is not None
    table = wire_table(run.summary.wire, {name: topic.kind for name, topic in run.summary.topics.items()})
    return replace(table, title="A whole run: `etac run wu2018 --capture`")


TABLES: dict[str, Callable[[int], Table]] = {
    "carriers": carriers,
    "qos": choices,
    "receivers": receivers,
    "loss": losses,
    "runs": runs,
    "captured": captured,
}
_NOTE = ("Bytes from the Ethernet header on (14; a real link adds 24 for preamble, check sequence and gap).",)


def _each(found: Measured) -> float:
    assert found.topic.bytes_a_message is not None
    return found.topic.bytes_a_message


def _by_cause(found: Measured) -> list[str]:
    bytes_ = [found.topic.causes[cause].total_bytes if cause in found.topic.causes else 0 for cause in
              (Cause.DATA, Cause.HEARTBEAT, Cause.ACKNACK)]  # fmt: skip
    each = [f"{size / found.topic.messages:.0f}" if size else "" for size in bytes_]
    return [*each, f"{found.topic.all_causes.frames / found.topic.messages:.2f}"]


def main(
    messages: Annotated[int, typer.Option(min=2, help="Of each measurement; five times as many over a lossy path.")] = (
        20
    ),
    only: Annotated[str | None, typer.Option(help=f"One of: {', '.join(TABLES)}.")] = None,
    write: Annotated[Path | None, typer.Option(help="Write the page.")] = None,
) -> None:
    """Measure, print, and write the page."""
    if INSIDE not in os.environ:
        reason = why_not()
        if reason:
            print(f"skipped: {reason}")
            return
        os.execvpe("env", ["env", *private(), sys.executable, *sys.argv], {**os.environ, INSIDE: "1"})
    set_up_loopback()
    console = make_console()
    found = {}
    for name in TABLES if only is None else [only]:
        found[name] = TABLES[name](messages)
        show(found[name], console)
        console.print()
    if write is not None:
        write.write_text(_page(found), encoding="utf-8")


def _page(found: dict[str, Table]) -> str:
    if found.keys() != TABLES.keys():
        raise typer.BadParameter("--write writes the whole page: leave --only out")
    lines = [_HEAD.strip(), "", "## What to choose", "", *map(_filled, _advice(found))]
    for table in found.values():
        lines += ["", f"## {table.title}", "", *markdown_lines(table), "", *map(_filled, table.notes)]
    return "\n".join(lines) + "\n"


_HEAD = """
# What a message costs on the wire

Written by `./scripts/bench wire --write docs/wire.md`; the numbers are measured.

`etac run SCENARIO --capture` captures every frame of a run and gives each of its bytes to a topic and a cause;
`--capture FILE.pcapng` keeps the frames, for Wireshark. It takes Linux and the capability CAP_NET_RAW; without, the
run says so and goes on. Frames come from a packet socket on the loopback, filtered in the kernel to the ports of the
run's ROS domain, each once (the loopback shows them twice, on their way out and in). If the system drops some, the
account says how many.

**The rule.** Who has which writer and reader is learned from the discovery data in the same capture. Submessages of a
writer or a reader go to its topic, an ACKNACK to that of its reader; INFO_TS and INFO_DST go with the submessage
behind them. The headers of RTPS, UDP, IP and Ethernet, and what stands behind the last submessage, go to the first
submessage of the frame, for whose sake it was sent; there the frame is counted. Discovery (SPDP, SEDP, and what the
rmw layer tells of nodes) and liveliness stand apart, and so does what goes to or comes from the recorder, which no
spacecraft has. What fits nowhere is named "other" with the reason. All of it adds up to the captured frames, which a
test holds.

**What is counted.** From the Ethernet header on. Its 14 bytes are there on the loopback as well, with addresses of
zeros; preamble (8), check sequence (4) and gap (12) are on no capture, and add 24 on a real link. With IEEE 802.3 a
frame has 64 bytes at least, which every frame here has. The binaries of ROS 2 Jazzy come with the statistics of Fast
DDS compiled in: that is a submessage of 60 bytes in *every* frame; a Fast DDS built without sends so much less.

**What wall time does.** Heartbeats and acknowledgements go by wall time. A run in simulated time is over before most
of them are due, so its account has fewer than the same messages have in real time; the tables below have pauses of 60
ms between messages, longer than a heartbeat period. Nodes of one process hand messages over without a wire: capture
with `--processes node`, the default.

**The model.** Where nothing was captured, tables of a run and of `etac info` have a column "on Ethernet*": frames
with data, one to the process of each receiver, from the length of the CDR ([model.py](../etac_ros/capture/model.py)).
Of an ideal run it is what is captured as data, to the byte, which is a test. To a single receiver a frame has 16
bytes more than to several (INFO_DST); in a run the recorder is always a second one.
"""


def _advice(found: dict[str, Table]) -> list[str]:
    """Sentences with the numbers of the tables in them."""
    carried = {(row.cells[0], row.cells[1]): row.cells for row in found["carriers"].rows}
    point, many, stamped = carried["3", "compact"], carried["15", "compact"], carried["3", "stamped"]
    bare, safe, rare, last = (int(row.cells[-1]) for row in found["qos"].rows[:4])
    to_eight = [cell.split()[0] for cell in found["receivers"].rows[-1].cells]
    path = {(row.cells[0], row.cells[1]): row.cells for row in found["loss"].rows}
    often, seldom, never = "reliable, 20 ms", "reliable, 200 ms", "reliable, 3000 ms"
    worst, lost, rarely = path["30 %", often], path["10 %", often], path["10 %", never]
    late, patient = path["10 %, 50 ms", often], path["10 %, 50 ms", seldom]
    slow, slow_bare = path["10 %, 50 ms, 128 kbit/s", often], path["10 %, 50 ms, 128 kbit/s", "best effort"]
    run = {row.cells[0]: [float(cell.replace(",", "")) for cell in row.cells[1:]] for row in found["runs"].rows}
    case, measurement = run["qi2022 case1"], run["qi2022 measurement"]
    return [
        f"- **Count messages first.** {point[0]} numbers of compact are {point[3]} bytes and a frame of {point[6]}; "
        f"{many[0]} numbers are {many[3]} bytes and a frame of {many[6]}. A law that sends half as often sends half "
        "the bytes, whatever it sends; one that sends fewer numbers at the same instants saves little. In qi2022 the "
        f"torque instead of the measurement saves {_less(case[1], measurement[1])} of the payload, and "
        f"{_less(case[2], measurement[2])} of the bytes on Ethernet.",
        f"- **Stamps are cheap**: {int(stamped[6]) - int(point[6])} bytes a frame for double precision and the time "
        "of sending. Several values of one instant belong into one message.",
        f"- **Reliability costs more than the data** where messages are rare: {safe} bytes instead of {bare}, since "
        "each message is followed by a heartbeat and an acknowledgement of its own. With `history: 1` the heartbeat "
        f"rides on the message ({last} bytes), and an older value is never sent again once there is a newer one, "
        "which suits a controlled loop in real time. (In simulated time, where every message counts, it may end a "
        f"run.) Rare heartbeats save nearly all ({rare} bytes), but it is by a heartbeat that a reader learns what it "
        f"has missed: at 10 % loss the slowest message took {rarely[7]} ms, instead of {lost[7]}.",
        "- **Best effort** is right where the next message soon replaces the last one, and wrong where one message "
        "stands for a long time: an event-triggered sensor may be silent for minutes after it. A rule's key "
        "`longest_silence_s` bounds that; [networks.md](networks.md) has what losses do to each law.",
        f"- **Multicast from two receivers on**: to eight, best effort, {to_eight[2]} bytes instead of {to_eight[1]}. "
        f"Reliable, each receiver still acknowledges by itself: {to_eight[4]} instead of {to_eight[3]}.",
        f"- **A heartbeat period has to be longer than the way there and back.** Over {worst[0]} loss reliable "
        f"delivers {worst[2]}, for {worst[5]} bytes a message, the slowest after {worst[7]} ms. But where the path "
        f"takes 50 ms each way, heartbeats every 20 ms ask for what is under way already: {late[3]} messages sent "
        f"again and {late[5]} bytes a message, with heartbeats every 200 ms {patient[3]} and {patient[5]}. On a path "
        f"of 128 kbit/s they fill it: the median message takes {slow[6]} ms, with best effort {slow_bare[6]}.",
    ]


def _filled(text: str) -> str:
    indent = "  " if text.startswith("- ") else ""
    return textwrap.fill(text, 118, subsequent_indent=indent, break_long_words=False, break_on_hyphens=False)


def _less(own: float, other: float) -> str:
    return f"{100.0 * (1.0 - own / other):.0f} %"


if __name__ == "__main__":
    typer.run(main)
