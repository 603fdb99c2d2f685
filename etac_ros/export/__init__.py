"""A bag as tables: for pandas, MATLAB, Octave and numpy."""

from __future__ import annotations

from etac_ros.export.files import FORMATS, Format, write_tables
from etac_ros.export.tables import BagTables, open_bag

__all__ = ["FORMATS", "BagTables", "Format", "open_bag", "write_tables"]
