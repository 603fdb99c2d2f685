"""Files that a command is asked to write: refused before the work, written before anything is shown."""

from __future__ import annotations

import os
import sys
from pathlib import Path

from rich.console import Console

from etac_ros.errors import ScenarioError
from etac_ros.tables.terminal import make_console

STANDARD_OUTPUT = "-"
"""The name of the file that --json takes for it."""


def console_beside(json: Path | None, quiet: bool = False) -> Console:
    """The console for people; out of the way where JSON goes to standard output."""
    console = make_console()
    console.stderr = str(json) == STANDARD_OUTPUT
    console.quiet = quiet
    return console


def check_output(option: str, path: Path | None) -> None:
    """Refuse a file that could not be written, before the work instead of after it.

    Raises
    ------
    ScenarioError
        If it could not.
    """
    if path is None or str(path) == STANDARD_OUTPUT:
        return
    where = f"{option} {path}"
    if path.is_dir():
        raise ScenarioError(where, "is a directory", "a file")
    if not path.parent.is_dir():
        raise ScenarioError(where, f"there is no folder {path.parent}", "a folder that exists")
    if not os.access(path if path.exists() else path.parent, os.W_OK):
        raise ScenarioError(where, "may not be written to", "a file that may be written")


def write_output(option: str, path: Path, text: str) -> None:
    """Write a file, or standard output for ``-``: in UTF-8, whatever the terminal has.

    Raises
    ------
    ScenarioError
        If it cannot be written after all.
    """
    if str(path) == STANDARD_OUTPUT:
        sys.stdout.buffer.write(text.encode())
        sys.stdout.buffer.flush()
        return
    try:
        path.write_text(text, encoding="utf-8")
    except OSError as error:
        raise ScenarioError(f"{option} {path}", f"cannot be written ({error.strerror or error})") from None
