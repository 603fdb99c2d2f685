"""YAML as scenarios may use it: YAML 1.2's scalars, one reader for files and options, limits, and no traceback."""

from __future__ import annotations

import math
import os
from pathlib import Path
from typing import Any

import pytest
import yaml
from conftest import SmallScenario
from hypothesis import given
from hypothesis import strategies as st

from etac_ros.errors import ScenarioError
from etac_ros.plain_text import plain_text
from etac_ros.scenario.document import write_sections
from etac_ros.scenario.load import load
from etac_ros.scenario.yaml_text import DEEPEST, LARGEST_BYTES, MOST_VALUES, parse_value

TAKEN: dict[str, Any] = {
    "": None, "~": None, "null": None, "Null": None,
    "true": True, "False": False, "TRUE": True,
    "yes": "yes", "on": "on", "No": "No", "y": "y",
    "12": 12, "-3": -3, "+7": 7, "0": 0, "-0": 0, str(2**63 - 1): 2**63 - 1, str(-(2**63)): -(2**63),
    "1.5": 1.5, "1.": 1.0, ".5": 0.5, "1e-6": 1e-6, "-2E3": -2e3, "+.5e1": 5.0, "1.0e30": 1e30,
    ".inf": math.inf, "-.INF": -math.inf,
    "1:30": "1:30", "190:20:30": "190:20:30", "1_000": "1_000", "2024-01-01": "2024-01-01", "2024-99-99": "2024-99-99",
    "0b1": "0b1", "1e": "1e", "e5": "e5", ".": ".", "-": None, "1.2.3": "1.2.3", "=": "=",
    "'12'": "12", '"1e-6"': "1e-6", '"a\\tb\\n"': "a\tb\n", "é ∞ 漢": "é ∞ 漢",
    "!!str 12": "12", "! 12": "12", "!!int 12": 12, "!!float 3": 3.0, "!!bool true": True, "!!null ~": None,
    "!!map {a: 1}": {"a": 1}, "!!seq [1]": [1],
    "{1: a, true: b, ~: c}": {"1": "a", "true": "b", "~": "c"},
    "[&x [1, 2], *x]": [[1, 2], [1, 2]],
}  # fmt: skip
TAKEN["-"] = [None]  # a list of one


@pytest.mark.parametrize(("text", "value"), TAKEN.items())
def test_what_a_value_means(text: str, value: Any) -> None:
    found = parse_value(text, "here")
    assert found == value
    assert type(found) is type(value)


def test_no_number_is_read() -> None:
    assert math.isnan(parse_value(".nan", "here"))


LAUGHS = "a0: &a0 [x, x, x, x, x, x, x, x, x, x]\n" + "".join(
    f"a{i}: &a{i} [{', '.join([f'*a{i - 1}'] * 10)}]\n" for i in range(1, 12)
)
REFUSED: dict[str, tuple[str, list[str]]] = {
    "octal for some": ("a: 010", ["line 1, column 4", "010 is octal for some readers and decimal for others"]),
    "octal for no reader": ("08", ["08 is octal"]),
    "a negative one": ("-007", ["-007 is octal"]),
    "octal of YAML 1.2": ("0o17", ["0o17 is no decimal number"]),
    "hexadecimal": ("0x1F", ["0x1F is no decimal number"]),
    "400 digits": ("9" * 400, ["(400 characters) is beyond the whole numbers of 64 bits"]),
    "6,000 digits": ("9" * 6000, ["(6000 characters) is beyond the whole numbers of 64 bits"]),
    "one too many": (str(2**63), ["is beyond the whole numbers of 64 bits"]),
    "one too few": (str(-(2**63) - 1), ["is beyond the whole numbers of 64 bits"]),
    "a number beyond all": ("1e999", ["1e999 is beyond the numbers of 64 bits"]),
    "a text called a whole number": ("!!int abc", ["abc has the tag !!int and is not a whole number"]),
    "a text called a number": ("!!float abc", ["abc has the tag !!float and is not a number"]),
    "a date": ("!!timestamp 2024-01-01", ["the tag !!timestamp is not for scenarios"]),
    "binary": ("!!binary aGk=", ["the tag !!binary is not for scenarios"]),
    "a set": ("!!set {a, b}", ["the tag !!set is not for scenarios"]),
    "an object": ("!!python/object/apply:os.system [ls]", ["the tag !!python/object/apply:os.system is not for"]),
    "a tag of its own": ("!mine 3", ["the tag !mine is not for scenarios"]),
    "a tagged key": ("{!!int 3: 4}", ["the key has the tag !!int; keys are texts"]),
    "a key twice": ("a: 1\nb: 2\na: 3", ["line 3, column 1", "the key 'a' stands twice"]),
    "a key twice, in quotes": ("{a: 1, 'a': 2}", ["the key 'a' stands twice"]),
    "a merge key": ("a: &a {x: 1}\nb: {<<: *a}", ["line 2", "the merge key <<"]),
    "a list as a key": ("{[1]: 2}", ["a list or mapping stands where a key should"]),
    "an alias as a key": ("[&a x, {*a : 2}]", ["an alias stands where a key should"]),
    "a long key": (f"{'k' * 300}: 1", ["a key of 300 characters"]),
    "a tab": ("a:\n\tb: 1", ["line 2", "cannot start any token"]),
    "two documents": ("a: 1\n---\nb: 2", ["line 2", "a second document begins"]),
    "an alias of nothing": ("[*a]", ["the alias *a repeats nothing"]),
    "an alias of itself": ("&a [*a]", ["the alias *a repeats nothing that was complete before it"]),
    "too deep": ("[" * (DEEPEST + 1) + "]" * (DEEPEST + 1), [f"more than {DEEPEST} lists and mappings"]),
    "3,000 brackets": ("[" * 3000, ["line 1, column"]),
    "3,000 braces": ("{a: " * 3000, ["line 1, column"]),
    "deep through aliases": (
        "\n".join([f"- &a0 {'[' * 20}{']' * 20}", f"- {'[' * 20}*a0{']' * 20}"]),
        [f"more than {DEEPEST} lists and mappings"],
    ),
    "a billion laughs": (LAUGHS, ["line 6", f"more than {MOST_VALUES:,} values"]),
    "too many values": (f"[{'1,' * (MOST_VALUES + 1)}]", [f"more than {MOST_VALUES:,} values"]),
    "too large": ("x" * (LARGEST_BYTES + 1), [f"at most {LARGEST_BYTES:,}"]),
    "an escape code": ('title: "\\e[31mred"', ["line 1, column 8", "the text holds \\x1b[31mred, a code"]),
    "an escape code in a key": ('{"\\a": 1}', ["the text holds \\x07, a code"]),
    "a turned direction": ("a: \u202eabc", ["the text holds \\u202eabc, a code"]),
    "a control character": ("a: \x00", ["control characters are not allowed"]),
    "half a character": ("a: \udc80", ["holds bytes that are no text"]),
    "no end": ("title: [1", ["line", "expected: valid YAML"]),
}  # fmt: skip


