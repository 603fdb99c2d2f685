"""The registry of message types and topics: what it names exists, and nothing else keeps such names."""

from __future__ import annotations

import re
from pathlib import Path

import numpy as np
import pytest

import etac_ros
from etac_ros.bag.codec import decode, encode
from etac_ros.bag.definitions import schema_text
from etac_ros.graph import topics
from etac_ros.graph.wire import CLOCK_TYPE, LINK_TYPES, NOTE_TYPE, SCALAR_FIELDS, TABLE_TYPE

PACKAGE = Path(etac_ros.__file__).parent
REGISTRY = {PACKAGE / "graph" / "wire.py", PACKAGE / "graph" / "topics.py"}
SHOWN = {PACKAGE / "bag" / "state.py", PACKAGE / "bag" / "markers.py"}
"""What bags show of bodies, which no node ever sends: types of their own."""


@pytest.mark.parametrize("name", [*LINK_TYPES, NOTE_TYPE, TABLE_TYPE, CLOCK_TYPE])
def test_every_type_is_one_of_the_common_interfaces(name: str) -> None:
    assert schema_text(name)


@pytest.mark.parametrize("name", LINK_TYPES)
def test_a_bag_restores_every_component_at_its_place(name: str) -> None:
    value = np.arange(1.0, 1.0 + len(SCALAR_FIELDS.get(name, "12345")))
    assert decode(name, encode(name, value, 1_500_000_000)).tolist() == value.tolist()


def test_types_of_the_emulation_plane() -> None:
    assert topics.type_of("/clock") == CLOCK_TYPE
    assert topics.type_of(topics.window_topic("/sm/plant")) == TABLE_TYPE
    assert topics.type_of(topics.truth_topic("/sm/plant")) == TABLE_TYPE
    assert topics.type_of(topics.next_topic("/sensor")) == topics.type_of(topics.JOIN) == NOTE_TYPE


def test_no_other_file_names_a_topic_of_the_emulation_plane_or_a_message_type() -> None:
    types = "|".join({*LINK_TYPES, NOTE_TYPE, TABLE_TYPE, CLOCK_TYPE})
    named = re.compile(rf'"(\{{EMULATION\}}/|/emulation|/clock|({types})")')
    others = [path for path in PACKAGE.rglob("*.py") if path not in REGISTRY | SHOWN]
    found = [path.name for path in others if named.search(path.read_text(encoding="utf-8"))]
    assert found == []
