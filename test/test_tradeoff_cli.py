"""``etac tradeoff`` on the command line: tables, sentences, page and pictures."""

from __future__ import annotations

from pathlib import Path

import pytest
from test_cli import etac

from etac_ros.scenario.load import load


def short_wu2018(folder: Path, *replacements: tuple[str, str]) -> Path:
    """wu2018 for 150 s, with a few values only."""
    text = load("wu2018").path.read_text()
    start = text.index("    tradeoff:")
    section = """\
    tradeoff:
      curves:
        alpha: {label: "alpha alone", vary: {sensor.trigger.alpha: [0.3, 0.6]}}
      periodic: {variant: periodic, vary: {sensor.trigger.period_s: [1.0, 4.0, 8.0]}}

"""
    text = text[:start] + section + text[text.index("    published:", start) :]
    for old, new in (("duration_s: 1000.0", "duration_s: 150.0"), *replacements):
        assert old in text
        text = text.replace(old, new, 1)
    path = folder / "short.yaml"
    path.write_text(text)
    return path


def test_a_trade_off_its_page_and_its_picture(tmp_path: Path) -> None:
    path = short_wu2018(tmp_path)
    (tmp_path / "docs").mkdir()
    done = etac("tradeoff", str(path), "--runs", "1", "--write", "docs", "--workers", "1", cwd=tmp_path)
    assert done.returncode == 0, done.stderr
    assert sorted(file.name for file in (tmp_path / "docs").iterdir()) == ["tradeoff_wu2018.png", "tradeoffs.md"]
    assert (tmp_path / "docs" / "tradeoff_wu2018.png").read_bytes().startswith(b"\x89PNG")
    page = (tmp_path / "docs" / "tradeoffs.md").read_text()
    assert f"`etac tradeoff {path} --runs 1 --write docs`" in page
    assert "(tradeoff_wu2018.png)" in page
    for words in ("alpha alone", "alpha 0.3", "period 8 s", "At its error, periodic", "Zeno check", "wu2018 eq. (36)"):
        assert words in page
        assert words in done.stdout
    rows = [line for line in page.splitlines() if line.startswith("| alpha alone | alpha ")]
    assert len(rows) == 3  # two points, and the shortest interval
    assert len({line.count("|") for line in rows[:2]}) == 1


def test_the_same_trade_off_is_the_same_page_and_picture(tmp_path: Path) -> None:
    path = short_wu2018(tmp_path)
    (tmp_path / "docs").mkdir()
    found = []
    for workers in ("1", "2"):
        done = etac("tradeoff", str(path), "--runs", "2", "--write", "docs", "--workers", workers, cwd=tmp_path)
        assert done.returncode == 0, done.stderr
        found.append({file.name: file.read_bytes() for file in (tmp_path / "docs").iterdir()})
    assert found[0] == found[1]


@pytest.mark.parametrize(
    ("old", "new", "said"),
    [
        ("{sensor.trigger.alpha:", "{sensor.trigger.alfa:", ["/**.tradeoff.curves.alpha", "alfa", "'alpha'?"]),
        ("[0.3, 0.6]", "[]", ["/**.tradeoff.curves.alpha.vary.sensor.trigger.alpha", "found []"]),
    ],
)
def test_a_mistake_in_the_section_runs_nothing(tmp_path: Path, old: str, new: str, said: list[str]) -> None:
    path = short_wu2018(tmp_path, (old, new))
    (tmp_path / "docs").mkdir()
    done = etac("tradeoff", str(path), "--write", "docs", cwd=tmp_path)
    assert done.returncode == 2
    for words in (str(path), *said):
        assert words in done.stderr
    assert "Traceback" not in done.stderr
    assert not list((tmp_path / "docs").iterdir())


def test_bad_arguments_run_nothing(tmp_path: Path) -> None:
    for arguments, words in (
        (["wu2018", "--write", "nowhere"], "--write nowhere: there is no such folder"),
        (["wu2019"], "'wu2018'?"),
        (["wu2018", "--runs", "0"], "--runs"),
    ):
        done = etac("tradeoff", *arguments, cwd=tmp_path)
        assert done.returncode == 2, arguments
        assert words in done.stderr
