"""YAML as a scenario may use it: plain data, of a bounded size, read as YAML 1.2 and as ROS read it alike.

One reader for files, for values behind ``--set`` and for parameter files. Texts that the two specifications, or
ROS's own parser of parameter files, take for different values (``010``, eight or ten) are refused; those that only
the old YAML 1.1 takes for numbers (``1:30``, ``1_000``) are texts, as are ``yes`` and dates. A text that holds codes a
terminal would act on is refused, so that nothing of a scenario has to be looked at again before it is shown.
"""

from __future__ import annotations

import math
import re
from collections.abc import Iterator
from dataclasses import dataclass, field
from typing import Any

import yaml

from etac_ros.errors import ScenarioError
from etac_ros.plain_text import plain_text

LARGEST_BYTES = 16 * 1024 * 1024
"""Of a file; a formation of 1000 spacecraft, written out, takes about a third."""
DEEPEST = 32
"""Mappings and lists within each other."""
MOST_VALUES = 1_000_000
"""Values in a file, with those that aliases repeat."""
LONGEST_KEY = 256
_LARGEST_INTEGER = 2**63 - 1

_NULL = frozenset({"", "~", "null", "Null", "NULL"})
_BOOLEANS = {"true": True, "True": True, "TRUE": True, "false": False, "False": False, "FALSE": False}
_ROS_BOOLEANS = frozenset({"y", "n", "yes", "no", "on", "off"})
"""What ROS's parser, in lower case, takes for true or false and YAML 1.2 for a text."""
_INTEGER = re.compile(r"[-+]?\d+")
_OTHER_BASE = re.compile(r"0o[0-7]+|0x[0-9a-fA-F]+")
_LEADING_ZERO = re.compile(r"[-+]?0\d+")
_FLOAT = re.compile(r"[-+]?(?:\.\d+|\d+(?:\.\d*)?)(?:[eE][-+]?\d+)?", re.ASCII)
_INFINITE = re.compile(r"([-+]?)\.(?:inf|Inf|INF)")
_NO_NUMBER = frozenset({".nan", ".NaN", ".NAN"})
_TAG = "tag:yaml.org,2002:"
_OF_SCALARS = {"str": str, "int": int, "float": float, "bool": bool, "null": type(None)}
_IN_WORDS = {"int": "a whole number", "float": "a number", "bool": "true or false", "null": "null"}

# libyaml reads as ROS does (its parser of parameter files is built on it), and twenty times as fast. Nor does what it
# writes read otherwise.
_Parser: Any = getattr(yaml, "CSafeLoader", yaml.SafeLoader)
_Dumper: Any = getattr(yaml, "CSafeDumper", yaml.SafeDumper)


class _Refused(ValueError):
    """What stands there is YAML, and not for a scenario."""


@dataclass
class _Open:
    """A mapping or list that is being read."""

    value: dict[str, Any] | list[Any]
    anchor: str | None
    key: str | None = None
    size: int = 1
    depth: int = 1

    def add(self, value: Any, size: int, depth: int) -> None:
        self.size += size
        self.depth = max(self.depth, depth + 1)
        if isinstance(self.value, list):
            self.value.append(value)
        else:
            assert self.key is not None
            self.value[self.key] = value
            self.key = None


