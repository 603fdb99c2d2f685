"""How figures look: two themes, and the settings that make a drawing the same bytes everywhere."""

from __future__ import annotations

import math
import re
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from dataclasses import dataclass
from io import BytesIO
from typing import TYPE_CHECKING, Any, NamedTuple

from etac_ros.beside import Elsewhere, Work, here

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure

WIDTH_IN = 7.2
"""Width of every figure; with the type below it reads at 100 % on a page and, scrolled, on a phone."""
PAGE_DPI = 220
_SUPERSCRIPTS = str.maketrans("-0123456789", "⁻⁰¹²³⁴⁵⁶⁷⁸⁹")
_SUBSCRIPTS = str.maketrans("0123456789", "₀₁₂₃₄₅₆₇₈₉")
_GREEK = {"chi": "χ", "eta": "η", "omega": "ω", "rho": "ρ", "sigma": "σ", "tau": "τ"}
_SPELLED = re.compile(rf"\b({'|'.join(_GREEK)})(\d*)\b")
_WRITTEN_OUT = (1e-4, 1e6)
"""Beyond these a decade is written as a power of ten."""
_FEW_DECADES = 100.0
BUCKETS = 1100
"""Pixel columns of a panel at most: what a curve is thinned out to."""
_DASHES = ((5.0, 1.6), (1.4, 1.2), (6.0, 1.4, 1.2, 1.4), (2.8, 1.2))
_PREFIXES = {-3: "m", -6: "µ", -9: "n"}
_TAKES_PREFIX = ("deg", "rad", "N m", "N", "m", "s")
"""What a unit begins with to which a prefix can be put: of a square or a root it would mean something else."""
_READS_WELL = (0.05, 1e5)


@dataclass(frozen=True)
class Theme:
    """Colours of a figure.

    Attributes
    ----------
    paper, ink, muted, grid
        Background, text, secondary text and lines.
    axes
        The three axes of a vector, or curves in their order. Chosen apart in lightness, too, so that they can
        be told in grey and with any colour vision.
    this, others, limit
        The reported run, those that are laid beside it, and thresholds.
    """

    name: str
    paper: str
    ink: str
    muted: str
    grid: str
    axes: tuple[str, ...]
    this: str
    others: tuple[str, ...]
    limit: str

    def colour(self, number: int) -> str:
        """Colour of the curve with this number, counted from 0."""
        return self.axes[number % len(self.axes)]

    def run_style(self, number: int) -> dict[str, Any]:
        """Colour, dashes and width of a run: 0 is the reported one, whose line is solid and wide.

        Twelve runs beside it can be told from each other: 3 colours and 4 dashes have no common factor.
        """
        if number == 0:
            return {"color": self.this, "linestyle": "solid", "linewidth": 1.7}
        place = number - 1
        colour, dashes = self.others[place % len(self.others)], _DASHES[place % len(_DASHES)]
        return {"color": colour, "linestyle": (0, dashes), "linewidth": 1.1}


LIGHT = Theme(
    name="light",
    paper="#ffffff",
    ink="#1c2430",
    muted="#5b6675",
    grid="#e3e7ec",
    axes=("#0b3f91", "#cf5a0c", "#1fa187", "#8a6fd1"),
    this="#0b4fae",
    others=("#cf5a0c", "#1fa187", "#8a6fd1"),
    limit="#c0392b",
)
DARK = Theme(
    name="dark",
    paper="#161b22",
    ink="#e6eaf0",
    muted="#a3adba",
    grid="#2c343f",
    axes=("#6fb1ff", "#ff9a4d", "#58d6bd", "#eee1a0"),
    this="#6fb1ff",
    others=("#ff9a4d", "#58d6bd", "#eee1a0"),
    limit="#ff8577",
)


class Pictures(NamedTuple):
    """PNG files of a figure: to stand alone, and for a light and a dark page, empty where a page shows none."""

    alone: bytes
    light: bytes
    dark: bytes


@dataclass(frozen=True)
class Rendered:
    """A figure in the light theme, and what hands out its pictures, which may be made elsewhere: whoever asks waits."""

    figure: Figure
    pictures: Work[Pictures]

    @property
    def alone(self) -> bytes:
        """PNG file that stands alone."""
        return self.pictures().alone

    @property
    def light(self) -> bytes:
        """PNG file for a light page."""
        return self.pictures().light

    @property
    def dark(self) -> bytes:
        """PNG file for a dark page."""
        return self.pictures().dark


