"""Make the stored sweeps anew, and say which of them are stale."""

from __future__ import annotations

import platform
from collections.abc import Callable, Sequence
from dataclasses import replace
from pathlib import Path

import numba
import numpy as np
import scipy

from etac_ros import __version__
from etac_ros.engines.inprocess import InProcess
from etac_ros.errors import ScenarioError
from etac_ros.metrics.published import published_figures
from etac_ros.metrics.stored import FILE, Stored, StoredFigure, StoredSweep, declared, differs
from etac_ros.metrics.verdict import Spread
from etac_ros.reproduce.dispersion import REASON, common_dispersions
from etac_ros.reproduce.variants import published_variants, title_of
from etac_ros.scenario.load import Scenario, baseline_of
from etac_ros.sweep.bands import bands
from etac_ros.sweep.plan import make_plan
from etac_ros.sweep.run import sweep, usual_workers
from etac_ros.timing.windows import WindowPolicy

RUNS = 12
"""Of each variant, unless more or fewer are asked for: a standard deviation is then known to 21 %."""
COMMAND = "etac reproduce --bands"
_PROBE_TICKS = 400
_CLOSE = 1.0e-9
"""What two builds of the same formulas may differ in over so few ticks, relative to the largest number."""

Say = Callable[[str], None]


def place() -> Path:
    """Where the stored sweeps lie in this installation."""
    import etac_ros.metrics.stored as module

    return Path(module.__file__).with_name(FILE)


def make(
    names: Sequence[str],
    known: Stored | None,
    runs: int,
    workers: int | None,
    say: Say,
    keep: Callable[[Stored], None],
) -> Stored:
    """Run what is stale or missing, and hand over all that there is after each.

    Parameters
    ----------
    names
        Scenarios; what is stored of others stays as it is.
    known
        What is stored already.
    runs
        Dispersed runs of each variant; stored sweeps of more are kept.
    workers
        Processes; None takes every core.
    say
        Told what is being done.
    keep
        Given the file after each sweep, so that an interrupted command goes on where it was.
    """
    sweeps = [] if known is None else [one for one in known.sweeps if one.scenario not in names]
    before = {(one.scenario, one.variant): one for one in (known.sweeps if known is not None else [])}
    for name in names:
        for scenario in published_variants(name):
            found = before.get((scenario.name, scenario.variant))
            if found is None or found.runs < runs or why_other_runs(scenario, found):
                found = _sweep(scenario, runs, workers, say)
            elif why_stale(scenario, found):
                found = _declared_anew(scenario, found) or _sweep(scenario, runs, workers, say)
            sweeps.append(found)
            rest = [one for one in before.values() if (one.scenario, one.variant) not in _keys(sweeps)]
            keep(_file([*sweeps, *rest]))
    made = _file(sweeps)
    keep(made)
    return made


def _keys(sweeps: Sequence[StoredSweep]) -> set[tuple[str, str | None]]:
    return {(one.scenario, one.variant) for one in sweeps}


def _file(sweeps: Sequence[StoredSweep]) -> Stored:
    versions = {
        "etac_ros": __version__, "python": platform.python_version(), "numpy": np.__version__,
        "scipy": scipy.__version__, "numba": numba.__version__,
    }  # fmt: skip
    ordered = sorted(sweeps, key=lambda one: one.scenario)  # stable: variants stay in the order of their file
    return Stored(made_by=COMMAND, dispersion=REASON, versions=versions, sweeps=ordered)


def write(stored: Stored, path: Path) -> None:
    """Write the file, all at once.

    Raises
    ------
    ScenarioError
        If it cannot be written.
    """
    beside = path.with_name(f".{path.name}.new")
    try:
        beside.write_text(stored.model_dump_json(indent=1) + "\n", encoding="utf-8")
        beside.replace(path)
    except OSError as error:
        raise ScenarioError(
            str(path), f"cannot be written ({error})", "", "run it in a checkout of the source"
        ) from None