@dataclass
class _Reader:
    """Builds the tree from events, without recursion, and counts while it does so."""

    values: int = 0
    open: list[_Open] = field(default_factory=list)
    anchors: dict[str, tuple[Any, int, int]] = field(default_factory=dict)
    root: Any = None
    documents: int = 0

    def take(self, event: yaml.Event) -> None:
        if isinstance(event, yaml.ScalarEvent) and plain_text(event.value) != event.value:
            # Titles and names reach terminals and pages, which would act on them.
            raise _Refused(f"the text holds {_cut(plain_text(event.value))}, a code that a terminal acts on")
        match event:
            case yaml.DocumentStartEvent():
                self.documents += 1
                if self.documents > 1:
                    raise _Refused("a second document begins; one file is one scenario")
            case yaml.MappingStartEvent() | yaml.SequenceStartEvent():
                self._begin(event)
            case yaml.MappingEndEvent() | yaml.SequenceEndEvent():
                done = self.open.pop()
                self._place(done.value, done.anchor, done.size, done.depth)
            case yaml.ScalarEvent():
                if self._awaits_key():
                    self._take_key(event)
                else:
                    self._count(1)
                    self._place(_scalar_of(event), event.anchor, 1, 1)
            case yaml.AliasEvent():
                self._repeat(str(event.anchor))

    def _awaits_key(self) -> bool:
        return bool(self.open) and isinstance(self.open[-1].value, dict) and self.open[-1].key is None

    def _begin(self, event: yaml.CollectionStartEvent) -> None:
        if self._awaits_key():
            raise _Refused("a list or mapping stands where a key should")
        if len(self.open) >= DEEPEST:
            raise _Refused(f"more than {DEEPEST} lists and mappings within each other")
        kind = "map" if isinstance(event, yaml.MappingStartEvent) else "seq"
        if event.tag not in (None, "!", _TAG + kind):
            raise _Refused(f"the tag {_shown_tag(event.tag)} is not for scenarios, which are plain data")
        self._count(1)
        self.open.append(_Open({} if kind == "map" else [], event.anchor))

    def _take_key(self, event: yaml.ScalarEvent) -> None:
        key, within = str(event.value), self.open[-1].value
        if event.tag not in (None, "!", _TAG + "str"):
            raise _Refused(f"the key has the tag {_shown_tag(event.tag)}; keys are texts")
        if len(key) > LONGEST_KEY:
            raise _Refused(f"a key of {len(key)} characters; {LONGEST_KEY} are the most")
        if key == "<<" and event.implicit[0]:
            raise _Refused("the merge key << is of YAML 1.1 only; ROS does not read it either")
        if key in within:  # YAML forbids it, and most parsers silently take the last
            raise _Refused(f"the key '{key}' stands twice in one mapping")
        self.open[-1].key = key

    def _repeat(self, anchor: str) -> None:
        if self._awaits_key():
            raise _Refused("an alias stands where a key should")
        if anchor not in self.anchors:
            raise _Refused(f"the alias *{anchor} repeats nothing that was complete before it")
        value, size, depth = self.anchors[anchor]
        if len(self.open) + depth > DEEPEST + 1:
            raise _Refused(f"more than {DEEPEST} lists and mappings within each other")
        self._count(size)
        self._place(value, None, size, depth)

    def _place(self, value: Any, anchor: str | None, size: int, depth: int) -> None:
        if anchor is not None:
            self.anchors[anchor] = value, size, depth
        if self.open:
            self.open[-1].add(value, size, depth)
        else:
            self.root = value

    def _count(self, more: int) -> None:
        self.values += more
        if self.values > MOST_VALUES:
            raise _Refused(f"more than {MOST_VALUES:,} values")


def parse_value(text: str, where: str) -> Any:
    """The value of a YAML text: a file's, or one behind ``--set key=``.

    Parameters
    ----------
    text
        One YAML document, or nothing at all, which is null.
    where
        File or option, to begin messages with.

    Returns
    -------
    Any
        Mappings with texts as keys, lists, texts, whole numbers of 64 bits, numbers, true, false or null.

    Raises
    ------
    ScenarioError
        With line and column, if it is no YAML, or YAML beyond what a scenario may use: larger, deeper, with tags
        of other kinds, keys that stand twice, numbers that readers disagree about.
    """
    if len(text) > LARGEST_BYTES:
        raise ScenarioError(where, f"{len(text):,} characters", f"at most {LARGEST_BYTES:,}")
    reader, mark = _Reader(), None
    try:
        for event in _events(text):
            mark = event.start_mark
            reader.take(event)
    except _Refused as refused:
        raise ScenarioError(where, _at(mark, str(refused)), "valid YAML of a scenario") from None
    except yaml.YAMLError as error:
        raise ScenarioError(where, _problem(error), "valid YAML") from None
    except UnicodeEncodeError:
        raise ScenarioError(where, "holds bytes that are no text", "UTF-8") from None
    return reader.root


