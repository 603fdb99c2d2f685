"""Machine code on disk is that of the function that asks for it, whatever else is written at the same time."""

from __future__ import annotations

import os
import subprocess
import sys
import textwrap
from pathlib import Path

import pytest

from etac_ros.maths.kernel_cache import KernelFiles


def test_two_that_compile_at_the_same_time_get_what_is_their_own(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """Each point at which one process can be interrupted by another: before and behind every change of the folder."""
    replace, done = Path.replace, []

    def interrupted(path: Path, target: Path) -> Path:
        if not done:
            done.append(target)
            KernelFiles(tmp_path, "f", "1").save("other", "code of other")
            replace(path, target)
            KernelFiles(tmp_path, "f", "1").save("third", "code of third")
            return target
        return replace(path, target)

    files = KernelFiles(tmp_path, "f", "1")
    assert files.load("one") is None
    monkeypatch.setattr(Path, "replace", interrupted)
    files.save("one", "code of one")
    found = KernelFiles(tmp_path, "f", "1")
    assert done
    assert [found.load(key) for key in ("one", "other", "third")] == ["code of one", "code of other", "code of third"]


def test_code_of_an_earlier_version_is_never_found_and_goes_with_the_next_save(tmp_path: Path) -> None:
    before, after = KernelFiles(tmp_path, "f", "1"), KernelFiles(tmp_path, "f", "2")
    beside = KernelFiles(tmp_path, "f2", "1")
    before.save("key", "old")
    beside.save("key", "of another function")
    assert after.load("key") is None
    after.save("key", "new")
    assert (before.load("key"), after.load("key"), beside.load("key")) == (None, "new", "of another function")
    assert len(list(tmp_path.iterdir())) == 2


@pytest.mark.parametrize("kept", [0, 1, 40, -1])
def test_a_file_of_which_a_part_is_lost_is_no_code(tmp_path: Path, kept: int) -> None:
    files = KernelFiles(tmp_path, "f", "1")
    files.save("key", "code")
    path = files.path("key")
    path.write_bytes(path.read_bytes()[:kept])
    assert files.load("key") is None
    files.save("key", "code")
    assert files.load("key") == "code"


def test_what_cannot_be_kept_is_compiled_anew_each_time(tmp_path: Path) -> None:
    files = KernelFiles(tmp_path / "gone", "f", "1")
    files.save("key", "code")
    assert files.load("key") is None


def test_names_of_any_length_make_files(tmp_path: Path) -> None:
    long = [KernelFiles(tmp_path, "f" * 400 + end, "1") for end in "ab"]
    for number, files in enumerate(long):
        files.save("key", number)
    assert [files.load("key") for files in long] == [0, 1]


SOURCE = """
import numpy as np
from etac_ros.maths.compiled import kernel

@kernel
def formed(a):
    return a[0] * {factor}
"""

SCRIPT = """
import os, sys
import numpy as np
import own_law
if len(sys.argv) > 1:
    source = open(own_law.__file__).read()
    open(own_law.__file__, "w").write(source.replace("* 0.5", sys.argv[1]))
print(own_law.formed(np.array([8.0])))
"""


def test_what_was_edited_before_its_first_call_is_not_kept_for_what_it_is_now(tmp_path: Path) -> None:
    """As in a notebook: imported, edited, called, and everything anew the next day."""
    (tmp_path / "own_law.py").write_text(textwrap.dedent(SOURCE).format(factor="0.5"))
    environment = {**os.environ, "NUMBA_CACHE_DIR": str(tmp_path / "cache"), "PYTHONPATH": str(tmp_path)}

    def printed(*words: str) -> str:
        command = [sys.executable, "-c", SCRIPT, *words]
        return subprocess.run(command, env=environment, capture_output=True, text=True, check=True).stdout.strip()

    assert printed("* 0.25") == "4.0"
    assert printed() == "2.0"
