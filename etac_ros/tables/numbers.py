"""How figures are written for people."""

from __future__ import annotations


def number(value: float) -> str:
    """A figure: whole numbers whole, others to four digits."""
    return f"{value:,.0f}" if float(value).is_integer() and abs(value) < 1e9 else f"{value:,.4g}"


def optional(value: float | None, form: str = "") -> str:
    """A figure that may be missing; nothing stands there then."""
    if value is None:
        return ""
    return format(value, form) if form else number(value)


def band(low: float, high: float) -> str:
    """A band; empty where it has no width."""
    return "" if low == high else f"{number(low)} to {number(high)}"


def bracketed(unit: str) -> str:
    """A unit behind a name; nothing where there is none."""
    return f" [{unit}]" if unit not in ("", "1") else ""


def type_words(type_name: str) -> str:
    """A message type as ROS tools show it."""
    return type_name.replace("/msg/", "/")
