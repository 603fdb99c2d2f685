"""An opponent edits copies of the scenarios so that more is reproduced; no verdict and no headline becomes better."""

from __future__ import annotations

import re
from collections.abc import Callable, Sequence
from functools import cache
from pathlib import Path

import pytest
import yaml

from etac_ros.errors import ScenarioError
from etac_ros.metrics.verdict import Verdict
from etac_ros.reproduce.headline import headline
from etac_ros.reproduce.rows import Baselines, Row, rows_of
from etac_ros.scenario.load import load
from etac_ros.scenario.places import find
from etac_ros.scenario.schema import FigureKind

WORTH = {Verdict.REPRODUCED: 3, Verdict.KEPT: 3, Verdict.NEAR: 2}
"""All others say nothing for a reading."""


BASELINES: Baselines = {}


def rows(path: str) -> list[Row]:
    return rows_of(load(path), "inprocess", Path(), lambda text: None, BASELINES)


@cache
def honest(name: str) -> tuple[Row, ...]:
    return tuple(rows(str(find(name))))


def edited(name: str, tmp_path: Path, edit: Callable[[dict[str, object]], None]) -> str:
    content = yaml.safe_load(find(name).read_text())
    edit(content["/**"]["ros__parameters"])
    path = tmp_path / f"{name}.yaml"
    path.write_text(yaml.safe_dump(content, sort_keys=False))
    return str(path)


def gains(before: Sequence[Row], after: Sequence[Row]) -> list[str]:
    """What an edit made better."""
    old = {row.key: row for row in before}
    found = [
        f"{row.key}: {old[row.key].verdict if row.key in old else 'nothing'} became {row.verdict}"
        for row in after
        if WORTH.get(row.verdict, 0) > (WORTH.get(old[row.key].verdict, 0) if row.key in old else 0)
    ]
    mine, its = headline(after), headline(before)
    if mine.reproduced > its.reproduced or mine.kept > its.kept or mine.figures < its.figures:
        found.append(f"{its} became {mine}")
    return found


def each(change: Callable[[dict[str, object]], None]) -> Callable[[dict[str, object]], None]:
    """Apply a change to every published figure."""

    def edit(everywhere: dict[str, object]) -> None:
        for one in everywhere["published"].values():  # type: ignore[attr-defined]
            if isinstance(one, dict) and "value" in one:
                change(one)

    return edit


def as_limit(one: dict[str, object]) -> None:
    one.pop("fitted_to", None)
    one["kind"] = "limit"


def as_fitted(one: dict[str, object]) -> None:
    one.pop("kind", None)
    one["fitted_to"] = "something"


def as_independent(one: dict[str, object]) -> None:
    one.pop("fitted_to", None)
    one.pop("kind", None)


def without_measure(one: dict[str, object]) -> None:
    one.pop("measure", None)


def rounder(one: dict[str, object]) -> None:
    one["value"] = f"{float(one['value']):.0e}"  # type: ignore[arg-type]


def own_measure(one: dict[str, object]) -> None:
    if isinstance(one.get("measure"), dict):
        one["measure"]["from_s"] = 700.0  # type: ignore[index]


def wide(everywhere: dict[str, object]) -> None:
    for one in everywhere["dispersion"].values():  # type: ignore[attr-defined]
        one.update({kind: 50.0 * size for kind, size in one.items()})


def easy_figure(everywhere: dict[str, object]) -> None:
    everywhere["published"]["easy"] = {  # type: ignore[index]
        "value": "1e9", "kind": "limit", "measure": {"statistic": "energy_n2m2s"},
    }  # fmt: skip


TRICKS = {
    "every figure is a limit": each(as_limit),
    "every figure is fitted": each(as_fitted),
    "no figure is fitted or constructed": each(as_independent),
    "no figure has a measure": each(without_measure),
    "figures are rounded": each(rounder),
    "figures are measured where it is quiet": each(own_measure),
    "starts are dispersed more": wide,
    "a figure that is always met": easy_figure,
}


@pytest.mark.parametrize("name", ["flexible", "shi2022"])
@pytest.mark.parametrize("trick", TRICKS.values(), ids=TRICKS)
def test_no_trick_makes_anything_better(name: str, trick: Callable[[dict[str, object]], None], tmp_path: Path) -> None:
    assert {row.verdict for row in honest(name)} & {Verdict.NOT_REPRODUCED, Verdict.NOT_KEPT}  # there is a motive
    assert gains(honest(name), rows(edited(name, tmp_path, trick))) == []


def test_a_small_change_of_the_run_frees_no_figure(tmp_path: Path) -> None:
    def edit(everywhere: dict[str, object]) -> None:
        each(as_limit)(everywhere)
        everywhere["seed"] = 2

    assert gains(honest("shi2022"), rows(edited("shi2022", tmp_path, edit))) == []


@pytest.mark.parametrize("band", [{"low": 0.0, "high": 1.0e9}, {"low": 0.0}])
def test_no_band_can_be_typed(band: dict[str, float], tmp_path: Path) -> None:
    path = edited("flexible", tmp_path, each(lambda one: one.update(band)))
    with pytest.raises(ScenarioError, match="unknown key"):
        load(path)


def test_another_reading_of_the_same_figure_does_not_count_again() -> None:
    found = honest("flexible")
    again = [Row(**{**vars(row), "variant": "another"}) for row in found]
    assert headline([*found, *again]).figures == headline(found).figures
    assert headline([*found, *again]).limits == headline(found).limits


def test_what_follows_from_a_fitted_count_does_not_count() -> None:
    one, other = honest("wu2018")[0], honest("wu2018")[-1]
    assert (one.paper.kind, other.key.name) == (FigureKind.FITTED, "reduction_percent")
    percentage = other.paper.model_copy(update={"kind": FigureKind.PERCENTAGE, "fitted_to": ""})
    assert headline([one, Row(**{**vars(other), "paper": percentage})]).figures == 0


def test_related_figures_have_the_worst_verdict_of_them() -> None:
    figures = [row for row in honest("wu2018") if row.paper.kind is FigureKind.FITTED]
    free = [row.paper.model_copy(update={"kind": FigureKind.COUNT, "fitted_to": ""}) for row in figures]
    verdicts = (Verdict.REPRODUCED, Verdict.NOT_REPRODUCED, Verdict.REPRODUCED)
    made = [
        Row(**{**vars(row), "paper": paper, "judgement": type(row.judgement)(verdict, None, None)})
        for row, paper, verdict in zip(figures, free, verdicts, strict=True)
    ]
    assert (headline(made).figures, headline(made).reproduced) == (1, 0)
    assert re.match("0 of 1 independent figures reproduced", str(headline(made)))