def why_stale(scenario: Scenario, found: StoredSweep) -> str:
    """Why a stored sweep is none of this scenario any more; empty if it is.

    Compared are the digest of everything that bears on a run, that of its baseline, the dispersions, what the code
    makes of the first ticks, and how each figure is declared.
    """
    return why_other_runs(scenario, found) or _why_other_figures(scenario, found)


def why_other_runs(scenario: Scenario, found: StoredSweep) -> str:
    """Why its runs would be others; empty if they would not."""
    if found.digest != scenario.content_digest or found.seed != scenario.run.seed:
        return "the scenario has changed"
    baseline = baseline_of(scenario)
    if found.baseline != (None if baseline is None else baseline.content_digest):
        return "its baseline has changed"
    if found.dispersions != _dumped(scenario):
        return "the dispersions have changed"
    now, then = np.array(probe(scenario)), np.array(found.probe)
    if now.shape != then.shape or not np.allclose(now, then, rtol=0.0, atol=_CLOSE * float(np.abs(then).max())):
        return "the code gives other numbers over the first ticks"
    return ""


def _why_other_figures(scenario: Scenario, found: StoredSweep) -> str:
    here = {str(key): declared(one, key.name) for key, one in published_figures(scenario, scenario.build()).items()}
    if here.keys() != found.figures.keys():
        return "other figures are published"
    for key, one in here.items():
        changed = differs(one, found.figures[key])
        if changed:
            return f"{key}: {changed}"
    return ""


def _declared_anew(scenario: Scenario, found: StoredSweep) -> StoredSweep | None:
    """The same runs with figures as they are declared now; None if they do not have one of these."""
    figures: dict[str, StoredFigure] = {}
    for key, one in published_figures(scenario, scenario.build()).items():
        here, there = declared(one, key.name), found.figures.get(str(key))
        if there is None or here.measure != there.measure:
            return None
        figures[str(key)] = here.model_copy(update={"spread": there.spread})
    return found.model_copy(update={"figures": figures})


def probe(scenario: Scenario) -> list[float]:
    """States at the end of the first ticks, and the number of messages of each link: what the code makes of it."""
    graph = scenario.build()
    graph = replace(graph, end_tick=min(graph.end_tick, _PROBE_TICKS))
    recording = InProcess(graph, WindowPolicy(8, 64)).run()
    states = [float(number) for name in graph.plants for number in recording.samples(name)[1][-1]]
    return states + [float(len(recording.messages[name])) for name in graph.links]


def _dumped(scenario: Scenario) -> dict[str, dict[str, float]]:
    return {key: one.model_dump(exclude_none=True) for key, one in common_dispersions(scenario).items()}


def _sweep(scenario: Scenario, runs: int, workers: int | None, say: Say) -> StoredSweep:
    title = title_of(scenario)
    plan = replace(
        make_plan(str(scenario.path), runs, scenario.variant, dispersion=False),
        dispersions=common_dispersions(scenario),
    )
    result = sweep(plan, usual_workers(workers), lambda done, planned: say(f"{title}: {done} of {planned} runs"))
    figures = published_figures(scenario, scenario.build())
    spreads = {
        band.figure: Spread(mean=band.mean, sd=band.sd, p5=band.p5, p95=band.p95, runs=band.count)
        for band in bands(result, [str(key) for key in figures])
    }
    found: dict[str, StoredFigure] = {
        str(key): declared(one, key.name, spreads.get(str(key))) for key, one in figures.items()
    }
    baseline = baseline_of(scenario)
    return StoredSweep(
        scenario=scenario.name,
        variant=scenario.variant,
        digest=scenario.content_digest,
        baseline=None if baseline is None else baseline.content_digest,
        seed=scenario.run.seed,
        runs=runs,
        dispersions=_dumped(scenario),
        probe=probe(scenario),
        figures=found,
    )
