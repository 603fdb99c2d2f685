"""When faults had a node down is shaded in every figure over time, and said in words."""

from __future__ import annotations

from dataclasses import replace
from fractions import Fraction
from pathlib import Path

import pytest
from matplotlib.figure import Figure

from etac_ros.graph.faults import FaultKind
from etac_ros.maths.wall_clock import WallClock
from etac_ros.report.figures.downtime import MARK, downtimes
from etac_ros.report.figures.registry import FIGURES
from etac_ros.report.figures.style import LIGHT
from etac_ros.report.interactive import spec
from etac_ros.report.source import read_run
from etac_ros.report.view import View
from etac_ros.runs import run_in_process
from etac_ros.scenario.load import load

FAULTS = [
    "faults.hang={at_s: 10.0, node: /sensor, do: stall, for_s: 5.0}",
    "faults.end={at_s: 50.0, node: /controller, do: kill}",
]


@pytest.fixture(scope="module")
def view(tmp_path_factory: pytest.TempPathFactory) -> View:
    bag = tmp_path_factory.mktemp("faults") / "bag"
    run_in_process(load("wu2018", None, ["duration_s=60", *FAULTS]), bag)
    return View(read_run(bag))


@pytest.mark.parametrize("name", ["overview", "attitude", "intervals", "network"])
def test_figures_over_time_are_shaded(view: View, name: str) -> None:
    kind = next(kind for kind in FIGURES if kind.name == name)
    figure = Figure(figsize=kind.size_in(view))
    kind.draw(view, figure, LIGHT)
    for axes in figure.axes:
        low, high = axes.get_xlim()
        wanted = [(max(low, 10.0), 15.0), (50.0, 60.0)] if kind.over_time else []
        spans = [patch.get_extents().transformed(axes.transData.inverted()) for patch in axes.patches]
        found = [(span.x0, span.x1) for span, patch in zip(spans, axes.patches, strict=True) if patch.get_gid() == MARK]
        assert found == [pytest.approx(span) for span in wanted if span[1] > low and span[0] < high]
    if kind.over_time:
        told = spec(figure)
        assert told is not None
        assert [len(axes["spans"]) for axes in told["axes"]] == [len(axes.patches) for axes in figure.axes]
    said = " Shaded: hang (stall of /sensor, from 10 s to 15 s), end (kill of /controller, from 50 s on)."
    assert kind.words(view).endswith(said) is kind.over_time


def test_a_run_without_faults_says_nothing_of_them(view: View, tmp_path: Path) -> None:
    assert len(downtimes(view)) == 2
    run_in_process(load("wu2018", None, ["duration_s=20"]), tmp_path / "bag")
    alone = View(read_run(tmp_path / "bag"))
    assert downtimes(alone) == []
    assert not any("Shaded" in kind.words(alone) for kind in FIGURES if kind.applies(alone))


def test_who_died_on_the_way_back_is_shaded_until_then(view: View) -> None:
    """In real time the first restart had not come back when the second fault began; the second one has."""
    hang, end = view.run.summary.faults.values()
    first = end.model_copy(update={"do": FaultKind.RESTART, "at_s": 20.0, "until_s": 25.0})
    second = first.model_copy(update={"at_s": 30.0, "until_s": 35.0, "joined_s": 36.0})
    summary = view.run.summary.model_copy(update={"faults": {"hang": hang, "first": first, "second": second}})
    recording = replace(view.run.recording, wall=WallClock(0, 32, Fraction(1)))
    found = downtimes(View(replace(view.run, summary=summary, recording=recording)))
    assert [one[:2] for one in found] == [(10.0, 15.0), (20.0, 30.0), (30.0, 36.0)]
    assert "first (restart of /controller, from 20 s to 30 s)" in [one.words for one in found]
