"""Whatever a stranger writes into a bag, it is read, or refused in words: no traceback, no hang.

``ETAC_FUZZ=20`` tries twenty times as many.
"""

from __future__ import annotations

import json
import os
import tempfile
from contextlib import suppress
from functools import cache
from pathlib import Path

import numpy as np
import pytest
from conftest import FewFigures
from hypothesis import given, settings
from hypothesis import strategies as st
from toy import toy
from typer.testing import CliRunner

from etac_ros.bag.codec import decode_truth, encode, encode_truth
from etac_ros.bag.describe import describe
from etac_ros.bag.description import DESCRIPTION_ATTACHMENT
from etac_ros.bag.read import read_bag
from etac_ros.bag.recover import recover
from etac_ros.bag.topics import TopicDescription
from etac_ros.bag.write import BagWriter
from etac_ros.cli.main import app
from etac_ros.errors import BagError, EtacError
from etac_ros.report import write_report
from etac_ros.report.source import read_run
from etac_ros.runs import SCENARIO_ATTACHMENT, run_in_process
from etac_ros.scenario.load import load

SCALE = int(os.environ.get("ETAC_FUZZ", "1"))
Raw = tuple[TopicDescription, int, int, int, bytes]


@cache
def contents(
    whose: str,
) -> tuple[list[TopicDescription], dict[str, bytes], dict[str, str], list[Raw], dict[str, bytes]]:
    """Topics, attachments, metadata and messages of a bag of ours, or of one with classes of others; and its files."""
    with tempfile.TemporaryDirectory() as folder:
        if whose == "ours":
            scenario = load("wu2018", None, ["duration_s=4"])
        else:
            scenario = toy(Path(folder), {"a": {"at": [1, 4]}, "b": {"echo": True}})
        run_in_process(scenario, Path(folder, "bag"))
        bag = read_bag(Path(folder, "bag"))
        files = {path.name: path.read_bytes() for path in Path(folder, "bag").iterdir()}
        return list(bag.topics), bag.attachments, bag.metadata, list(map(tuple, bag.messages())), files  # type: ignore[arg-type]


def look(bag: Path) -> None:
    """Do all that is done with a bag but draw it; any error has to be one for people."""
    for attempt in (describe, read_run, lambda bag: recover(bag, bag.with_name("saved"))):
        with suppress(EtacError):
            attempt(bag)


odd_numbers = st.sampled_from([np.nan, np.inf, -np.inf, 1e308, -1e200, 0.0, 1e-320])
odd_times = st.one_of(st.integers(0, 2**64 - 1), st.integers(0, 10**10), st.just(0))
odd_texts = st.sampled_from(
    ["", "[" * 2000, "{" * 2000, "null", "-1", "1e999", "nan", "[]", "{}", "\x1b]0;x\x07", "$\\frac{", "9" * 5000, "0",
     "etac_ros.cli.main:app", "os:system", "!!python/object:os.system", "&a [*a]", "2020-01-01", "1" + "0" * 40, '"',
     "/plant", "etac_ros.plants.rigid_mrp:RigidMrp", "physical", "\u202e"]
)  # fmt: skip


@st.composite
def mangled_text(draw: st.DrawFn, text: bytes) -> bytes:
    """A few words or parts of a text exchanged for odd ones."""
    for _ in range(draw(st.integers(1, 3))):
        start = draw(st.integers(0, max(len(text) - 1, 0)))
        end = min(len(text), start + draw(st.integers(0, 40)))
        if draw(st.booleans()):  # whole words, so that it stays YAML or JSON more often
            while start > 0 and text[start - 1 : start] not in b" ,\n[{:":
                start -= 1
            while end < len(text) and text[end : end + 1] not in b" ,\n]}":
                end += 1
        text = text[:start] + draw(odd_texts).encode("utf-8", "surrogatepass") + text[end:]
    return text


