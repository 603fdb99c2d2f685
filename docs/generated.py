"""Pages of the site that are made of docstrings and parameters: each law, rule, plant, medium rule and module kind."""

import importlib
import inspect
import pkgutil
from collections.abc import Iterator
from pathlib import Path
from types import ModuleType
from typing import Any

from pydantic import BaseModel
from pydantic_core import PydanticUndefined

ROOMS = {
    "laws": "Signals and control laws",
    "triggers": "Trigger rules",
    "plants": "Plants",
    "media": "Shared media and their access rules",
    "modules": "Kinds of modules",
}
_METHODS = ("command", "evaluate", "first", "fold", "margin", "propagate", "scan", "fire", "receive")


def write_pages(folder: Path) -> None:
    """One page a room, with every class that a scenario can name."""
    folder.mkdir(parents=True, exist_ok=True)
    for room, title in ROOMS.items():
        lines = [title, "=" * len(title), ""]
        package = importlib.import_module(f"etac_ros.{room}")
        for info in sorted(pkgutil.iter_modules(package.__path__), key=lambda info: info.name):
            module = importlib.import_module(f"{package.__name__}.{info.name}")
            found = list(_classes(module))
            if found:
                lines += [*_heading(info.name, "-"), (module.__doc__ or "").strip(), ""]
            for kind in found:
                lines += _section(kind)
        text = "\n".join(lines) + "\n"
        path = folder / f"{room}.rst"
        if not path.exists() or path.read_text(encoding="utf-8") != text:
            path.write_text(text, encoding="utf-8")


def write_rest(docs: Path, path: Path) -> None:
    """A page that leads to those which the index does not name, so that the site has every page that is written."""
    named = (docs / "index.md").read_text(encoding="utf-8").splitlines()
    pages = sorted(page.relative_to(docs).with_suffix("").as_posix() for page in docs.rglob("*.md"))
    rest = [page for page in pages if page not in named and page != "index" and not page.startswith("_build")]
    lines = [*_heading("More", "="), *([".. toctree::", ""] if rest else ["Every page is named in the index."])]
    path.write_text("\n".join([*lines, *(f"   /{page}" for page in rest)]) + "\n", encoding="utf-8")


def _heading(text: str, mark: str) -> list[str]:
    return [text, mark * len(text), ""]


def _classes(module: ModuleType) -> Iterator[type]:
    """Classes that a scenario can name: they are defined here, and have parameters."""
    for _, kind in inspect.getmembers(module, inspect.isclass):
        parameters = getattr(kind, "Parameters", None)
        own = kind.__module__ == module.__name__ and not kind.__name__.startswith("_")
        named = inspect.isclass(parameters) and issubclass(parameters, BaseModel)
        if own and named and not issubclass(kind, BaseModel):
            yield kind


def _section(kind: type) -> list[str]:
    name = f"{kind.__module__}.{kind.__name__}"
    lines = [*_heading(kind.__name__, "^"), f"In a scenario: ``{kind.__module__}:{kind.__name__}``.", ""]
    lines += [f".. autoclass:: {name}", ""]
    for method in _METHODS:
        if method in vars(kind) and inspect.getdoc(getattr(kind, method)):
            lines += [f"   .. automethod:: {method}", ""]
    facts = [
        f"{word}: {value}"
        for word, value in (
            ("takes", _size(kind, "signal_size")),
            ("gives", _size(kind, "command_size")),
            ("numbers watched", _size(kind, "size")),
            ("numbers sent", _size(kind, "sent_size")),
            ("inputs", _mapping(kind, "inputs")),
            ("unit", vars(kind).get("unit", "")),
        )
        if value
    ]
    if facts:
        lines += [f"Inputs and outputs: {'; '.join(facts)}.", ""]
    return lines + _parameters(kind.Parameters)  # type: ignore[attr-defined]


def _size(kind: type, name: str) -> str:
    value = vars(kind).get(name)
    return str(value) if isinstance(value, int) else ""


def _mapping(kind: type, name: str) -> str:
    value = vars(kind).get(name)
    return ", ".join(f"{port} ({size})" for port, size in value.items()) if isinstance(value, dict) else ""


def _parameters(model: type[BaseModel]) -> list[str]:
    if not model.model_fields:
        return ["It has no parameters.", ""]
    lines = [".. list-table:: Parameters", "   :header-rows: 1", "", "   * - key", "     - type", "     - default"]
    for key, field in model.model_fields.items():
        default: Any = field.default
        if default is PydanticUndefined:
            default = "required" if field.default_factory is None else "see the class"
        kind = getattr(field.annotation, "__name__", None) or str(field.annotation)
        limits = ", ".join(str(one) for one in field.metadata if type(one).__name__ in ("Gt", "Ge", "Lt", "Le"))
        lines += [f"   * - ``{field.alias or key}``", f"     - ``{kind}{f' ({limits})' if limits else ''}``"]
        lines += [f"     - ``{default}``"]
    return [*lines, ""]
