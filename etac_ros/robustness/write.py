"""Maps of robustness as tables, for a terminal and for a page."""

from __future__ import annotations

from collections.abc import Mapping, Sequence

from etac_ros.robustness.crowd import Crowded
from etac_ros.robustness.grid import EVENTS, PERIODIC, Cell, Map, Robustness
from etac_ros.robustness.retransmission import RETRIES, TIMEOUT_S, Tried
from etac_ros.tables.markdown import markdown_lines
from etac_ros.tables.numbers import optional
from etac_ros.tables.table import Row, Table

_HEAD = """# Networks

Written by `{command}`; the numbers are those of the runs, in process, with
each scenario's seed. One draw of losses is one draw: near the edge another seed may fall on the other side.

A run **holds** if no watch ended it and its largest steady attitude error of any spacecraft is no more than {factor:g}
times that of the same loop over ideal links.
"""
_MAPS = """## Loss and delay

Every network link of a scenario loses messages one by one with the same probability, and delivers the others after the
same delay, rounded up to whole ticks. Nothing is sent again. A cell has the network messages and the largest steady
attitude error [deg]; **{mark}** marks runs that do not hold. In the pictures the colour is how many times as large as
over ideal links the error is, from 1 to 100 and more.
"""
_AGAIN = """## What a retransmission costs

The variant `radio` of each scenario, with other losses of each frame: sent once, and acknowledged. Then a frame is
sent again {timeout:g} s after it, {retries} times at most, and trigger rules that can compare with what was
acknowledged do so. Bytes are those of all frames on the air, overhead and acknowledgements included.
"""
_CROWD = """## How many spacecraft share a medium

A formation in several sizes with all its broadcasts on one medium, that of its variant `radio`. The slowest medium is
found by halving the rate (and lengthening the backoff as much) until the formation does not hold, six times at most.
The ideal error is that of the same size and loop over ideal links. What counts as holding is measured by the smallest
formation over ideal links, since a large one may not hold even there.
"""
_FAILS = "fails"


def map_table(found: Robustness, which: Map) -> Table:
    """One map: a row for each loss, a column for each delay."""
    rows = tuple(
        Row((f"{loss:.3g}", *(_words(which.at(loss, delay)) for delay in found.delays_s))) for loss in found.losses
    )
    columns = ("loss", *(f"{delay:g} s" for delay in found.delays_s))
    notes = ("Network messages; largest steady attitude error [deg].",)
    return Table(f"{found.scenario.name}, {which.variant}", columns, rows, notes)


def furthest_table(all_found: Sequence[Robustness]) -> Table:
    """Up to what loss and what delay each loop holds."""
    rows = []
    for found in all_found:
        for place, which in enumerate(found.maps):
            loss, delay = which.furthest_loss(), which.furthest_delay()
            cells = ("none" if loss is None else f"{loss:.3g}", "none" if delay is None else f"{delay:g}")
            rows.append(Row((found.scenario.name if place == 0 else "", which.variant, *cells)))
    columns = ("scenario", "loop", "loss, without delay", "delay [s], without loss")
    notes = ("The largest of the grid up to which every run holds.",)
    return Table("How far each loop holds", columns, tuple(rows), notes, frozenset({"loop"}))


def suffers_table(all_found: Sequence[Robustness]) -> Table:
    """Which loop suffers more, of scenarios with two: the one that holds less far, and by the error in all cells."""
    rows = []
    for found in all_found:
        if len(found.maps) == 2:
            one, other = found.maps
            by_loss = _less_far(one, other, one.furthest_loss(), other.furthest_loss())
            by_delay = _less_far(one, other, one.furthest_delay(), other.furthest_delay())
            held = tuple(f"{sum(cell.holds for cell in which.cells)} of {len(which.cells)}" for which in (one, other))
            rows.append(Row((found.scenario.name, by_loss, by_delay, *held)))
    columns = ("scenario", "by loss", "by delay", f"{EVENTS}: cells that hold", f"{PERIODIC}: cells that hold")
    return Table("Which loop suffers more", columns, tuple(rows), (), frozenset({"by loss", "by delay"}))


