"""The spread of figures over a sweep, and its shortest inter-event time."""

from __future__ import annotations

from typing import Any

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from etac_ros.sweep.bands import Endings, bands, endings, shortest_interval
from etac_ros.sweep.result import SweepResult, result_of

SHORTEST = "min_interval_s"
PAPER = {
    "figure": "triggers",
    "node": None,
    "value": 3.0,
    "printed": "3",
    "kind": "count",
    "fitted_to": "",
    "spread": None,
    "changed": "",
    "label": "",
    "where": "",
    "reason": "",
}
DESCRIPTION: dict[str, Any] = {
    "points": [{"k": 1.0}, {"k": 2.0}],
    "runs": 50,
    "published": [{"triggers": PAPER}, {}],
    "sensors": ["/pm/a", "/pm/b"],
    "event_triggered": ["/pm/b"],
    "ticks_per_second": 20,
}


def row(sample: int, **more: Any) -> dict[str, Any]:
    blank = {"seed": 0, "halted": "", "refused": "", "wall_s": 0.0}
    return {"sample": sample, "run": sample // 2, "point": sample % 2, **blank, **more}


def result(*rows: dict[str, Any]) -> SweepResult:
    return result_of(rows, DESCRIPTION)


@given(st.lists(st.floats(-1e6, 1e6), min_size=1, max_size=40))
def test_statistics_are_those_of_numpy(values: list[float]) -> None:
    found = bands(result(*(row(2 * n, triggers=value) for n, value in enumerate(values))))
    assert len(found) == 1
    band = found[0]
    assert (band.figure, band.point, band.count) == ("triggers", 0, len(values))
    assert band.mean == pytest.approx(np.mean(values), rel=1e-12, abs=1e-9)
    assert band.sd == pytest.approx(np.std(values, ddof=1) if len(values) > 1 else 0.0, rel=1e-9, abs=1e-9)
    assert (band.low, band.high) == (min(values), max(values))
    assert [band.p5, band.p95] == pytest.approx(np.percentile(values, [5, 95]), abs=1e-9)
    assert band.published is not None


def test_points_are_kept_apart_and_what_is_missing_does_not_count() -> None:
    found = bands(
        result(
            row(0, triggers=2.0), row(1, triggers=10.0), row(2, triggers=6.0), row(3, triggers=None), row(4, own=1.0)
        )
    )  # fmt: skip
    assert [(band.figure, band.point, band.count, band.mean) for band in found] == [
        ("triggers", 0, 2, 4.0),
        ("own", 0, 1, 1.0),
        ("triggers", 1, 1, 10.0),
    ]
    assert [band.published is None for band in found] == [False, True, True]


def test_figures_can_be_chosen_and_keys_are_none() -> None:
    made = result(row(0, triggers=2.0, own=1.0, **{"set.k": 1.0, "drawn.x": 3.0}))
    assert made.figures == ("triggers", "own")
    assert [band.figure for band in bands(made, ["own", "run", "nothing"])] == ["own"]


def test_the_shortest_interval_is_that_of_an_event_triggered_module() -> None:
    made = result(
        row(0, **{f"{SHORTEST} /pm/a": 0.05, f"{SHORTEST} /pm/b": 0.5}),
        row(7, **{f"{SHORTEST} /pm/a": 0.05, f"{SHORTEST} /pm/b": 0.15}),
        row(8, **{f"{SHORTEST} /pm/a": 0.05, f"{SHORTEST} /pm/b": None}),
    )
    shortest = shortest_interval(made)
    assert shortest is not None
    assert (shortest.seconds, shortest.ticks, shortest.sample, shortest.run, shortest.point) == (0.15, 3, 7, 3, 1)


def test_no_interval_is_none() -> None:
    assert shortest_interval(result(row(0, **{f"{SHORTEST} /pm/a": 0.05, f"{SHORTEST} /pm/b": None}))) is None
    assert shortest_interval(result(row(0, triggers=1.0))) is None


def test_endings_are_counted_point_by_point() -> None:
    made = result(
        row(0, halted="touched"), row(1, refused="no"), row(2), row(3, refused="no"), row(4, halted="touched")
    )
    assert endings(made) == [Endings(3, 2, 0), Endings(2, 0, 2)]
