"""The report as it stands on the disk: pictures and one page that needs nothing but itself."""

from __future__ import annotations

import json
import re
import shutil
from base64 import b64decode
from dataclasses import replace
from datetime import date
from functools import partial
from html.parser import HTMLParser
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from matplotlib.figure import Figure

from etac_ros.metrics import curves
from etac_ros.metrics.summary import summarise
from etac_ros.report import tables, write_report
from etac_ros.report.figures.registry import FIGURES
from etac_ros.report.figures.style import LIGHT, rendered
from etac_ros.report.page import MOST_BYTES, Drawn, page
from etac_ros.report.source import ReportedRun, read_run
from etac_ros.report.view import View
from etac_ros.report.write import baseline_beside
from etac_ros.runs import run_in_process
from etac_ros.scenario.load import load
from etac_ros.scenario.places import config_folders

SIGNATURE = b"\x89PNG\r\n\x1a\n"


def record(bag: Path, *overrides: str, variant: str | None = None) -> Path:
    run_in_process(load("wu2018", variant, overrides), bag)
    return bag


@pytest.fixture(scope="module")
def folder(tmp_path_factory: pytest.TempPathFactory) -> Path:
    folder = tmp_path_factory.mktemp("report")
    record(folder / "run_2026_01_02", "duration_s=200")
    record(folder / "baseline", "duration_s=200", variant="periodic")
    return folder


@pytest.fixture(scope="module")
def html(folder: Path) -> Path:
    return write_report(folder / "run_2026_01_02", [folder / "baseline"])


@pytest.fixture(scope="module")
def whole(tmp_path_factory: pytest.TempPathFactory) -> ReportedRun:
    return read_run(record(tmp_path_factory.mktemp("whole") / "bag"))


@pytest.fixture(scope="module")
def periodic(tmp_path_factory: pytest.TempPathFactory) -> ReportedRun:
    return read_run(record(tmp_path_factory.mktemp("periodic") / "bag", variant="periodic"))


class Tags(HTMLParser):
    """All tags of a page with their attributes."""

    def __init__(self, text: str) -> None:
        super().__init__()
        self.found: list[tuple[str, dict[str, str | None]]] = []
        self.feed(text)

    def handle_starttag(self, tag: str, attrs: list[tuple[str, str | None]]) -> None:
        self.found.append((tag, dict(attrs)))

    def named(self, name: str) -> list[dict[str, str | None]]:
        return [attributes for tag, attributes in self.found if tag == name]


def png_in(uri: str | None) -> bytes:
    assert uri is not None
    prefix, _, data = uri.partition(",")
    assert prefix == "data:image/png;base64"
    return b64decode(data, validate=True)


def without_scripts(text: str) -> str:
    return re.sub(r"<script.*?</script>", "", text, flags=re.DOTALL)


def data_of(html: Path) -> Any:
    (found,) = re.findall(r'<script id="data" type="application/json">(.*?)</script>', html.read_text(encoding="utf-8"))
    return json.loads(found)


def unpacked(packed: dict[str, str]) -> Any:
    return np.frombuffer(b64decode(packed["bdata"]), dtype="<f4")


def drawn_of(run: ReportedRun) -> list[Drawn]:
    kind = FIGURES[0]
    return [Drawn(kind, rendered(partial(kind.draw, View(run)), kind.size_in(View(run))))]


def cells(table: tables.Table | None, first: str) -> dict[str, str]:
    """One row of a table by its headings; of equal headings the first counts."""
    assert table is not None
    row = next(row for row in table.rows if row.cells[0] == first)
    assert len(row.cells) == len(table.columns)
    return dict(reversed(list(zip(table.columns, row.cells, strict=True))))


def test_the_report_stands_in_the_bag_unless_told_otherwise(html: Path, folder: Path) -> None:
    assert html == folder / "run_2026_01_02" / "report" / "index.html"
    assert read_run(folder / "run_2026_01_02").scenario.name == "wu2018"


def test_the_page_needs_nothing_but_itself(html: Path) -> None:
    text = html.read_text(encoding="utf-8")
    assert "default-src 'none'" in text  # so the browser sees to it, too
    for forbidden in ("http:", "https:", "file:", "url(", "@import", "<link", "<iframe"):
        assert forbidden not in without_scripts(text)
    for _, attributes in Tags(text).found:
        for name in ("src", "srcset", "href", "data", "poster"):
            assert attributes.get(name, "data:") is not None
            assert str(attributes.get(name, "data:")).startswith("data:")


