"""Few open files, little memory, a closed output: said in the project's form, or of no consequence."""

from __future__ import annotations

import errno
import os
import resource
import subprocess
import sys
from pathlib import Path

import pytest

from etac_ros.bag.read import read_bag
from etac_ros.engines.ros.limits import enough_files, refused_by_system
from etac_ros.errors import RunError

LIMIT_S = 90


def etac_in_shell(before: str, after: str, folder: Path) -> subprocess.CompletedProcess[str]:
    return subprocess.run(
        ["sh", "-c", f'{before} exec "{sys.executable}" -m etac_ros {after}'],
        cwd=folder,
        env={**os.environ, "PYTHONPATH": os.pathsep.join(sys.path)},
        capture_output=True,
        text=True,
        timeout=LIMIT_S,
        check=False,
    )


def test_too_few_open_files_are_named_before_anything_starts(tmp_path: Path) -> None:
    done = etac_in_shell("ulimit -n 64;", "run xie2021 --set duration_s=1 --bag bag", tmp_path)
    assert done.returncode == 1
    assert "limit of open files (64): is too low for a run of 18 processes" in done.stderr
    assert "ulimit -n 1024" in done.stderr
    assert not (tmp_path / "bag").exists()


def test_a_soft_limit_is_raised_while_processes_start() -> None:
    soft, hard = resource.getrlimit(resource.RLIMIT_NOFILE)
    low = len(os.listdir("/proc/self/fd")) + 30
    resource.setrlimit(resource.RLIMIT_NOFILE, (low, hard))
    try:
        with enough_files(20):
            assert resource.getrlimit(resource.RLIMIT_NOFILE)[0] > low
        assert resource.getrlimit(resource.RLIMIT_NOFILE)[0] == low
    finally:
        resource.setrlimit(resource.RLIMIT_NOFILE, (soft, hard))


def test_too_little_memory_is_named(tmp_path: Path) -> None:
    done = etac_in_shell("ulimit -v 300000;", "run wu2018 --set duration_s=1 --bag bag", tmp_path)
    assert done.returncode == 1
    assert "memory is limited to 292 MiB (ulimit -v)" in done.stderr
    assert "Traceback" not in done.stderr


@pytest.mark.parametrize(
    ("error", "found"),
    [
        (OSError(errno.EMFILE, "Too many open files"), "no more files can be opened"),
        (OSError(errno.EAGAIN, "Resource temporarily unavailable"), "no more processes or threads"),
        (MemoryError(), "no memory is left"),
        (RuntimeError("pthread_create failed: Resource temporarily unavailable"), "no more processes or threads"),
        (RuntimeError("std::bad_alloc"), "no memory is left"),
    ],
)
def test_what_the_system_refuses_is_told(error: Exception, found: str) -> None:
    refused = refused_by_system(error, "starting node /sensor")
    assert isinstance(refused, RunError)
    assert "starting node /sensor" in str(refused)
    assert found in str(refused)


def test_other_errors_are_left_alone() -> None:
    assert refused_by_system(ValueError("no"), "x") is None
    assert refused_by_system(FileNotFoundError(errno.ENOENT, "no"), "x") is None


def test_a_closed_output_costs_only_what_would_have_been_shown(tmp_path: Path) -> None:
    done = etac_in_shell("exec >&-;", "run wu2018 --set duration_s=20 --bag bag", tmp_path)
    assert done.returncode == 0, done.stderr
    assert done.stderr == "etac: standard output is closed: nothing of what is found can be shown\n"
    assert read_bag(tmp_path / "bag").recording().messages["filtered_error"]