@st.composite
def mangled_json(draw: st.DrawFn, text: bytes) -> bytes:
    """Some value of a tree exchanged for another kind of value, or taken away."""
    tree = json.loads(text)
    for _ in range(draw(st.integers(1, 3))):
        part = tree
        while isinstance(part, dict | list) and part:
            key = draw(st.sampled_from(sorted(part) if isinstance(part, dict) else range(len(part))))
            if not isinstance(part[key], dict | list) or not part[key] or draw(st.integers(0, 4)) == 0:
                odd = [None, -1, 0, 1, 7, 10**30, 1.5, "", "/plant", [], {}, [0, 1], [3, 1], True, "x" * 50]
                if draw(st.booleans()) and isinstance(part, dict):
                    del part[key]
                else:
                    part[key] = draw(st.sampled_from(odd))
                break
            part = part[key]
    return json.dumps(tree).encode()


@st.composite
def mangled_message(draw: st.DrawFn, raw: Raw) -> Raw:
    topic, logged, published, sequence, cdr = raw
    what = draw(st.integers(0, 6))
    if what == 0:
        logged = draw(odd_times)
    elif what == 1:
        logged = published = draw(odd_times)
    elif what == 2:
        sequence = draw(st.integers(0, 2**32 - 1))
    elif what == 3:
        cdr = cdr[: draw(st.integers(0, len(cdr)))]
    elif what == 4 and len(cdr) > 4:
        place = draw(st.integers(4, len(cdr) - 1))
        cdr = cdr[:place] + bytes([draw(st.integers(0, 255))]) + cdr[place + 1 :]
    elif topic.link is None:
        shape = draw(st.tuples(st.integers(1, 40), st.integers(0, 9)))
        cdr = encode_truth(draw(st.sampled_from([0, 1, 2**53])), np.full(shape, draw(odd_numbers)))
    elif topic.type_name.endswith("MultiArray"):
        with np.errstate(over="ignore"):
            cdr = encode(topic.type_name, np.full(draw(st.integers(0, 9)), draw(odd_numbers)), 0)
    else:
        with np.errstate(over="ignore"):  # what is too large for a float32 is infinite there
            cdr = encode(topic.type_name, np.full(3, np.float32(draw(odd_numbers))), 0)
    return topic, logged, published, sequence, cdr


@settings(max_examples=100 * SCALE)
@given(st.data(), st.sampled_from(["ours", "theirs"]))
def test_a_bag_with_sound_checksums_may_say_anything(data: st.DataObject, whose: str) -> None:
    topics, attachments, metadata, messages, _ = contents(whose)
    attachments, metadata, messages = dict(attachments), dict(metadata), list(messages)
    for _ in range(data.draw(st.integers(1, 2))):
        match data.draw(st.integers(0, 4)):
            case 0:
                text = attachments[SCENARIO_ATTACHMENT]
                attachments[SCENARIO_ATTACHMENT] = data.draw(mangled_text(text))
            case 1:
                text = attachments[DESCRIPTION_ATTACHMENT]
                attachments[DESCRIPTION_ATTACHMENT] = data.draw(mangled_text(text))
            case 2:
                try:
                    attachments[DESCRIPTION_ATTACHMENT] = data.draw(mangled_json(attachments[DESCRIPTION_ATTACHMENT]))
                except ValueError:  # it is no JSON any more
                    attachments[DESCRIPTION_ATTACHMENT] = b""
            case 3:
                key = data.draw(st.sampled_from(sorted(metadata)))
                metadata[key] = data.draw(odd_texts)
            case _:
                place = data.draw(st.integers(0, len(messages) - 1))
                messages[place] = data.draw(mangled_message(messages[place]))
    with tempfile.TemporaryDirectory() as folder:
        bag = Path(folder, "bag")
        try:
            with BagWriter(bag, topics, attachments, metadata) as writer:
                for topic, logged, published, sequence, cdr in messages:
                    writer.write(topic.name, cdr, logged, published, sequence)
        except BagError:  # not even our writer takes such a rate of ticks
            return
        look(bag)


