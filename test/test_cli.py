"""The command line: exit codes, and errors that say what to do before anything has started."""

from __future__ import annotations

import os
import subprocess
import sys
from pathlib import Path

import pytest
import yaml


def etac(*arguments: str, cwd: Path) -> subprocess.CompletedProcess[str]:
    """Run ``etac`` in a folder."""
    environment = {**os.environ, "PYTHONPATH": os.pathsep.join(str(Path(p).resolve()) for p in sys.path if p)}
    return subprocess.run(
        [sys.executable, "-m", "etac_ros", *arguments],
        cwd=cwd,
        env=environment,
        capture_output=True,
        text=True,
        timeout=120,
        check=False,
    )


@pytest.mark.parametrize(
    ("arguments", "said"),
    [
        (["run", "wu2019"], ["wu2019", "'wu2018'?"]),
        (["run", "wu2018", "--variant", "perodic"], ["perodic", "'periodic'?"]),
        (["run", "wu2018", "--set", "sensor.triger.alpha=0.4"], ["triger", "'trigger'?"]),
        (["run", "wu2018", "--set", "sensor.trigger.alpha=1.5"], ["sensor.trigger.alpha", "1.5"]),
        (["run", "wu2018", "--set", "duration_s=1.01"], ["duration_s", "1.03125"]),
        (["run", "wu2018", "--set", "alpha"], ["--set alpha", "key=value"]),
        (
            ["run", "wu2018", "--set", "windows={first: 9, longest: 3}"],
            ["windows", "no longer than the longest"],
        ),
    ],
)
def test_bad_input_starts_nothing(arguments: list[str], said: list[str], tmp_path: Path) -> None:
    done = etac(*arguments, cwd=tmp_path)
    assert done.returncode == 2
    for words in said:
        assert words in done.stderr
    assert "Traceback" not in done.stderr
    assert not list(tmp_path.iterdir())


def test_existing_bag_is_never_touched(tmp_path: Path) -> None:
    (tmp_path / "mine").mkdir()
    done = etac("run", "wu2018", "--bag", "mine", cwd=tmp_path)
    assert done.returncode == 1
    assert "mine" in done.stderr
    assert not list((tmp_path / "mine").iterdir())


def test_unwritable_bag(tmp_path: Path) -> None:
    (tmp_path / "file").write_text("")
    done = etac("run", "wu2018", "--bag", "file/bag", cwd=tmp_path)
    assert done.returncode == 1
    assert "file" in done.stderr


def test_run_info_resolve(tmp_path: Path) -> None:
    done = etac("run", "wu2018", "--set", "duration_s=50", "--bag", "bag", cwd=tmp_path)
    assert done.returncode == 0, done.stderr
    assert "/filtered_error" in done.stdout
    info = etac("info", "bag", cwd=tmp_path)
    assert info.returncode == 0
    assert "/torque_command" in info.stdout
    resolved = etac("resolve", "wu2018", "--variant", "periodic", "--set", "seed=9", cwd=tmp_path)
    content = yaml.safe_load(resolved.stdout)
    assert content["/**"]["ros__parameters"]["seed"] == 9
    assert content["/sensor"]["ros__parameters"]["trigger"]["period_s"] == 1.0


def test_baseline_runs_over_the_same_graph(tmp_path: Path) -> None:
    done = etac("run", "wu2018", "--baseline", "--bag", "bag", cwd=tmp_path)
    assert done.returncode == 0, done.stderr
    assert "24,000" in done.stdout
    info = etac("info", "bag_periodic", cwd=tmp_path)
    assert "1,000" in info.stdout


def test_list(tmp_path: Path) -> None:
    done = etac("list", cwd=tmp_path)
    assert "wu2018" in done.stdout
    assert "periodic" in done.stdout


def test_no_such_bag(tmp_path: Path) -> None:
    for command in ("info", "recover", "report"):
        done = etac(command, "nothing", cwd=tmp_path)
        assert done.returncode == 1
        assert "nothing" in done.stderr
        assert "Traceback" not in done.stderr
