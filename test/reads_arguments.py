"""Asks, for the tests, what command lines say to a node: in a process of its own, since DDS stays where it was."""

from __future__ import annotations

import json
import os
import sys
from typing import Any

from etac_ros.cli.nodes import check_same_for_all, join_domain, own_options
from etac_ros.errors import ScenarioError
from etac_ros.scenario.load import load

domain = join_domain()
from etac_ros.engines.ros.arguments import RosArguments  # noqa: E402

SCENARIO = load("wu2018")


def answer(executable: str, arguments: list[str]) -> dict[str, Any]:
    try:
        with RosArguments(executable, arguments, domain) as given:
            own = own_options(executable, given.others)
            check_same_for_all(executable, SCENARIO, given)
            found = [given.name, list(given.params_files), list(given.passed_on)]
            return {"found": found, "own": [str(own.bag), own.clock, own.rate, own.live]}
    except ScenarioError as error:
        return {"refused": str(error)}


answers = [answer(executable, arguments) for executable, arguments in json.load(sys.stdin)]
json.dump(answers, sys.stdout)
sys.stdout.flush()
os._exit(0)  # Fast DDS was seen to hang when a process ends
