"""The result of a sweep: a table with one row a run, and what was swept; a Parquet file holds both."""

from __future__ import annotations

import json
import os
from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import pyarrow as pa
import pyarrow.parquet as pq

from etac_ros.errors import ScenarioError
from etac_ros.sweep.describe import FORMAT, Description
from etac_ros.sweep.sample import DRAWN, KEYS, SET, Row

_METADATA = b"etac_ros.sweep"
_TYPES = {
    "sample": pa.int64(), "run": pa.int64(), "point": pa.int64(), "seed": pa.int64(),
    "halted": pa.string(), "refused": pa.string(), "wall_s": pa.float64(),
}  # fmt: skip


@dataclass(frozen=True)
class SweepResult:
    """What a sweep has found.

    Attributes
    ----------
    table
        One row a run, by sample number. Columns: those of :data:`etac_ros.sweep.sample.KEYS`, ``set.KEY`` with grid
        values, ``drawn.KEY`` with draws, and a column a figure, null where a run does not have it.
    description
        What was swept, from :func:`etac_ros.sweep.describe.describe`.
    path
        The Parquet file; None if it was not written.
    """

    table: pa.Table
    description: Description
    path: Path | None = None

    @property
    def planned(self) -> int:
        """Number of samples of the whole sweep."""
        return int(self.description["runs"]) * len(self.description["points"])

    @property
    def complete(self) -> bool:
        """Whether all samples have been run."""
        return bool(self.table.num_rows == self.planned)

    @property
    def figures(self) -> tuple[str, ...]:
        """Names of the columns that are figures."""
        return tuple(name for name in self.table.column_names if name not in KEYS and not name.startswith((SET, DRAWN)))


def result_of(rows: Sequence[Row], description: Description) -> SweepResult:
    """Lay rows out as a table, in the order of their samples."""
    ordered = sorted(rows, key=lambda row: int(row["sample"]))
    names = list(dict.fromkeys([*KEYS, *(name for row in ordered for name in row)]))
    columns = {name: _column(name, [row.get(name) for row in ordered]) for name in names}
    return SweepResult(pa.table(columns), description)


def _column(name: str, values: list[Any]) -> pa.Array:
    if name in _TYPES:
        return pa.array(values, _TYPES[name])
    if name.startswith(SET):
        numbers = all(isinstance(value, (int, float)) and not isinstance(value, bool) for value in values)
        # Lists, mappings and mixtures keep their form as JSON.
        return pa.array(values, pa.float64()) if numbers else pa.array([_text(value) for value in values], pa.string())
    if any(isinstance(value, list) for value in values):
        return pa.array(values, pa.list_(pa.float64()))
    return pa.array(values, pa.float64())


def _text(value: Any) -> str:
    return value if isinstance(value, str) else json.dumps(value)


def write_result(result: SweepResult, path: Path) -> SweepResult:
    """Write a result to a Parquet file, all at once.

    Raises
    ------
    ScenarioError
        If it cannot be written.
    """
    table = result.table.replace_schema_metadata({_METADATA: json.dumps(dict(result.description)).encode()})
    beside = path.with_name(f".{path.name}.{os.getpid()}")
    try:
        path.parent.mkdir(parents=True, exist_ok=True)
        pq.write_table(table, beside, compression="zstd")
        os.replace(beside, path)
    except OSError as error:
        beside.unlink(missing_ok=True)
        raise ScenarioError(str(path), f"cannot be written ({error})", "", "see --output") from None
    return SweepResult(table, result.description, path)


def read_result(path: Path) -> SweepResult:
    """Read a result back.

    Raises
    ------
    ScenarioError
        If the file is missing or damaged, or is no result of a sweep.
    """
    if not path.is_file():
        raise ScenarioError(str(path), "there is no such file", "a result of `etac sweep`")
    try:
        table = pq.read_table(path)
    except (pa.ArrowException, OSError) as error:
        reason = str(error).splitlines()[0]
        raise ScenarioError(
            str(path), f"is damaged, or no Parquet file ({reason})", "a result of `etac sweep`", "another --output"
        ) from None
    found = (table.schema.metadata or {}).get(_METADATA)
    description = None if found is None else json.loads(found)
    if description is None or not set(KEYS) <= set(table.column_names):
        raise ScenarioError(str(path), "is a Parquet file of something else", "a result of `etac sweep`")
    if description["format"] != FORMAT:
        raise ScenarioError(
            str(path), f"has format {description['format']}", f"format {FORMAT}, which this etac_ros reads and writes"
        )
    return SweepResult(table, description, path)
