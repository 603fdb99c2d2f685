"""What cannot be reported is refused in words: where, what was found, what was expected, what to do."""

from __future__ import annotations

import subprocess
import sys
from dataclasses import replace
from fractions import Fraction
from pathlib import Path

import pytest

from etac_ros.bag.from_recording import write_recording
from etac_ros.bag.read import read_bag
from etac_ros.errors import BagError, EtacError
from etac_ros.maths.wall_clock import WallClock
from etac_ros.report import ReportError, write_report
from etac_ros.report.plausible import check_fit
from etac_ros.runs import SCENARIO_ATTACHMENT, Run, bag_metadata, run_in_process
from etac_ros.scenario.load import load


@pytest.fixture(scope="module")
def recorded(tmp_path_factory: pytest.TempPathFactory) -> Run:
    return run_in_process(load("wu2018", None, ["duration_s=5"]), tmp_path_factory.mktemp("bags") / "bag")


def bag_of(recorded: Run) -> Path:
    assert recorded.bag is not None
    return recorded.bag


def rewritten(recorded: Run, bag: Path, attachments: dict[str, bytes]) -> Path:
    scenario = recorded.scenario
    metadata = bag_metadata(scenario, "inprocess")
    write_recording(bag, scenario.build(), recorded.recording, metadata, attachments)
    return bag


def complete(error: EtacError) -> bool:
    return all((error.where, error.found, error.expected, error.remedy))


def test_no_bag_at_all(tmp_path: Path) -> None:
    with pytest.raises(BagError, match=r"holds 0 \.mcap files"):
        write_report(tmp_path)
    with pytest.raises(BagError, match="is not there"):
        write_report(tmp_path / "nowhere")
    assert list(tmp_path.iterdir()) == []


def test_a_bag_without_its_scenario(recorded: Run, tmp_path: Path) -> None:
    bag = rewritten(recorded, tmp_path / "bag", {"notes.txt": b""})
    with pytest.raises(
        BagError, match=r"no attachment scenario.yaml in it \(attachments: notes.txt, run.json\)"
    ) as caught:
        write_report(bag)
    assert complete(caught.value)
    assert not (bag / "report").exists()


def test_a_scenario_whose_classes_are_not_here(recorded: Run, tmp_path: Path) -> None:
    text = recorded.scenario.text.replace("etac_ros.laws.wu2018:Proportional", "their_laws.mine:Law")
    bag = rewritten(recorded, tmp_path / "bag", {SCENARIO_ATTACHMENT: text.encode()})
    with pytest.raises(BagError, match=r"'their_laws\.mine' cannot be imported") as caught:
        write_report(bag, trust=True)
    assert complete(caught.value)
    assert "/tmp" not in caught.value.found


def test_a_scenario_with_a_link_that_was_not_recorded(recorded: Run, tmp_path: Path) -> None:
    text = recorded.scenario.text.replace("torque_command:", "other_command:")
    bag = rewritten(recorded, tmp_path / "bag", {SCENARIO_ATTACHMENT: text.encode()})
    with pytest.raises(BagError, match="link other_command: is not in the bag"):
        write_report(bag)


def test_a_bag_without_a_sample(recorded: Run, tmp_path: Path) -> None:
    recording = type(recorded.recording)(recorded.recording.messages, {"/plant": []})
    scenario = recorded.scenario
    attachments = {SCENARIO_ATTACHMENT: scenario.text.encode()}
    write_recording(tmp_path / "bag", scenario.build(), recording, bag_metadata(scenario, "ros"), attachments)
    with pytest.raises(BagError, match="not one committed sample") as caught:
        write_report(tmp_path / "bag")
    assert complete(caught.value)


def test_a_run_of_other_plants_over_it(recorded: Run, tmp_path: Path) -> None:
    run_in_process(load("flexible", None, ["duration_s=1"]), tmp_path / "other")
    with pytest.raises(
        BagError, match=r"a run of scenario 'flexible' with /plant \(etac_ros.plants.flexible:Fl"
    ) as caught:
        write_report(bag_of(recorded), [tmp_path / "other"], tmp_path / "report")
    assert complete(caught.value)
    assert caught.value.where == str(tmp_path / "other")
    assert "/plant (etac_ros.plants.rigid:RigidBody)" in caught.value.expected
    assert not (tmp_path / "report").exists()


@pytest.mark.parametrize("place", ["file", "file/report"])
def test_a_folder_that_cannot_be_made(recorded: Run, place: str, tmp_path: Path) -> None:
    (tmp_path / "file").write_text("in the way")
    with pytest.raises(ReportError, match="cannot be written") as caught:
        write_report(bag_of(recorded), output=tmp_path / place)
    assert complete(caught.value)
    assert (tmp_path / "file").read_text() == "in the way"


def test_the_folder_that_is_named_is_the_one_in_the_way(recorded: Run, tmp_path: Path) -> None:
    (tmp_path / "file").write_text("in the way")
    with pytest.raises(ReportError, match="cannot be written") as caught:
        write_report(bag_of(recorded), output=tmp_path / "report", figures=tmp_path / "file")
    assert caught.value.where == str(tmp_path / "file")


def test_a_page_that_cannot_be_written(recorded: Run, tmp_path: Path) -> None:
    (tmp_path / "overview.png").mkdir()
    with pytest.raises(ReportError, match="cannot be written"):
        write_report(bag_of(recorded), output=tmp_path)


def test_importing_the_room_costs_neither_ros_nor_matplotlib() -> None:
    code = "import sys, etac_ros.report; print({'rclpy', 'matplotlib'} & set(sys.modules))"
    done = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, check=True)
    assert done.stdout.strip() == "set()"


def test_in_real_time_who_is_late_may_send_after_the_end_and_in_simulated_time_nobody_does(recorded: Run) -> None:
    assert recorded.bag is not None
    graph, found = recorded.scenario.graph, read_bag(recorded.bag)
    (first, *_) = recorded.recording.messages["filtered_error"]
    late = [first._replace(tick=graph.end_tick + 1)]
    simulated = replace(recorded.recording, messages={**recorded.recording.messages, "filtered_error": late})
    with pytest.raises(BagError, match=f"was sent at tick {graph.end_tick + 1}"):
        check_fit(recorded.bag, found, graph, simulated)
    check_fit(recorded.bag, found, graph, replace(simulated, wall=WallClock(0, 32, Fraction(1))))
