"""A thousand mangled scenarios and a thousand mangled bags: each is read, or refused in words, and none hangs.

    ./scripts/bench fuzz                                    # 1,000 of each; the suite tries some hundreds
    ./scripts/bench fuzz --examples 20000 --only scenarios
    ./scripts/bench fuzz --write docs/fuzz.md

The generators are those of ``test/test_scenario_fuzz.py`` and ``test/test_bag_fuzz.py``, told to try more. An error
that is none of ours fails its test, which prints the smallest case that shows it; a file that takes longer than the
limit hangs. The exit code says whether there was either.
"""

from __future__ import annotations

import os
import re
import subprocess
import sys
import time
from dataclasses import dataclass
from pathlib import Path
from typing import Annotated

import typer

ROOT = Path(__file__).resolve().parent.parent
FILES = {"scenarios": ("test_scenario_fuzz.py", 850), "bags": ("test_bag_fuzz.py", 140)}
"""The test file, and how many examples it tries by itself."""
_TRIED = re.compile(r"- (\d+) passing, (\d+) failing, and (\d+) invalid")
_LIMIT_S = 4.0
"""Wall time a case; far more than any takes, and for the whole file a bound all the same."""


@dataclass(frozen=True)
class Tried:
    """What came of one kind."""

    kind: str
    read: int
    failed: int
    seconds: float
    hung: bool


def fuzz_kind(kind: str, examples: int) -> Tried:
    """Try so many of one kind, in a process of its own."""
    file, own = FILES[kind]
    scale = -(-examples // own)
    options = ["-q", "-p", "no:cacheprovider", "--hypothesis-show-statistics"]
    began = time.monotonic()
    try:
        done = subprocess.run(
            [sys.executable, "-m", "pytest", *options, str(ROOT / "test" / file)],
            cwd=ROOT,
            env={**os.environ, "ETAC_FUZZ": str(scale)},
            capture_output=True,
            text=True,
            timeout=_LIMIT_S * own * scale,
        )
    except subprocess.TimeoutExpired:
        return Tried(kind, 0, 0, time.monotonic() - began, hung=True)
    found = [tuple(map(int, numbers)) for numbers in _TRIED.findall(done.stdout)]
    if done.returncode:
        print(done.stdout, done.stderr, file=sys.stderr)
    failed = max(sum(failing for _, failing, _ in found), int(done.returncode != 0))
    return Tried(kind, sum(passing for passing, _, _ in found), failed, time.monotonic() - began, hung=False)


def main(
    examples: Annotated[int, typer.Option(min=1, help="Of each kind, at least.")] = 1000,
    only: Annotated[str, typer.Option(help="scenarios or bags.")] = "",
    write: Annotated[Path | None, typer.Option(help="Where the page goes.")] = None,
) -> None:
    """Try, and print what came of it."""
    tried = [fuzz_kind(kind, examples) for kind in FILES if only in ("", kind)]
    lines = [
        "# Fuzzing",
        "",
        f"Written by `./scripts/bench fuzz --examples {examples} --write docs/fuzz.md`. The cases are drawn, always "
        "the same ones. What is mangled: values, keys, whole sections, pieces of text and bytes of scenarios, and odd "
        "options; attachments, metadata, messages, times and bytes of bags, which are described, read and recovered.",
        "",
        "| kind | cases | tracebacks | hangs | seconds |",
        "| --- | --- | --- | --- | --- |",
        *(f"| {one.kind} | {one.read:,} | {one.failed} | {int(one.hung)} | {one.seconds:.0f} |" for one in tried),
    ]
    text = "\n".join(lines) + "\n"
    print(text)
    good = all(not one.failed and not one.hung and one.read >= examples for one in tried)
    if write is not None and good:
        write.write_text(text, encoding="utf-8")
    raise typer.Exit(not good)


if __name__ == "__main__":
    typer.run(main)
