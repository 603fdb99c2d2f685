"""A bag that was cut off has its state again when it is repaired: as far as its samples go, and the very messages."""

from __future__ import annotations

from pathlib import Path

import pytest

from etac_ros.bag.contents import Contents
from etac_ros.bag.metadata import FILE_NAME
from etac_ros.bag.recover import recover
from etac_ros.runs import run_in_process, state_rest
from etac_ros.scenario.load import load

State = dict[str, list[tuple[int, bytes]]]


def state_of(directory: Path) -> tuple[State, int]:
    """State by topic, with the time it tells of, and the end of the samples [ns]."""
    found: State = {}
    end = 0
    for message in Contents(directory / f"{directory.name}_0.mcap").messages():
        if message.topic.kind == "state":
            found.setdefault(message.topic.name, []).append((message.publish_time_ns, message.cdr))
        elif message.topic.plant is not None:
            end = max(end, message.publish_time_ns)
    return found, end


@pytest.mark.parametrize(("name", "variant", "duration_s"), [("xie2021", "radio", 1), ("shi2022", None, 10)])
def test_what_waited_to_be_written_is_made_of_the_samples(
    name: str, variant: str | None, duration_s: int, tmp_path: Path
) -> None:
    whole, cut = tmp_path / "whole", tmp_path / "cut"
    scenario = load(name, variant, [f"duration_s={duration_s}", f"state_rate_hz={50 / duration_s}"])
    for directory in (whole, cut):
        run_in_process(scenario, directory)
    expected, end = state_of(whole)
    file = cut / "cut_0.mcap"
    data = file.read_bytes()
    file.write_bytes(data[: len(data) // 2])
    (cut / FILE_NAME).unlink()
    report = recover(cut, completing=state_rest)
    assert not report.nothing_to_do
    found, reached = state_of(cut)
    assert 0 < reached < end
    assert report.messages["/tf"] == len(found["/tf"]) > 5
    plants = scenario.graph.plants
    for topic, messages in expected.items():
        inside = [one for one in messages if one[0] <= reached]
        assert set(found[topic]) <= set(inside), topic
        # Several plants have not all got as far.
        assert len(plants) > 1 or sorted(found[topic]) == sorted(inside), topic
    assert recover(cut, completing=state_rest).nothing_to_do


def test_what_is_there_is_not_made_twice(tmp_path: Path) -> None:
    run_in_process(load("wu2018", None, ["duration_s=20"]), tmp_path / "bag")
    contents = Contents(tmp_path / "bag" / "bag_0.mcap")
    messages = list(contents.messages())
    rest = state_rest(contents)
    assert rest is not None
    for message in messages:
        rest.take(message)
    assert list(rest.rest()) == []
    half = state_rest(contents)
    assert half is not None
    kept = [m for m in messages if m.topic.name != "/tf" or m.sequence <= 10]
    for message in kept:
        half.take(message)
    missing = [(topic, cdr, logged, published) for topic, cdr, logged, published, _ in half.rest()]
    assert missing == [(m.topic.name, m.cdr, m.log_time_ns, m.publish_time_ns) for m in messages if m not in kept]


@pytest.mark.parametrize("changes", [["state_rate_hz=0"], ["truth_every=5"]])
def test_what_cannot_be_completed_is_left_as_it_is(changes: list[str], tmp_path: Path) -> None:
    run_in_process(load("wu2018", None, ["duration_s=20", *changes]), tmp_path / "bag")
    contents = Contents(tmp_path / "bag" / "bag_0.mcap")
    list(contents.messages())
    assert state_rest(contents) is None
