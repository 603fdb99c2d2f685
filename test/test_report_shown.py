"""What the figures of watched quantities, elastic modes and trigger rules show, for every system that has them."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest
from matplotlib.axes import Axes
from matplotlib.figure import Figure

from etac_ros.graph.replay import trigger_ticks
from etac_ros.metrics import curves
from etac_ros.metrics.decisions import parts_of
from etac_ros.modules.triggering import Triggering, triggering_modules
from etac_ros.plants.plant import modes_slice_of
from etac_ros.report import tables
from etac_ros.report.figures.kind import FigureKind
from etac_ros.report.figures.registry import FIGURES
from etac_ros.report.figures.style import LIGHT, prefixed, symbols
from etac_ros.report.source import read_run
from etac_ros.report.view import View
from etac_ros.runs import run_in_process
from etac_ros.scenario.load import load

SYSTEMS = {
    "flexible": ("flexible", None, 30.0),
    "flexible, sliding mode": ("flexible", "smc", 5.0),
    "shi2022": ("shi2022", None, 40.0),
    "qi2022, trigger on the PM": ("qi2022", None, 10.0),
    "qi2022, measurement sent": ("qi2022", "measurement", 5.0),
    "qi2022, trigger on the SM": ("qi2022", "site-sm", 10.0),
    "xie2021": ("xie2021", None, 12.0),
    "xie2021, held": ("xie2021", "held", 4.0),
}


@pytest.fixture(scope="module")
def views(tmp_path_factory: pytest.TempPathFactory) -> dict[str, View]:
    folder = tmp_path_factory.mktemp("bags")
    found = {}
    for place, (words, (name, variant, duration_s)) in enumerate(SYSTEMS.items()):
        run_in_process(load(name, variant, [f"duration_s={duration_s}"]), folder / str(place))
        found[words] = View(read_run(folder / str(place)))
    return found


def kind(name: str) -> FigureKind:
    return next(kind for kind in FIGURES if kind.name == name)


def drawn(name: str, view: View) -> list[Axes]:
    figure = Figure(figsize=kind(name).size_in(view))
    kind(name).draw(view, figure, LIGHT)
    return figure.axes


def panel_of(words: str, view: View) -> Axes:
    """The first panel of a watched quantity."""
    return next(axes for axes in drawn("watched", view) if axes.get_ylabel().replace("\n", " ").startswith(words))


@pytest.mark.parametrize("system", SYSTEMS)
def test_every_rule_is_recomputed_to_fire_where_its_module_did_and_nowhere_else(
    system: str, views: dict[str, View]
) -> None:
    view = views[system]
    run = view.run
    compared = [
        name for name in triggering_modules(run.graph) if "Periodic" not in type(trigger_of(view, name)).__name__
    ]
    assert tuple(view.margins) == tuple(compared)
    assert compared
    for name, found in view.margins.items():
        np.testing.assert_array_equal(found.errors >= found.thresholds, found.fired)
        ticks = trigger_ticks(run.graph, run.recording, name)
        np.testing.assert_array_equal(found.ticks[found.fired], ticks[1:])
        np.testing.assert_array_equal(found.ticks, np.arange(ticks[0] + 1, run.graph.end_tick))
        assert found.fired.sum() > 3


def trigger_of(view: View, name: str) -> object:
    module = view.run.graph.modules[name]
    assert isinstance(module, Triggering)
    return module.trigger


@pytest.mark.parametrize("system", SYSTEMS)
def test_the_signal_shown_is_what_was_on_the_wire_at_each_triggering_instant(
    system: str, views: dict[str, View]
) -> None:
    view = views[system]
    rate = view.run.graph.ticks_per_second
    for name, found in view.decisions.items():
        # Who fires together with a neighbour forms its signal with that neighbour's message of the same tick in it.
        together = system.startswith("xie2021")
        for part in found.parts:
            shown, sent = found.signal(part, rate), found.sent(part, rate)
            at = np.searchsorted(shown.times_s, sent.times_s)
            # Off by what float32 on the wire has taken from it.
            close = np.abs(shown.values[at] - sent.values).max(axis=1) <= 1e-5 * np.abs(shown.values).max()
            assert close[1:].mean() > 0.8 if together else close.all(), (name, part)


def test_a_run_without_watches_has_no_such_figure_and_one_with_them_a_panel_for_each(
    views: dict[str, View], tmp_path: Path
) -> None:
    run_in_process(load("wu2018", None, ["duration_s=5"]), tmp_path / "bag")
    plain = View(read_run(tmp_path / "bag"))
    assert not kind("watched").applies(plain)
    assert not kind("modes").applies(plain)
    assert tables.watched_table(plain) is None
    shi = views["shi2022"]
    labels = [axes.get_ylabel().replace("\n", " ") for axes in drawn("watched", shi)]
    assert len(labels) == sum(len(watches) for watches in shi.run.summary.watches.values())
    assert {"angular velocity [rad/s]", "performance variable χ"} <= set(labels)


def test_watched_values_peak_where_the_summary_says(views: dict[str, View]) -> None:
    view = views["shi2022"]
    watched = view.run.summary.watches["/controller"][0]
    axes = panel_of("performance variable χ", view)
    curves = [line for line in axes.lines if len(np.asarray(line.get_xdata())) > 2]
    assert len(curves) == 3
    values = np.concatenate([np.asarray(line.get_ydata(), dtype=float) for line in curves])
    assert np.abs(values).max() == pytest.approx(watched.largest)
    table = tables.watched_table(view)
    assert table is not None
    row = next(row for row in table.rows if row.cells[0] == "/controller, performance variable χ")
    assert row.cells[1:4] == (f"{watched.largest:.4g}", f"{watched.at_s:g}", watched.axis)
    assert row.cells[-1] == "1"


def test_bounds_are_drawn_where_a_curve_comes_near_and_told_anyway(views: dict[str, View]) -> None:
    """The modules of qi2022 start 0.42 deg apart; they are noticed beyond 0.5 deg and touch at 0.9 deg."""
    view = views["qi2022, trigger on the PM"]
    axes = panel_of("angle between the modules", view)
    assert {text.get_text() for text in axes.texts} == {"notice ±0.5 deg", "limit ±0.9 deg"}
    levels = {
        round(float(np.asarray(line.get_ydata())[0]), 6) for line in axes.lines if line.get_color() == LIGHT.limit
    }
    assert levels == {0.5, -0.5, 0.9, -0.9}
    assert "noticed beyond 0.5 deg, ends the run at 0.9 deg" in kind("watched").caption(view)
    # shi2022 stays far below its limit of 0.4 rad/s.
    velocity = panel_of("angular velocity", views["shi2022"])
    assert not velocity.texts
    assert max(velocity.get_ylim()) < 0.2
    assert "Angular velocity: ends the run at 0.4 rad/s." in kind("watched").caption(views["shi2022"])
    assert "they are reported only" in kind("watched").caption(views["flexible"])


@pytest.mark.parametrize(
    ("system", "plant", "columns"), [("flexible", "/plant", 4), ("qi2022, measurement sent", "/sim/plant", 3)]
)
def test_modes_are_the_coordinates_without_their_rates(
    system: str, plant: str, columns: int, views: dict[str, View]
) -> None:
    view = views[system]
    graph, recording = view.run.graph, view.run.recording
    dynamics = curves.dynamics(graph, plant)
    names = [label.split()[0] for label in dynamics.labels[modes_slice_of(dynamics)]]
    assert names == [f"eta{mode + 1}" for mode in range(columns)]
    modes = curves.modes(graph, recording, plant)
    # The state has the rates too, behind the coordinates: they are their derivatives.
    where = modes_slice_of(dynamics)
    rates = recording.samples(plant)[1][:, where.stop : where.stop + columns]
    slopes = np.gradient(modes.values, modes.times_s, axis=0)
    np.testing.assert_allclose(slopes[1:-1], rates[1:-1], atol=0.1 * np.abs(rates).max())
    labels = [axes.get_ylabel() for axes in drawn("modes", view)]
    assert list(dict.fromkeys(label.split(" ")[0] for label in labels)) == [
        f"η{'₁₂₃₄'[mode]}" for mode in range(columns)
    ]
    assert all("√kg\u00a0m" in label for label in labels)


def test_a_plant_without_modes_has_none(views: dict[str, View]) -> None:
    run = views["shi2022"].run
    assert curves.modes(run.graph, run.recording, "/plant").values.shape[1] == 0
    assert not kind("modes").applies(views["shi2022"])


@pytest.mark.parametrize(
    ("system", "labels"),
    [
        ("flexible", ["σ"]),
        ("flexible, sliding mode", ["ω", "s"]),
        ("shi2022", ["τ"]),
        ("qi2022, trigger on the PM", ["τ"]),
        ("xie2021", ["χ", "ė", "η"] * 4),
    ],
)
def test_each_quantity_of_a_signal_has_a_panel_with_its_symbol(
    system: str, labels: list[str], views: dict[str, View]
) -> None:
    found = [axes.get_ylabel().split(" ")[0] for axes in drawn("signal", views[system]) if axes.get_xlim()[0] == 0.0]
    assert found == labels


def test_signals_are_cut_into_their_quantities() -> None:
    one, two, three = parts_of("[chi, e_dot, eta]", "rad/s, 1/s, N m", 9)
    assert (one.symbol, one.unit, one.columns) == ("chi", "rad/s", slice(0, 3))
    assert (two.symbol, two.unit, two.columns) == ("e_dot", "1/s", slice(3, 6))
    assert (three.symbol, three.unit, three.columns) == ("eta", "N m", slice(6, 9))
    assert [part.unit for part in parts_of("ω, s", "rad/s", 6)] == ["rad/s", "rad/s"]
    (whole,) = parts_of("a, b", "", 3)
    assert (whole.symbol, whole.columns) == ("a, b", slice(0, 3))


@pytest.mark.parametrize(
    ("unit", "largest", "factor", "written"),
    [
        ("deg", 12.0, 1.0, "deg"),
        ("deg/s", 0.02, 1e3, "mdeg/s"),
        ("N m", 2e-5, 1e6, "µN m"),
        ("√kg m", 4e-3, 1e3, "10⁻³ √kg m"),  # a thousandth of a root is no root of a thousandth
        ("N²m²s", 6.5e5, 1e-3, "10³ N²m²s"),
        ("", 2e-4, 1e6, "10⁻⁶"),
        ("deg", 0.0, 1.0, "deg"),
        ("deg", float("nan"), 1.0, "deg"),
        ("deg", float("inf"), 1.0, "deg"),
    ],
)
def test_units_take_prefixes_only_where_these_mean_the_same(
    unit: str, largest: float, factor: float, written: str
) -> None:
    found = prefixed(unit, largest)
    assert (pytest.approx(found[0]), found[1]) == (factor, written)


def test_symbols_are_written_as_in_a_paper() -> None:
    assert symbols("eta1") == "η₁"
    assert symbols("performance variable chi") == "performance variable χ"
    assert symbols("[chi, e_dot, eta]") == "[χ, ė, η]"
    assert symbols("kg^1/2 m/s") == "√kg m/s"
    assert symbols("beta, metal, q_po") == "beta, metal, q_po"
