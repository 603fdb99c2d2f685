"""What was captured of a run, as a table: by topic, cause and layer."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import replace

from etac_ros.capture.account import Layers, TopicWire, WireAccount
from etac_ros.tables.table import Row, Table

COLUMNS = ("messages", "frames", "payload", "CDR", "RTPS", "UDP, IP", "Ethernet", "all bytes", "a message")
_CDR = "CDR bytes"
_SPARE = frozenset({"RTPS", "UDP, IP", "Ethernet"})
MODEL = "on Ethernet*"
"""Heading of a column with a model where nothing was captured."""
_MODEL_NOTE = "* a model of the frames with data to the receivers; --capture counts all that is sent"


def wire_table(wire: WireAccount, kinds: Mapping[str, str]) -> Table:
    """Every captured byte once, in rows that add up to the last one.

    Parameters
    ----------
    wire
        What was captured.
    kinds
        Kind of each topic of the run; those of no link are summed as the emulation plane.
    """
    links = {name: topic for name, topic in wire.topics.items() if kinds.get(name) in ("network", "internal")}
    rows = []
    for name, topic in links.items():
        rows.append(Row((name, *_cells(topic.all_causes, topic))))
        rows += [Row((f"  {cause.value}", *_cells(layers))) for cause, layers in topic.causes.items()]
    rows.append(
        Row(("all links", *_cells(_sum([topic.all_causes for topic in links.values()]))), strong=True, ends=True)
    )
    others = [topic.all_causes for name, topic in wire.topics.items() if name not in links]
    apart = {
        "emulation plane": _sum(others),
        "to and from the recorder": _sum([topic.recorder for topic in wire.topics.values()]),
        "discovery": wire.discovery,
        "liveliness": wire.liveliness,
        **{f"other: {reason}": layers for reason, layers in wire.other.items()},
    }
    rows += [Row((name, *_cells(layers))) for name, layers in apart.items() if layers.frames or layers.total_bytes]
    rows.append(Row(("all that was captured", *_cells(wire.attributed)), strong=True))
    return Table("On the wire", ("topic", *COLUMNS), tuple(rows), _notes(wire), spare=_SPARE)


def with_model(table: Table, modelled: Mapping[str, int | None]) -> Table:
    """A table of topics with one column more, behind that of CDR: bytes on Ethernet by what heads the row, as modelled.

    Parameters
    ----------
    table
        Of topics.
    modelled
        Bytes by topic; None or 0 where no model is.
    """
    if not any(modelled.values()):
        return table
    place = table.columns.index(_CDR) + 1

    def wider(cells: tuple[str, ...], cell: str) -> tuple[str, ...]:
        return (*cells[:place], cell, *cells[place:])

    rows = []
    for row in table.rows:
        size = modelled.get(row.cells[0])
        rows.append(replace(row, cells=wider(row.cells, f"{size:,}" if size else "")))
    spare = table.spare | {MODEL}
    notes = (*table.notes, _MODEL_NOTE)
    return replace(table, columns=wider(table.columns, MODEL), rows=tuple(rows), notes=notes, spare=spare)


def _notes(wire: WireAccount) -> tuple[str, ...]:
    notes = [
        "Ethernet: headers of 14 bytes; a real link adds 24 (preamble, check sequence, gap). CDR and payload add up.",
    ]
    if wire.statistics_bytes:
        notes.append(f"of RTPS {wire.statistics_bytes:,} are statistics that this build of Fast DDS puts in each frame")
    if wire.missed_frames:
        notes.append(f"! {wire.missed_frames:,} frames more were not captured: their buffer was full")
    return tuple(notes)


def _sum(parts: list[Layers]) -> Layers:
    return sum(parts, Layers())


def _cells(layers: Layers, topic: TopicWire | None = None) -> tuple[str, ...]:
    counts = (
        layers.frames, layers.payload_bytes, layers.cdr_bytes, layers.rtps_bytes, layers.udp_ip_bytes,
        layers.ethernet_bytes, layers.total_bytes,
    )  # fmt: skip
    messages = "" if topic is None else f"{topic.messages:,}"
    each = "" if topic is None or topic.bytes_a_message is None else f"{topic.bytes_a_message:,.1f}"
    return (messages, *(f"{count:,}" if count else "" for count in counts), each)