def rendered(
    draw: Callable[[Figure, Theme], None],
    size_in: tuple[float, float],
    alone_dpi: int = PAGE_DPI,
    elsewhere: Elsewhere = here,
    is_shown_as_data: Callable[[Figure], bool] = lambda figure: False,
) -> Rendered:
    """Draw a figure; the same drawing always gives the same bytes.

    Parameters
    ----------
    draw
        Fills an empty figure.
    size_in
        Width and height [in].
    alone_dpi
        Pixels an inch of the file that stands alone, which is light.
    elsewhere
        Who makes the pictures of it.
    is_shown_as_data
        Whether a page shows the filled figure by its data, so that it takes no picture of it.
    """
    with _look(LIGHT):
        figure = _filled(draw, size_in, LIGHT)
    for_page = not is_shown_as_data(figure)

    def pictures() -> Pictures:
        with _look(LIGHT):
            if for_page or alone_dpi == PAGE_DPI:
                light = _png(figure)
            else:
                figure.draw_without_rendering()  # lays it out as it would be on a page
            if alone_dpi == PAGE_DPI:
                alone = light
            else:
                figure.set_layout_engine("none")
                figure.set_dpi(alone_dpi)
                alone = _png(figure)
        if not for_page:
            return Pictures(alone, b"", b"")
        with _look(DARK):
            return Pictures(alone, light, _png(_filled(draw, size_in, DARK, like=figure)))

    return Rendered(figure, elsewhere(pictures))


def picture(draw: Callable[[Figure, Theme], None], size_in: tuple[float, float]) -> bytes:
    """PNG file of a figure for a light page; the same drawing always gives the same bytes."""
    with _look(LIGHT):
        return _png(_filled(draw, size_in, LIGHT))


def vector_files(draw: Callable[[Figure, Theme], None], size_in: tuple[float, float]) -> dict[str, bytes]:
    """A figure for papers, by the ending of its file: SVG and PDF. The same drawing always gives the same bytes."""
    files = {}
    with _look(LIGHT):
        import matplotlib

        matplotlib.rcParams.update({"svg.hashsalt": "etac_ros", "pdf.fonttype": 42})
        figure = _filled(draw, size_in, LIGHT)
        for ending, metadata in (("svg", {"Date": None}), ("pdf", {"CreationDate": None, "Producer": None})):
            file = BytesIO()
            figure.savefig(file, format=ending, metadata=metadata)
            files[ending] = file.getvalue()
    return files


@contextmanager
def _look(theme: Theme) -> Iterator[None]:
    # Imported here: matplotlib costs a second, and a bag that cannot be read should not have to wait for it.
    import matplotlib

    with matplotlib.rc_context():
        # The reader's own matplotlibrc shall not change a report.
        matplotlib.rcdefaults()
        settings: Any = _settings(theme)
        matplotlib.rcParams.update(settings)
        yield


def _filled(
    draw: Callable[[Figure, Theme], None],
    size_in: tuple[float, float],
    theme: Theme,
    like: Figure | None = None,
) -> Figure:
    """A figure that is laid out when it is drawn, or like another one: laying out takes half of the time."""
    from matplotlib.figure import Figure

    figure = Figure(figsize=size_in, dpi=PAGE_DPI, layout="constrained" if like is None else None)
    draw(figure, theme)
    _without_markup(figure)
    if like is not None:
        for axes, its_like in zip(figure.axes, like.axes, strict=True):
            axes.set_position(its_like.get_position())
        for title, its_title in zip(figure.texts, like.texts, strict=True):
            title.set_position(its_title.get_position())
    return figure


def _without_markup(figure: Figure) -> None:
    """Show what others have written as it is: two dollars would make a formula of it, which may not even be one."""
    from matplotlib.text import Text

    for text in figure.findobj(Text):
        if "$" in text.get_text():  # tick labels, which are formulas, are not there yet
            text.set_parse_math(False)


def _png(figure: Figure) -> bytes:
    from matplotlib.backends.backend_agg import FigureCanvasAgg

    canvas: Any = FigureCanvasAgg(figure)
    file = BytesIO()
    # Figure.savefig would go through all artists twice.
    canvas.print_png(file, metadata={"Software": None})
    return file.getvalue()


