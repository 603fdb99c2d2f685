"""The stored sweeps: the spread of every published figure over dispersed starts, made once and read by all tables.

The file ``stored.json`` lies beside this module; ``etac reproduce --bands`` makes it.
"""

from __future__ import annotations

import json
from collections.abc import Mapping
from functools import cache
from importlib.resources import files
from typing import Any

from pydantic import BaseModel, ConfigDict, Field

from etac_ros.metrics.verdict import Spread
from etac_ros.scenario.load import Scenario
from etac_ros.scenario.schema import FigureKind, PublishedFigure

FILE = "stored.json"


class _Model(BaseModel):
    model_config = ConfigDict(defer_build=True, extra="forbid", frozen=True)


class StoredFigure(_Model):
    """A published figure as it was declared when the sweep ran, and its spread."""

    printed: str
    kind: FigureKind
    measure: dict[str, Any] | None
    spread: Spread | None = Field(description="null where no run has the figure")


class StoredSweep(_Model):
    """The dispersed runs of one scenario or variant.

    Attributes
    ----------
    digest
        Of everything that bears on the undispersed run: :attr:`Scenario.content_digest`.
    baseline
        The same of its baseline; None where it has none.
    dispersions
        What each run drew, by NODE.KEY.
    probe
        Numbers of the first ticks of the undispersed run: they change when the code behind them does.
    """

    scenario: str
    variant: str | None
    digest: str
    baseline: str | None
    seed: int
    runs: int
    dispersions: dict[str, dict[str, float]]
    probe: list[float]
    figures: dict[str, StoredFigure]


class Stored(_Model):
    """The file: what all sweeps have in common, and the sweeps."""

    format: int = 1
    made_by: str
    dispersion: str = Field(description="the one size, in words, with its reason")
    versions: dict[str, str]
    sweeps: list[StoredSweep]


@cache
def stored() -> Stored | None:
    """The stored sweeps of this installation; None if there are none."""
    place = files(__package__) / FILE
    return Stored.model_validate(json.loads(place.read_text(encoding="utf-8"))) if place.is_file() else None


@cache
def _by_digest() -> Mapping[str, StoredSweep]:
    found = stored()
    return {} if found is None else {one.digest: one for one in found.sweeps}


@cache
def _by_name() -> Mapping[tuple[str, str | None], StoredSweep]:
    found = stored()
    return {} if found is None else {(one.scenario, one.variant): one for one in found.sweeps}


def stored_sweep(scenario: Scenario) -> StoredSweep | None:
    """The dispersed runs of a scenario; failing these, those of the one with its name. None if there are none.

    Whoever takes a spread from it compares the digest first; how figures are declared is compared with either, so that
    no small change of a scenario frees it from what its figures were declared to be.
    """
    return _by_digest().get(scenario.content_digest) or _by_name().get((scenario.name, scenario.variant))


def declared(figure: PublishedFigure, name: str, spread: Spread | None = None) -> StoredFigure:
    """How a figure is declared, under the name of what it stands beside."""
    measure = None if figure.measure is None else figure.measure.model_dump(mode="json", exclude_none=True)
    return StoredFigure(printed=figure.printed, kind=figure.kind_as(name), measure=measure, spread=spread)


def differs(here: StoredFigure, there: StoredFigure) -> str:
    """In what a figure is declared otherwise than when its spread was stored; empty if in nothing."""
    return ", ".join(
        f"{name} is {_shown(mine)}, and was {_shown(its)}"
        for name in ("printed", "kind", "measure")
        if (mine := getattr(here, name)) != (its := getattr(there, name))
    )


def _shown(value: object) -> str:
    return "none" if value is None else str(value)
