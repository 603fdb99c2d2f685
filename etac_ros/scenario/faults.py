"""What pydantic found wrong with a parameter set, in the words of a scenario file."""

from __future__ import annotations

from collections.abc import Iterable, Iterator, Mapping
from types import UnionType
from typing import Annotated, Any, Union, get_args, get_origin

from pydantic import BaseModel

from etac_ros.errors import ScenarioError
from etac_ros.parameters import EXACTLY_ONE
from etac_ros.scenario.document import EVERYWHERE, choice, shortened, shown

Path = tuple[int | str, ...]

_EXPECTED = {
    "bool_type": "true or false",
    "dict_type": "a mapping",
    "float_type": "a number",
    "int_type": "a whole number",
    "model_type": "a mapping",
    "string_type": "a text",
    "tuple_type": "a list",
}
"""Where JSON's words are not those of YAML."""


def faults_of(
    model: type[BaseModel], values: Any, found: Iterable[Mapping[str, Any]], where: str
) -> list[ScenarioError]:
    """One error a fault: key, what was found, what was expected, and the nearest valid name.

    Parameters
    ----------
    model
        The parameter class.
    values
        What was checked.
    found
        From pydantic's ``ValidationError.errors()``.
    where
        File and key of ``values``.
    """
    faults: dict[Path, ScenarioError] = {}
    for fault in found:
        path: Path = tuple(fault["loc"])
        parent = path[:-1] if path and isinstance(path[-1], int) else path
        length = _fixed_length(model, parent)
        given = _at(values, parent)
        if length is not None and isinstance(given, list) and len(given) != length:
            # Its elements, missing or wrong, are one fault together.
            faults[parent] = _wrong_length(given, length, _key(where, parent))
        else:
            faults[path] = _fault(model, fault, path, _key(where, path))
    return list(faults.values())


def field_names(model: type[BaseModel]) -> list[str]:
    """The keys of a parameter class, as they stand in a file."""
    return [field.alias or name for name, field in model.model_fields.items()]


def unknown_key(key: str, known: Iterable[str], where: str) -> ScenarioError:
    """The error that a key is none of those that are known."""
    return ScenarioError(where, f"unknown key '{shortened(key)}'", choice(key, known))


def _fault(model: type[BaseModel], fault: Mapping[str, Any], path: Path, key: str) -> ScenarioError:
    kind = fault["type"]
    if kind == "extra_forbidden":
        known = [name for kind in _types_at(model, path[:-1]) if _is_model(kind) for name in field_names(kind)]
        return unknown_key(str(path[-1]), known, key)
    if kind == "missing":
        return ScenarioError(key, "is missing", "a value: this key has no default")
    if kind == EXACTLY_ONE:
        return _not_exactly_one(fault["ctx"], key)
    text = str(fault["msg"]).removeprefix("Value error, ").removeprefix("Input should be ")
    if kind == "value_error" and isinstance(fault["input"], dict):
        return ScenarioError(key, text)  # of several keys together; the text says what is wrong with them
    return ScenarioError(key, f"found {shown(fault['input'])}", _EXPECTED.get(kind, text))


def _wrong_length(values: list[Any], length: int, key: str) -> ScenarioError:
    if any(isinstance(value, list) for value in values):
        return ScenarioError(key, f"found a list of lists, {shown(values)}", f"one list of {length}, row by row")
    return ScenarioError(key, f"found {len(values)} values, {shown(values)}", f"{length} values")


def _not_exactly_one(context: Mapping[str, Any], key: str) -> ScenarioError:
    given: list[str] = context["given"]
    if not given:
        return ScenarioError(key, "none of them is given", f"exactly one of {context['names']}")
    setting = key.rpartition(": ")[2].removeprefix(f"{EVERYWHERE}.").lstrip("/")
    ways = " or ".join(f"--set {setting}.{name}=null" for name in given)
    return ScenarioError(
        key,
        f"{' and '.join(given)} are given",
        f"exactly one of {context['names']}",
        f"take one away with null: {ways}",
    )


def _key(where: str, path: Path) -> str:
    """Names below each other with dots, places in a list in brackets."""
    return where + "".join(f"[{part}]" if isinstance(part, int) else f".{part}" for part in path)


def _at(values: Any, path: Path) -> Any:
    for part in path:
        try:
            values = values[part]
        except (KeyError, IndexError, TypeError):
            return None
    return values


def _fixed_length(model: type[BaseModel], path: Path) -> int | None:
    for kind in _types_at(model, path):
        if get_origin(kind) is tuple and Ellipsis not in get_args(kind):
            return len(get_args(kind))
    return None


def _types_at(model: type[BaseModel], path: Path) -> list[Any]:
    """The types that a parameter class allows at a place below it."""
    kinds: list[Any] = [model]
    for part in path:
        kinds = [below for kind in kinds for below in _types_below(kind, part)]
    return kinds


def _types_below(kind: Any, part: int | str) -> Iterator[Any]:
    if _is_model(kind):
        for name, field in kind.model_fields.items():
            if part in (name, field.alias):
                yield from _alternatives(field.annotation)
    elif get_origin(kind) is dict:
        yield from _alternatives(get_args(kind)[1])


def _alternatives(annotation: Any) -> Iterator[Any]:
    """The types in an annotation, without unions and what else is annotated."""
    if get_origin(annotation) is Annotated:
        yield from _alternatives(get_args(annotation)[0])
    elif get_origin(annotation) in (Union, UnionType):
        for alternative in get_args(annotation):
            yield from _alternatives(alternative)
    else:
        yield annotation


def _is_model(kind: Any) -> bool:
    return isinstance(kind, type) and issubclass(kind, BaseModel)