def test_every_figure_is_on_the_page_light_and_dark_and_in_words(html: Path) -> None:
    tags = Tags(html.read_text(encoding="utf-8"))
    shown = [attributes["id"] for attributes in tags.named("figure")]
    assert shown == [
        "overview", "turning", "attitude", "rate", "torque", "signal", "network", "margin", "intervals", "bytes",
        "raster", "energy", "lyapunov",
    ]  # fmt: skip
    (light,), (dark,) = tags.named("img"), tags.named("source")  # what is no curve stays a picture
    files = png_in(light["src"]), png_in(dark["srcset"]), (html.parent / "network.png").read_bytes()
    assert all(file.startswith(SIGNATURE) for file in files)
    assert files[0] != files[1]
    assert files[0] == files[2]
    plots = {tag["id"]: tag["aria-label"] for tag in tags.named("div") if tag.get("class") == "plot"}
    assert set(plots) == {"turning-plot", *(f"plot-{name}" for name in shown if name not in ("network", "turning"))}
    assert all(plots.values())
    for name in shown:
        if name != "turning":
            assert (html.parent / f"{name}.png").read_bytes().startswith(SIGNATURE)


def test_the_page_fits_into_a_letter(html: Path) -> None:
    assert html.stat().st_size <= MOST_BYTES


def test_interactive_figures_are_those_that_are_drawn(html: Path, folder: Path) -> None:
    data = data_of(html)
    view = View(read_run(folder / "run_2026_01_02"), (read_run(folder / "baseline"),))
    for kind in FIGURES:
        if kind.applies(view) and kind.name != "network":
            figure = Figure(figsize=kind.size_in(view))
            kind.draw(view, figure, LIGHT)
            for axes, told in zip(figure.axes, data["figures"][kind.name]["axes"], strict=True):
                lines = [line for line in axes.lines if line.get_transform() == axes.transData]
                assert [trace["mode"] for trace in told["traces"]][: len(lines)] == [
                    "markers" if line.get_linestyle() == "None" else "lines" for line in lines
                ]
                for line, trace in zip(lines, told["traces"], strict=False):
                    ends = [float(value) for value in np.float32(line.get_xydata()[[0, -1]]).ravel()]
                    x, y = unpacked(trace["x"]), unpacked(trace["y"])
                    np.testing.assert_array_equal([x[0], y[0], x[-1], y[-1]], ends)
                    np.testing.assert_array_equal(np.nanmax(y), np.float32(np.nanmax(line.get_ydata())))
                assert told["ylabel"].replace("<br>", "\n") == axes.get_ylabel()
    names = {trace["name"] for trace in data["figures"]["overview"]["axes"][0]["traces"]}
    assert names == set(view.labels)


def test_the_bodies_turn_as_they_did(html: Path, folder: Path) -> None:
    turning = data_of(html)["turning"]
    run = read_run(folder / "run_2026_01_02")
    _, states = run.recording.samples("/plant")
    (body,) = turning["bodies"]
    ticks = np.round(unpacked(turning["times"]) * 32).astype(int)
    assert (ticks[0], ticks[-1]) == (0, 6400)
    assert body["name"] == "/plant"
    np.testing.assert_array_equal(unpacked(body["q"]).reshape(-1, 4), np.float32(states[ticks, 0:4]))


def test_what_a_bag_says_cannot_leave_the_data(html: Path) -> None:
    run = read_run(html.parent.parent)
    evil = run.scenario.run.model_copy(update={"title": "</script><script>alert(1)</script>"})
    text = page(View(replace(run, scenario=replace(run.scenario, run=evil))), drawn_of(run))
    assert "<script>alert" not in text


