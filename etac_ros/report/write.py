"""Writing a report: its pictures and its page."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from pathlib import Path
from typing import TYPE_CHECKING

from etac_ros.errors import EtacError
from etac_ros.report.figures.kind import FigureKind
from etac_ros.report.figures.registry import FIGURES
from etac_ros.report.figures.style import PAGE_DPI, Theme, rendered
from etac_ros.report.page import Drawn, page
from etac_ros.report.source import read_other, read_run
from etac_ros.report.view import View

if TYPE_CHECKING:
    from matplotlib.figure import Figure

PAGE = "index.html"
_OVERVIEW_DPI = 125
"""With this the overview is about 900 x 700 pixels, which suits a README."""


class ReportError(EtacError):
    """A report cannot be written."""


def write_report(
    bag: Path,
    others: Sequence[Path] = (),
    output: Path | None = None,
    *,
    trust: bool = False,
    say: Callable[[str], None] = lambda step: None,
) -> Path:
    """Draw a report from bags alone: one PNG file a figure, and one page that holds them all.

    Parameters
    ----------
    bag
        Directory of the bag that is reported.
    others
        Bags of runs of the same plants to lay over it: its baseline, other variants, other controllers.
    output
        Folder of the report, made if it is not there; None is ``BAG/report``.
    trust
        Whether to import classes that are not of etac_ros, if the scenario in a bag names any: that runs their code.
        Without them the report leaves out what only they can tell.
    say
        Told what is being done.

    Returns
    -------
    Path
        The page, ``index.html``.

    Raises
    ------
    BagError
        If a bag cannot be read, carries no scenario, or holds a run of other plants than the first.
    ReportError
        If the folder cannot be written to.
    """
    run = read_run(bag, trust)
    view = View(run, tuple(read_other(other, run, trust) for other in others))
    folder = bag / "report" if output is None else output
    try:
        # Before drawing, which takes seconds: they should not be lost on a folder that cannot be written to.
        folder.mkdir(parents=True, exist_ok=True)
        drawn = []
        for kind in FIGURES:
            if kind.applies(view):
                say(f"{bag}: drawing {kind.name}")
                drawn.append(_drawn(kind, view))
                (folder / f"{kind.name}.png").write_bytes(drawn[-1].files.alone)
        path = folder / PAGE
        path.write_text(page(view, drawn), encoding="utf-8", newline="\n")
    except OSError as error:
        raise ReportError(
            str(folder),
            f"the report cannot be written: {error.strerror or error}",
            "a folder that may be written to, on a disk that has space left",
            "choose another with --output",
        ) from error
    return path


def _drawn(kind: FigureKind, view: View) -> Drawn:
    def draw(figure: Figure, theme: Theme) -> None:
        kind.draw(view, figure, theme)

    dpi = _OVERVIEW_DPI if kind.name == "overview" else PAGE_DPI
    return Drawn(kind, rendered(draw, kind.size_in(view), dpi))
