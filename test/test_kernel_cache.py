"""Machine code on disk is that of the function that asks for it, whatever else is written at the same time."""

from __future__ import annotations

import os
import subprocess
import sys
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


def test_code_of_another_version_is_never_found(tmp_path: Path) -> None:
    before, after = KernelFiles(tmp_path, "f", "1"), KernelFiles(tmp_path, "f", "2")
    before.save("key", "old")
    assert after.load("key") is None
    after.save("key", "new")
    assert (before.load("key"), after.load("key")) == ("old", "new")


def test_what_was_not_used_for_longest_goes(tmp_path: Path) -> None:
    beside = KernelFiles(tmp_path, "f2", "1")
    beside.save("key", "of another function")
    versions = [KernelFiles(tmp_path, "f", str(version)) for version in range(40)]
    for age, files in enumerate(versions[:20]):
        files.save("key", age)
        os.utime(files.path("key"), (age, age))
    assert versions[0].load("key") == 0
    for files in versions[20:]:
        files.save("key", "newer")
    assert beside.load("key") == "of another function"
    assert [files.load("key") for files in versions[:20]] == [0, *[None] * 8, *range(9, 20)]


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


def test_what_who_was_killed_has_left_goes_like_the_rest(tmp_path: Path) -> None:
    left = tmp_path / "f.0123.nbcxyz"
    left.write_text("half")
    os.utime(left, (0, 0))
    for version in range(40):
        KernelFiles(tmp_path, "f", str(version)).save("key", version)
    assert not left.exists()


def test_names_of_any_length_make_files(tmp_path: Path) -> None:
    long = [KernelFiles(tmp_path, "f" * 400 + end, "1") for end in "ab"]
    for number, files in enumerate(long):
        files.save("key", number)
    assert [files.load("key") for files in long] == [0, 1]


HELPER = """
import own_constants
from etac_ros.maths.compiled import inlined

@inlined
def scaled(value):
    return value * own_constants.factor
"""

UNKNOWN = """
from numba import float64
from numba.experimental import jitclass
from etac_ros.maths.compiled import kernel

@jitclass([("factor", float64)])
class Law:
    def __init__(self):
        self.factor = {}

@kernel
def formed(a):
    return Law().factor * a[0]
"""

LAW = """
from etac_ros.maths.compiled import kernel
from own_helper import scaled

@kernel
def formed(a):
    return scaled(a[0])
"""

SCRIPT = """
import sys
import numpy as np
import own_constants, own_law
if len(sys.argv) > 1:
    open(own_constants.__file__, "w").write(sys.argv[1])
print(own_law.formed(np.array([8.0])), "numba.np.arraymath" in sys.modules)
"""


def test_code_follows_every_file_that_it_is_made_of_and_what_was_imported_of_it(tmp_path: Path) -> None:
    """Also as in a notebook: imported, edited, called, and everything anew the next day."""
    (tmp_path / "own_helper.py").write_text(HELPER)
    (tmp_path / "own_law.py").write_text(LAW)
    (tmp_path / "own_constants.py").write_text("factor = 0.5\n")
    environment = {**os.environ, "NUMBA_CACHE_DIR": str(tmp_path / "cache"), "PYTHONPATH": str(tmp_path)}

    def printed(*words: str) -> str:
        command = [sys.executable, "-c", SCRIPT, *words]
        return subprocess.run(command, env=environment, capture_output=True, text=True, check=True).stdout.strip()

    assert printed("factor = 0.25\n") == "4.0 True"
    assert printed() == "2.0 True"
    assert printed() == "2.0 False"
    (tmp_path / "own_helper.py").write_text(HELPER.replace("return value", "return 1.0 + value"))
    assert printed() == "3.0 True"


@pytest.mark.slow
def test_what_is_not_known_through_and_through_is_compiled_each_time(tmp_path: Path) -> None:
    for factor in (0.5, 0.25):
        (tmp_path / "own_law.py").write_text(UNKNOWN.format(factor))
        environment = {**os.environ, "NUMBA_CACHE_DIR": str(tmp_path / "cache"), "PYTHONPATH": str(tmp_path)}
        command = [sys.executable, "-c", "import numpy, own_law\nprint(own_law.formed(numpy.array([8.0])))"]
        done = subprocess.run(command, env=environment, capture_output=True, text=True, check=True)
        assert float(done.stdout) == 8.0 * factor
