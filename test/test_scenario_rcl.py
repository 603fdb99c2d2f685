"""Parameter files that ROS reads: what `etac resolve` prints and what is shipped, read by rcl's own parser."""

from __future__ import annotations

import json
import subprocess
import sys
from pathlib import Path
from typing import Any

import pytest
from conftest import SmallScenario

from etac_ros.errors import ScenarioError
from etac_ros.scenario.document import EVERYWHERE, read_sections
from etac_ros.scenario.load import load, load_files
from etac_ros.scenario.places import available, find

# The parser sits in the library that ROS nodes start with, so a process with nodes in it is asked. It prints what
# rcl gives each of them.
ASK_RCL = """
import json, sys
import rclpy.context, rclpy.node
from rclpy.parameter import parameter_value_to_python
found = []
for files, names in json.load(sys.stdin):
    context = rclpy.context.Context()
    arguments = [word for file in files for word in ("--params-file", file)]
    try:
        rclpy.init(args=["--ros-args", *arguments], context=context)
    except Exception as error:
        found.append(str(error))
        continue
    given = {}
    for name in names:
        namespace, _, base = name.rpartition("/")
        node = rclpy.node.Node(base, namespace=namespace or "/", context=context,
                               start_parameter_services=False, enable_rosout=False)
        given[name] = {key: parameter.value if not hasattr(parameter.value, "tolist") else parameter.value.tolist()
                       for key, parameter in node._parameter_overrides.items()}
        node.destroy_node()
    context.try_shutdown()
    found.append(given)
json.dump(found, sys.stdout, default=list)
"""


def read_by_rcl(*questions: tuple[list[Path], list[str]]) -> list[Any]:
    """For each question, files and names of nodes: the parameters of each node, or rcl's error."""
    asked = json.dumps([([str(file) for file in files], names) for files, names in questions])
    command = [sys.executable, "-c", ASK_RCL]
    done = subprocess.run(command, input=asked, capture_output=True, text=True, timeout=120, check=False)
    assert done.returncode == 0, done.stderr
    found = json.loads(done.stdout)
    assert isinstance(found, list)
    return found


def flat(tree: Any, above: str = "") -> dict[str, Any]:
    """A tree as ROS has it: dotted names, nothing for what is empty."""
    if not isinstance(tree, dict):
        return {} if tree in ([], ()) else {above: tree}
    found: dict[str, Any] = {}
    for key, value in tree.items():
        found.update(flat(value, f"{above}.{key}" if above else key))
    return found


def test_rcl_reads_what_resolve_prints_and_gives_each_node_its_values(tmp_path: Path) -> None:
    questions, wanted = [], []
    for name in available():
        for variant in (None, load(name).run.baseline):
            scenario = load(name, variant)
            path = tmp_path / f"{name}_{variant}.yaml"
            path.write_text(scenario.text, encoding="utf-8")
            sections = read_sections(path)
            questions.append(([path], list(scenario.nodes)))
            wanted.append({node: flat({**sections[EVERYWHERE], **sections[node]}) for node in scenario.nodes})
            assert load(str(path)).digest == scenario.digest
    for question, found, expected in zip(questions, read_by_rcl(*questions), wanted, strict=True):
        assert isinstance(found, dict), (question, found)
        for node, values in expected.items():
            assert comparable(found[node]) == comparable(values), node


def comparable(values: dict[str, Any]) -> dict[str, Any]:
    """Without empty lists, which have no type for ROS, and without what only sweeps read: rcl mistakes the dots of
    NODE.KEY there for its own separators."""
    return {key: value for key, value in values.items() if value is not None and not key.startswith("dispersion.")}


def test_rcl_reads_the_shipped_files() -> None:
    files = [find(name) for name in available()]
    for file, found in zip(files, read_by_rcl(*(([file], ["/sensor"]) for file in files)), strict=True):
        assert isinstance(found, dict), found
        assert found["/sensor"]["scenario"] == file.stem


