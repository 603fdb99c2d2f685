"""When faults had a node down, shaded in every figure over time."""

from __future__ import annotations

from typing import TYPE_CHECKING, NamedTuple

from etac_ros.graph.faults import FaultKind
from etac_ros.report.view import View

if TYPE_CHECKING:
    from matplotlib.axes import Axes

_GREY = "#808a96"
"""Of either theme: between its paper and its ink."""
_ALPHA = 0.22
MARK = "downtime"
"""The gid of the patches, by which the interactive page finds them."""


class Downtime(NamedTuple):
    """From when to when a node was down by a fault [s], and what is said of it."""

    start_s: float
    stop_s: float
    words: str


def downtimes(view: View) -> list[Downtime]:
    """Of the reported run: until the node went on, in real time until its new process was in the run.

    One that a later fault of the same node has killed on its way there is shaded with that.
    """
    run = view.run
    found = []
    accounts = run.summary.faults
    for name, account in accounts.items():
        back = account.until_s
        if run.recording.wall is not None and account.do is FaultKind.RESTART:
            later = [one.at_s for one in accounts.values() if one.node == account.node and one.at_s > account.at_s]
            back = min(later, default=None) if account.joined_s is None else account.joined_s
        stop = run.end_s if back is None else min(back, run.end_s)
        until = "on" if back is None else f"to {back:.6g} s"
        between = f"from {account.at_s:.6g} s {until}"
        found.append(Downtime(account.at_s, stop, f"{name} ({account.do.value} of {account.node}, {between})"))
    return found


def caption(view: View) -> str:
    """What is shaded, in a sentence; empty where nothing is."""
    found = downtimes(view)
    return f" Shaded: {', '.join(one.words for one in found)}." if found else ""


def shade(axes: Axes, view: View) -> None:
    """Shade them in axes whose horizontal one is time; its limits stay as they are."""
    low, high = axes.get_xlim()
    for one in downtimes(view):
        if one.start_s < high and one.stop_s > low:
            start, stop = max(low, one.start_s), min(high, one.stop_s)
            axes.axvspan(start, stop, facecolor=_GREY, alpha=_ALPHA, linewidth=0.0, zorder=0.4, gid=MARK)
            axes.set_xlim(low, high)
