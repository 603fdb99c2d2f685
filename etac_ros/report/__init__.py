"""Reports: the paper's figures and the tables of a run, drawn from its bag alone."""

from __future__ import annotations

from etac_ros.report.write import ReportError, write_report

__all__ = ["ReportError", "write_report"]