BASE = """\
/**: {ros__parameters: {scenario: s}}
/a: {ros__parameters: {x: 1, y: 1, m: {p: 1, q: 1}}}
/n/a: {ros__parameters: {x: 1}}
/n/b: {ros__parameters: {x: 1}}
"""
FORMS: dict[str, list[str]] = {
    "a namespace": [BASE, "n: {a: {ros__parameters: {x: 2}}, b: {ros__parameters: {y: 2}}}\n"],
    "namespaces within each other": [BASE.replace("/n/a:", "/k/n/a:"), "k: {n: {a: {ros__parameters: {x: 2}}}}\n"],
    "a name without its slash": [BASE.replace("/a: {ros__parameters: {x: 1, y", "a: {ros__parameters: {x: 1, y")],
    "one namespace, whichever": [BASE + '"/*/a": {ros__parameters: {x: 3}}\n'],
    "any namespaces or none": [BASE + '"/**/a": {ros__parameters: {x: 4, z: [1, 2]}}\n'],
    "every name": [BASE + '"/*": {ros__parameters: {x: 5}}\n'],
    "a wildcard before what it matches": ['"/**/a": {ros__parameters: {x: 6, w: 6}}\n' + BASE],
    "a wildcard of another file": [BASE, '"/**/a": {ros__parameters: {m: {q: 7}}}\n'],
    "a later file wins": [BASE, "/a: {ros__parameters: {x: 8, m: {p: 8}}}\n", "/a: {ros__parameters: {x: 9}}\n"],
    "what comes first in the first file stays first": [
        BASE + '"/**/a": {ros__parameters: {x: 10}}\n',
        "/a: {ros__parameters: {x: 11}}\n",
    ],
}


def test_every_form_of_a_parameter_file_means_here_what_it_means_to_ros(tmp_path: Path) -> None:
    questions, wanted = [], []
    for number, texts in enumerate(FORMS.values()):
        files = [tmp_path / f"{number}_{place}.yaml" for place in range(len(texts))]
        for file, text in zip(files, texts, strict=True):
            file.write_text(text)
        sections = read_sections(*files)
        nodes = [name for name in sections if name != EVERYWHERE]
        questions.append((files, nodes))
        wanted.append({node: flat({"scenario": "s", **sections[node]}) for node in nodes})
    for form, found, expected in zip(FORMS, read_by_rcl(*questions), wanted, strict=True):
        assert found == expected, form


def test_several_files_make_one_scenario(small: SmallScenario, tmp_path: Path) -> None:
    more = tmp_path / "more.yaml"
    more.write_text("/sensor: {ros__parameters: {trigger: {alpha: 0.25}}}\n/**: {ros__parameters: {seed: 9}}\n")
    path = str(small())
    scenario = load_files([path, str(more)])
    assert scenario.digest == load(path, None, ["sensor.trigger.alpha=0.25", "seed=9"]).digest
    assert load_files([path, str(more)], "patient").nodes["/sensor"]["trigger"]["alpha"] == 0.9


def test_files_without_a_section_of_the_run_are_no_scenario(tmp_path: Path) -> None:
    path = tmp_path / "more.yaml"
    path.write_text("/sensor: {ros__parameters: {trigger: {alpha: 0.25}}}\n")
    with pytest.raises(ScenarioError, match="is not a scenario file"):
        load_files([str(path), str(path)])


def test_a_wildcard_that_matches_nothing_is_refused(small: SmallScenario) -> None:
    path = small()
    path.write_text(path.read_text() + '"/**/sensr": {ros__parameters: {low_pass_s: 1.0}}\n')
    with pytest.raises(ScenarioError, match=r"/\*\*/sensr: matches no node\n.*'/sensor'"):
        load(str(path))


def test_one_spacecraft_of_a_formation_may_have_a_section_of_its_own(tmp_path: Path) -> None:
    path = tmp_path / "own.yaml"
    path.write_text("sc2: {sensor: {ros__parameters: {trigger: {c1: 0.5}}}}\n")
    nodes = load_files(["xie2021", str(path)]).nodes
    assert [nodes[f"/sc{i}/sensor"]["trigger"]["c1"] for i in (1, 2, 3)] == [0.001, 0.5, 0.001]
