"""What a sweep is, as plain data: kept inside its result, and compared before a sweep goes on."""

from __future__ import annotations

import platform
from collections.abc import Mapping
from typing import Any

import numba
import numpy as np
import pyarrow as pa
import scipy

from etac_ros import __version__
from etac_ros.errors import ScenarioError
from etac_ros.metrics.published import stands_beside_paper
from etac_ros.metrics.summary import published_values
from etac_ros.scenario.document import shown
from etac_ros.scenario.load import Scenario
from etac_ros.sweep.plan import Plan

Description = Mapping[str, Any]

FORMAT = 3
_MUST_AGREE = ("scenario", "variant", "version", "fixed", "points", "dispersions", "runs", "seed", "digests")
_WORDS = {
    "digests": "the scenario itself, or the code of its classes",
    "runs": "--runs",
    "fixed": "--set",
    "points": "--set with several values",
}


def describe(plan: Plan) -> dict[str, Any]:
    """All that bears on the rows of a sweep, and what their reader needs; ready for JSON.

    ``scenario_text`` is the complete parameter file at the first grid point; ``points`` say in what the others differ.
    """
    first = plan.scenario
    return {
        "format": FORMAT,
        "scenario": first.name,
        "title": first.run.title,
        "variant": first.variant,
        "version": __version__,
        "fixed": list(plan.fixed),
        "dispersions": {key: one.model_dump(mode="json", exclude_none=True) for key, one in plan.dispersions.items()},
        "runs": plan.runs,
        "seed": plan.seed,
        "digests": [point.scenario.digest for point in plan.points],
        "points": [dict(point.values) for point in plan.points],
        "sensors": list(plan.sensors),
        "event_triggered": [name for name, by_events in plan.sensors.items() if by_events],
        "published": [_published(point.scenario) for point in plan.points],
        "source": first.run.published.source or "paper",
        "ticks_per_second": first.run.ticks_per_second,
        "scenario_text": first.text,
        "versions": {
            "python": platform.python_version(),
            "numpy": np.__version__,
            "scipy": scipy.__version__,
            "numba": numba.__version__,
            "pyarrow": pa.__version__,
        },
    }


def _published(scenario: Scenario) -> dict[str, Any]:
    """The figures of the paper by column, where they stand beside runs of this scenario."""
    if stands_beside_paper(scenario) is not None:
        return {}
    return {
        str(key): figure.model_dump(mode="json") for key, figure in published_values(scenario, scenario.build()).items()
    }


def check_same(mine: Description, found: Description, where: str) -> None:
    """Refuse to go on with the rows of another sweep.

    Raises
    ------
    ScenarioError
        Saying in what they differ.
    """
    differing = [key for key in _MUST_AGREE if mine[key] != found.get(key)]
    if not differing:
        return
    key = differing[0]
    values = f" ({shown(found.get(key))} there, {shown(mine[key])} here)" if key != "digests" else ""
    names = ", ".join(_WORDS.get(one, one) for one in differing)
    raise ScenarioError(
        where,
        f"holds another sweep; what differs: {names}{values}",
        "the same scenario, options and version to go on with it",
        "another --output, or remove that file",
    )
