"""Writing a report: its pictures and its page."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from functools import partial
from pathlib import Path
from typing import TYPE_CHECKING

from etac_ros.beside import Beside, Elsewhere, here
from etac_ros.errors import BagError, EtacError
from etac_ros.report.figures.kind import FigureKind
from etac_ros.report.figures.registry import FIGURES
from etac_ros.report.figures.style import PAGE_DPI, Theme, rendered, vector_files
from etac_ros.report.interactive import shows_curves_only
from etac_ros.report.page import Drawn, page
from etac_ros.report.source import ReportedRun, read_other, read_run
from etac_ros.report.view import View

if TYPE_CHECKING:
    from matplotlib.figure import Figure

PAGE = "index.html"
_OVERVIEW_DPI = 125
"""With this the overview is about 900 x 700 pixels, which suits a README."""


class ReportError(EtacError):
    """A report cannot be written."""


def _with_samples(bag: Path, run: ReportedRun) -> ReportedRun:
    """The run, if there is something to draw.

    Raises
    ------
    BagError
        If its bag keeps no samples.
    """
    if run.recording.every == 0:
        raise BagError(
            str(bag),
            "it was recorded with --truth none, so there is nothing to draw",
            "committed samples, be it of every Nth tick",
            "etac info shows its messages, etac export has them and the triggering instants; record it with --truth N",
        )
    return run


def write_report(
    bag: Path,
    others: Sequence[Path] = (),
    output: Path | None = None,
    *,
    trust: bool = False,
    figures: Path | None = None,
    say: Callable[[str], None] = lambda step: None,
    forks: bool = False,
) -> Path:
    """Draw a report from bags alone: one PNG file a figure, and one page that shows them all, to zoom and read off.

    Parameters
    ----------
    bag
        Directory of the bag that is reported.
    others
        Bags of runs of the same plants to lay over it: its baseline, other variants, other controllers. Without any,
        the bag of the baseline that ``etac run --baseline`` wrote beside it is found by itself.
    output
        Folder of the report, made if it is not there; None is ``BAG/report``.
    trust
        Whether to import classes that are not of etac_ros, if the scenario in a bag names any: that runs their code.
        Without them the report leaves out what only they can tell.
    figures
        Folder for the figures as SVG and PDF, made if it is not there; None writes none.
    say
        Told what is being done.
    forks
        Whether pictures may be drawn by a second process as well, which is forked of this one: where no thread runs.

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
    run = _with_samples(bag, read_run(bag, trust, shown=True))
    view = View(
        run,
        tuple(
            _with_samples(other, read_other(other, run, trust, shown=True))
            for other in others or baseline_beside(bag, run)
        ),
    )
    folder = bag / "report" if output is None else output
    try:
        # Before drawing, which takes seconds: they should not be lost on a folder that cannot be written to.
        folder.mkdir(parents=True, exist_ok=True)
        if figures is not None:
            figures.mkdir(parents=True, exist_ok=True)
        drawn, elsewhere = [], Beside() if forks else here
        for kind in FIGURES:
            if kind.applies(view):
                say(f"{bag}: drawing {kind.name}")
                drawn.append(_drawn(kind, view, elsewhere))
                if figures is not None:
                    for ending, data in vector_files(partial(kind.draw, view), kind.size_in(view)).items():
                        (figures / f"{kind.name}.{ending}").write_bytes(data)
        for figure in drawn:
            say(f"{bag}: drawing {figure.kind.name}")
            (folder / f"{figure.kind.name}.png").write_bytes(figure.files.alone)
        path = folder / PAGE
        path.write_text(page(view, drawn), encoding="utf-8", newline="\n")
    except OSError as error:
        raise ReportError(
            str(error.filename or folder),
            f"the report cannot be written: {error.strerror or error}",
            "a folder that may be written to, on a disk that has space left",
            "choose another with --output or --figures",
        ) from error
    return path


def baseline_beside(bag: Path, run: ReportedRun) -> tuple[Path, ...]:
    """The bag of a run's baseline, where ``etac run --baseline`` put it; nothing where there is none."""
    variant = run.scenario.run.baseline
    beside = bag.absolute().with_name(f"{bag.absolute().name}_{variant}")
    return (beside,) if variant is not None and not run.is_baseline and beside.is_dir() else ()


def _drawn(kind: FigureKind, view: View, elsewhere: Elsewhere) -> Drawn:
    def draw(figure: Figure, theme: Theme) -> None:
        kind.draw(view, figure, theme)

    dpi = _OVERVIEW_DPI if kind.name == "overview" else PAGE_DPI
    return Drawn(kind, rendered(draw, kind.size_in(view), dpi, elsewhere, shows_curves_only))
