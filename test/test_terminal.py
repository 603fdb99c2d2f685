"""What stands in a terminal: rows stay whole at any width, progress is beside results, interrupts say what is kept."""

from __future__ import annotations

import io
import json
import os
import re
import signal
import subprocess
import sys
from pathlib import Path

import pytest
from rich.console import Console
from typer._completion_classes import BashComplete
from typer.main import get_command

from etac_ros.cli.interrupts import Interrupted, keeping
from etac_ros.cli.listing import list_scenarios, list_variants
from etac_ros.cli.main import app
from etac_ros.cli.outputs import check_output, console_beside
from etac_ros.cli.papers import papers
from etac_ros.cli.progress import lines_now_and_then
from etac_ros.cli.reproduce import reproduce
from etac_ros.cli.run import RunRequest, run_and_show
from etac_ros.cli.show import show_summary
from etac_ros.errors import ScenarioError
from etac_ros.graph.plant import PlantModule
from etac_ros.reproduce.kept import Kept
from etac_ros.reproduce.rows import rows_of
from etac_ros.reproduce.variants import published_variants
from etac_ros.runs import simulate
from etac_ros.scenario.load import load
from etac_ros.tables.table import Row, Table
from etac_ros.tables.terminal import show

WIDTHS = (80, 100, 160)


def terminal(width: int) -> Console:
    return Console(file=io.StringIO(), width=width, force_terminal=True, no_color=True, markup=False, emoji=False)


def lines_of(console: Console) -> list[str]:
    assert isinstance(console.file, io.StringIO)
    return [line.rstrip() for line in re.sub(r"\x1b\[[0-9;]*m", "", console.file.getvalue()).split("\n")]


def request(scenario: str, *overrides: str) -> RunRequest:
    return RunRequest(scenario, None, overrides, "inprocess")


@pytest.mark.parametrize(
    ("scenario", "seconds", "width"), [*(("wu2018", 20, width) for width in WIDTHS), ("xie2021", 1, 80)]
)
def test_no_row_of_a_run_is_wider_than_the_terminal(scenario: str, seconds: int, width: int) -> None:
    console = terminal(width)
    run_and_show(request(scenario, f"duration_s={seconds}"), console)
    lines = lines_of(console)
    assert max(map(len, lines)) <= width
    for name in load(scenario).build().links.values():
        # Each topic's row begins with its whole name, and its numbers stand behind it.
        (row,) = [line for line in lines if line.split()[:1] == [name.topic]]
        assert row.split()[-1].replace(",", "").isdigit()


@pytest.mark.parametrize("width", WIDTHS)
def test_no_text_is_cut_off(width: int) -> None:
    console = terminal(width)
    papers(console)
    list_scenarios(console)
    list_variants("shi2022", console)
    lines = lines_of(console)
    assert max(map(len, lines)) <= width
    assert not [line for line in lines if "…" in line]


def test_a_text_that_is_too_long_alone_goes_on_below_itself() -> None:
    console = terminal(30)
    words = "etac run wu2018 --bag bags/wu2018"
    show(Table("", ("item", "command"), (Row(("equation 1 to 3", words)),), texts=frozenset({"command"})), console)
    lines = lines_of(console)
    assert max(map(len, lines)) <= 30
    assert "".join(line[17:] for line in lines[2:]).replace(" ", "") == words.replace(" ", "")


def test_list_says_what_a_variant_is_and_what_each_changes() -> None:
    console = terminal(100)
    list_scenarios(console)
    assert "A variant is a named set of changes" in " ".join(lines_of(console))
    console = terminal(100)
    list_variants("wu2018", console)
    text = "\n".join(lines_of(console))
    assert "periodic           sensor.trigger.class = etac_ros.triggers.periodic:Periodic" in text
    assert "sensor.trigger.period_s = 1.0" in text
    assert "published" not in text
    with pytest.raises(ScenarioError, match="wu2019"):
        list_variants("wu2019", console)


