"""The layouts in share/ are those that the scenarios give, and name nothing that is not in a bag."""

from __future__ import annotations

import json
import re
from functools import reduce
from pathlib import Path
from typing import Any
from xml.etree import ElementTree

import pytest
from pydantic import TypeAdapter
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


OF_FORKS = {"title", "axisScale"}
"""Keys that Lichtblick, the open fork of Foxglove, reads instead of a newer one beside it."""


@pytest.mark.parametrize("name", available())
def test_foxglove_knows_every_key_and_its_values(name: str) -> None:
    """Foxglove publishes what its layouts may hold as classes of its SDK."""
    published = pytest.importorskip("foxglove.layouts", reason="foxglove-sdk is not installed")

    def check(kind: str, found: dict[str, Any]) -> None:
        known = getattr(published, kind)
        words = {key: re.sub(r"[A-Z]", lambda letter: "_" + letter[0].lower(), key) for key in found}
        assert set(found) <= set(known()._to_dict()) | OF_FORKS, kind
        TypeAdapter(known).validate_python({words[key]: found[key] for key in found if key not in OF_FORKS})

    foxglove = json.loads((SHARE / f"{name}.foxglove.json").read_text(encoding="utf-8"))
    for panel, config in foxglove["configById"].items():
        assert config.pop("foxglovePanelTitle", "") == config.get("title", "")
        if panel.startswith("Plot!"):
            for series in config.pop("paths"):
                check("PlotSeries", series)
            check("PlotConfig", config)
            continue
        for topic in config.pop("topics").values():
            check("BaseRendererRosMarkerTopicSettings", topic)
        check("ThreeDeeCameraState", config.pop("cameraState"))
        check("BaseRendererTransforms", config.pop("scene")["transforms"])
        check("ThreeDeeConfig", config)


PLOTJUGGLER = {
    "tabbed_widget": {"parent", "name"},
    "Tab": {"containers", "tab_name"},
    "Container": set(),
    "DockSplitter": {"orientation", "count", "sizes"},
    "DockArea": {"name"},
    "plot": {"mode", "style", "flip_x", "flip_y"},
    "limitY": set(),
    "curve": {"name", "color"},
    "currentTabIndex": {"index"},
    "use_relative_time_offset": {"enabled"},
}
"""What its loader reads (plot_docker.cpp, plotwidget.cpp) of what we write."""


@pytest.mark.parametrize("name", available())
def test_plotjuggler_reads_every_element(name: str) -> None:
    for element in ElementTree.parse(SHARE / f"{name}.plotjuggler.xml").getroot().iter():
        if element.tag == "root":
            continue
        assert set(element.attrib) == PLOTJUGGLER[element.tag]
        if element.tag == "DockSplitter":
            # It asks for as many sizes as parts without looking whether they are there.
            count = int(element.attrib["count"])
            sizes = [float(size) for size in element.attrib["sizes"].split(";")]
            assert len(sizes) == len(element) == count
            assert sum(sizes) == pytest.approx(1.0, abs=1e-5)
            assert element.attrib["orientation"] in "|-"
        elif element.tag == "plot":
            assert (element.attrib["mode"], element.attrib["style"]) == ("TimeSeries", "Lines")


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
