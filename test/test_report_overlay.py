"""Several bags laid over each other: names, styles, panels and tables, and what cannot be compared."""

from __future__ import annotations

import re
from itertools import combinations
from pathlib import Path

import numpy as np
import pytest
from conftest import FewFigures
from matplotlib.colors import to_rgb
from matplotlib.figure import Figure
from typer.testing import CliRunner

from etac_ros.cli.main import app
from etac_ros.parameters import FloatArray
from etac_ros.report import tables
from etac_ros.report.figures.kind import FigureKind
from etac_ros.report.figures.registry import FIGURES
from etac_ros.report.figures.style import DARK, LIGHT, Theme
from etac_ros.report.page import lead
from etac_ros.report.source import ReportedRun, read_run
from etac_ros.report.view import View
from etac_ros.runs import run_in_process
from etac_ros.scenario.load import load

DURATION_S = 40.0


@pytest.fixture(scope="module")
def folder(tmp_path_factory: pytest.TempPathFactory) -> Path:
    folder = tmp_path_factory.mktemp("bags")
    record(folder / "plain")
    record(folder / "periodic", variant="periodic")
    record(folder / "smc", variant="smc")
    record(folder / "coarse", "sensor.trigger.gamma=1e-3")
    record(folder / "other_start", "plant.dynamics.attitude_mrp=[0.1,0.0,0.0]", "duration_s=20")
    return folder


def record(bag: Path, *overrides: str, variant: str | None = None) -> None:
    run_in_process(load("flexible", variant, [f"duration_s={DURATION_S:g}", *overrides]), bag)


def view_of(folder: Path, *names: str) -> View:
    first, *others = (read_run(folder / name) for name in names)
    return View(first, tuple(others))


def drawn(name: str, view: View) -> Figure:
    figure = Figure(figsize=kind(name).size_in(view))
    kind(name).draw(view, figure, LIGHT)
    return figure


def kind(name: str) -> FigureKind:
    return next(kind for kind in FIGURES if kind.name == name)


def test_runs_are_called_by_their_variants(folder: Path) -> None:
    assert view_of(folder, "plain", "periodic", "smc").labels == ("this run", "baseline (periodic)", "smc")
    # The baseline of nothing, and a run of the file as it stands.
    assert view_of(folder, "periodic", "plain").labels == ("this run (periodic)", "flexible")
    assert view_of(folder, "smc").labels == ("this run",)


def test_runs_of_one_variant_are_told_by_what_they_override_or_by_number(folder: Path) -> None:
    labels = view_of(folder, "smc", "plain", "coarse").labels
    assert labels == ("this run (smc)", "flexible, duration_s=40", "flexible, duration_s=40, gamma=0.001")
    assert view_of(folder, "plain", "smc", "smc").labels[1:] == ("smc, duration_s=40", "smc, duration_s=40 (2)")


def test_the_measured_baseline_is_found_wherever_it_stands(folder: Path) -> None:
    view = view_of(folder, "plain", "smc", "periodic")
    assert view.baseline is view.others[1]
    assert view_of(folder, "plain", "smc").baseline is None
    assert view_of(folder, "periodic", "plain").baseline is None


def lightness_and_colour(colour: str, matrix: FloatArray) -> FloatArray:
    """CIE L*a*b* of a colour as a reader of some colour vision sees it (Machado and others, 2009)."""
    srgb = np.array(to_rgb(colour))
    linear = np.where(srgb <= 0.04045, srgb / 12.92, ((srgb + 0.055) / 1.055) ** 2.4)
    seen = np.clip(matrix @ linear, 0.0, 1.0)
    to_xyz = np.array([[0.4124, 0.3576, 0.1805], [0.2126, 0.7152, 0.0722], [0.0193, 0.1192, 0.9505]])
    ratio = to_xyz @ seen / np.array([0.9505, 1.0, 1.089])
    f = np.where(ratio > (6 / 29) ** 3, np.cbrt(ratio), ratio / (3 * (6 / 29) ** 2) + 4 / 29)
    return np.array([116 * f[1] - 16, 500 * (f[0] - f[1]), 200 * (f[1] - f[2])])


VISIONS = {
    "usual": np.eye(3),
    "no red": np.array(
        [[0.152286, 1.052583, -0.204868], [0.114503, 0.786281, 0.099216], [-0.003882, -0.048116, 1.051998]]
    ),
    "no green": np.array(
        [[0.367322, 0.860646, -0.227968], [0.280085, 0.672501, 0.047413], [-0.011820, 0.042940, 0.968881]]
    ),
    "no blue": np.array(
        [[1.255528, -0.076749, -0.178779], [-0.078411, 0.930809, 0.147602], [0.004733, 0.691367, 0.303900]]
    ),
}


