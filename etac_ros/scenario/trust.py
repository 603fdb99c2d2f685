"""Which classes may be imported on the word of a file: naming a class in a scenario means running its module.

Who runs a scenario trusts it. Who looks at a bag need not: there, only the classes of etac_ros itself are imported.
They are those that stand in a file of this very package, in one of the rooms that hold classes for scenarios, and are
defined in that file.
"""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from contextlib import contextmanager
from contextvars import ContextVar
from functools import lru_cache
from pathlib import Path
from typing import Any

import etac_ros

_PACKAGE = Path(etac_ros.__file__).resolve().parent
_ROOMS = ("graph", "laws", "media", "modules", "plants", "triggers")
_own_only: ContextVar[bool] = ContextVar("own_only", default=False)


@contextmanager
def own_classes_only() -> Iterator[None]:
    """Refuse to import any class that is not of etac_ros, within this block."""
    token = _own_only.set(True)
    try:
        yield
    finally:
        _own_only.reset(token)


def may_import(path: str) -> bool:
    """Whether the class of this name may be imported here and now."""
    return is_own(path) or not _own_only.get()


@lru_cache(maxsize=1024)
def is_own(path: str) -> bool:
    """Whether ``package.module:Class`` names a class in a file of etac_ros. Nothing is imported to find out."""
    module, colon, name = path.partition(":")
    package, *rooms = module.split(".")
    if package != _PACKAGE.name or not rooms or rooms[0] not in _ROOMS or not colon:
        return False
    if not name.isidentifier() or not all(part.isidentifier() for part in rooms):
        return False
    file = _PACKAGE.joinpath(*rooms).with_suffix(".py")
    return file.is_file() and file.resolve().is_relative_to(_PACKAGE)


def foreign_classes(nodes: Mapping[str, Mapping[str, Any]]) -> tuple[str, ...]:
    """The classes that the nodes of a scenario name and that are not of etac_ros, in their order."""
    return tuple(dict.fromkeys(name for name in _named(nodes) if not is_own(name)))


def _named(tree: Any) -> Iterator[str]:
    pending = [tree]
    while pending:
        part = pending.pop(0)
        if isinstance(part, Mapping):
            for key, value in part.items():
                if isinstance(value, str) and (key == "class" or (key == "module" and ":" in value)):
                    yield value
            pending += part.values()
        elif isinstance(part, list | tuple):
            pending += part
