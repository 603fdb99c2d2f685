"""Looking at a bag runs nobody's code: what only classes of others can compute stands in the bag, to the last bit."""

from __future__ import annotations

import sys
from collections.abc import Iterator
from pathlib import Path

import numpy as np
import pytest
from conftest import FewFigures
from typer.testing import CliRunner

from etac_ros.bag.describe import describe
from etac_ros.bag.description import DESCRIPTION_ATTACHMENT, from_json
from etac_ros.bag.read import read_bag
from etac_ros.bag.recover import recover
from etac_ros.cli.main import app
from etac_ros.errors import BagError, EtacError, RunError, ScenarioError
from etac_ros.metrics import curves
from etac_ros.report import write_report
from etac_ros.report.source import ReportedRun, read_run
from etac_ros.report.view import View
from etac_ros.runs import run_in_process, run_over_ros
from etac_ros.scenario.load import Scenario, load
from etac_ros.scenario.trust import foreign_classes, is_own

THEIRS = """
from pathlib import Path

with Path(__file__).with_name("imported").open("a") as file:
    file.write("x")

from etac_ros.laws import shi2022, wu2018
from etac_ros.media import csma
from etac_ros.plants import flexible, manoeuvre, pm_sm, rigid, rigid_mrp

def of_mine(kind):
    return type(kind.__name__, (kind,), {"__module__": __name__})

for module in (csma, flexible, manoeuvre, pm_sm, rigid, rigid_mrp, shi2022, wu2018):
    for name, kind in list(vars(module).items()):
        if isinstance(kind, type) and kind.__module__ == module.__name__ and hasattr(kind, "Parameters"):
            globals()[name] = of_mine(kind)
"""


