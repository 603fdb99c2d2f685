"""Tables of a bag as files: Parquet and CSV a file a table, MATLAB and numpy one file with arrays."""

from __future__ import annotations

import re
from collections.abc import Iterator, Sequence
from enum import StrEnum
from itertools import chain
from pathlib import Path
from typing import Any

import numpy as np
import pyarrow as pa
import pyarrow.compute as pc
import pyarrow.csv
import pyarrow.parquet
from scipy.io import savemat

from etac_ros.errors import BagError
from etac_ros.export.tables import BagTables
from etac_ros.maths.ticks import seconds

_NO_WORD = re.compile(r"[^A-Za-z0-9]+")
_LONGEST_NAME = 63  # of a field in MATLAB


class Format(StrEnum):
    """What tables are written as."""

    PARQUET = "parquet"
    CSV = "csv"
    MAT = "mat"
    NPZ = "npz"


FORMATS = tuple(kind.value for kind in Format)


def write_tables(bag: BagTables, kind: Format | str, folder: Path, names: Sequence[str] = ()) -> tuple[Path, ...]:
    """Write tables of a bag.

    Parameters
    ----------
    bag
        From :func:`~etac_ros.export.tables.open_bag`.
    kind
        ``parquet`` and ``csv`` make a tidy file a table; ``mat`` and ``npz`` one file, in which ``TABLE.NODE`` has the
        arrays ``time_s``, ``tick`` and one a quantity, a column a component.
    folder
        Made if it is not there.
    names
        Which tables; none means all.

    Returns
    -------
    tuple of Path
        The files.

    Raises
    ------
    BagError
        If there is no such table, or the files cannot be written.
    """
    kind = Format(kind)
    chosen = tuple(names) or bag.names
    for name in chosen:
        if name not in bag.names:
            raise bag.no_table(name)
    try:
        folder.mkdir(parents=True, exist_ok=True)
        if kind in (Format.PARQUET, Format.CSV):
            return tuple(_write_table(bag.pieces(name), folder / f"{name}.{kind}") for name in chosen)
        path = folder / f"{bag.path.absolute().name}.{kind}"
        arrays = {name: _arrays(bag, name) for name in chosen}
        if kind is Format.MAT:
            savemat(path, arrays, do_compression=True, long_field_names=True, oned_as="column")
        else:
            np.savez_compressed(path, allow_pickle=False, **_flat(arrays))
        return (path,)
    except OSError as error:
        raise BagError(
            str(folder),
            f"the tables cannot be written: {error.strerror or error}",
            "a folder that may be written to, on a disk that has space left",
            "choose another with --output",
        ) from error


def _write_table(pieces: Iterator[pa.Table], path: Path) -> Path:
    """Write the pieces of a table one after the other."""
    prepared = pieces if path.suffix == ".parquet" else map(_in_words, pieces)
    first = next(prepared)
    if path.suffix == ".parquet":
        writer = pyarrow.parquet.ParquetWriter(path, first.schema, compression="zstd")
    else:
        writer = pyarrow.csv.CSVWriter(path, first.schema)
    with writer:
        for piece in chain([first], prepared):
            writer.write_table(piece)
    return path


def _in_words(table: pa.Table) -> pa.Table:
    """As CSV takes it."""
    for place, column in enumerate(table.schema):
        if pa.types.is_list(column.type):  # a cell is a text: numbers with blanks between, which float() reads back
            words = pa.array([" ".join(repr(number) for number in row) for row in table.column(place).to_pylist()])
            table = table.set_column(place, column.name, words)
        elif pa.types.is_dictionary(column.type):
            table = table.set_column(place, column.name, table.column(place).cast(pa.string()))
    return table


def _arrays(bag: BagTables, name: str) -> dict[str, Any]:
    """A table as arrays by node: what a matrix language wants."""
    if name in ("triggers", "messages"):
        return _events(bag.table(name), "node" if name == "triggers" else "link")
    found: dict[str, Any] = {}
    for series in bag.series(name):
        of_node = found.setdefault(_word(series.node), {})
        times = np.asarray(seconds(series.ticks, bag.ticks_per_second), dtype=np.float64)
        if name in ("torque", "watched"):  # each has times of its own
            of_node = of_node.setdefault(_word(series.quantity), {})
            of_node["value"] = series.values
        else:
            of_node[_word(series.quantity)] = series.values
        of_node["time_s"], of_node["tick"] = times, series.ticks
    return found


def _events(table: pa.Table, by: str) -> dict[str, Any]:
    found = {}
    for who in pc.unique(table.column(by)).to_pylist():
        rows = table.filter(pc.equal(table.column(by), who))
        columns = {}
        for name in rows.column_names:
            column = rows.column(name)
            if pa.types.is_list(column.type):
                columns[name] = np.array(column.to_pylist(), dtype=np.float64)  # of one link, so of one size
            elif not pa.types.is_dictionary(column.type):
                columns[name] = column.to_numpy()
        found[_word(who)] = columns
    return found


def _flat(nested: dict[str, Any], prefix: str = "") -> dict[str, Any]:
    flat: dict[str, Any] = {}
    for key, value in nested.items():
        flat |= _flat(value, f"{prefix}{key}.") if isinstance(value, dict) else {f"{prefix}{key}": value}
    return flat


def _word(text: str) -> str:
    """A name that a matrix language takes."""
    word = _NO_WORD.sub("_", text).strip("_")[:_LONGEST_NAME]
    return word if word[:1].isalpha() else f"n{word}"[:_LONGEST_NAME]
