"""Numbers that stand in reasons, in the README and in the docs are those that their commands give."""

from __future__ import annotations

import re

import claims
import pytest

from etac_ros.metrics.stored import stored_sweep
from etac_ros.scenario.load import load

ALL, QUOTES = claims.read()
FAST = [claim for claim in ALL if not claim.slow]


@pytest.mark.parametrize("claim", FAST, ids=lambda claim: claim.says)
def test_a_claim_is_what_its_run_gives(claim: claims.Claim) -> None:
    assert claims.faults(claim) == []


@pytest.mark.parametrize("claim", [claim for claim in ALL if claim.slow], ids=lambda claim: claim.says)
def test_a_claim_that_takes_long_stands_where_it_says(claim: claims.Claim) -> None:
    for name in claim.files:
        assert claim.says in claims.flowing((claims.ROOT / name).read_text(encoding="utf-8")), name


@pytest.mark.parametrize("name", [f"config/{path.name}" for path in sorted((claims.ROOT / "config").glob("*.yaml"))])
def test_no_number_stands_in_a_reason_without_a_claim_or_a_source(name: str) -> None:
    assert claims.unfounded(name, ALL, QUOTES[name]) == []


def test_no_number_stands_in_the_readme_without_a_claim_or_a_source() -> None:
    assert claims.unfounded_in_prose("README.md", ALL, QUOTES["README.md"]) == []


def test_a_number_in_prose_without_a_claim_is_found() -> None:
    found = claims.unfounded_in_prose("README.md", [], {})
    assert any("README.md: 210 in" in fault for fault in found)


def test_what_the_readme_says_of_equal_error_stands_on_the_page_of_trades() -> None:
    said = claims.flowing((claims.ROOT / "README.md").read_text(encoding="utf-8"))
    page = (claims.ROOT / "docs" / "tradeoffs.md").read_text(encoding="utf-8")
    of_wu2018 = page[page.index("spacecraft (wu2018)") :]
    needs = re.search(
        r"At its error, periodic needs ([\d.]+) times the bytes \(\S+\) and ([\d.]+) times the", of_wu2018
    )
    stays = re.search(r"smallest error \(\S+\) down to \S+ bytes \(period ([\d.]+) s\)", of_wu2018)
    assert needs is not None
    assert stays is not None
    assert f"holds its error up to {stays[1]} s, so" in said
    assert f"needs only {float(needs[1]):.1f} times the bytes - and {float(needs[2]):.0f} times the energy" in said


def test_a_wrong_number_is_found() -> None:
    right = next(claim for claim in FAST if claim.says == "84 times in 1000 s")
    wrong = claims.Claim(
        right.says.replace("84", "85"), right.files, right.scenario, right.variants, right.overrides, right.gives, False
    )
    found = claims.faults(wrong)
    assert any("does not stand in" in fault for fault in found)
    assert any("says 85, and the run gives 84" in fault for fault in found)


def test_a_number_without_a_claim_is_found() -> None:
    found = claims.unfounded("config/qi2022.yaml", [], QUOTES["config/qi2022.yaml"])
    assert any("12.45" in fault for fault in found)


@pytest.mark.parametrize(
    ("value", "printed", "holds"),
    [(84.0, "84", True), (84.4, "84", True), (84.6, "84", False), (0.0112, "1.1e-2", True), (1999.6, "2,000", True)],
)
def test_a_value_rounds_to_what_is_printed(value: float, printed: str, holds: bool) -> None:
    assert claims.rounds_to(value, printed) == holds


def test_what_is_said_of_all_dispersed_starts_is_so() -> None:
    """shi2022: of a spread without any width, the mean is what each of them gave."""
    scenario = load("shi2022")
    figure = scenario.published["min_interval_s"]
    assert "all dispersed starts have a longer one" in figure.reason
    sweep = stored_sweep(scenario)
    assert sweep is not None
    spread = sweep.figures["min_interval_s"].spread
    assert spread is not None
    assert spread.runs == sweep.runs
    assert spread.sd < 1e-9
    assert spread.mean > figure.value
