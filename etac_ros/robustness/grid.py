"""A scenario run over a grid of losses and delays on all its network links."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace

from etac_ros.errors import ScenarioError
from etac_ros.graph.graph import LinkKind
from etac_ros.metrics.summary import Summary
from etac_ros.runs import simulate, warm_up
from etac_ros.scenario.load import Scenario, load
from etac_ros.scenario.schema import LinkSection

EVENTS = "event-triggered"
PERIODIC = "periodic"
"""Names of the loops; the second is the variant of that name."""


@dataclass(frozen=True)
class Cell:
    """One run.

    Attributes
    ----------
    loss, delay_s
        Of every network link.
    messages
        Over the network.
    error_deg
        Largest attitude error of any plant over the steady part of the run; None of plants without an attitude.
    halted
        Why a watch ended the run; empty otherwise.
    holds
        Whether it went to its end with a steady error of no more than so many times that of the ideal run.
    """

    loss: float
    delay_s: float
    messages: int
    error_deg: float | None
    halted: str
    holds: bool


@dataclass(frozen=True)
class Map:
    """The cells of one variant, by loss and delay."""

    variant: str
    cells: tuple[Cell, ...]

    def at(self, loss: float, delay_s: float) -> Cell:
        """The cell of a loss and a delay."""
        return next(cell for cell in self.cells if (cell.loss, cell.delay_s) == (loss, delay_s))

    def furthest_loss(self) -> float | None:
        """The largest loss without delay up to which every run holds; None if none does."""
        return _last_that_holds([(cell.loss, cell.holds) for cell in self.cells if cell.delay_s == 0.0])

    def furthest_delay(self) -> float | None:
        """The largest delay without loss up to which every run holds [s]; None if none does."""
        return _last_that_holds([(cell.delay_s, cell.holds) for cell in self.cells if cell.loss == 0.0])


@dataclass(frozen=True)
class Robustness:
    """A scenario beside its periodic loop."""

    scenario: Scenario
    losses: tuple[float, ...]
    delays_s: tuple[float, ...]
    factor: float
    maps: tuple[Map, ...]


def robustness(
    name: str,
    losses: Sequence[float],
    delays_s: Sequence[float],
    factor: float,
    overrides: Sequence[str] = (),
    tell: Callable[[str], None] = lambda words: None,
) -> Robustness:
    """Run a scenario, and its variant ``periodic`` if it has one, over the grid, in process.

    Parameters
    ----------
    name
        The scenario.
    losses, delays_s
        The grid, in any order; 0 is always among both, as what others are compared with.
    factor
        A run holds while its steady error is no more than so many times that of the ideal run.
    overrides
        As behind ``--set``.
    tell
        Told what runs now.

    Raises
    ------
    ScenarioError
        If it cannot be loaded, has no network link, or a loss or delay is none.
    """
    for loss in losses:
        if not 0.0 <= loss < 1.0:
            raise ScenarioError("--losses", f"found {loss:g}", "probabilities from 0 to less than 1")
    for delay in delays_s:
        if not 0.0 <= delay < float("inf"):
            raise ScenarioError("--delays", f"found {delay:g}", "seconds, 0 or more")
    scenario = load(name, None, overrides)
    if not network_links(scenario):
        raise ScenarioError(str(scenario.path), "no link is of kind network", "one whose losses could matter")
    rows, columns = tuple(sorted({0.0, *losses})), tuple(sorted({0.0, *delays_s}))
    variants = [scenario]
    if PERIODIC in scenario.variants:
        variants.append(load(name, PERIODIC, overrides))
    maps = []
    for variant in variants:
        warm_up(variant)
        ideal = simulate(with_channel(variant, 0.0, 0.0)).summary
        cells = []
        for loss in rows:
            for delay in columns:
                tell(f"{scenario.name} {variant.variant or ''}: loss {loss:g}, delay {delay:g} s")
                summary = ideal if loss == delay == 0.0 else simulate(with_channel(variant, loss, delay)).summary
                cells.append(_cell(loss, delay, summary, ideal, factor))
        maps.append(Map(variant.variant or EVENTS, tuple(cells)))
    return Robustness(scenario, rows, columns, factor, tuple(maps))


def with_channel(scenario: Scenario, loss: float, delay_s: float) -> Scenario:
    """The scenario with this loss and this delay on all its network links, in the place of what they have."""
    links = dict(scenario.run.links)
    for name in network_links(scenario):
        changed = {**links[name].model_dump(by_alias=True), "loss": loss, "delay_ticks": 0, "delay_s": delay_s or None}
        changed |= {"bursts": None, "jitter": None, "medium": None, "acknowledged": None}
        links[name] = LinkSection.model_validate(changed)
    media = {
        name: one for name, one in scenario.run.media.items() if any(link.medium == name for link in links.values())
    }
    return replace(scenario, run=scenario.run.model_copy(update={"links": links, "media": media}))


def network_links(scenario: Scenario) -> list[str]:
    """Names of the links that cross the network."""
    return [name for name, link in scenario.run.links.items() if link.kind is LinkKind.NETWORK]


def _cell(loss: float, delay_s: float, summary: Summary, ideal: Summary, factor: float) -> Cell:
    error = largest_error(summary)
    return Cell(loss, delay_s, summary.network.messages, error, summary.halted, holds(summary, ideal, factor))


def holds(summary: Summary, ideal: Summary, factor: float) -> bool:
    """Whether a run went to its end with a steady error of no more than so many times that of the ideal run."""
    error, usual = largest_error(summary), largest_error(ideal)
    return not summary.halted and (error is None or usual is None or error <= factor * usual)


def largest_error(summary: Summary) -> float | None:
    """Largest attitude error of any plant over the steady part [deg]; None of plants without an attitude."""
    errors = [one.max_attitude_error_deg for one in summary.performance.values()]
    known = [error for error in errors if error is not None]
    return max(known, default=None)


def _last_that_holds(cells: Sequence[tuple[float, bool]]) -> float | None:
    last = None
    for value, holds in sorted(cells):
        if not holds:
            break
        last = value
    return last
