"""The tables of a run in real time, for terminals and reports alike."""

from __future__ import annotations

from etac_ros.metrics.latency import Distribution, RealTimeAccount
from etac_ros.tables.numbers import optional
from etac_ros.tables.table import Row, Table

_SPREAD = ("least", "median", "99 %", "most")


def real_time_tables(account: RealTimeAccount) -> list[Table]:
    """Latency of topics, from sample to torque, and how punctual the nodes were."""
    return [
        table for table in (_latency(account), _loops(account), _nodes(account), _foreign(account)) if table is not None
    ]


def _latency(account: RealTimeAccount) -> Table | None:
    rows = tuple(Row((topic, f"{found.count:,}", *_cells(found))) for topic, found in account.latency_ms.items())
    note = "from the source timestamp until the receiver took the message, at each of ours"
    return Table("Latency of topics", ("latency [ms]", "taken", *_SPREAD), rows, (note,)) if rows else None


def _loops(account: RealTimeAccount) -> Table | None:
    rows = []
    for topic, loop in account.loops.items():
        rows.append(Row((topic, "ms", f"{loop.ms.count:,}", *_cells(loop.ms))))
        rows.append(Row(("", "ticks", "", *(f"{value:g}" for value in _values(loop.ticks)))))
    note = (
        "from the instant of the sample that triggered until the torque arrived [ms], and until the first tick that "
        f"felt it; a tick is {account.tick_ms:.4g} ms"
    )
    columns = ("sample to torque", "in", "arrived", *_SPREAD)
    return Table("From sample to torque", columns, tuple(rows), (note,), frozenset({"in"})) if rows else None


def _nodes(account: RealTimeAccount) -> Table | None:
    rows = tuple(
        Row(
            (
                name,
                "" if node.wakes is None else f"{node.wakes.count:,}",
                *(("",) * len(_SPREAD) if node.wakes is None else _cells(node.wakes)),
                f"{node.missed_ticks:,}",
                f"{node.stale_acts + node.starved:,}",
            )
        )
        for name, node in account.nodes.items()
    )
    notes = [
        "how late a node woke for its own acts; missed: ticks that it slept through; late samples: acts on one that a "
        "torque had changed, or without the newest"
    ]
    if abs(account.clock_stepped_s) >= 1e-3:
        notes.append(
            f"the wall clock was set by {account.clock_stepped_s:.3g} s meanwhile: latencies are wrong by that"
        )
    columns = ("woke late [ms]", "acts", *_SPREAD, "missed", "late samples")
    return Table("Punctuality of nodes", columns, rows, tuple(notes)) if rows else None


def _foreign(account: RealTimeAccount) -> Table | None:
    rows = tuple(
        Row((name, f"{counts.asked:,}", f"{counts.came:,}", "" if counts.fits else "not one answer to each message"))
        for name, counts in account.foreign.items()
    )
    columns = ("foreign node", "messages to it", "from it", "remark")
    return Table("Foreign nodes", columns, rows, texts=frozenset({"remark"})) if rows else None


def _values(found: Distribution) -> tuple[float, ...]:
    return found.least, found.median, found.p99, found.most


def _cells(found: Distribution) -> tuple[str, ...]:
    return tuple(optional(value, ".3f") for value in _values(found))
