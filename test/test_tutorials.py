"""The tutorials work as they stand: all commands and pieces of Python run, and what is shown is what comes out."""

from __future__ import annotations

import contextlib
import io
import re
import runpy
import shlex
import shutil
import subprocess
import sys
from pathlib import Path
from typing import Any

import pytest
from typer.testing import CliRunner

from etac_ros.cli.main import BAD_INPUT, FAILED_RUN, app
from etac_ros.engines.ros.domain import DomainLease
from etac_ros.errors import EtacError, ScenarioError

ROOT = Path(__file__).resolve().parent.parent
PAGES = sorted((ROOT / "docs" / "tutorials").glob("*.md"))
BLOCK = re.compile(r"^```(console|python|output)\n(.*?)^```$", re.DOTALL | re.MULTILINE)
EXPECTED_CODE = re.compile(r"# exits with (\d+)")
DOMAIN = "97"
"""The ROS domain that the pages name; the tests put one of their own in its place."""


def assert_shown(expected: list[str], output: str, where: str) -> None:
    """Each line stands in the output, in this order, at the beginning of a line; blanks do not count."""
    lines = iter(" ".join(line.split()) for line in output.splitlines())
    for line in expected:
        wanted = " ".join(line.split())
        if wanted not in ("", "..."):
            assert any(found.startswith(wanted) or (len(wanted.split()) == 1 and wanted in found) for found in lines), (
                f"{where}: '{line}' does not come, or not in this order:\n{output}"
            )


class Reader:
    """Somebody who works through a page, in a copy of the examples."""

    def __init__(self, folder: Path, domain: str) -> None:
        self.folder = folder
        self.domain = domain
        self.names: dict[str, Any] = {}

    def runs(self, command: str) -> tuple[int, str]:
        """Exit code and output of a command; etac and Python in this process, which saves their start."""
        words = shlex.split(command.replace("PYTHONPATH=. ", ""), comments=True)
        if words[0] == "cd":
            self.folder = self.folder / words[1]
            return 0, ""
        with contextlib.chdir(self.folder):
            if words[0] == "etac":
                return self._etac(words[1:])
            if words[0] == "python":
                return 0, self._python(words[1])
            program = {"etac": f"{sys.executable} -m etac_ros", "python": sys.executable}
            command = re.sub(r"\b(etac|python) ", lambda word: f"{program[word[1]]} ", command)
            command = command.replace(DOMAIN, self.domain)
            done = subprocess.run(
                ["bash", "-c", command], stdout=subprocess.PIPE, stderr=subprocess.STDOUT, text=True, timeout=120,
                check=False,
            )  # fmt: skip
            return done.returncode, done.stdout

    def _etac(self, arguments: list[str]) -> tuple[int, str]:
        done = CliRunner().invoke(app, arguments)
        if isinstance(done.exception, EtacError):
            code = BAD_INPUT if isinstance(done.exception, ScenarioError) else FAILED_RUN
            return code, f"{done.output}{done.exception}"
        if done.exception is not None and not isinstance(done.exception, SystemExit):
            raise done.exception
        return done.exit_code, done.output

    def _python(self, file: str) -> str:
        with contextlib.redirect_stdout(io.StringIO()) as output:
            runpy.run_path(file, run_name="__main__")
        return output.getvalue()

    def reads(self, code: str) -> str:
        """What a piece of Python prints; names live on through the page."""
        with contextlib.chdir(self.folder), contextlib.redirect_stdout(io.StringIO()) as output:
            exec(compile(code, "a piece of the page", "exec"), self.names)
        return output.getvalue()


@pytest.mark.parametrize("page", PAGES, ids=lambda page: page.stem)
def test_page(page: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch, lease: DomainLease) -> None:
    shutil.copytree(ROOT / "examples", tmp_path / "examples")
    monkeypatch.syspath_prepend(str(tmp_path / "examples"))
    monkeypatch.setenv("FASTDDS_BUILTIN_TRANSPORTS", "UDPv4")  # shared memory would outlive the end by kill
    lease.release()
    reader = Reader(tmp_path, str(lease.domain))
    printed = ""
    for kind, block in BLOCK.findall(page.read_text(encoding="utf-8")):
        if kind == "python":
            printed = reader.reads(block)
        elif kind == "output":
            assert_shown(block.splitlines(), printed, page.name)
        else:
            for part in re.split(r"^\$ ", block, flags=re.MULTILINE)[1:]:
                command, *expected = part.splitlines()
                code, output = reader.runs(command)
                wanted = EXPECTED_CODE.search(command)
                assert code == (int(wanted[1]) if wanted else 0), f"{page.name}: {command}\n{output}"
                assert_shown(expected, output, f"{page.name}: {command}")
    for module in ("dead_zone", "dynamic_trigger", "servo"):
        sys.modules.pop(module, None)  # another page has another copy


def test_every_example_is_on_a_page() -> None:
    pages = [ROOT / "README.md", *(ROOT / "docs").rglob("*.md")]
    text = "".join(page.read_text(encoding="utf-8") for page in pages)
    examples = [path for path in (ROOT / "examples").iterdir() if path.is_file()]
    code = "".join(path.read_text(encoding="utf-8") for path in examples)
    for example in examples:
        assert example.name in text or f"from {example.stem} import" in code, example
