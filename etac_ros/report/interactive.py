"""The figures of a report as data for plotly: the same curves that the pictures show, to zoom, to read off, to hide.

Whatever a figure has drawn is taken from it, so a picture and its interactive twin cannot tell different things.
Colours stay those of the light theme; the page knows what they are in the dark one.
"""

from __future__ import annotations

from base64 import b64encode
from collections.abc import Iterator
from dataclasses import fields
from html import escape
from typing import TYPE_CHECKING, Any

import numpy as np

from etac_ros.parameters import FloatArray
from etac_ros.report.figures.decimate import decimated
from etac_ros.report.figures.downtime import MARK
from etac_ros.report.figures.style import DARK, LIGHT, Theme

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.collections import LineCollection
    from matplotlib.figure import Figure
    from matplotlib.lines import Line2D
    from matplotlib.patches import Patch
    from matplotlib.text import Text

COLUMNS = 320
"""Pixel columns to which a curve is thinned out, every peak kept: a page should be small enough for a letter."""
_POINT = 4.0 / 3.0
"""Pixels of a typographic point on a screen."""
_DASHES = {"solid": "solid", "dashed": "dash", "dotted": "dot", "dashdot": "dashdot", "-": "solid"}


def shows_curves_only(figure: Figure) -> bool:
    """Whether all that a figure shows can be told by :func:`spec`."""
    return all(axes.axison and all(patch.get_gid() == MARK for patch in axes.patches) for axes in figure.axes)


def spec(figure: Figure, columns: int = COLUMNS) -> dict[str, Any] | None:
    """What a drawn figure of the light theme shows, as traces and axes; None if it shows anything but curves.

    Parameters
    ----------
    figure
        As it was drawn.
    columns
        To how many pixel columns each curve is thinned out.
    """
    if not shows_curves_only(figure):
        return None
    names = _names(figure)
    return {
        "axes": [_axes(axes, names, columns) for axes in figure.axes],
        "timed": any(axes.get_xlabel().startswith("time") for axes in figure.axes),
        "height": round(float(figure.get_figheight()) * 96.0),
    }


def colours_in_the_dark() -> dict[str, str]:
    """What the colours of the light theme are in the dark one."""
    pairs: dict[str, str] = {}
    for name in (field.name for field in fields(Theme)):
        light, dark = getattr(LIGHT, name), getattr(DARK, name)
        both = zip(light, dark, strict=True) if isinstance(light, tuple) else [(light, dark)]
        pairs |= {one: other for one, other in both if one.startswith("#")}
    return pairs


def packed(values: FloatArray) -> dict[str, str]:
    """Numbers as plotly takes them in a third of the letters."""
    data = np.ascontiguousarray(values, dtype="<f4").tobytes()
    return {"dtype": "f4", "bdata": b64encode(data).decode()}


def _axes(axes: Axes, names: dict[tuple[str, str], str], columns: int) -> dict[str, Any]:
    from matplotlib.collections import LineCollection
    from matplotlib.ticker import FixedLocator

    place = axes.get_subplotspec()
    assert place is not None  # figures of a report are grids
    heights = np.asarray(place.get_gridspec().get_height_ratios(), dtype=np.float64).tolist()
    traces = [_trace(axes, line, names, columns) for line in axes.lines if _is_curve(axes, line)]
    traces += [_strokes(some) for some in axes.collections if isinstance(some, LineCollection)]
    log = axes.get_yscale() == "log"
    low, high = axes.get_ylim()
    named = isinstance(axes.yaxis.get_major_locator(), FixedLocator)
    ticks = [float(place) for place in axes.get_yticks()], [_told(text.get_text()) for text in axes.get_yticklabels()]
    return {
        "row": place.rowspan.start,
        "column": place.colspan.start,
        "columns": place.get_gridspec().ncols,
        "share": heights[place.rowspan.start],
        "title": " · ".join(_told(text) for text in (axes.get_title(loc="left"), axes.get_title(loc="right")) if text),
        "xlabel": axes.get_xlabel(),
        "ylabel": _told(axes.get_ylabel()).replace("\n", "<br>"),
        "x": [float(end) for end in axes.get_xlim()],
        "y": [float(np.log10(end)) for end in (low, high)] if log else [float(low), float(high)],
        "log": log,
        "ticks": ticks if named else None,
        "traces": traces,
        "levels": [_level(line) for line in axes.lines if not _is_curve(axes, line)],
        "spans": [_span(patch) for patch in axes.patches if patch.get_gid() == MARK],
        "words": [words for text in axes.texts for words in _words(text)],
    }


def _is_curve(axes: Axes, line: Line2D) -> bool:
    """Whether a line lies in the data; one across the whole axes does not."""
    return line.get_transform() == axes.transData


