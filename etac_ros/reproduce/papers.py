"""Every numbered item of the papers, with the command that computes, shows or checks it, or the reason for none."""

from __future__ import annotations

import re
from collections.abc import Mapping
from functools import cache
from importlib.resources import files
from typing import Any

import yaml
from pydantic import BaseModel, ConfigDict, model_validator

from etac_ros.tables.table import Row, Table

FILE = "papers.yaml"
_NUMBERS = re.compile(r"(\d+)(?:-(\d+))?")


class _Model(BaseModel):
    model_config = ConfigDict(defer_build=True, extra="forbid", frozen=True)


class Item(_Model):
    """Some items of one kind.

    Attributes
    ----------
    kind
        ``equation``, ``figure``, ``theorem``, ...
    first, last
        Their numbers.
    what
        What they are about.
    command
        What computes, shows or checks them; several are joined by ``&&``.
    reason
        Why nothing does, or what has to be known of it.
    """

    kind: str
    first: int
    last: int
    what: str
    command: str = ""
    reason: str = ""

    @model_validator(mode="before")
    @classmethod
    def _from_file(cls, given: Any) -> Any:
        """In the file the kind is a key, and the numbers its value."""
        if not isinstance(given, dict) or "kind" in given:
            return given
        own = {key: value for key, value in given.items() if key in ("what", "command", "reason")}
        kinds = [key for key in given if key not in own]
        found = _NUMBERS.fullmatch(str(given[kinds[0]])) if len(kinds) == 1 else None
        if found is None:
            raise ValueError(f"{given} has no kind with its numbers, as equation: 3 or equation: 3-5")
        return {**own, "kind": kinds[0], "first": int(found[1]), "last": int(found[2] or found[1])}

    @model_validator(mode="after")
    def _said(self) -> Item:
        if not (self.command or self.reason):
            raise ValueError(f"{self.name} has neither a command nor a reason")
        if self.last < self.first:
            raise ValueError(f"{self.name}: the numbers ascend")
        return self

    @property
    def numbers(self) -> range:
        """Of the items."""
        return range(self.first, self.last + 1)

    @property
    def name(self) -> str:
        """As a text refers to them."""
        numbers = f"{self.first}" if self.first == self.last else f"{self.first} to {self.last}"
        return f"{self.kind} {numbers}"

    @property
    def commands(self) -> tuple[str, ...]:
        """Each command by itself."""
        return tuple(one.strip() for one in self.command.split("&&") if one.strip())


class PaperItems(_Model):
    """The items of one paper."""

    title: str
    numbered: dict[str, int]
    items: tuple[Item, ...]

    def faults(self) -> list[str]:
        """Items that are missing, or listed twice or without being numbered."""
        listed = [(item.kind, number) for item in self.items for number in item.numbers]
        wanted = [(kind, number) for kind, count in self.numbered.items() for number in range(1, count + 1)]
        missing = [f"{kind} {number} is missing" for kind, number in wanted if (kind, number) not in listed]
        others = sorted({one for one in listed if listed.count(one) > 1 or one not in wanted})
        return missing + [f"{kind} {number} is listed twice, or is none" for kind, number in others]


@cache
def paper_items() -> Mapping[str, PaperItems]:
    """The papers by scenario."""
    text = (files(__package__) / FILE).read_text(encoding="utf-8")
    return {name: PaperItems.model_validate(body) for name, body in yaml.safe_load(text).items()}


def items_table(paper: PaperItems) -> Table:
    """The items of a paper as a table."""
    rows = tuple(Row((item.name, item.what, item.command, item.reason)) for item in paper.items)
    return Table("", ("item", "what", "command", "reason, or what to know"), rows, texts=frozenset(
        {"item", "what", "command", "reason, or what to know"}
    ))  # fmt: skip