@pytest.mark.parametrize("theme", [LIGHT, DARK], ids=["light", "dark"])
@pytest.mark.parametrize("vision", VISIONS.values(), ids=VISIONS.keys())
def test_colours_of_runs_can_be_told_apart_and_from_the_paper(theme: Theme, vision: FloatArray) -> None:
    colours = [theme.this, *theme.others]
    for one, other in combinations(colours, 2):
        apart = lightness_and_colour(one, vision) - lightness_and_colour(other, vision)
        assert np.linalg.norm(apart) > 14.0, (one, other)
    for colour in colours:
        apart = lightness_and_colour(colour, vision) - lightness_and_colour(theme.paper, vision)
        assert abs(apart[0]) > 30.0, colour


def test_twelve_runs_beside_the_reported_one_have_a_style_of_their_own() -> None:
    styles = [LIGHT.run_style(number) for number in range(13)]
    assert len({(style["color"], str(style["linestyle"])) for style in styles}) == 13
    assert styles[0]["linestyle"] == "solid"
    assert all(style["linestyle"] != "solid" and style["linewidth"] < styles[0]["linewidth"] for style in styles[1:])


def test_every_axis_has_panels_of_its_own_in_which_each_run_has_its_style(folder: Path) -> None:
    view = view_of(folder, "plain", "periodic", "smc")
    figure = drawn("attitude", view)
    assert [axes.get_ylabel().split("\n")[-1].split("[")[0].strip() for axes in figure.axes] != []
    words = [re.sub(r"\s+", " ", axes.get_ylabel()) for axes in figure.axes]
    assert [label.rsplit(" ", 1)[0] for label in words] == [
        f"attitude error {axis}" for axis in ("roll", "pitch", "yaw")
    ]
    for axes, column in zip(figure.axes, range(3), strict=True):
        curves = [line for line in axes.lines if len(np.asarray(line.get_xdata())) > 2]
        assert [line.get_color() for line in curves] == [LIGHT.run_style(number)["color"] for number in range(3)]
        starts = [float(np.asarray(line.get_ydata())[0]) for line in curves]
        assert starts == pytest.approx([starts[0]] * 3), column
        assert starts[0] != 0.0
    legend = [text.get_text() for text in figure.legends[0].get_texts()]
    assert legend == list(view.labels)


@pytest.mark.parametrize("name", ["overview", "attitude", "rate", "torque", "watched", "modes", "energy", "bytes"])
def test_all_runs_are_in_the_figures_that_can_hold_them(name: str, folder: Path) -> None:
    view = view_of(folder, "plain", "periodic", "smc")
    colours = {line.get_color() for axes in drawn(name, view).axes for line in axes.lines}
    assert {LIGHT.this, *LIGHT.others[:2]} <= colours


@pytest.mark.parametrize("name", ["signal", "margin", "intervals"])
def test_figures_of_one_run_say_so(name: str, folder: Path) -> None:
    assert kind(name).caption(view_of(folder, "plain", "smc")).endswith("Of this run only.")
    assert "Of this run only" not in kind(name).caption(view_of(folder, "plain"))


def test_a_run_that_dwarfs_the_reported_one_leaves_the_panel_and_is_written_above_it(folder: Path) -> None:
    view = view_of(folder, "plain", "smc")
    largest = [np.abs(run.held["/plant"]["torque"].values[:, 0]).max() for run in view.runs]
    assert largest[1] > 10.0 * largest[0]
    axes = drawn("torque", view).axes[0]
    assert axes.get_title(loc="right") == f"smc: up to {largest[1]:.3g} N m"
    assert largest[0] <= max(abs(end) for end in axes.get_ylim()) < 2.0 * largest[0]
    # The other way round it is a flat line, and nothing leaves the panel.
    axes = drawn("torque", view_of(folder, "smc", "plain")).axes[0]
    assert axes.get_title(loc="right") == ""
    assert max(abs(end) for end in axes.get_ylim()) >= largest[1]


def test_a_rough_curve_lies_behind_the_reported_run_and_a_smooth_one_before_it(folder: Path) -> None:
    view = view_of(folder, "plain", "smc", "periodic")
    axes = drawn("torque", view).axes[0]
    orders = {line.get_color(): line.get_zorder() for line in axes.lines}
    main, smc, periodic = (orders[LIGHT.run_style(number)["color"]] for number in range(3))
    assert smc < main < periodic


