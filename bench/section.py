"""What a bench prints, and what it writes into its own section of a page of docs/: the same tables and sentences.

A bench that has a section says each of its results once::

    section = Section("sweep", "Sweeps", command="./scripts/bench sweep")
    section.say("Runs a second, once warm: what a Monte Carlo of a night can have.")
    section.show(table)              # an etac_ros.tables.table.Table
    if write:
        section.write()              # replaces this section of the page, and no other

On the page a section stands between ``<!-- bench sweep -->`` and ``<!-- end sweep -->``. The page is
docs/performance.md, where one that is not there yet is put where ``ORDER`` has it, or that of ``ELSEWHERE``.
"""

from __future__ import annotations

import os
import platform
import re
import textwrap
from importlib.metadata import PackageNotFoundError, version
from pathlib import Path

from rich.console import Console

from etac_ros.tables.markdown import markdown_lines
from etac_ros.tables.table import Table
from etac_ros.tables.terminal import make_console, show

PAGE = Path(__file__).resolve().parent.parent / "docs" / "performance.md"
ORDER = ("speed", "hop", "inprocess", "sweep", "command", "memory", "long", "disk", "formation", "anchors")
"""Sections of the page from above to below; each is a bench, or part of one that writes several."""
ELSEWHERE = {"wall": PAGE.with_name("wallclock.md")}
"""Sections that stand on the page of what they are about."""
_PACKAGES = ("numba", "numpy", "scipy", "pydantic", "ros-jazzy-rclpy")


class Section:
    """Results of a bench, printed as they come and kept for the page.

    Parameters
    ----------
    name
        Of the section; one of ``ORDER`` or ``ELSEWHERE``.
    title
        Its heading.
    command
        What the reader types to have it anew.
    console
        Where it prints.
    packages
        Distributions whose versions matter here beside the usual ones.
    """

    def __init__(
        self, name: str, title: str, command: str, console: Console | None = None, packages: tuple[str, ...] = ()
    ) -> None:
        if name not in ORDER and name not in ELSEWHERE:
            raise ValueError(f"docs/performance.md has no place for a section '{name}': name it in ORDER")
        self._name, self._title, self._console = name, title, console or make_console()
        self._lines: list[str] = []
        self._head = f"Written by `{command} --write`, on {machine(packages)}."
        self._console.print(f"\n{title}: {machine(packages)}")

    def say(self, sentence: str) -> None:
        """A sentence that says what the numbers mean; it is filled to the width of the page."""
        self._console.print(sentence, soft_wrap=not self._console.is_terminal)
        self._lines += ["", *filled(sentence)]

    def show(self, table: Table) -> None:
        """A table, with its title above and its notes below."""
        show(table, self._console)
        if table.title:
            self._lines += ["", *filled(f"{table.title}:")]
        self._lines += ["", *markdown_lines(table)]
        for note in table.notes:
            self._lines += ["", *filled(note)]

    def markdown(self) -> str:
        """What stands on the page between the marks."""
        return "\n".join([f"## {self._title}", "", *filled(self._head), *self._lines])

    def write(self, page: Path | None = None) -> None:
        """Put it into its page, or another, in the place of what stood there."""
        page = page or ELSEWHERE.get(self._name, PAGE)
        page.write_text(put(page.read_text(encoding="utf-8"), self._name, self.markdown()), encoding="utf-8")
        self._console.print(f"written: {page}")


def put(page: str, name: str, content: str) -> str:
    """The text of a page with the content of one section replaced, or put in its place in ``ORDER``."""
    new = f"{_begin(name)}\n\n{content.strip()}\n\n{_end(name)}"
    if name in sections(page):
        begin, end = page.index(_begin(name)), page.index(_end(name)) + len(_end(name))
        return page[:begin] + new + page[end:]
    for follower in ORDER[ORDER.index(name) + 1 :] if name in ORDER else ():
        if follower in sections(page):
            place = page.index(_begin(follower))
            return f"{page[:place]}{new}\n\n{page[place:]}"
    return f"{page.rstrip()}\n\n{new}\n"


def sections(page: str) -> list[str]:
    """Names of the sections of a page, from above to below."""
    return [name for name in re.findall(r"^<!-- bench (\w+) -->$", page, re.MULTILINE) if _end(name) in page]


def machine(packages: tuple[str, ...] = ()) -> str:
    """The machine, what else it was doing, and versions: numbers of two headers that differ cannot be compared."""
    parts = [
        f"{os.cpu_count()} cores ({_processor()})",
        f"load average {os.getloadavg()[0]:.1f}",
        f"{platform.system()} {platform.release().split('-')[0]}",
        f"Python {platform.python_version()}",
    ]
    return ", ".join([*parts, *(f"{name} {version_of(name)}" for name in (*_PACKAGES, *packages))])


def version_of(distribution: str) -> str:
    """Of what is installed; a ROS that is sourced has no distributions."""
    try:
        return version(distribution)
    except PackageNotFoundError:
        return "unknown"


def filled(text: str) -> list[str]:
    """A paragraph in lines of the page's width."""
    return textwrap.wrap(text, 120, break_long_words=False, break_on_hyphens=False)


def _processor() -> str:
    for line in Path("/proc/cpuinfo").read_text(encoding="utf-8").splitlines():
        if line.startswith("model name"):
            return line.partition(":")[2].strip()
    return platform.machine()


def _begin(name: str) -> str:
    return f"<!-- bench {name} -->"


def _end(name: str) -> str:
    return f"<!-- end {name} -->"