def _settings(theme: Theme) -> dict[str, Any]:
    return {
        "font.family": "DejaVu Sans",  # comes with matplotlib
        "font.size": 8.0,
        "axes.titlesize": 8.0,
        "axes.titlecolor": theme.muted,
        "axes.titlelocation": "left",
        "axes.titlepad": 5.0,
        "axes.labelsize": 8.0,
        "axes.labelcolor": theme.ink,
        "axes.edgecolor": theme.muted,
        "axes.linewidth": 0.7,
        "axes.facecolor": theme.paper,
        "axes.spines.top": False,
        "axes.spines.right": False,
        "axes.grid": True,
        "axes.axisbelow": True,
        "grid.color": theme.grid,
        "grid.linewidth": 0.6,
        "xtick.color": theme.muted,
        "ytick.color": theme.muted,
        "xtick.labelcolor": theme.ink,
        "ytick.labelcolor": theme.ink,
        "xtick.labelsize": 7.5,
        "ytick.labelsize": 7.5,
        "xtick.major.width": 0.7,
        "ytick.major.width": 0.7,
        "xtick.minor.size": 0.0,
        "ytick.minor.size": 0.0,
        "legend.fontsize": 8.0,
        "legend.frameon": False,
        "legend.labelcolor": theme.ink,
        "legend.borderaxespad": 0.2,
        "legend.borderpad": 0.3,
        "legend.columnspacing": 1.6,
        "legend.handlelength": 1.8,
        "lines.linewidth": 1.1,
        "figure.facecolor": theme.paper,
        "savefig.facecolor": theme.paper,
        "text.color": theme.ink,
        "figure.constrained_layout.h_pad": 0.05,
        "figure.constrained_layout.w_pad": 0.05,
        "figure.constrained_layout.wspace": 0.04,
        "axes.formatter.limits": (-4, 5),
    }


def prefixed(unit: str, largest: float) -> tuple[float, str]:
    """A factor and a unit with which a value of this size reads well: 1000 and ``mN m``, or 1000 and ``10⁻³ √kg m``."""
    low, high = _READS_WELL
    if not 0.0 < largest < math.inf or low <= largest < high:
        return 1.0, unit
    exponent = 3 * math.floor(math.log10(largest) / 3.0)
    first = unit.split("/")[0]
    if exponent in _PREFIXES and first in _TAKES_PREFIX:
        return 10.0**-exponent, f"{_PREFIXES[exponent]}{unit}"
    return 10.0**-exponent, f"{power_of_ten(exponent)} {unit}".strip()


def symbols(text: str) -> str:
    """Write spelled-out Greek letters, their indices and roots of units as a paper does: ``eta1`` is ``η₁``."""
    spelled = _SPELLED.sub(lambda found: _GREEK[found[1]] + found[2].translate(_SUBSCRIPTS), text)
    return spelled.replace("e_dot", "ė").replace("kg^1/2", "√kg")


def power_of_ten(exponent: int) -> str:
    """Write a power of ten as text; matplotlib's own mathematical text takes many times as long."""
    return "10" + str(exponent).translate(_SUPERSCRIPTS)


def logarithmic(axes: Axes) -> None:
    """Make the vertical axis logarithmic, marked at its decades only."""
    from matplotlib.ticker import FuncFormatter, NullLocator

    axes.set_yscale("log")
    axes.yaxis.set_major_formatter(FuncFormatter(lambda value, _: power_of_ten(round(math.log10(value)))))
    axes.yaxis.set_minor_locator(NullLocator())


def plain_logarithmic(axes: Axes) -> None:
    """Make the vertical axis logarithmic, once all is drawn, with its numbers written out: 0.1, 1, 10.

    It stays as it is where nothing above zero was drawn.
    """
    from matplotlib.ticker import FuncFormatter, LogLocator, NullLocator

    if not math.isfinite(axes.dataLim.minposy):
        return
    axes.set_yscale("log")
    low, high = axes.get_ylim()
    # A span without two decades in it would else be left without numbers.
    subs = (1.0,) if high > _FEW_DECADES * low else (1.0, 2.0, 5.0)
    axes.yaxis.set_major_locator(LogLocator(subs=subs))
    axes.yaxis.set_minor_locator(NullLocator())
    powers = low < _WRITTEN_OUT[0] or high > _WRITTEN_OUT[1]
    axes.yaxis.set_major_formatter(FuncFormatter(lambda value, _: _number(value, powers)))


def _number(value: float, powers: bool) -> str:
    decade = round(math.log10(value))
    return power_of_ten(decade) if powers and math.isclose(value, 10.0**decade) else f"{value:g}"


def thousands(axes: Axes) -> None:
    """Write whole numbers on the vertical axis, with separators as in the tables."""
    from matplotlib.ticker import FuncFormatter, MaxNLocator

    axes.yaxis.set_major_locator(MaxNLocator("auto", integer=True, steps=[1, 2, 2.5, 5, 10]))
    axes.yaxis.set_major_formatter(FuncFormatter(lambda value, _: f"{value:,.0f}"))
