"""Text of others, made harmless: shown in a terminal or on a page, it does nothing there."""

from __future__ import annotations

import unicodedata

_DANGEROUS = {"Cc", "Cf", "Cs", "Cn", "Co", "Zl", "Zp"}
"""Control codes (escape sequences begin with one), codes that hide or turn the direction of writing, lone surrogates,
what is no character, other line ends."""
_KEPT = "\n\t"


def plain_text(text: str, kept: str = _KEPT) -> str:
    r"""The text with every code that a terminal or a page would act on spelled out, as ``\x1b``.

    Parameters
    ----------
    text
        Any text.
    kept
        Codes that stay: line feed and tabulator, unless something else is said.
    """
    if text.isascii() and text.isprintable():
        return text
    return "".join(letter if letter in kept or _is_harmless(letter) else _spelled(letter) for letter in text)


def one_line(text: str) -> str:
    """The same for what has to stay on one line: a title, a name, a value in a table."""
    return plain_text(text, kept="")


def _is_harmless(letter: str) -> bool:
    return unicodedata.category(letter) not in _DANGEROUS


def _spelled(letter: str) -> str:
    return letter.encode("unicode_escape", "surrogatepass").decode("ascii")