def retransmission_table(name: str, tried: Sequence[Tried]) -> Table:
    """A scenario on its radio: a row for each loss, once and acknowledged."""
    columns = (
        "loss", "acknowledged", "messages", "arrived", "sent again", "acknowledgements", "bytes on the air",
        "steady error [deg]",
    )  # fmt: skip
    rows = tuple(
        Row(
            (
                f"{one.loss:.3g}",
                "yes" if one.acknowledged else "no",
                f"{one.messages:,}",
                f"{100.0 * one.delivered:.1f} %",
                f"{one.again:,}",
                f"{one.acknowledgements:,}",
                f"{one.air_bytes:,}",
                _error(one.error_deg, one.holds),
            )
        )
        for one in tried
    )
    return Table(f"{name} on its radio", columns, rows)


def crowd_table(name: str, found: Sequence[Crowded]) -> Table:
    """A formation on one medium: a row for each size and loop."""
    rate = f"{found[0].rate_bit_s / 1000:g} kbit/s"
    columns = (
        "loop", "spacecraft", "messages", "frames", "collided", "air used", "99 % within [s]", "steady error [deg]",
        "ideal [deg]", "slowest medium [kbit/s]",
    )  # fmt: skip
    rows = tuple(
        Row(
            (
                one.loop,
                f"{one.spacecraft}",
                f"{one.messages:,}",
                f"{one.frames:,}",
                f"{one.collided:,}",
                f"{100.0 * one.utilisation:.3g} %",
                optional(one.delay_s, ".3g"),
                _error(one.error_deg, one.holds),
                _error(one.ideal_deg, one.ideal_holds),
                "none" if one.slowest_bit_s is None else f"{one.slowest_bit_s / 1000:.3g}",
            )
        )
        for one in found
    )
    return Table(f"{name} on a medium of {rate}", columns, rows, (_breaking(found, rate),))


def picture_name(name: str) -> str:
    """File name of the picture of a scenario's maps."""
    return f"networks_{name}.png"


def page(
    all_found: Sequence[Robustness],
    tried: Mapping[str, Sequence[Tried]],
    crowds: Mapping[str, Sequence[Crowded]],
    command: str,
) -> str:
    """The page ``networks.md``.

    Parameters
    ----------
    all_found, tried, crowds
        Maps, retransmissions and formations, the latter by scenario.
    command
        That writes this very page.
    """
    parts = [_HEAD.format(command=command, factor=all_found[0].factor)]
    parts.append(_section(furthest_table(all_found)))
    parts.append(_section(suffers_table(all_found)))
    if tried:
        parts.append(_AGAIN.format(timeout=TIMEOUT_S, retries=RETRIES))
        parts += [_section(retransmission_table(name, some), 3) for name, some in tried.items()]
    if crowds:
        parts.append(_CROWD)
        parts += [_section(crowd_table(name, some), 3) for name, some in crowds.items()]
    parts.append(_MAPS.format(mark=_FAILS))
    for found in all_found:
        name = found.scenario.name
        parts.append(f"![Steady error of {name} by loss and delay]({picture_name(name)})\n")
        parts += [_section(map_table(found, which), 3) for which in found.maps]
    return "\n".join(parts)


def _less_far(one: Map, other: Map, first: float | None, second: float | None) -> str:
    """The name of the loop that holds less far."""
    if first == second:
        return "neither"
    return one.variant if (-1.0 if first is None else first) < (-1.0 if second is None else second) else other.variant


def _breaking(found: Sequence[Crowded], rate: str) -> str:
    """In words: up to how many spacecraft each loop holds."""
    words = []
    for loop in dict.fromkeys(one.loop for one in found):
        sizes = sorted((one for one in found if one.loop == loop), key=lambda one: one.spacecraft)
        broken = [one.spacecraft for one in sizes if not one.holds]
        ideal = [one.spacecraft for one in sizes if not one.ideal_holds]
        most = sizes[-1].spacecraft
        end = f"breaks at {broken[0]} spacecraft" if broken else f"holds with {most} spacecraft, the most tried"
        beside = f"breaks at {ideal[0]}" if ideal else f"holds with {most}"
        words.append(f"the {loop} loop {end} (over ideal links it {beside})")
    return f"At {rate}, {'; '.join(words)}."


def _section(table: Table, level: int = 2) -> str:
    notes = [*table.notes, ""] if table.notes else []
    return "\n".join([f"{'#' * level} {table.title}", "", *markdown_lines(table), "", *notes])


def _words(cell: Cell) -> str:
    error = "" if cell.error_deg is None else f"; {cell.error_deg:.2g}"
    return f"{cell.messages:,}{error}" + ("" if cell.holds else f" {_FAILS}")


def _error(error_deg: float | None, holds: bool) -> str:
    return f"{optional(error_deg, '.2g')}{'' if holds else f' {_FAILS}'}"