def test_quiet_shows_nothing(capfd: pytest.CaptureFixture[str], tmp_path: Path) -> None:
    run_and_show(request("wu2018", "duration_s=5"), console_beside(None, quiet=True))
    assert capfd.readouterr() == ("", "")
    assert not list(tmp_path.iterdir())


def test_shell_completion() -> None:
    complete = BashComplete(get_command(app), {}, "etac", "_ETAC_COMPLETE")
    assert [one.value for one in complete.get_completions(["run"], "w")] == ["wu2018"]
    assert [one.value for one in complete.get_completions(["run", "wu2018", "--variant"], "per")] == ["periodic"]
    assert complete.get_completions(["run", "wu2019", "--variant"], "") == []


def test_lines_of_progress_are_few(capfd: pytest.CaptureFixture[str]) -> None:
    times = iter([0.0, 1.0, 5.0, 6.0, 11.0])
    say = lines_now_and_then(False, lambda: next(times), 5.0)
    for step in "abcd":
        say(step)
    assert capfd.readouterr() == ("", "etac: b ...\netac: d ...\n")
    quiet = lines_now_and_then(True, lambda: 0.0, 0.0)
    quiet("a")
    assert capfd.readouterr() == ("", "")


def test_an_interrupt_tells_what_is_kept_in_the_innermost_words() -> None:
    with pytest.raises(Interrupted) as caught, keeping("outer"), keeping(lambda: "inner"):
        raise KeyboardInterrupt
    assert caught.value.kept == "inner"


@pytest.mark.skipif(os.getuid() == 0, reason="root may write anywhere")
def test_a_file_without_leave_to_write_is_refused(tmp_path: Path) -> None:
    (tmp_path / "no").mkdir(mode=0o500)
    with pytest.raises(ScenarioError, match="may not be written to"):
        check_output("--json", tmp_path / "no" / "x.json")


def test_files_that_cannot_be_written_are_refused(tmp_path: Path) -> None:
    for path, words in ((tmp_path, "is a directory"), (tmp_path / "none" / "x", "there is no folder")):
        with pytest.raises(ScenarioError, match=words):
            check_output("--write", path)
        with pytest.raises(ScenarioError, match=words):
            reproduce(["wu2018"], "inprocess", terminal(80), path)
    check_output("--json", Path("-"))