def test_each_run_has_a_column_in_the_tables(folder: Path) -> None:
    view = view_of(folder, "plain", "periodic", "smc")
    pointing = tables.performance_table(view)
    assert pointing.columns == ("plant", *view.labels)
    energy = next(row.cells for row in pointing.rows if row.cells[0] == "/plant: energy [N²m²s]")
    assert energy[1:] == tuple(f"{run.summary.performance['/plant'].energy_n2m2s:.4g}" for run in view.runs)
    triggering = tables.trigger_table(view)
    assert triggering is not None
    counts = next(row.cells for row in triggering.rows if row.cells[0] == "/sensor: triggering instants")
    assert counts[1:] == tuple(f"{run.summary.triggers['/sensor'].count:,}" for run in view.runs)
    traffic = tables.traffic_table(view)
    assert traffic.groups == (("", 1), ("this run", 3), ("baseline (periodic)", 2), ("smc", 2), ("", 1))
    assert all(len(row.cells) == len(traffic.columns) == 9 for row in traffic.rows)
    published = tables.published_table(view)
    assert published is not None
    assert published.columns[-2:] == view.labels[1:]
    for label, other in zip(view.labels[1:], view.others, strict=True):
        assert f"{label} put {other.summary.network.messages:,} messages" in lead(view)


def test_reductions_of_every_run_are_against_the_measured_baseline(folder: Path) -> None:
    view = view_of(folder, "plain", "periodic", "smc")
    table = tables.published_table(view)
    assert table is not None
    rows = {row.cells[0]: dict(zip(table.columns, row.cells, strict=True)) for row in table.rows}
    baseline = view.others[0].summary.network.payload_bytes
    for label, run in (("this run", view.run), ("smc", view.others[1])):
        expected = 100.0 * (1.0 - run.summary.network.payload_bytes / baseline)
        assert float(rows["fewer bytes as sent [%]"][label].replace(",", "")) == pytest.approx(expected, rel=1e-3)
    assert rows["fewer bytes as sent [%]"]["baseline (periodic)"] == ""


def test_plants_with_other_parameters_are_laid_over_each_other_and_named(folder: Path) -> None:
    view = view_of(folder, "plain", "other_start")
    (remark,) = tables.remarks(view)
    assert remark == ("The run 'flexible' is of a plant with other parameters: /plant.dynamics.attitude_mrp.")
    assert tables.remarks(view_of(folder, "plain", "smc", "coarse")) == ()


def test_time_axes_end_with_the_longest_run(folder: Path) -> None:
    for names in (("plain", "other_start"), ("other_start", "plain")):
        view = view_of(folder, *names)
        for name in ("overview", "bytes", "raster", "attitude", "torque", "energy"):
            assert max(axes.get_xlim()[1] for axes in drawn(name, view).axes) == DURATION_S


def test_late_figures_say_from_when_on_for_each_run(folder: Path) -> None:
    (note,) = tables.performance_table(view_of(folder, "plain", "smc")).notes
    assert note.startswith(f"* at the end, which comes before {steady_from(view_of(folder, 'plain').run):g} s.")
    (note,) = tables.performance_table(changed_late(folder)).notes
    assert note.startswith("* from 7 s on (this run), ")


def changed_late(folder: Path) -> View:
    if not (folder / "late").exists():
        record(folder / "late", "steady_from_s=7")
    return view_of(folder, "late", "plain")


def steady_from(run: ReportedRun) -> float:
    return run.summary.steady_from_s


def test_captions_say_from_when_on_the_figures_are_steady(folder: Path) -> None:
    view = changed_late(folder)
    largest = view.run.summary.performance["/plant"].max_attitude_error_deg
    assert f"From 7 s on the error of this run, taken as one angle, is {largest:.3g} deg" in kind("attitude").caption(
        view
    )
    assert "From 7 s on its norm" in kind("rate").caption(view)


@pytest.mark.filterwarnings("error")
def test_the_command_takes_any_number_of_bags(folder: Path, tmp_path: Path, few_figures: FewFigures) -> None:
    few_figures("overview")
    bags = [str(folder / name) for name in ("plain", "periodic", "smc")]
    done = CliRunner().invoke(app, ["report", *bags, "--output", str(tmp_path)], catch_exceptions=False)
    assert done.exit_code == 0
    text = (tmp_path / "index.html").read_text(encoding="utf-8")
    assert "baseline (periodic) put" in text
    assert '<th scope="colgroup" colspan="2">smc</th>' in text
