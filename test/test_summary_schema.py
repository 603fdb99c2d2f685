"""The machine-readable summary: its schema stands in the repository, and both engines keep to it."""

from __future__ import annotations

import json
from importlib.resources import files
from pathlib import Path

import jsonschema
import pytest

from etac_ros.metrics.summary import Summary, summary_schema, with_measured
from etac_ros.runs import run_in_process, run_over_ros
from etac_ros.scenario.load import load

SCHEMA = json.loads(files("etac_ros.metrics").joinpath("summary.schema.json").read_text())
PROMISED = {
    "scenario", "engine", "overrides", "seed", "duration_s", "triggers", "topics", "network", "final_state",
    "performance", "timing", "bag", "published",
}  # fmt: skip


@pytest.fixture(scope="module")
def summaries(tmp_path_factory: pytest.TempPathFactory) -> dict[str, Summary]:
    """Summaries of the same run by both engines, the second with its baseline."""
    scenario = load("wu2018", None, ["duration_s=100"])
    by_calls = run_in_process(scenario).summary
    over_ros = run_over_ros(scenario, tmp_path_factory.mktemp("run") / "bag").summary
    return {"inprocess": by_calls, "ros": with_measured(over_ros, by_calls)}


def test_schema_in_the_repository_is_current() -> None:
    assert json.dumps(SCHEMA, indent=2) + "\n" == summary_schema()


@pytest.mark.parametrize("engine", ["inprocess", "ros"])
def test_summary_keeps_to_the_schema(engine: str, summaries: dict[str, Summary]) -> None:
    content = json.loads(summaries[engine].model_dump_json())
    jsonschema.validate(content, SCHEMA)
    assert content.keys() >= PROMISED
    assert content["engine"] == engine


def test_schema_refuses_what_is_not_promised(summaries: dict[str, Summary]) -> None:
    content = json.loads(summaries["ros"].model_dump_json())
    content["triggers"]["/sensor"].pop("count")
    with pytest.raises(jsonschema.ValidationError):
        jsonschema.validate(content, SCHEMA)


def test_figures_of_the_summary(summaries: dict[str, Summary]) -> None:
    """Totals are sums, an interval is a difference, and measured CDR sizes are the computed ones."""
    ros, inprocess = summaries["ros"], summaries["inprocess"]
    triggers = ros.triggers["/sensor"]
    gaps = [b - a for a, b in zip(triggers.times_s, triggers.times_s[1:], strict=False)]
    assert (triggers.count, triggers.min_interval_s, triggers.max_interval_s) == (
        len(triggers.times_s), min(gaps), max(gaps),
    )  # fmt: skip
    assert triggers.mean_interval_s == pytest.approx(sum(gaps) / len(gaps))
    for name in ("/filtered_error", "/torque_command"):
        topic = ros.topics[name]
        assert (topic.kind, topic.messages, topic.payload_bytes) == (
            "network",
            triggers.count,
            12 * triggers.count,
        )
        assert topic == inprocess.topics[name]
        assert (topic.first_s, topic.last_s) == (triggers.times_s[0], triggers.times_s[-1])
    assert ros.network.payload_bytes == 24 * triggers.count
    assert ros.network.cdr_bytes == 32 * triggers.count
    assert ros.topics["/emulation/torque"].payload_bytes == 0
    assert ros.value("network_payload_bytes") == ros.network.payload_bytes
    assert ros.baseline is not None
    assert ros.value("reduction_percent") == pytest.approx(0.0)


def test_written_by_the_command_line(tmp_path: Path) -> None:
    from etac_ros.cli.run import RunRequest, run_and_show
    from etac_ros.cli.show import make_console

    file = tmp_path / "summary.json"
    request = RunRequest("wu2018", "periodic", ("duration_s=50",), "inprocess", json=file)
    run_and_show(request, make_console())
    content = json.loads(file.read_text())
    jsonschema.validate(content, SCHEMA)
    assert content["triggers"]["/sensor"]["count"] == 50
    assert content["overrides"] == {"duration_s": 50}
    assert content["variant"] == "periodic"
