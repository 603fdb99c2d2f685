"""The running digest: no two histories that differ in one act, tick, window, message or value look alike."""

from __future__ import annotations

from itertools import combinations

import numpy as np

from etac_ros.scenario.load import load
from etac_ros.timing.digest import Places, acted, carried, knows_ticks, received
from etac_ros.timing.orders import MessageId


def test_every_act_shows() -> None:
    histories = {
        "acted": acted(0, 0, 0),
        "acted later": acted(0, 1, 0),
        "acted on another window": acted(0, 0, 1),
        "acted after": acted(0x12345678, 0, 0),
        "received nothing": received(0, 0, 0, ()),
        "received nothing later": received(0, 1, 0, ()),
        "received without knowing when": received(0, None, 0, ()),
        "received on another window": received(0, 0, 1, ()),
        "received after": received(0x12345678, 0, 0, ()),
        "received one": received(0, 0, 0, [(0, 1)]),
        "received another": received(0, 0, 0, [(0, 2)]),
        "received of another link": received(0, 0, 0, [(1, 1)]),
        "received two": received(0, 0, 0, [(0, 1), (0, 2)]),
        "received two in another order": received(0, 0, 0, [(0, 2), (0, 1)]),
        "received two one by one": received(received(0, 0, 0, [(0, 1)]), 0, 0, [(0, 2)]),
        "a value": carried(0, np.array([1.0, 2.0])),
        "a value's last bit": carried(0, np.array([1.0, np.nextafter(2.0, 3.0)])),
        "a value after": carried(0x12345678, np.array([1.0, 2.0])),
    }
    for (one, value), (other, another) in combinations(histories.items(), 2):
        assert value != another, f"{one}, {other}"


def test_links_are_numbered_in_their_order() -> None:
    places = Places(["b", "a"])
    assert places.of([MessageId("a", 3), MessageId("b", 1)]) == [(1, 3), (0, 1)]


def test_who_merely_answers_does_not_know_the_tick() -> None:
    modules = load("wu2018").build().modules
    known = {name: knows_ticks(module) for name, module in modules.items()}
    assert known == {"/plant": True, "/sensor": True, "/controller": False, "/actuator": False}