def test_reproduce_goes_on_after_an_interruption(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.chdir(tmp_path)
    short = [load("wu2018", variant, ["duration_s=5"]) for variant in (None, "filtered-noise", "periodic")]
    monkeypatch.setattr("etac_ros.cli.reproduce.published_variants", lambda name: short)
    measured: list[str | None] = []

    def rows(scenario, engine, folder, say, baselines, kept):  # type: ignore[no-untyped-def]
        if kept.of(scenario) is None:
            if len(measured) == 2 and not stood:
                raise KeyboardInterrupt
            measured.append(scenario.variant)
        return rows_of(scenario, engine, folder, say, baselines, kept)

    monkeypatch.setattr("etac_ros.cli.reproduce.rows_of", rows)
    stood = False
    with pytest.raises(Interrupted, match="2 of 3 variants are measured and stand in reproduce/inprocess_"):
        reproduce(["wu2018"], "inprocess", terminal(80))
    assert measured == [None, "filtered-noise"]
    stood = True
    console = terminal(80)
    after = reproduce(["wu2018"], "inprocess", console)
    assert measured == [None, "filtered-noise", "periodic"]
    assert "2 of 3 variants were measured before the last interruption" in " ".join(lines_of(console))
    assert not list(tmp_path.iterdir())
    monkeypatch.setattr("etac_ros.cli.reproduce.rows_of", rows_of)
    assert [(row.key, row.measured) for row in reproduce(["wu2018"], "inprocess", terminal(80))] == [
        (row.key, row.measured) for row in after
    ]


def test_what_is_kept_of_reproduce_is_that_of_the_same_files_only(tmp_path: Path) -> None:
    variants = published_variants("wu2018")[:1]
    kept = Kept(variants, "inprocess", tmp_path)
    kept.add(variants[0], {})
    assert Kept(variants, "inprocess", tmp_path).of(variants[0]) == {}
    changed = [load("wu2018", None, ["seed=77"])]
    assert Kept(variants, "ros", tmp_path).of(variants[0]) is None
    assert Kept(changed, "inprocess", tmp_path).of(changed[0]) is None
    with kept.path.open("a") as file:
        file.write('["wu2018", "per')  # cut off
    assert len(Kept(variants, "inprocess", tmp_path)) == 1
    kept.forget()
    assert not list(tmp_path.glob("*.jsonl"))


def etac(command: str, cwd: Path, wait_for: str = "") -> subprocess.CompletedProcess[str]:
    """Run a shell line in which ETAC is this etac."""
    paths = os.pathsep.join(str(Path(path).resolve()) for path in sys.path if path)
    line = command.replace("ETAC", f"{sys.executable} -m etac_ros")
    return subprocess.run(
        ["bash", "-o", "pipefail", "-c", line], cwd=cwd, env={**os.environ, "PYTHONPATH": paths},
        capture_output=True, text=True, timeout=120, check=False,
    )  # fmt: skip


def test_a_closed_pipe_is_no_failed_run(tmp_path: Path) -> None:
    done = etac("ETAC run wu2018 --engine inprocess --set duration_s=20 --json s.json | true", tmp_path)
    assert (done.returncode, done.stderr) == (0, "")
    assert json.loads((tmp_path / "s.json").read_text())["scenario"] == "wu2018"
    # A verdict stands whoever reads it.
    (tmp_path / "broken.yaml").write_text("/**: {}\n")
    assert etac("ETAC run broken.yaml | true", tmp_path).returncode == 2


def test_an_interrupt_of_a_run_names_its_bag(tmp_path: Path) -> None:
    arguments = ["run", "wu2018", "--variant", "periodic", "--set", "duration_s=1000000", "--bag", "bag"]
    paths = os.pathsep.join(str(Path(path).resolve()) for path in sys.path if path)
    code = f"""
import os, signal, sys
import etac_ros.cli.run as run
from etac_ros.cli.main import main
whole = run.run_over_ros
def interrupted(scenario, bag, options, on_progress, on_start):
    def progress(tick, fired):
        if tick > 100 and not sent:
            sent.append(os.kill(os.getpid(), signal.SIGINT))
    sent = []
    return whole(scenario, bag, options, progress)
run.run_over_ros = interrupted
sys.argv = ["etac", *{arguments!r}]
main()
"""
    done = subprocess.run(
        [sys.executable, "-c", code], cwd=tmp_path, env={**os.environ, "PYTHONPATH": paths}, capture_output=True,
        text=True, timeout=120, check=False,
        preexec_fn=lambda: signal.signal(signal.SIGINT, signal.default_int_handler),
    )  # fmt: skip
    assert done.returncode == 130, done.stderr
    assert "etac: interrupted: what had happened until then is in bag" in done.stderr
    assert "Traceback" not in done.stderr
    assert (tmp_path / "bag" / "metadata.yaml").is_file()


def test_a_run_that_a_watch_ended_says_of_when_its_figures_are(monkeypatch: pytest.MonkeyPatch) -> None:
    """wu2018 takes its steady figures from 600 s on; this one is over before."""
    monkeypatch.setattr(PlantModule, "left_bounds", lambda _, start, rows: "enough" if start + len(rows) > 50 else "")
    scenario = load("wu2018")
    summary = simulate(scenario).summary
    assert summary.halted
    assert 1.0 < summary.ended_s < 600.0 < summary.duration_s
    console = terminal(160)
    show_summary(scenario, summary, console)
    shown = "\n".join(lines_of(console))
    assert "error and rate at the end, * at the end, which comes before 600 s" in shown
    assert "from 600 s on" not in shown
    assert f": {summary.ended_s:g} s simulated in " in shown