def _trace(axes: Axes, line: Line2D, names: dict[tuple[str, str], str], columns: int) -> dict[str, Any]:
    x, y = (np.asarray(values, dtype=np.float64) for values in line.get_data(orig=False))
    drawn = line.get_linestyle() not in ("None", "none", " ", "")
    if drawn:
        x, y = decimated(x, y, columns)
    elif x.size > 4 * columns:
        kept = np.linspace(0, x.size - 1, 4 * columns).astype(np.int64)
        x, y = x[kept], y[kept]
    colour, dash = _colour(line.get_color()), _dash(line)
    return {
        "x": packed(x),
        "y": packed(y),
        "name": names.get((colour, dash))
        or names.get((colour, ""))
        or _told(axes.get_ylabel().partition("[")[0].strip()),
        "key": (colour, dash) in names or (colour, "") in names,
        "mode": "lines" if drawn else "markers",
        "colour": colour,
        "dash": dash,
        "size": float(line.get_linewidth() if drawn else line.get_markersize()) * _POINT,
        "steps": line.get_drawstyle() == "steps-post",
    }


def _strokes(collection: LineCollection) -> dict[str, Any]:
    """Vertical strokes as one curve with gaps."""
    segments = np.array([part for part in collection.get_segments() if len(part) == 2]).reshape(-1, 2, 2)
    points = np.concatenate([segments, np.full((segments.shape[0], 1, 2), np.nan)], axis=1).reshape(-1, 2)
    (colour, *_) = collection.get_colors() if len(collection.get_colors()) else [LIGHT.this]
    return {
        "x": packed(points[:, 0]), "y": packed(points[:, 1]), "name": "", "key": False, "mode": "lines",
        "colour": _colour(colour), "dash": "solid", "size": _POINT, "steps": False,
    }  # fmt: skip


def _span(patch: Patch) -> dict[str, Any]:
    """A stretch of time that is shaded, from top to bottom."""
    corners = patch.get_path().get_extents(patch.get_patch_transform())
    return {
        "x": [float(corners.x0), float(corners.x1)],
        "colour": _colour(patch.get_facecolor()),
        "opacity": float(patch.get_alpha() or 1.0),
    }


def _level(line: Line2D) -> dict[str, Any]:
    """A line across the whole axes."""
    (y, *_) = np.asarray(line.get_ydata(), dtype=np.float64)
    return {
        "y": float(y),
        "colour": _colour(line.get_color()),
        "dash": _dash(line),
        "size": float(line.get_linewidth()),
    }


def _words(text: Text) -> Iterator[dict[str, Any]]:
    from matplotlib.text import Annotation

    if not text.get_text() or not text.get_visible():
        return
    place, across = text.get_position(), False
    if isinstance(text, Annotation):
        place, across = text.xy, text.xycoords == ("axes fraction", "data")
    offset = text.get_position() if isinstance(text, Annotation) and text.anncoords == "offset points" else (0.0, 0.0)
    yield {
        "text": _told(text.get_text()),
        "x": float(place[0]),
        "y": float(place[1]),
        "across": across,
        "shift": [float(offset[0]) * _POINT, float(offset[1]) * _POINT],
        "right": text.get_horizontalalignment() == "right",
        "vertical": {"top": "top", "bottom": "bottom"}.get(text.get_verticalalignment(), "middle"),
        "colour": _colour(text.get_color()),
        "bold": text.get_fontweight() == "bold",
    }


def _names(figure: Figure) -> dict[tuple[str, str], str]:
    """What the legends call lines of a colour and a dash."""
    legends = [*figure.legends, *(axes.get_legend() for axes in figure.axes)]
    found: dict[tuple[str, str], str] = {}
    for legend in legends:
        if legend is not None:
            for handle, text in zip(legend.get_lines(), legend.get_texts(), strict=True):
                colour = _colour(handle.get_color())
                found.setdefault((colour, _dash(handle)), _told(text.get_text()))
                found.setdefault((colour, ""), _told(text.get_text()))
    return found


def _told(text: str) -> str:
    """A text as plotly shows it: it would take tags for what they are in HTML."""
    return escape(text, quote=False)


def _colour(colour: Any) -> str:
    from matplotlib.colors import to_hex

    return str(to_hex(colour))


def _dash(line: Line2D) -> str:
    """In plotly's words, or as lengths [px]."""
    style: Any = line.get_linestyle()
    if style != "--" or not getattr(line, "_unscaled_dash_pattern", (0, None))[1]:
        return _DASHES.get(style, "dash" if style == "--" else "solid")
    lengths = line._unscaled_dash_pattern[1]  # type: ignore[attr-defined]  # matplotlib has no getter for it
    return ",".join(f"{max(1.0, _POINT * length):.3g}px" for length in lengths)
