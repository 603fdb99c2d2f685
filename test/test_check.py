"""etac check says which class keeps a hidden state, or depends on windows."""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path

import pytest
from test_promises import PLANT, RULE, SENSOR, SIGNAL
from typer.testing import CliRunner

from etac_ros.check import check
from etac_ros.cli.main import app
from etac_ros.scenario.load import load

Small = Callable[..., Path]
CASES = {
    "plant with hidden state": (
        (PLANT, '"faulty:Forgetful"'),
        ["/plant: Forgetful.propagate gives something else when it is asked the same again"],
    ),
    "matrix product over a window": (
        (SIGNAL, '{class: "faulty:Matrix", beta: 0.5}'),
        ["/sensor: Matrix.evaluate gives other bits for samples one by one", "einsum"],
    ),
    "signal that works in place": (
        (SIGNAL, '{class: "faulty:InPlace", beta: 0.5}'),
        ["/sensor: InPlace.evaluate changes an argument"],
    ),
    "rule that counts": (
        (RULE, '{class: "faulty:Counting", alpha: 0.5, gamma: 1.0e-6}'),
        ["/sensor: Counting.first gives something else when it is asked the same again"],
    ),
    "module that remembers a look": (
        (SENSOR, '    module: "faulty:Restless"\n    reads: /plant\n    scan: ""\n'),
        ["/sensor: Restless.scan gives something else"],
    ),
}


@pytest.mark.parametrize("case", list(CASES))
def test_the_class_is_named(case: str, small: Small) -> None:
    replacement, parts = CASES[case]
    checked = check(load(str(small(replacement))))
    texts = "\n".join(map(str, checked.faults))
    assert all(part in texts for part in parts), texts


def test_a_scenario_that_keeps_the_contract(small: Small) -> None:
    checked = check(load(str(small())), most_ticks=100)
    assert checked.ticks == 100
    assert checked.faults == ()
    assert [run.length for run in checked.runs] == [1, 7, 64]
    assert len({run.digest for run in checked.runs}) == 1
    assert checked.runs[0].triggers > 2


def test_the_command_tells_by_its_exit_code(small: Small) -> None:
    good = CliRunner().invoke(app, ["check", str(small())])
    assert good.exit_code == 0, good.output
    assert "the same bits in all windows" in good.output
    bad = CliRunner().invoke(app, ["check", str(small((PLANT, '"faulty:Forgetful"')))])
    assert bad.exit_code == 1
    assert "Forgetful.propagate" in bad.output
