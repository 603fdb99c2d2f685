"""Digest of the code of a user's classes: with a scenario's values it decides what a run does.

A sweep that goes on, and nodes that are started on several machines, have to be of the same code. Compared are source
files, of the class and of every module of the user's that it imports, now or in one of its functions; packages that are
installed are what their version says, but for that of the class itself: a workspace installs it as often as it likes.
"""

from __future__ import annotations

import ast
import hashlib
import sys
from collections.abc import Iterator, Sequence
from functools import cache
from importlib.machinery import ModuleSpec
from importlib.util import resolve_name
from pathlib import Path
from sysconfig import get_path
from typing import NamedTuple

from etac_ros.source_digest import digest_of_sources, source_of

_INSTALLED = ("site-packages", "dist-packages")
_OWN = __name__.partition(".")[0]
_STANDARD = frozenset(Path(get_path(place)) for place in ("stdlib", "platstdlib"))


def code_digests(classes: Sequence[str]) -> dict[str, str]:
    """Digest of the code of each class, as ``package.module:Class``, that is no class of ours."""
    return {path: found for path in classes if (found := _code(path.partition(":")[0]))}


class _Found(NamedTuple):
    """Where a module stands."""

    file: Path
    package: str


@cache
def _code(name: str) -> str:
    """As it was when it was first asked for: later a process does not import it anew."""
    top = name.partition(".")[0]
    if top != _OWN and (installed := [Path(place) for place in _places(top) or () if _is_installed(Path(place))]):
        return digest_of_sources(installed)[:16]  # to follow its imports may take long
    digest = hashlib.sha256()
    pending, seen, said = list(_with_packages(name)), set(), False
    while pending:
        name = pending.pop(0)
        if name in seen:
            continue
        seen.add(name)
        found = _found(name)
        if found is None or (source := _source(found, name, top)) is None:
            continue
        said = True
        digest.update(name.encode() + b"\0" + source + b"\0")
        pending += _imports(found, source)
    return digest.hexdigest()[:16] if said else ""


def _found(name: str) -> _Found | None:
    """The file of a module, which is not imported to find it; None of what has none, or is no module.

    Whether it has been imported makes no difference: processes ask sooner and later.
    """
    loaded = sys.modules.get(name)
    if loaded is not None:
        file = getattr(loaded, "__file__", None)
        return _Found(Path(file), loaded.__package__ or "") if file else None
    parent = name.rpartition(".")[0]
    path = _places(parent) if parent else None
    if parent and path is None:
        return None
    spec = _spec(name, path)
    if spec is None or not spec.has_location or spec.origin is None:
        return None
    return _Found(Path(spec.origin), spec.parent or "")


def _places(package: str) -> Sequence[str] | None:
    """The folders of a package; None of what is none."""
    loaded = sys.modules.get(package)
    if loaded is not None:
        return getattr(loaded, "__path__", None)
    parent = package.rpartition(".")[0]
    path = _places(parent) if parent else None
    spec = None if parent and path is None else _spec(package, path)
    return None if spec is None else spec.submodule_search_locations


def _spec(name: str, path: Sequence[str] | None) -> ModuleSpec | None:
    for finder in sys.meta_path:
        try:
            spec = finder.find_spec(name, path)
        except (AttributeError, ImportError, OSError, ValueError):  # of somebody else
            continue
        if spec is not None:
            return spec
    return None


def _source(found: _Found, name: str, top: str) -> bytes | None:
    """What stands in the file of a module of the user's, whatever its line ends."""
    package = name.partition(".")[0]
    installed = _is_installed(found.file)
    if package == _OWN or (installed and package != top):
        return None
    if not installed and any(found.file.is_relative_to(place) for place in _STANDARD):
        return None
    return source_of(found.file)


def _is_installed(file: Path) -> bool:
    return any(part in _INSTALLED for part in file.parts)


def _imports(module: _Found, source: bytes) -> Iterator[str]:
    """Names of what a module may import, in its order; some are no modules."""
    try:
        statements = list(ast.walk(ast.parse(source)))
    except (SyntaxError, ValueError):  # edited since, or no Python source
        return
    for statement in statements:
        if isinstance(statement, ast.Import):
            for alias in statement.names:
                yield from _with_packages(alias.name)
        elif isinstance(statement, ast.ImportFrom):
            try:
                base = resolve_name("." * statement.level + (statement.module or ""), module.package)
            except (ImportError, ValueError):
                continue
            yield from _with_packages(base)
            for alias in statement.names:
                yield f"{base}.{alias.name}"


def _with_packages(name: str) -> Iterator[str]:
    parts = name.split(".")
    for count in range(1, len(parts) + 1):
        yield ".".join(parts[:count])
