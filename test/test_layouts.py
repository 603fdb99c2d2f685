"""The layouts in share/ are those that the scenarios give, and name nothing that is not in a bag."""

from __future__ import annotations

import json
import re
from functools import reduce
from pathlib import Path
from typing import Any
from xml.etree import ElementTree

import pytest
from rosbags.highlevel import AnyReader

from etac_ros.runs import layouts_of, run_in_process
from etac_ros.scenario.load import load
from etac_ros.scenario.places import available

SHARE = Path(__file__).parents[1] / "share"
SHORT = {"wu2018": "40", "qi2022": "4", "shi2022": "5", "flexible": "10", "xie2021": "5"}


@pytest.mark.parametrize("name", available())
def test_the_files_are_what_the_scenario_gives(name: str) -> None:
    """``etac layout NAME --output share`` writes them anew."""
    for file, text in layouts_of(load(name)).items():
        assert (SHARE / file).read_text(encoding="utf-8") == text, file


@pytest.mark.parametrize("name", available())
def test_every_topic_and_field_of_a_layout_is_in_the_bag(name: str, tmp_path: Path) -> None:
    run_in_process(load(name, None, [f"duration_s={SHORT[name]}"]), tmp_path / "bag")
    with AnyReader([tmp_path / "bag"]) as reader:
        messages = {c.topic: reader.deserialize(data, c.msgtype) for c, _, data in reader.messages()}
    foxglove = json.loads((SHARE / f"{name}.foxglove.json").read_text(encoding="utf-8"))
    shown = panels_of(foxglove["layout"])
    assert shown == set(foxglove["configById"])
    assert set(foxglove["configById"]["3D!bodies"]["topics"]) <= set(messages)
    curves = [path["value"] for panel in foxglove["configById"].values() for path in panel.get("paths", [])]
    tree = ElementTree.parse(SHARE / f"{name}.plotjuggler.xml")
    juggled = [curve.attrib["name"] for curve in tree.iter("curve")]
    assert len(curves) == len(set(curves)) == len(set(juggled)) > 10
    for curve in curves:
        topic, *fields = curve.split(".")
        number(messages[topic], fields)
        assert "/".join([topic, *fields]) in juggled


def panels_of(layout: Any) -> set[str]:
    if isinstance(layout, str):
        return {layout}
    return panels_of(layout["first"]) | panels_of(layout["second"])


def number(message: Any, fields: list[str]) -> float:
    def step(value: Any, field: str) -> Any:
        name, _, place = re.fullmatch(r"(\w+)(\[(\d+)\])?", field).groups()  # type: ignore[union-attr]
        found = getattr(value, name)
        return found if place is None else found[int(place)]

    return float(reduce(step, fields, message))