@settings(max_examples=40 * SCALE)
@given(st.data(), st.sampled_from(["ours", "theirs"]))
def test_a_bag_may_have_any_bytes_in_any_place(data: st.DataObject, whose: str) -> None:
    *_, files = contents(whose)
    with tempfile.TemporaryDirectory() as folder:
        bag = Path(folder, "bag")
        bag.mkdir()
        for name, content in files.items():
            (bag / name).write_bytes(content)
        name = data.draw(st.sampled_from(sorted(files)))
        content = files[name]
        for _ in range(data.draw(st.integers(1, 3))):
            start = data.draw(st.integers(0, len(content)))
            end = min(len(content), start + data.draw(st.integers(0, 200)))
            content = content[:start] + data.draw(st.binary(max_size=60)) + content[end:]
        (bag / name).write_bytes(content)
        look(bag)


@pytest.mark.parametrize(
    ("key", "value", "found"),
    [
        ("overrides", "{", "overrides: found {"),
        ("overrides", "[" * 100_000, "overrides: found [["),
        ("overrides", "[1]", "overrides: found [1]"),
        ("ticks_per_second", "33", "33 ticks a second, and 32 in its scenario"),
    ],
)
def test_metadata_that_makes_no_sense_is_named(tmp_path: Path, key: str, value: str, found: str) -> None:
    topics, attachments, metadata, messages, _ = contents("ours")
    with BagWriter(tmp_path / "bag", topics, attachments, {**metadata, key: value}) as writer:
        for topic, logged, published, sequence, cdr in messages:
            if key != "ticks_per_second":
                writer.write(topic.name, cdr, logged, published, sequence)
    with pytest.raises(BagError) as caught:
        write_report(tmp_path / "bag")
    assert found in str(caught.value)


@pytest.mark.parametrize("value", [np.nan, np.inf, 1e308])
def test_a_state_that_is_no_number_is_named_with_its_tick(tmp_path: Path, value: float) -> None:
    topics, attachments, metadata, messages, _ = contents("ours")
    with BagWriter(tmp_path / "bag", topics, attachments, metadata) as writer:
        for topic, logged, published, sequence, cdr in messages:
            changed = cdr
            if topic.plant is not None:
                first, samples = decode_truth(cdr)
                samples[max(40 - first, 0) :, 5] = value
                changed = encode_truth(first, samples)
            writer.write(topic.name, changed, logged, published, sequence)
    with pytest.raises(BagError, match=r"/plant: from 1\.25 s \(tick 40\) on the state is no number") as caught:
        write_report(tmp_path / "bag")
    assert "--set duration_s=1.25" in caught.value.remedy
    assert describe(tmp_path / "bag").duration_s == 4.0


ODD = "$\\frac{$ <script>"
CODES = "\x1b]0;gone\x07\u202e"


def test_an_odd_title_is_shown_and_does_nothing(
    tmp_path: Path, recwarn: pytest.WarningsRecorder, few_figures: FewFigures
) -> None:
    few_figures("overview", "network")
    topics, attachments, metadata, messages, _ = contents("ours")
    title = json.loads(json.dumps(load("wu2018").run.title))
    text = attachments[SCENARIO_ATTACHMENT].decode().replace("\n", "\n", 1)
    start = text.index(title[:20])
    line_start = text.rindex("\n", 0, start) + 1
    line_end = text.index("\n    ", start)
    while text[line_end + 5] == " ":  # the title goes on
        line_end = text.index("\n    ", line_end + 1)
    changed = f"{text[:line_start]}    title: {json.dumps(ODD)}{text[line_end:]}"
    attachments = {**attachments, SCENARIO_ATTACHMENT: changed.encode()}
    with BagWriter(tmp_path / "bag", topics, attachments, {**metadata, "engine": CODES}) as writer:
        for topic, logged, published, sequence, cdr in messages:
            writer.write(topic.name, cdr, logged, published, sequence)
    assert read_run(tmp_path / "bag").scenario.run.title == ODD
    page = write_report(tmp_path / "bag").read_text(encoding="utf-8")
    assert "<h1>$\\frac{$ &lt;script&gt;</h1>" in page
    assert "\\x1b]0;gone\\x07\\u202e" in page
    assert "\x1b" not in page
    done = CliRunner().invoke(app, ["info", str(tmp_path / "bag")])
    assert done.exit_code == 0
    assert "\x1b" not in done.output
    assert "\u202e" not in done.output
    assert "\\x1b]0;gone" in done.output
