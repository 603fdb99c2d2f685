"""Text of others is shown letter by letter: nothing in it is a command to a terminal or a page."""

import unicodedata

import pytest
from hypothesis import given
from hypothesis import strategies as st

from etac_ros.errors import BagError
from etac_ros.plain_text import one_line, plain_text


@pytest.mark.parametrize(
    ("text", "shown"),
    [
        ("\x1b[31mred\x1b[0m", r"\x1b[31mred\x1b[0m"),
        ("\x9b31m", r"\x9b31m"),
        ("\x1b]0;title\x07", r"\x1b]0;title\x07"),
        ("a\rb\x08\x00\x7f", r"a\rb\x08\x00\x7f"),
        ("abc\u202egpj.exe", r"abc\u202egpj.exe"),
        ("\u200b\u2066\ufeff\u2028", r"\u200b\u2066\ufeff\u2028"),
        ("\ud800", r"\ud800"),
        ("|s(tᵢ) − s| ≤ ½ N²m²s, 姿态, ω̇", "|s(tᵢ) − s| ≤ ½ N²m²s, 姿态, ω̇"),
        ("two\nlines\tand a tab", "two\nlines\tand a tab"),
    ],
)
def test_what_is_shown(text: str, shown: str) -> None:
    assert plain_text(text) == shown


def test_a_line_stays_one() -> None:
    assert one_line("two\nlines\tand a tab") == r"two\nlines\tand a tab"


@given(st.text(st.characters()))
def test_nothing_that_acts_is_left(text: str) -> None:
    shown = one_line(text)
    assert all(unicodedata.category(letter) not in ("Cc", "Cf", "Cs", "Zl", "Zp") for letter in shown)
    assert one_line(shown) == shown
    shown.encode("utf-8")


def test_errors_are_plain() -> None:
    error = BagError("/tmp/\x1b[2Jbag", "found \x1b]0;x\x07", "a\nb", "c\x9b")
    assert str(error) == "/tmp/\\x1b[2Jbag: found \\x1b]0;x\\x07\n  expected: a\nb\n  to mend it: c\\x9b"
