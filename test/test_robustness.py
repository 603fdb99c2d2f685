"""Maps of loss and delay: what is varied, what holds, and what the page says."""

from __future__ import annotations

from pathlib import Path

import pytest
from typer.testing import CliRunner

from etac_ros.cli.main import app
from etac_ros.errors import ScenarioError
from etac_ros.robustness.crowd import at_rate, crowd
from etac_ros.robustness.grid import Cell, Map, robustness, with_channel
from etac_ros.robustness.retransmission import retransmission
from etac_ros.robustness.write import crowd_table
from etac_ros.runs import simulate
from etac_ros.scenario.load import load


def test_every_network_link_gets_the_channel_and_no_other() -> None:
    graph = with_channel(load("qi2022", "radio"), 0.2, 0.12).build()
    changed = {name: (link.channel.loss, link.channel.delay_ticks, link.medium) for name, link in graph.links.items()}
    assert changed.pop("relative") == (0.2, 3, "")  # 0.12 s on a grid of 0.05 s
    assert set(changed.values()) == {(0.0, 0, "")}
    assert graph.media == {}


def test_cells_are_runs_of_their_own_and_what_holds_is_measured_by_the_ideal_run() -> None:
    found = robustness("wu2018", [0.4], [1.0], 3.0, ["duration_s=400"])
    assert (found.losses, found.delays_s) == ((0.0, 0.4), (0.0, 1.0))
    assert [which.variant for which in found.maps] == ["event-triggered", "periodic"]
    events, periodic = found.maps
    alone = simulate(with_channel(load("wu2018", None, ["duration_s=400"]), 0.4, 1.0)).summary
    cell, ideal = events.at(0.4, 1.0), events.at(0.0, 0.0)
    assert cell.messages == alone.network.messages
    assert cell.error_deg == alone.performance["/plant"].max_attitude_error_deg
    assert cell.error_deg is not None
    assert ideal.error_deg is not None
    assert ideal.holds
    assert cell.holds == (cell.error_deg <= 3.0 * ideal.error_deg)
    # A loop that speaks once a second bears losses that one which speaks only when it must does not.
    assert periodic.at(0.4, 0.0).holds
    assert not events.at(0.4, 0.0).holds


def test_acknowledgements_cost_bytes_and_bear_losses() -> None:
    found = retransmission("wu2018", [0.0, 0.4], 3.0, ["duration_s=400"])
    assert [(one.loss, one.acknowledged) for one in found] == [(0.0, False), (0.0, True), (0.4, False), (0.4, True)]
    ideal, told, lossy, again = found
    # Without a loss each message costs one more frame, an Imm-Ack of 11 bytes, and nothing is sent again.
    assert (told.again, told.acknowledgements) == (0, told.messages)
    assert ideal.air_bytes == 29 * ideal.messages
    assert told.air_bytes == (29 + 11) * told.messages
    assert (lossy.holds, again.holds) == (False, True)
    assert again.air_bytes == 29 * (again.messages + again.again) + 11 * again.acknowledgements
    assert lossy.delivered == pytest.approx(0.6, abs=0.1)
    assert again.delivered > 0.9


def test_a_scenario_without_a_radio_has_no_cost_of_it(tmp_path: Path) -> None:
    path = tmp_path / "plain.yaml"
    path.write_text(load("wu2018").text, encoding="utf-8")
    assert retransmission(str(path), [0.0], 3.0) == ()
    assert crowd(str(path), [4], 3.0) == ()


def test_a_formation_breaks_where_the_medium_cannot_carry_it() -> None:
    found = crowd("xie2021", [4, 5], 3.0, ["duration_s=2", "steady_from_s=0.0"])
    assert [(one.loop, one.spacecraft) for one in found] == [
        ("event-triggered", 4), ("event-triggered", 5), ("periodic", 4), ("periodic", 5),
    ]  # fmt: skip
    for one in found:
        assert one.holds == (one.slowest_bit_s is not None)
        assert one.error_deg is not None
        assert one.frames >= one.messages * 0.9
    words = crowd_table("xie2021", found).notes[0]
    assert words.startswith("At 250 kbit/s, the event-triggered loop")


def test_slower_media_have_longer_slots() -> None:
    slow = at_rate(load("xie2021", "radio"), 4).run.media["air"]
    assert (slow.rate_bit_s, slow.access["slot_s"]) == (62_500.0, 4 * 320.0e-6)


def test_how_far_a_loop_holds_ends_at_the_first_run_that_does_not() -> None:
    def cell(loss: float, delay: float, holds: bool) -> Cell:
        return Cell(loss, delay, 1, 0.1, "", holds)

    cells = (
        cell(0.0, 0.0, True),
        cell(0.1, 0.0, True),
        cell(0.2, 0.0, False),
        cell(0.3, 0.0, True),
        cell(0.0, 1.0, False),
    )
    assert Map("x", cells).furthest_loss() == 0.1
    assert Map("x", cells).furthest_delay() == 0.0
    assert Map("x", (cell(0.0, 0.0, False),)).furthest_loss() is None


def test_the_command_shows_the_maps_and_writes_them(tmp_path: Path) -> None:
    page = tmp_path / "networks.md"
    arguments = [
        "robustness",
        "qi2022",
        "--losses",
        "0.5",
        "--delays",
        "0",
        "--set",
        "duration_s=5",
        "--write",
        str(page),
    ]
    done = CliRunner().invoke(app, arguments)
    assert done.exit_code == 0, done.output
    text = page.read_text(encoding="utf-8")
    for words in ("qi2022, event-triggered", "qi2022, periodic", "How far each loop holds", "qi2022 on its radio"):
        assert words in done.output
        assert f"# {words}" in text
    picture = (tmp_path / "networks_qi2022.png").read_bytes()
    assert picture.startswith(b"\x89PNG")
    assert "](networks_qi2022.png)" in text
    found = robustness("qi2022", [0.5], [0.0], 3.0, ["duration_s=5"])
    assert f"| 0.5 | {found.maps[0].at(0.5, 0.0).messages:,}; " in text


@pytest.mark.parametrize(("losses", "delays", "words"), [([1.0], [0.0], "--losses"), ([0.0], [-1.0], "--delays")])
def test_a_grid_that_is_none(losses: list[float], delays: list[float], words: str) -> None:
    with pytest.raises(ScenarioError, match=words):
        robustness("wu2018", losses, delays, 3.0)


def test_numbers_that_are_none_are_refused_by_the_command(tmp_path: Path) -> None:
    done = CliRunner().invoke(app, ["robustness", "wu2018", "--losses", "many"])
    assert done.exit_code != 0