@pytest.fixture
def theirs(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Iterator[Path]:
    """A package of somebody else's, which notes down each time that it is imported."""
    folder = tmp_path / "src"
    folder.mkdir()
    (folder / "theirs.py").write_text(THEIRS)
    monkeypatch.syspath_prepend(folder)
    yield folder
    sys.modules.pop("theirs", None)


def imported(theirs: Path) -> int:
    sys.modules.pop("theirs", None)
    marks = theirs / "imported"
    return len(marks.read_text()) if marks.exists() else 0


def with_their(scenario: Scenario, modules: tuple[str, ...], folder: Path) -> Scenario:
    """The scenario with the classes of some modules of ours replaced by theirs."""
    text = scenario.text
    for module in modules:
        assert module in text
        text = text.replace(f"{module}:", "theirs:")
    path = folder / "theirs.yaml"
    path.write_text(text)
    return load(str(path))


SYSTEMS = {
    "wu2018": (["duration_s=20"], ("etac_ros.plants.rigid",)),
    # The access rule of a medium is none of ours, and nothing else.
    "wu2018 on the air": (
        [
            "duration_s=20",
            "media={air: {rate_bit_s: 2000.0, access: {class: 'etac_ros.media.csma:Csma'}}}",
            "links.filtered_error.medium=air",
            "links.torque_command.medium=air",
        ],
        ("etac_ros.media.csma",),
    ),
    # What becomes of messages on their way is told by the bag alone.
    "wu2018 late, twice, in bursts": (
        [
            "duration_s=40",
            "links.filtered_error={delay_s: 0.05, jitter: {normal_s: 1.0}, duplication: 0.5}",
            "links.torque_command={bursts: {good_s: 3.0, bad_s: 2.0, loss_bad: 0.9}}",
        ],
        ("etac_ros.plants.rigid",),
    ),
    "flexible": (["duration_s=5"], ("etac_ros.plants.flexible",)),
    "qi2022": (["duration_s=5.0"], ("etac_ros.plants.pm_sm",)),
    "shi2022": (["duration_s=12"], ("etac_ros.plants.manoeuvre", "etac_ros.laws.shi2022")),
    "xie2021": (["duration_s=1.5"], ("etac_ros.plants.rigid_mrp",)),
}


def figures(run: ReportedRun) -> dict[str, bytes]:
    """All numbers behind the figures of a report."""
    found = {}
    for row in curves.bodies(run.graph):
        found[f"attitude {row}"] = curves.attitude(run.graph, run.recording, row).values.tobytes()
        found[f"rate {row}"] = curves.rate(run.graph, run.recording, row).values.tobytes()
    for plant in run.graph.plants:
        found[f"angle {plant}"] = curves.attitude_angle(run.graph, run.recording, plant).values.tobytes()
        found[f"modes {plant}"] = curves.modes(run.graph, run.recording, plant).values.tobytes()
        found[f"energy {plant}"] = run.energy[plant].values.tobytes()
        found[f"labels {plant}"] = repr(tuple(curves.dynamics(run.graph, plant).labels)).encode()
    for node, (first, watches) in run.watches.items():
        for watch in watches:
            about = (first, watch.unit, watch.axes, watch.bound, watch.notice)
            found[f"{node} {watch.name}"] = repr(about).encode() + watch.values.tobytes()
    return found


@pytest.mark.parametrize("name", SYSTEMS)
def test_a_bag_says_the_same_without_its_classes_and_imports_none(name: str, theirs: Path, tmp_path: Path) -> None:
    overrides, modules = SYSTEMS[name]
    scenario = with_their(load(name.partition(" ")[0], None, overrides), modules, tmp_path)
    assert foreign_classes(scenario.classes)
    run_in_process(scenario, tmp_path / "bag")
    trusting = read_run(tmp_path / "bag", trust=True)
    before = imported(theirs)
    assert before > 0

    untrusting = read_run(tmp_path / "bag")
    describe(tmp_path / "bag")
    assert recover(tmp_path / "bag").nothing_to_do

    assert imported(theirs) == before
    assert figures(untrusting) == figures(trusting)
    assert untrusting.kinds_of_plants == trusting.kinds_of_plants
    here, there = untrusting.summary, trusting.summary
    figures_of_papers = {"own", "measured", "published"}
    assert here.model_dump(exclude=figures_of_papers) == there.model_dump(exclude=figures_of_papers)
    assert here.measured
    assert all(figure in there.measured for figure in here.measured)
    assert untrusting.left_out
    assert not trusting.left_out
    assert not View(untrusting).decisions


def test_the_page_says_what_is_left_out_and_how_to_get_it(
    theirs: Path, tmp_path: Path, few_figures: FewFigures
) -> None:
    few_figures("torque", "margin")
    scenario = with_their(load("wu2018", None, ["duration_s=20"]), ("etac_ros.laws.wu2018",), tmp_path / "src")
    run_in_process(scenario, tmp_path / "bag")
    before = imported(theirs)
    text = write_report(tmp_path / "bag").read_text(encoding="utf-8")
    assert imported(theirs) == before
    assert "theirs:Proportional" in text
    assert "etac report --trust" in text
    assert "Error and threshold" not in text
    done = CliRunner().invoke(app, ["report", "--trust", str(tmp_path / "bag")])
    assert done.exit_code == 0, done.output
    assert imported(theirs) > before
    text = (tmp_path / "bag" / "report" / "index.html").read_text(encoding="utf-8")
    assert "Error and threshold" in text
    assert "--trust" not in text


def test_a_bag_over_dds_holds_the_same(theirs: Path, tmp_path: Path) -> None:
    scenario = with_their(load("wu2018", None, ["duration_s=10"]), ("etac_ros.plants.rigid",), tmp_path)
    run_in_process(scenario, tmp_path / "calls")
    run_over_ros(scenario, tmp_path / "dds")
    calls, dds = (read_run(tmp_path / name) for name in ("calls", "dds"))
    assert figures(dds) == figures(calls)
    assert dds.left_out == calls.left_out != ""


def test_a_bag_that_was_cut_off_has_all_that_was_derived_of_its_truth(theirs: Path, tmp_path: Path) -> None:
    scenario = with_their(
        load("wu2018", None, ["duration_s=200", "state_rate_hz=0"]), ("etac_ros.plants.rigid",), tmp_path
    )
    run_in_process(scenario, tmp_path / "bag")
    path = tmp_path / "bag" / "bag_0.mcap"
    whole = path.read_bytes()
    for part in (0.3, 0.6, 0.9):
        path.write_bytes(whole[: int(part * len(whole))])
        recover(tmp_path / "bag")
        run = read_run(tmp_path / "bag")
        assert 0.0 < run.end_s < 200.0
        assert run.summary.network.messages > 0
        assert curves.attitude(run.graph, run.recording, "/plant").values.shape[0] == run.end_s * 32 + 1


def test_a_run_of_our_classes_alone_derives_nothing_and_is_described_all_the_same(tmp_path: Path) -> None:
    run_in_process(load("flexible", None, ["duration_s=1"]), tmp_path / "bag")
    bag = read_bag(tmp_path / "bag")
    assert not [topic for topic in bag.topics if topic.derived]
    run = from_json(bag.attachments[DESCRIPTION_ATTACHMENT])
    assert run.derived == {}
    assert run.nodes["/plant"].cls == "etac_ros.plants.flexible:Flexible"
    assert run.nodes["/plant"].plant is not None
    assert run.nodes["/plant"].plant.labels[-1] == "eta_dot4 [kg^1/2 m/s]"
    (network,) = [link for link in run.links.values() if link.sender == "/sensor"]
    assert (network.port, network.kind) == (run.nodes["/sensor"].triggers, "network")


EXITS = "import sys\nsys.exit(0)\n"


def test_a_class_that_ends_the_process_when_imported_is_an_error(theirs: Path, tmp_path: Path) -> None:
    scenario = with_their(load("wu2018", None, ["duration_s=2"]), ("etac_ros.laws.wu2018",), tmp_path)
    run_in_process(scenario, tmp_path / "bag")
    sys.modules.pop("theirs", None)
    (theirs / "theirs.py").write_text(EXITS)
    with pytest.raises(ScenarioError, match="SystemExit"):
        load(str(tmp_path / "theirs.yaml"))
    with pytest.raises(BagError, match="SystemExit"):
        write_report(tmp_path / "bag", trust=True)
    assert CliRunner().invoke(app, ["report", "--trust", str(tmp_path / "bag")]).exit_code != 0
    assert read_run(tmp_path / "bag").left_out  # without it, nothing is to be feared


FAILING = (
    THEIRS
    + """
class RigidBody(rigid.RigidBody):
    def euler_angles(self, states):
        raise KeyError("mine")
"""
)


def test_a_class_that_fails_to_say_what_its_samples_mean_is_named(theirs: Path, tmp_path: Path) -> None:
    (theirs / "theirs.py").write_text(FAILING)
    scenario = with_their(load("wu2018", None, ["duration_s=2"]), ("etac_ros.plants.rigid",), tmp_path)
    with pytest.raises(RunError, match=r"/plant: .*KeyError: 'mine'") as caught:
        run_in_process(scenario, tmp_path / "bag")
    assert isinstance(caught.value.__cause__, KeyError)


def test_a_bag_of_before_without_a_description_asks_for_trust(theirs: Path, tmp_path: Path) -> None:
    from etac_ros.bag.write import BagWriter

    scenario = with_their(load("wu2018", None, ["duration_s=2"]), ("etac_ros.laws.wu2018",), tmp_path)
    run_in_process(scenario, tmp_path / "bag")
    new = read_bag(tmp_path / "bag")
    attachments = {"scenario.yaml": new.attachments["scenario.yaml"]}
    topics = [topic for topic in new.topics if topic.derived is None]
    with BagWriter(tmp_path / "old", topics, attachments, new.metadata) as writer:
        for raw in new.messages():
            if raw.topic in topics:
                writer.write(raw.topic.name, raw.cdr, raw.log_time_ns, raw.publish_time_ns, raw.sequence)
    before = imported(theirs)
    with pytest.raises(BagError, match="does not describe its run") as caught:
        read_run(tmp_path / "old")
    assert "--trust" in caught.value.remedy
    assert imported(theirs) == before
    assert read_run(tmp_path / "old", trust=True).summary.triggers["/sensor"].count > 0


@pytest.mark.parametrize(
    "name",
    [
        "theirs:Law",
        "etac_ros:Law",
        "etac_ros.laws:Law",
        "etac_ros.__main__:main",
        "etac_ros.cli.main:app",
        "etac_ros.runs:Run",
        "etac_ros.laws.nowhere:Law",
        "etac_ros.laws.wu2018",
        "etac_ros.laws.wu2018:",
        "etac_ros.laws.wu2018:Proportional.Parameters",
        "etac_ros.laws..wu2018:Proportional",
        "etac_ros.laws.wu2018 :Proportional",
        "etac_ros.laws./../../theirs:Law",
        "etac_ros.laws.../wu2018:Proportional",
        "os:system",
        "etac_ros_evil.laws.wu2018:Proportional",
        ":",
        "",
    ],
)
def test_what_is_no_class_of_ours(name: str) -> None:
    assert not is_own(name)


def test_what_is_a_class_of_ours() -> None:
    assert is_own("etac_ros.laws.wu2018:Proportional")
    assert foreign_classes({"/a": {"law": {"class": "etac_ros.laws.wu2018:Proportional"}, "module": "sensor"}}) == ()
    nodes = {"/a": {"module": "mine:A", "parts": [{"class": "mine:B"}]}, "/b": {"law": {"class": "mine:A"}}}
    assert foreign_classes(nodes) == ("mine:A", "mine:B")


def test_a_link_to_a_file_elsewhere_is_not_ours(monkeypatch: pytest.MonkeyPatch, tmp_path: Path) -> None:
    import etac_ros.scenario.trust as trust

    package = tmp_path / "etac_ros"
    (package / "laws").mkdir(parents=True)
    (tmp_path / "evil.py").touch()
    (package / "laws" / "good.py").touch()
    (package / "laws" / "evil.py").symlink_to(tmp_path / "evil.py")
    monkeypatch.setattr(trust, "_PACKAGE", package)
    assert is_own("etac_ros.laws.good:Law")
    assert not is_own("etac_ros.laws.evil:Law")


@pytest.mark.parametrize("name", ["etac_ros.laws.wu2018:Parameters", "etac_ros.laws.wu2018:BaseModel"])
def test_what_a_file_of_ours_has_only_imported_is_not_its_class(name: str) -> None:
    with pytest.raises(ScenarioError, match="has no class"):
        load("wu2018", None, [f"controller.law.class={name}"])


def test_a_plant_in_a_bag_does_not_move(theirs: Path, tmp_path: Path) -> None:
    scenario = with_their(load("wu2018", None, ["duration_s=2"]), ("etac_ros.plants.rigid",), tmp_path)
    run_in_process(scenario, tmp_path / "bag")
    run = read_run(tmp_path / "bag")
    plant = curves.dynamics(run.graph, "/plant")
    with pytest.raises(EtacError, match="recorded samples only"):
        plant.propagate(np.zeros(7), 0, 1, np.zeros(3))
