"""Every command and every piece of Python in the README works as it stands there."""

from __future__ import annotations

import os
import re
import shlex
import subprocess
import sys
from pathlib import Path

import pytest
from hands import what_ros_says

from etac_ros.metrics.summary import Summary
from etac_ros.runs import run_in_process
from etac_ros.scenario.load import load

ROOT = Path(__file__).resolve().parent.parent
README = (ROOT / "README.md").read_text(encoding="utf-8")
BLOCKS = re.findall(r"```(\w+)\n(.*?)```", README, re.DOTALL)
COMMANDS = [
    line.removeprefix("$ ").partition("  #")[0].strip()
    for kind, block in BLOCKS
    if kind == "console"
    for line in block.splitlines()
    if line.startswith("$ ")
]
# Not again from inside the tests: the tests themselves, and what takes minutes (test_reproduce.py tries a short one).
ELSEWHERE = ("./scripts/test", "./scripts/bench", "./scripts/etac reproduce", "./scripts/etac tradeoff")
REAL_TIME = "--clock wall"
"""Takes as long as it says: test_wall_ros.py and test_wall_compare.py run shorter ones."""
PACED = {
    "--rate 20 --live": "--rate 20 --live --set duration_s=20",
    "play bags/BAG --rate 10": "play bags/BAG --rate 100",
}
"""What takes as long as it says, and what is run in its place."""
NEEDS_OTHERS = ("node ", "external=true", "ros2 run", "--only")


@pytest.fixture(scope="module")
def folder(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """A working folder with a bag, and with the README's law in ``mine.py``."""
    folder = tmp_path_factory.mktemp("readme")
    run_in_process(load("wu2018", None, ["duration_s=100"]), folder / "bags" / "BAG")
    run_in_process(load("wu2018", "periodic", ["duration_s=100"]), folder / "bags" / "OTHER")
    (folder / "mine.py").write_text(snippet("class DeadZone"))
    return folder


def snippet(containing: str) -> str:
    """The Python block that contains a text."""
    (found,) = [block for kind, block in BLOCKS if kind == "python" and containing in block]
    return found


def test_the_summary_is_described_key_by_key() -> None:
    described = README[README.index("### The summary") : README.index("In Python: `from etac_ros.runs")]
    assert not set(Summary.model_fields) - set(re.findall(r"`(\w+)`", described))
    assert f"The key `format` is {Summary.model_fields['format'].default};" in described


def test_the_two_commands_come_first() -> None:
    assert COMMANDS[0] == "./scripts/run wu2018"
    assert COMMANDS[1] == "./scripts/test"
    assert README.index("./scripts/run wu2018") < 600


@pytest.mark.parametrize(
    "command",
    [
        c
        for c in COMMANDS
        if not c.startswith(ELSEWHERE) and not any(words in c for words in (*NEEDS_OTHERS, REAL_TIME))
    ],
)
def test_command(command: str, folder: Path) -> None:
    environment = {**os.environ, "PYTHONPATH": os.pathsep.join([str(folder), str(ROOT), *sys.path])}
    words = command.removeprefix("PYTHONPATH=. ")
    program = f"{shlex.quote(sys.executable)} -m etac_ros"
    words = re.sub(r"^\./scripts/etac", program, re.sub(r"^\./scripts/run", f"{program} run", words))
    for said, shorter in PACED.items():
        words = words.replace(said, shorter)
    done = subprocess.run(
        words,
        shell=True,
        cwd=folder,
        env=environment,
        capture_output=True,
        text=True,
        timeout=120,
        check=False,
    )
    assert done.returncode == 0, done.stdout + done.stderr


def test_executables_take_the_arguments_of_the_readme(tmp_path: Path) -> None:
    (command,) = [c for c in COMMANDS if c.startswith("ros2 run etac_ros")]
    executable, *arguments = command.split()[3:]
    (tmp_path / "my_run.yaml").write_text(load("wu2018").text)
    (answer,) = what_ros_says([(executable, arguments)], tmp_path)
    assert answer["found"] == ["/sensor", ["my_run.yaml"], []]


def test_reading_a_bag(folder: Path) -> None:
    done = subprocess.run(
        [sys.executable, "-c", snippet("AnyReader")],
        cwd=folder,
        capture_output=True,
        text=True,
        timeout=60,
        check=False,
    )
    assert done.returncode == 0, done.stderr
    assert "Point32" in done.stdout


def test_files_that_the_readme_links_to_exist() -> None:
    for target in re.findall(r"\]\(([^)#]+)\)", README):
        assert (ROOT / target).exists(), target


def test_pages_link_to_what_is_there() -> None:
    # Sphinx looks after links between pages; those to files of the repository are looked after here.
    docs = ROOT / "docs"
    for page in docs.rglob("*.md"):
        text = re.sub(r"```.*?```", "", page.read_text(encoding="utf-8"), flags=re.DOTALL)
        for target in re.findall(r"\]\(([^)#\s]+)", text):
            assert "://" in target or (page.parent / target).exists(), f"{page.name}: {target}"


@pytest.mark.parametrize(
    "page", [ROOT / "README.md", *sorted((ROOT / "docs").rglob("*.md"))], ids=lambda page: page.name
)
def test_examples_mean_the_same_in_zsh(page: Path) -> None:
    # It takes bare brackets, stars and question marks for patterns, and refuses those that match nothing.
    for line in page.read_text(encoding="utf-8").splitlines():
        if line.startswith("$ "):
            bare = re.sub(r"'[^']*'|\"[^\"]*\"", "", line.partition("  #")[0])
            assert not re.search(r"[\[\]*?{}~]", bare), line
