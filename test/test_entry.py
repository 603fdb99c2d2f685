"""How ``etac`` begins and ends: the collector leaves imports alone, and an end loses nothing."""

from __future__ import annotations

import subprocess
import sys
from pathlib import Path

import pytest

ENTRY = "from etac_ros.cli.entry import leave, spare_what_is_imported\n"


def ended(code: str) -> tuple[int, str, str]:
    done = subprocess.run([sys.executable, "-c", ENTRY + code], capture_output=True, text=True, check=False)
    return done.returncode, done.stdout, done.stderr


@pytest.mark.parametrize("collected", ["", "gc.collect()"])
def test_an_end_keeps_what_a_class_has_written_to_a_file_that_it_leaves_open(tmp_path: Path, collected: str) -> None:
    path = tmp_path / "notes.csv"
    code = f"""
import gc
spare_what_is_imported()
class Noting:
    def __init__(self):
        self.me, self.notes = self, open({str(path)!r}, "w")
        self.notes.write("1, 2")
def main():
    noting = Noting()
    {collected}
main()
leave(3)
"""
    assert ended(code) == (3, "", "")
    assert path.read_text() == "1, 2"


@pytest.mark.parametrize(
    ("given", "code", "words"), [("None", 0, ""), ("3", 3, ""), ("256 + 7", 7, ""), ("'no'", 1, "no\n")]
)
def test_an_end_has_the_exit_code_that_python_would_give_it(given: str, code: int, words: str) -> None:
    assert ended(f"leave({given})") == (code, "", words)


def test_an_end_does_what_was_left_for_it_and_keeps_what_was_written() -> None:
    late = "import atexit\natexit.register(print, 'late')\nprint('early')\nleave(0)"
    assert ended(late) == (0, "early\nlate\n", "")


def test_an_end_waits_for_a_thread_that_is_to_be_waited_for() -> None:
    thread = """
import threading
main = threading.main_thread()
def work():
    main.join()  # which has come to its end
    print('done')
threading.Thread(target=work).start()
leave(5)
"""
    assert ended(thread) == (5, "done\n", "")


def test_what_is_imported_is_spared_and_later_garbage_is_not() -> None:
    code = """
import gc, weakref
usual = gc.get_threshold()
class Knot:
    def __init__(self):
        self.me = self
spare_what_is_imported()
assert gc.get_threshold()[0] > 100 * usual[0], gc.get_threshold()
early = weakref.ref(Knot())
kept = [[] for _ in range(gc.get_threshold()[0])]  # as many objects as that begin it
assert early() is not None and gc.get_freeze_count() > len(kept) // 2, gc.get_freeze_count()
assert gc.get_threshold() == usual and not gc.callbacks
late = weakref.ref(Knot())
more = [[] for _ in range(2 * usual[0])]
assert late() is None
"""
    assert ended(code) == (0, "", "")