@pytest.mark.parametrize(("text", "said"), REFUSED.values(), ids=REFUSED.keys())
def test_what_is_refused(text: str, said: list[str]) -> None:
    with pytest.raises(ScenarioError) as raised:
        parse_value(text, "here")
    message = str(raised.value)
    assert message.startswith("here: ")
    assert all(words in message for words in said), message
    assert len(message) < 400


def test_the_deepest_tree_and_the_most_values_are_taken() -> None:
    assert parse_value("[" * DEEPEST + "]" * DEEPEST, "here")
    assert len(parse_value(f"[{'1,' * (MOST_VALUES - 1)}]", "here")) == MOST_VALUES - 1


@pytest.mark.parametrize(
    ("assignment", "said"),
    [
        ("duration_s=1:30", 'duration_s: found "1:30"'),
        ("seed=010", "--set seed: line 1, column 1: 010 is octal"),
        ("seed=1_000", 'seed: found "1_000"'),
        ("seed=true", "seed: found true"),
        ("duration_s=yes", 'duration_s: found "yes"'),
        (f"title={'[' * 3000}", "--set title: line 1"),
        ("sensor" + ".a" * 500 + "=1", "500 keys below each other"),
    ],
)
def test_the_same_reader_is_behind_options(assignment: str, said: str, small: SmallScenario) -> None:
    with pytest.raises(ScenarioError) as raised:
        load(str(small()), None, [assignment])
    assert said in str(raised.value)


def test_what_is_no_text_file_is_refused_and_never_waited_for(tmp_path: Path) -> None:
    os.mkfifo(tmp_path / "pipe.yaml")
    (tmp_path / "folder.yaml").mkdir()
    (tmp_path / "latin.yaml").write_bytes(b"/**:\n  ros__parameters: {title: '\xe9'}\n")
    with (tmp_path / "large.yaml").open("wb") as file:
        file.truncate(LARGEST_BYTES + 1)
    said = {
        "pipe": "is no file", "folder": "is a directory", "latin": "line 2 holds bytes that are no UTF-8",
        "large": "bytes", "none": "there is no such file", "n" * 300: "cannot be read", "nul\0": "no such file",
    }  # fmt: skip
    for name, words in said.items():
        with pytest.raises(ScenarioError, match=words):
            load(str(tmp_path / f"{name}.yaml"))


odd_texts = st.one_of(
    st.sampled_from(
        ["010", "1:30", "y", "NO", "0x1f", "1e5", "~", "", "2024-01-01", "=", "<<", "0o7", "9" * 30, ".nan"]
    ),
    st.text(max_size=12).filter(lambda text: plain_text(text) == text),
)


@given(st.dictionaries(st.from_regex(r"[a-z<]{1,6}", fullmatch=True).filter(lambda key: key != "<<"), odd_texts))
def test_texts_are_written_so_that_every_reader_takes_them_for_texts(body: dict[str, str]) -> None:
    text = write_sections({"/**": body})
    expected = {"/**": {"ros__parameters": body}}
    assert parse_value(text, "here") == expected
    assert yaml.safe_load(text) == expected  # the numbers of YAML 1.1
