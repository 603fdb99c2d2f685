"""Where output goes: narrow character sets, pipes that close, full disks, JSON alone, interrupts before a run."""

from __future__ import annotations

import json
import os
import signal
import subprocess
import sys
from pathlib import Path

import pytest

RUN = ("run", "wu2018", "--engine", "inprocess", "--set", "duration_s=20")


def environment(**more: str) -> dict[str, str]:
    paths = [str(Path(path).resolve()) for path in sys.path if path]
    kept = {key: value for key, value in os.environ.items() if not key.startswith("LC_") and key != "PYTHONUTF8"}
    return {**kept, "PYTHONPATH": os.pathsep.join(paths), **more}


def etac(*arguments: str, cwd: Path, **more: str) -> subprocess.CompletedProcess[bytes]:
    command = [sys.executable, "-m", "etac_ros", *arguments]
    return subprocess.run(command, cwd=cwd, env=environment(**more), capture_output=True, timeout=120, check=False)


@pytest.mark.parametrize(
    "settings",
    [{"LC_ALL": "C"}, {"PYTHONIOENCODING": "ascii"}, {"LC_ALL": "C", "PYTHONCOERCECLOCALE": "0", "PYTHONUTF8": "0"}],
    ids=["C", "ascii", "C and nothing else"],
)
def test_terminals_without_our_letters(settings: dict[str, str], tmp_path: Path) -> None:
    done = etac(*RUN, cwd=tmp_path, **settings)
    assert done.returncode == 0, done.stderr
    assert b"/filtered_error" in done.stdout
    assert not done.stderr


def test_whoever_reads_may_stop_and_the_summary_is_written_all_the_same(tmp_path: Path) -> None:
    command = [sys.executable, "-m", "etac_ros", *RUN, "--json", "summary.json"]
    reading, writing = os.pipe()
    os.close(reading)
    process = subprocess.Popen(command, cwd=tmp_path, env=environment(), stdout=writing, stderr=subprocess.PIPE)
    os.close(writing)
    _, said = process.communicate(timeout=120)
    assert b"Traceback" not in said
    assert b"Exception" not in said
    assert json.loads((tmp_path / "summary.json").read_text())["scenario"] == "wu2018"


@pytest.mark.skipif(not Path("/dev/full").exists(), reason="there is no full device here")
def test_output_that_cannot_be_written_is_said(tmp_path: Path) -> None:
    with Path("/dev/full").open("wb") as full:
        command = [sys.executable, "-m", "etac_ros", "list"]
        done = subprocess.run(
            command, cwd=tmp_path, env=environment(), stdout=full, stderr=subprocess.PIPE, timeout=120, check=False
        )
    assert done.returncode == 1
    assert done.stderr == b"etac: standard output: No space left on device\n"


def test_json_to_standard_output_has_it_for_itself(tmp_path: Path) -> None:
    done = etac(*RUN, "--json", "-", cwd=tmp_path, PYTHONIOENCODING="ascii")
    assert done.returncode == 0, done.stderr
    assert json.loads(done.stdout)["scenario"] == "wu2018"
    assert b"/filtered_error" in done.stderr
    assert not list(tmp_path.iterdir())


def test_json_to_what_cannot_be_written_is_refused_before_the_run(tmp_path: Path) -> None:
    (tmp_path / "folder").mkdir()
    for target, words in (("folder", b"is a directory"), ("none/x.json", b"there is no folder none")):
        done = etac(*RUN, "--json", target, cwd=tmp_path)
        assert done.returncode == 2
        assert done.stderr.startswith(b"etac: --json " + target.encode() + b": " + words)
        assert not done.stdout


IMPORTED = {
    "the commands": ("typer", "list"),
    "a command": ("rich.console", "run wu2018"),
    "what a scenario needs": ("numba", "run wu2018 --engine inprocess"),
}


@pytest.mark.parametrize(("module", "arguments"), IMPORTED.values(), ids=IMPORTED.keys())
def test_an_interrupt_while_importing_leaves_no_traceback(module: str, arguments: str, tmp_path: Path) -> None:
    # An import hook stands for the user: it interrupts where this module is imported.
    code = f"""
import os, runpy, signal, sys
class Interrupt:
    def find_spec(self, name, path=None, target=None):
        if name == {module!r}:
            os.kill(os.getpid(), signal.SIGINT)
sys.meta_path.insert(0, Interrupt())
sys.argv = ["etac", *{arguments.split()!r}]
runpy.run_module("etac_ros", run_name="__main__", alter_sys=True)
"""
    command = [sys.executable, "-c", code]
    done = subprocess.run(
        command, cwd=tmp_path, env=environment(), capture_output=True, text=True, timeout=120, check=False,
        preexec_fn=lambda: signal.signal(signal.SIGINT, signal.default_int_handler),
    )  # fmt: skip
    assert done.returncode == 130, done.stderr
    assert "Traceback" not in done.stderr


def test_codes_of_a_file_do_not_reach_the_terminal(tmp_path: Path) -> None:
    text = '/**: {ros__parameters: {scenario: x, "\\e[31mred": 1}}\n'
    (tmp_path / "evil.yaml").write_text(text)
    for arguments in (
        ("run", "evil.yaml"),
        ("run", "\x1b]0;title\x07.yaml"),
        ("run", "wu2018", "--variant", "\x1b[2J"),
        ("run", "wu2018", "--set", 'sensor.trigger.class="\\e[2J:x"'),
    ):
        done = etac(*arguments, cwd=tmp_path)
        assert done.returncode == 2, done.stderr
        assert b"\x1b" not in done.stderr + done.stdout
        assert b"\\x1b" in done.stderr or b"\\u001b" in done.stderr, done.stderr
