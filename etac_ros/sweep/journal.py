"""The rows of a sweep that is not finished, on disk as they come: what a restart goes on from.

A line of JSON that describes the sweep, then one line a row. A line that was cut off at the end by a crash is dropped;
anything else that is no row means that the file is damaged.
"""

from __future__ import annotations

import json
import os
from collections.abc import Iterable
from pathlib import Path
from types import TracebackType
from typing import IO, Self

from etac_ros.errors import ScenarioError
from etac_ros.sweep.describe import Description, check_same
from etac_ros.sweep.sample import Row

SUFFIX = ".unfinished"


class Journal:
    """Opens the journal of a sweep, or begins it; a context manager.

    Parameters
    ----------
    path
        Its file.
    description
        Of the sweep that is to go on.

    Attributes
    ----------
    rows
        The rows that stand in it, in no order.

    Raises
    ------
    ScenarioError
        If it cannot be written, is damaged, or belongs to another sweep.
    """

    def __init__(self, path: Path, description: Description) -> None:
        self.path = path
        self.rows: list[Row] = []
        kept = 0
        try:
            path.parent.mkdir(parents=True, exist_ok=True)
            if path.exists() and path.stat().st_size:
                kept = self._read(description)
            self._file: IO[bytes] = open(path, "r+b" if path.exists() else "x+b")  # noqa: SIM115  closed by __exit__
            self._file.truncate(kept)
            self._file.seek(kept)
            if not kept:
                self._write([description])
        except OSError as error:
            raise ScenarioError(str(path), f"cannot be written ({error})", "", "see --output") from None

    def append(self, rows: Iterable[Row]) -> None:
        """Add rows, and see them to the disk."""
        found = list(rows)
        self.rows += found
        self._write(found)

    def __enter__(self) -> Self:
        return self

    def __exit__(self, kind: type[BaseException] | None, error: BaseException | None, at: TracebackType | None) -> None:
        self._file.close()

    def _write(self, values: Iterable[object]) -> None:
        # One write, so that an interruption leaves no half line behind which more would follow.
        self._file.write(b"".join(json.dumps(value).encode() + b"\n" for value in values))
        self._file.flush()
        os.fsync(self._file.fileno())

    def _read(self, description: Description) -> int:
        """Read what is there; returns the length of its whole lines."""
        content = self.path.read_bytes()
        whole = content[: content.rfind(b"\n") + 1]
        if not whole:
            return 0
        head, *lines = whole.splitlines()
        found = self._line(head, 1)
        if "digests" not in found:
            raise self._damaged(1)
        check_same(description, found, str(self.path))
        for number, line in enumerate(lines, start=2):
            row = self._line(line, number)
            if "sample" not in row:
                raise self._damaged(number)
            self.rows.append(row)
        return len(whole)

    def _line(self, line: bytes, number: int) -> Row:
        try:
            found = json.loads(line)
        except ValueError:
            raise self._damaged(number) from None
        if not isinstance(found, dict):
            raise self._damaged(number)
        return found

    def _damaged(self, number: int) -> ScenarioError:
        return ScenarioError(
            str(self.path),
            f"is damaged in line {number}",
            "what an interrupted sweep leaves",
            "remove it to start anew",
        )