def test_figures_for_papers_are_the_same_bytes_each_time(
    folder: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    few = tuple(kind for kind in FIGURES if kind.name in ("torque", "network"))  # drawing all of them takes seconds
    monkeypatch.setattr("etac_ros.report.write.FIGURES", few)
    for place in ("a", "b"):
        write_report(folder / "baseline", output=tmp_path / "report", figures=tmp_path / place)
    names = sorted(path.name for path in (tmp_path / "a").iterdir())
    assert names == ["network.pdf", "network.svg", "torque.pdf", "torque.svg"]
    assert (tmp_path / "a" / "torque.pdf").read_bytes().startswith(b"%PDF")
    for name in names:
        assert (tmp_path / "a" / name).read_bytes() == (tmp_path / "b" / name).read_bytes()


def test_the_baseline_that_the_run_wrote_is_found(tmp_path: Path) -> None:
    record(tmp_path / "run", "duration_s=20")
    assert baseline_beside(tmp_path / "run", read_run(tmp_path / "run")) == ()
    record(tmp_path / "run_periodic", "duration_s=20", variant="periodic")
    assert baseline_beside(tmp_path / "run", read_run(tmp_path / "run")) == (tmp_path / "run_periodic",)
    assert baseline_beside(tmp_path / "run_periodic", read_run(tmp_path / "run_periodic")) == ()


def test_the_headline_leaves_out_who_only_keeps_a_clock(tmp_path: Path) -> None:
    run_in_process(load("qi2022", None, ["duration_s=10"]), tmp_path / "pair")
    view = View(read_run(tmp_path / "pair"))
    assert view.triggering_instants == view.run.summary.triggers["/pm/relative_sensor"].count < 200
    record(tmp_path / "periodic", "duration_s=20", variant="periodic")
    assert View(read_run(tmp_path / "periodic")).triggering_instants == 20


def test_the_overview_is_as_large_as_a_readme_wants_it(html: Path) -> None:
    header = (html.parent / "overview.png").read_bytes()[16:24]
    width, height = int.from_bytes(header[:4]), int.from_bytes(header[4:])
    assert (width, 600 < height < 800) == (900, True)


def test_the_same_bag_gives_the_same_bytes_wherever_it_lies(html: Path, folder: Path, tmp_path: Path) -> None:
    shutil.copytree(folder / "run_2026_01_02", tmp_path / "moved", ignore=shutil.ignore_patterns("report"))
    (tmp_path / "moved" / "run_2026_01_02_0.mcap").rename(tmp_path / "moved" / "moved_0.mcap")
    metadata = tmp_path / "moved" / "metadata.yaml"
    metadata.write_text(metadata.read_text().replace("run_2026_01_02", "moved"))
    again = write_report(tmp_path / "moved", [folder / "baseline"], tmp_path / "elsewhere")
    assert again == tmp_path / "elsewhere" / "index.html"
    assert again.read_bytes() == html.read_bytes()
    names = [picture.name for picture in html.parent.glob("*.png")]
    assert len(names) == 12
    for name in names:
        assert (again.parent / name).read_bytes() == (html.parent / name).read_bytes()


def test_no_wall_clock_stands_on_the_page(html: Path) -> None:
    # Without its pictures, in which any four digits may stand.
    text = without_scripts(page(View(read_run(html.parent.parent)), []))
    assert "2026" not in text
    assert f"{date.today():%Y}" not in text


def test_counts_and_totals_are_those_of_the_run(whole: ReportedRun, periodic: ReportedRun) -> None:
    table = tables.traffic_table(View(whole, (periodic,)))
    rows = {row.cells[0]: row for row in table.rows}
    messages, payload = whole.summary.network.messages, whole.summary.network.payload_bytes
    assert rows["/filtered_error"].cells[1:3] == (f"{messages // 2}", f"{payload // 2:,}")
    total = (f"{messages}", f"{payload:,}", f"{16 * messages:,}", "2,000", "24,000")
    assert rows["all network"].cells[1:-1] == total
    assert rows["/filtered_error"].cells[-1] == "geometry_msgs/Point32"
    assert rows["all network"].strong
    assert not rows["/filtered_error"].strong
    # Kinds apart: no physical link and no truth in the network's part.
    assert list(rows).index("all network") < list(rows).index("/emulation/torque")
    assert "/emulation/plant/truth" in rows
    assert rows["/emulation/torque"].cells[2] == ""


def test_this_run_stands_beside_the_paper_and_the_baseline(whole: ReportedRun, periodic: ReportedRun) -> None:
    table = tables.published_table(View(whole, (periodic,)))
    triggers = cells(table, "triggering instants")
    assert triggers == {
        "": "triggering instants",
        "this run": str(whole.summary.triggers["/sensor"].count),
        "paper": "84",
        "5 to 95 %": cells(table, "triggering instants")["5 to 95 %"],
        "verdict": "fitted",
        "baseline (periodic)": "1,000",
    }
    assert " to " in triggers["5 to 95 %"]  # the stored spread
    assert cells(table, "baseline's payload [bytes]")["baseline (periodic)"] == "24,000"
    assert cells(table, "baseline's payload [bytes]")["this run"] == ""
    reduction = cells(table, "fewer bytes as sent [%]")
    payload = whole.summary.network.payload_bytes
    assert float(reduction["this run"]) == pytest.approx(100.0 * (1.0 - payload / 24_000.0), abs=0.05)


def test_what_is_measured_at_the_baseline_stands_in_its_column_alone(whole: ReportedRun, periodic: ReportedRun) -> None:
    view = View(whole, (whole, periodic))
    assert view.labels == ("this run", "wu2018", "baseline (periodic)")
    row = cells(tables.published_table(view), "baseline's payload [bytes]")
    assert [row[label] for label in view.labels] == ["", "", "24,000"]


def test_what_is_not_the_papers_is_said_not_to_be(whole: ReportedRun, tmp_path: Path) -> None:
    run = read_run(record(tmp_path / "bag", "sensor.trigger.alpha=0.05", "duration_s=200"))
    beside = run.summary.model_copy(update={"published": whole.summary.published, "published_not": ""})
    assert (
        cells(tables.published_table(View(replace(run, summary=beside))), "triggering instants")["verdict"] == "missed"
    )


def test_a_changed_run_does_not_stand_beside_the_paper_and_says_why(tmp_path: Path) -> None:
    run = read_run(record(tmp_path / "bag", "sensor.trigger.alpha=0.05", "duration_s=200"))
    table = tables.published_table(View(run))
    assert table is not None
    assert table.columns == ("", "this run")
    assert any("sensor.trigger.alpha and duration_s are changed" in note for note in table.notes)
    assert View(run).paper_baseline is None


def ends_of_lines(view: View) -> list[tuple[float, float]]:
    """Last point of each curve of the figure of bytes, with its name and total written at it."""
    figure = Figure()
    next(kind for kind in FIGURES if kind.name == "bytes").draw(view, figure, LIGHT)
    (axes,) = figure.axes
    ends = [(float(line.get_xdata()[-1]), float(line.get_ydata()[-1])) for line in axes.lines]  # type: ignore[index]
    for (_, total), text in zip(ends, axes.texts, strict=True):
        assert text.get_text().endswith(f": {total:,.0f} B")
    return ends


def test_without_a_measured_baseline_the_published_one_is_drawn_and_named_so(whole: ReportedRun) -> None:
    view = View(whole)
    assert view.paper_baseline is not None
    assert view.paper_baseline.value == 24_000.0
    volume = next(kind for kind in FIGURES if kind.name == "bytes")
    measured, dashed = ends_of_lines(view)
    assert (measured, dashed) == ((1000.0, whole.summary.network.payload_bytes), (1000.0, 24_000.0))
    assert "24,000 bytes published for the baseline" in volume.caption(view)
    assert "not measured" in volume.caption(view)
    table = tables.published_table(view)
    assert table is not None
    assert any("none was measured here" in note for note in table.notes)


def test_with_a_measured_baseline_the_published_one_is_not_drawn(whole: ReportedRun, periodic: ReportedRun) -> None:
    volume = next(kind for kind in FIGURES if kind.name == "bytes")
    view = View(whole, (periodic,))
    assert "published" not in volume.caption(view)
    assert ends_of_lines(view) == [(1000.0, whole.summary.network.payload_bytes), (1000.0, 24_000.0)]
    assert len(curves.cumulative_bytes(periodic.graph, periodic.recording).times_s) > 1000


def test_the_published_baseline_is_not_drawn_over_a_run_of_another_length(folder: Path) -> None:
    assert View(read_run(folder / "run_2026_01_02")).paper_baseline is None


def test_a_variant_is_compared_with_what_the_paper_publishes_of_it(periodic: ReportedRun, tmp_path: Path) -> None:
    assert tables.published_table(View(periodic)) is None
    run_in_process(load("flexible", "periodic", ["duration_s=10"]), tmp_path / "bag")
    run = read_run(tmp_path / "bag")
    assert cells(tables.published_table(View(run)), "triggering instants") == {
        "": "triggering instants",
        "this run": "5",
    }
    stands = summarise(replace(run.scenario, overrides={}), run.graph, run.recording, "inprocess", run.summary.timing)
    row = cells(tables.published_table(View(replace(run, summary=stands))), "triggering instants")
    assert (row["this run"], row["paper"], row["verdict"]) == ("5", "500", "missed")


def test_captions_say_where_the_paper_shows_the_same(whole: ReportedRun, html: Path) -> None:
    assert View(whole).shown_in("torque") == "figs. 4 and 5"
    text = html.read_text(encoding="utf-8")
    assert "The paper shows the same in its figs.\u00a06 and 7." in text


def test_a_variant_takes_away_what_the_paper_does_not_show_of_it() -> None:
    assert load("flexible").run.published.shown_in == {
        "attitude": "figs. 4 and 5",
        "rate": "fig. 6",
        "torque": "fig. 7",
        "modes": "figs. 11 and 12",
        "signal": "fig. 9",
        "margin": "fig. 8",
    }
    smc = load("flexible", "smc")
    assert smc.run.published.shown_in is not None
    assert "margin" not in smc.run.published.shown_in
    assert smc.run.published.shown_in["modes"] == "figs. 19 and 20"
    assert load("flexible", "periodic").run.published.shown_in is None
    assert load("shi2022", "periodic").run.published.shown_in == {"energy": "fig. 5"}
    # Neither stands in the parameter file of a node: rcl has no null.
    assert "null" not in smc.text


def test_a_figure_that_the_paper_does_not_show_has_no_place_in_its_caption(tmp_path: Path) -> None:
    run_in_process(load("flexible", "smc", ["duration_s=2"]), tmp_path / "bag")
    view = View(read_run(tmp_path / "bag"))
    assert (view.shown_in("modes"), view.shown_in("margin"), view.shown_in("energy")) == ("figs. 19 and 20", "", "")


def test_scenarios_name_figures_that_there_are() -> None:
    names = {kind.name for kind in FIGURES}
    for path in config_folders()[0].glob("*.yaml"):
        assert set(load(str(path)).run.published.shown_in or {}) <= names, path


def test_a_rule_without_margins_has_no_margin_figure(periodic: ReportedRun) -> None:
    applying = [kind.name for kind in FIGURES if kind.applies(View(periodic))]
    assert "signal" in applying
    assert "margin" not in applying


def test_axes_with_decades_in_them_are_logarithmic(whole: ReportedRun, periodic: ReportedRun) -> None:
    scales = {}
    view = View(whole, (periodic,))
    for kind in FIGURES:
        figure = Figure()
        if kind.applies(view):
            kind.draw(view, figure, LIGHT)
        scales[kind.name] = {axes.get_yscale() for axes in figure.axes}
    assert scales["margin"] == scales["intervals"] == {"log"}
    assert scales["overview"] == {"log", "linear"}
    assert scales["attitude"] == scales["torque"] == scales["bytes"] == {"linear"}


def test_every_triggering_instant_that_a_pixel_can_show_has_a_stroke(whole: ReportedRun, periodic: ReportedRun) -> None:
    figure = Figure()
    next(kind for kind in FIGURES if kind.name == "raster").draw(View(whole, (periodic,)), figure, LIGHT)
    strokes = [len(lines.get_segments()) for lines in figure.axes[0].collections]  # type: ignore[attr-defined]
    # A quarter of a second apart, ten instants share a pixel of 1000 s; no two of these do.
    assert strokes == [whole.summary.triggers["/sensor"].count, 1000]


def test_a_run_that_ended_early_is_said_to_have(whole: ReportedRun) -> None:
    first, samples = whole.recording.truth["/plant"][0]
    cut = replace(whole, recording=replace(whole.recording, truth={"/plant": [(first, samples)]}))
    assert tables.remarks(View(whole)) == ()
    (remark,) = tables.remarks(View(cut))
    assert f"{(samples.shape[0] - 1) / 32:g} s of 1000 s" in remark
    assert View(cut).paper_baseline is None


def test_identity_tells_how_to_run_it_again(folder: Path) -> None:
    view = View(read_run(folder / "run_2026_01_02"), (read_run(folder / "baseline"),))
    table = tables.identity_table(view)
    assert cells(table, "overrides")["this run"] == "duration_s=200"
    assert cells(table, "variant") == {"": "variant", "this run": "none", "baseline (periodic)": "periodic"}
    assert cells(table, "seed")["this run"] == "1"
    assert cells(table, "engine")["this run"] == "inprocess"
    assert cells(table, "digest")["this run"] == load("wu2018", None, ["duration_s=200"]).digest


def test_text_from_a_scenario_cannot_become_markup(tmp_path: Path) -> None:
    bag = record(tmp_path / "bag", 'title="<script>1</script> & more"', "duration_s=5")
    text = page(View(read_run(bag)), [])
    assert text.count("<script") == 3  # the page's own: data, plotly, what draws
    assert "&lt;script&gt;1&lt;/script&gt; &amp; more" in text