def looks_plain(text: str) -> bool:
    """Whether a text can stand without quotes, and every reader takes it for a text."""
    if text.lower() in _ROS_BOOLEANS:
        return False
    try:
        return isinstance(plain_scalar(text), str)
    except ValueError:
        return False


def plain_scalar(text: str) -> Any:
    """The value of a scalar without quotes and tag: YAML 1.2's core schema.

    Raises
    ------
    ValueError
        For numbers that a run could not use, or that readers disagree about.
    """
    if text in _NULL:
        return None
    if text in _BOOLEANS:
        return _BOOLEANS[text]
    if text[0] not in "+-.0123456789":
        return text
    if _LEADING_ZERO.fullmatch(text):
        raise _Refused(f"{_cut(text)} is octal for some readers and decimal for others; leave out its leading zeros")
    if _OTHER_BASE.fullmatch(text):
        raise _Refused(f"{_cut(text)} is no decimal number, and not every reader takes it for one")
    if _INTEGER.fullmatch(text) and text.isascii():
        if len(text) > 20 or not -_LARGEST_INTEGER - 1 <= int(text) <= _LARGEST_INTEGER:
            raise _Refused(f"{_cut(text)} is beyond the whole numbers of 64 bits; a large number is written as 1.0e30")
        return int(text)
    if _FLOAT.fullmatch(text):
        value = float(text)
        if math.isinf(value):
            raise _Refused(f"{_cut(text)} is beyond the numbers of 64 bits")
        return value
    infinite = _INFINITE.fullmatch(text)
    if infinite:
        return -math.inf if infinite[1] == "-" else math.inf
    return math.nan if text in _NO_NUMBER else text


def _events(text: str) -> Iterator[yaml.Event]:
    yield from yaml.parse(text, Loader=_Parser)


def _scalar_of(event: yaml.ScalarEvent) -> Any:
    text = str(event.value)
    if event.tag is None or event.tag == "!":
        return plain_scalar(text) if event.implicit[0] and event.tag is None else text
    kind = event.tag.removeprefix(_TAG)
    if not event.tag.startswith(_TAG) or kind not in _OF_SCALARS:
        raise _Refused(f"the tag {_shown_tag(event.tag)} is not for scenarios, which are plain data")
    if kind == "str":
        return text
    value = plain_scalar(text)
    if kind == "float" and type(value) is int:
        return float(value)
    if type(value) is not _OF_SCALARS[kind]:
        raise _Refused(f"{_cut(text)} has the tag !!{kind} and is not {_IN_WORDS[kind]}")
    return value


def _shown_tag(tag: str) -> str:
    return _cut(f"!!{tag.removeprefix(_TAG)}" if tag.startswith(_TAG) else tag)


def _cut(text: str) -> str:
    return text if len(text) <= 40 else f"{text[:24]}... ({len(text)} characters)"


def _problem(error: yaml.YAMLError) -> str:
    problem = getattr(error, "problem", None) or getattr(error, "reason", None) or str(error)
    return _at(getattr(error, "problem_mark", None), str(problem))


def _at(mark: Any, problem: str) -> str:
    return f"line {mark.line + 1}, column {mark.column + 1}: {problem}" if mark else problem


class Dumper(_Dumper):  # type: ignore[misc]
    """Writes what :func:`parse_value` and ROS read back: texts that look like something else in quotes, no aliases."""

    def ignore_aliases(self, data: Any) -> bool:
        """True for everything: what stands twice is written twice."""
        return True


def _represent_text(dumper: Dumper, text: str) -> yaml.ScalarNode:
    node: yaml.ScalarNode = dumper.represent_scalar(f"{_TAG}str", text, style=None if looks_plain(text) else '"')
    return node


Dumper.add_representer(str, _represent_text)
