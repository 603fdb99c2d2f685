"""How many small changes of the code the tests notice: cosmic-ray's mutants of the rooms that carry the promises.

    .venv/bin/python -m pip install -e .[mutation]          # only this needs cosmic-ray
    ./scripts/bench mutation                                # a sample of each file, about 25 minutes of one core
    ./scripts/bench mutation --named                        # the changes that have a name, one by one; a minute
    ./scripts/bench mutation --only timing --most 1000      # all mutants of some files
    ./scripts/bench mutation --journal FILE                 # goes on where it was cut off, and tries survivors again
    ./scripts/bench mutation --write docs/mutation.md

cosmic-ray makes the mutants; what runs them is here, because a mutant should cost a second and not the five of a
fresh pytest. A file's tests are run in a forked child of a process that has imported all that does not depend on the
file; the child gets the changed source from an import hook, so nothing on disk is touched. Which tests ought to notice
is said below, file by file: cheap ones, without DDS. A mutant that runs for ever is noticed by its time.
"""

from __future__ import annotations

import ast
import fnmatch
import hashlib
import importlib
import importlib.abc
import importlib.machinery
import importlib.util
import os
import random
import resource
import shutil
import signal
import sys
import tempfile
import time
import traceback
from collections.abc import Iterator, Sequence
from dataclasses import dataclass, field
from pathlib import Path
from types import CodeType, ModuleType
from typing import Annotated

import typer

ROOT = Path(__file__).resolve().parent.parent
TEST = ROOT / "test"
ROOMS = ("bag", "engines", "graph", "laws", "maths", "metrics", "modules", "plants", "scenario", "timing", "triggers")
"""What most of the tests below import; the rest is imported where it is wanted."""
SEED = 10
MOST = 40
"""Mutants of a file; of those with more, so many are drawn."""

PROTOCOL = (
    "test_dispatcher.py",
    "test_worker.py",
    "test_nodes.py",
    "test_time_protocol.py::test_trace_in_process",
    "test_interleavings.py::test_whoever_is_starved_nothing_changes[wu2018 delay]",
)
"""Quick ones first: the first that notices ends a trial."""
NODES = ("test_nodes.py",)
BAG = ("test_bag_errors.py", "test_bag_forms.py", "test_bag_recover.py", "test_bag_damage.py")

TESTS: dict[str, tuple[str, ...]] = {
    "engines/ros/count_check.py": ("test_count_check.py",),
    "engines/ros/foreign.py": ("test_foreign_watch.py", *NODES),
    "engines/ros/endpoints.py": ("test_endpoints.py", *NODES),
    "timing/digest.py": ("test_digest.py",),
    "timing/dispatcher.py": ("test_dispatcher.py", *PROTOCOL),
    "timing/duties.py": PROTOCOL,
    "timing/master.py": ("test_master.py", *PROTOCOL),
    "timing/windows.py": ("test_master.py", *PROTOCOL),
    "timing/worker.py": ("test_worker.py", *PROTOCOL),
    "engines/ros/coordinator.py": ("test_coordinator.py", *NODES),
    "engines/ros/recorder.py": NODES,
    "graph/channel.py": ("test_channel.py", "test_replay.py"),
    "graph/replay.py": ("test_replay.py", "test_figures.py"),
    "engines/ros/module_node.py": NODES,
    "triggers/relative.py": ("test_trigger_relative.py",),
    "triggers/timing.py": ("test_trigger_timing.py",),
    "engines/inprocess.py": ("test_master.py", "test_replay.py", *PROTOCOL),
    "bag/write.py": BAG,
    "graph/driver.py": ("test_user_class.py", *PROTOCOL),
    "metrics/summary.py": ("test_summary_schema.py", "test_figures.py", "test_replay.py", "test_report_data.py"),
    "engines/ros/messages.py": ("test_wire.py", *NODES),
    "engines/ros/notes.py": NODES,
    "engines/ros/plan.py": NODES,
    "engines/ros/run_node.py": NODES,
    "bag/clock.py": ("test_bag_clock.py",),
    "bag/reserve.py": ("test_bag_names.py",),
    "bag/run_bag.py": ("test_bag_run_bag.py", "test_bag_of_run.py"),
    "bag/read.py": BAG,
    "bag/recover.py": BAG,
    "triggers/componentwise.py": ("test_trigger_componentwise.py",),
    "triggers/periodic.py": ("test_trigger_periodic.py",),
    "triggers/split_norm.py": ("test_trigger_split_norm.py",),
}


@dataclass(frozen=True)
class Mutant:
    """One change of one file.

    Attributes
    ----------
    file
        Below the package.
    what
        The change in words: the operator's name, or the name of the change.
    line
        First line that differs; 0 if there is none.
    before, after
        That line, and what stands there now.
    source
        The whole file as it would be.
    tests
        Test files that ought to notice.
    """

    file: str
    what: str
    line: int
    before: str
    after: str
    source: str = field(repr=False)
    tests: tuple[str, ...] = ()

    @property
    def digest(self) -> str:
        """Of the changed file."""
        return hashlib.sha256(f"{self.file}\n{self.source}".encode()).hexdigest()

    @property
    def key(self) -> str:
        """What identifies it though lines move."""
        return f"{self.file}: {self.after.strip()}"

    def __str__(self) -> str:
        return f"{self.file}:{self.line} {self.what}: `{self.before.strip()}` -> `{self.after.strip()}`"


NAMED: tuple[tuple[str, str, str, str, str], ...] = (
    (
        "the count check may be off by two", "engines/ros/count_check.py",
        "if len(set(counts.values())) > 1:", "if max(counts.values()) - min(counts.values()) > 2:",
        "test_count_check.py",
    ),
    (
        "the continuity check is removed", "engines/ros/endpoints.py",
        "if self._continuous and number != self.count.messages:", "if False:",
        "test_endpoints.py",
    ),
    (
        "an order overtakes the window before it", "timing/worker.py",
        "return self._epoch() >= order.epoch and all(", "return all(",
        "test_worker.py",
    ),
    (
        "a window overtakes the order before it", "timing/worker.py",
        "return self._proposal is None or self._proposal >= window.start", "return True",
        "test_worker.py",
    ),
    (
        "conclude in spite of a delayed arrival", "timing/master.py",
        "alone = len(due) == 1 and tick not in self._calendar and", "alone = len(due) == 1 and",
        "test_master.py",
    ),
    (
        "leave to conclude in spite of a delayed arrival", "timing/master.py",
        "min(earliest, self._graph.end_tick) - 1\n", "min(earliest, self._graph.end_tick - 1)\n",
        "test_master.py",
    ),
    (
        "energy is blind to delay", "graph/replay.py",
        "Delivery(arrival, 1 if arrival > message.tick else message.step + 1, message)",
        "Delivery(message.tick, message.step + 1, message)",
        "test_replay.py",
    ),
    (
        "energy is blind to loss", "graph/replay.py",
        "for arrival in way.arrivals(message.sequence, sent):",
        "for arrival in (sent + link.channel.delay_ticks,):",
        "test_replay.py",
    ),
    (
        "inputs are not summed", "graph/held.py",
        "total[place] = value if number == 0 else total[place] + value", "total[place] = value",
        "test_held_inputs.py",
    ),
    (
        "deliveries at the end tick", "graph/replay.py",
        "arrival < graph.end_tick", "arrival <= graph.end_tick",
        "test_replay.py",
    ),
    (
        "one sample too many", "metrics/summary.py",
        "return min(first + int(states.shape[0]), graph.end_tick) - first", "return int(states.shape[0])",
        "test_replay.py",
    ),
    (
        "fired counts links", "timing/master.py",
        "if link.port == triggering and self._last_fired.get(sender, tick) != tick:", "if link.port == triggering:",
        "test_replay.py",
    ),
    (
        "the last halt wins", "timing/master.py",
        "if report.halt and not self.halted:", "if report.halt:",
        "test_master.py",
    ),
    (
        "the recorder does not wait for messages without a place", "engines/ros/recorder.py",
        "return not self._waiting and all(", "return all(",
        "test_nodes.py",
    ),
)  # fmt: skip
"""Changes that once went unnoticed: name, file, what stands there, what is put there, the test file that notices."""


EXPLAINED: dict[str, str] = {
    "bag/write.py: if log_time_ns >= self._last_ns:": "Of two equal times either is the last.",
    "graph/channel.py: @dataclass(frozen=True, slots=False)": "The same object in more memory.",
    "timing/digest.py: return crc32(_ACT.pack( -1, tick, epoch), digest)": "Any number but that of the other kind of "
    "act will do.",
    "timing/digest.py: _UNTOLD = ~1": "Any number that is no tick will do.",
    "engines/inprocess.py: if plant is None and self._plant(plant).halt:": "The run is over: what a module says of a "
    "window of before goes into no result.",
    "engines/inprocess.py: if proposal is None or proposal is not order.grant:": "A module that does not use its leave "
    "is asked later, and does the same.",
}
"""Changes that change no result, and why, by :attr:`Mutant.key`."""


def named_mutants() -> list[Mutant]:
    """The changes with a name; each says where its text has to stand, exactly once."""
    found = []
    for name, file, old, new, test in NAMED:
        text = _text(file)
        if text.count(old) != 1:
            raise SystemExit(
                f"'{name}': {file} has {text.count(old)} times {old!r}; expected once. Bring it up to date."
            )
        found.append(_mutant(file, name, text, text.replace(old, new), (test,)))
    return found


def mutants_of(file: str, most: int, seed: int) -> tuple[int, list[Mutant]]:
    """How many mutants of a file cosmic-ray makes, and a draw of those that do not just change an annotation."""
    try:
        from cosmic_ray.ast import ast_nodes, get_ast
        from cosmic_ray.mutating import mutate_code
        from cosmic_ray.plugins import get_operator, operator_names
    except ImportError:
        raise SystemExit("cosmic-ray is missing here: .venv/bin/python -m pip install -e .[mutation]") from None

    text = _text(file)
    nodes = list(ast_nodes(get_ast(text)))
    places = []
    for name in sorted(operator_names()):
        if "Variable" not in name:  # those want to be told which variables
            operator = get_operator(name)()
            positions = sum(1 for node in nodes for _ in operator.mutation_positions(node))
            places += [(name, occurrence) for occurrence in range(positions)]
    random.Random(f"{seed} {file}").shuffle(places)
    found = []
    seen = {_bare(text)}
    for name, occurrence in places:
        if len(found) == most:
            break
        try:
            source = mutate_code(text, get_operator(name)(), occurrence)
        except AttributeError:  # its ExceptionReplacer stumbles over dotted names
            continue
        bare = _bare(source)
        if bare not in seen:  # else nothing that runs is different
            seen.add(bare)
            found.append(_mutant(file, name.removeprefix("core/"), text, source, TESTS[file]))
    return len(places), found


def _mutant(file: str, what: str, text: str, source: str, tests: tuple[str, ...]) -> Mutant:
    pairs = zip(text.splitlines(), source.splitlines(), strict=False)
    line, before, after = next(((n, a, b) for n, (a, b) in enumerate(pairs, 1) if a != b), (0, "", ""))
    return Mutant(
        file,
        what,
        line,
        before,
        after,
        source,
        tuple(test for test in tests if (TEST / test.partition("::")[0]).exists()),
    )


def _text(file: str) -> str:
    return (ROOT / "etac_ros" / file).read_text(encoding="utf-8")


class _Bare(ast.NodeTransformer):
    """Takes annotations away that nobody evaluates."""

    def visit_Module(self, node: ast.Module) -> ast.AST:
        for inner in node.body:
            if isinstance(inner, ast.AnnAssign):
                inner.annotation = ast.Constant(None)
        return self.generic_visit(node)

    def visit_FunctionDef(self, node: ast.FunctionDef) -> ast.AST:
        node.returns = None
        for inner in ast.walk(node):
            if isinstance(inner, ast.AnnAssign):  # those of a class are read by pydantic and dataclasses
                inner.annotation = ast.Constant(None)
        return self.generic_visit(node)

    def visit_arg(self, node: ast.arg) -> ast.AST:
        node.annotation = None
        return node


def _bare(text: str) -> str:
    try:
        return ast.dump(_Bare().visit(ast.parse(text)))
    except SyntaxError:
        return ""


class _Changed(importlib.abc.MetaPathFinder, importlib.machinery.SourceFileLoader):
    """Imports one module from a changed source."""

    def __init__(self, mutant: Mutant) -> None:
        path = ROOT / "etac_ros" / mutant.file
        super().__init__(module_name(mutant.file), str(path))
        self._source = mutant.source

    def find_spec(
        self, fullname: str, path: Sequence[str] | None, target: ModuleType | None = None
    ) -> importlib.machinery.ModuleSpec | None:
        return (
            importlib.util.spec_from_file_location(fullname, self.path, loader=self) if fullname == self.name else None
        )

    def get_code(self, fullname: str) -> CodeType:
        return compile(self._source, self.path, "exec", dont_inherit=True)


def module_name(file: str) -> str:
    """The module that a file below the package is."""
    return "etac_ros." + file.removesuffix(".py").replace("/", ".").removesuffix(".__init__")


def dependents(module: str) -> set[str]:
    """A module and all that import it, directly or not."""
    imports: dict[str, set[str]] = {}
    for path in (ROOT / "etac_ros").rglob("*.py"):
        name = module_name(str(path.relative_to(ROOT / "etac_ros")))
        tree = ast.parse(path.read_text(encoding="utf-8"))
        wanted = {node.module for node in ast.walk(tree) if isinstance(node, ast.ImportFrom) and node.module}
        wanted |= {
            f"{node.module}.{alias.name}"
            for node in ast.walk(tree)
            if isinstance(node, ast.ImportFrom) and node.module
            for alias in node.names
        }
        wanted |= {alias.name for node in ast.walk(tree) if isinstance(node, ast.Import) for alias in node.names}
        imports[name] = wanted
    found = {module}
    while True:  # whoever imports a module imports the packages above it, too
        more = {name for name, wanted in imports.items() if wanted & found} - found
        packages = {
            name for name in imports if (ROOT / "etac_ros" / Path(*name.split(".")[1:], "__init__.py")).exists()
        }
        more |= {name for name in imports if any(name.startswith(f"{above}.") for above in packages & found)} - found
        if not more:
            return found
        found |= more


def import_the_rest(file: str) -> None:
    """Import what the tests need and what does not depend on a file, once for all its mutants."""
    for name in ("hypothesis", "numba", "pydantic", "pytest", "rosbags.serde", "scipy.linalg", "typer", "yaml"):
        importlib.import_module(name)
    changing = dependents(module_name(file))
    for path in sorted((ROOT / "etac_ros").rglob("*.py")):
        name = module_name(str(path.relative_to(ROOT / "etac_ros")))
        if name not in changing and name.split(".")[1:2] and name.split(".")[1] in ROOMS:
            importlib.import_module(name)
    if set(sys.modules) & changing:
        raise SystemExit(f"{file}: imported before it is changed: {sorted(set(sys.modules) & changing)}")


def tests_pass(mutant: Mutant, limit_s: float) -> bool | None:
    """Whether the tests of a mutant pass; None if they take too long."""
    child = os.fork()
    if child == 0:
        code = 3
        try:
            code = _run_tests(mutant)
        finally:
            os._exit(code)
    until = time.monotonic() + limit_s
    pause = 0.01
    while time.monotonic() < until:
        done, status = os.waitpid(child, os.WNOHANG)
        if done:
            return os.waitstatus_to_exitcode(status) == 0
        time.sleep(pause)
    os.killpg(child, signal.SIGKILL)
    os.waitpid(child, 0)
    return None


def _run_tests(mutant: Mutant) -> int:
    os.setsid()
    nothing = os.open(os.devnull, os.O_RDWR)
    for stream in (0, 1, 2):
        os.dup2(nothing, stream)
    resource.setrlimit(resource.RLIMIT_AS, (6 << 30, 6 << 30))
    sys.meta_path.insert(0, _Changed(mutant))
    with tempfile.TemporaryDirectory() as folder:
        if mutant.file.startswith("triggers/"):
            _own_kernels(Path(folder, "kernels"), mutant)
        os.chdir(ROOT)
        import pytest

        options = ["-x", "-q", "-p", "no:cacheprovider", "--basetemp", f"{folder}/tests"]
        return int(pytest.main([*options, *(str(TEST / test) for test in mutant.tests)]))


def _own_kernels(folder: Path, mutant: Mutant) -> None:
    """Machine code of the changed file is compiled anew: numba goes by the file on disk, which is as before."""
    from numba.core import config

    importlib.import_module("etac_ros.maths.compiled")
    shutil.copytree(config.CACHE_DIR, folder, ignore=shutil.ignore_patterns(f"{Path(mutant.file).stem}.*"))
    config.CACHE_DIR = str(folder)


@dataclass
class Score:
    """What became of the mutants of a file."""

    file: str
    known: int
    tried: int = 0
    seconds: float = 0.0
    survivors: list[Mutant] = field(default_factory=list)

    @property
    def noticed(self) -> int:
        return self.tried - len(self.survivors)


def try_all(file: str, known: int, mutants: Sequence[Mutant], journal: Path | None = None) -> Score:
    """Try mutants of one file, in a process of their own; the unchanged file goes first, and has to pass.

    What the journal says was noticed is not tried again.
    """
    score = Score(file, known)
    before = _read_journal(journal)
    for mutant in mutants:
        if mutant.digest in before:
            score.tried += 1
            score.seconds += before[mutant.digest]
    mutants = [mutant for mutant in mutants if mutant.digest not in before]
    if not mutants:
        return score
    receiving, sending = os.pipe()
    child = os.fork()
    if child == 0:
        code = 1
        try:
            os.close(receiving)
            import_the_rest(file)
            with os.fdopen(sending, "w") as pipe:
                for number, verdict, seconds in _verdicts(file, mutants):
                    pipe.write(f"{number} {verdict} {seconds}\n")
                    pipe.flush()
            code = 0
        except BaseException:
            traceback.print_exc()
        finally:
            os._exit(code)
    os.close(sending)
    with os.fdopen(receiving) as pipe:
        for line in pipe:
            number, verdict, seconds = line.split()
            score.tried += 1
            score.seconds += float(seconds)
            if verdict == "unnoticed":
                score.survivors.append(mutants[int(number)])
                print(f"    unnoticed: {mutants[int(number)]}", flush=True)
            elif journal is not None:
                with journal.open("a", encoding="utf-8") as kept:
                    kept.write(f"{mutants[int(number)].digest} {seconds}\n")
    _, status = os.waitpid(child, 0)
    if status:
        raise SystemExit(f"{file}: the tests do not pass on the unchanged file, or could not be run")
    return score


def _read_journal(journal: Path | None) -> dict[str, float]:
    if journal is None or not journal.exists():
        return {}
    return {digest: float(seconds) for digest, seconds in map(str.split, journal.read_text().splitlines())}


def _verdicts(file: str, mutants: Sequence[Mutant]) -> Iterator[tuple[int, str, float]]:
    text = _text(file)
    slowest = 0.0
    for tests in {mutant.tests for mutant in mutants}:
        began = time.monotonic()
        if not tests or not tests_pass(Mutant(file, "nothing", 0, "", "", text, tests), 600.0):
            print(f"{file}: {', '.join(tests) or 'no test file'}", file=sys.stderr)
            os._exit(1)
        slowest = max(slowest, time.monotonic() - began)
    for number, mutant in enumerate(mutants):
        began = time.monotonic()
        passed = tests_pass(mutant, 5.0 * slowest + 10.0)
        yield number, "unnoticed" if passed else "noticed", time.monotonic() - began


def main(
    only: Annotated[str, typer.Option(help="Part of the files' names.")] = "",
    most: Annotated[int, typer.Option(help="Mutants of a file.")] = MOST,
    seed: Annotated[int, typer.Option(help="Of the draw.")] = SEED,
    named: Annotated[bool, typer.Option("--named", help="Only the changes that have a name.")] = False,
    journal: Annotated[Path | None, typer.Option(help="Keeps what was noticed, which is not tried again.")] = None,
    write: Annotated[Path | None, typer.Option(help="Where the page goes.")] = None,
) -> None:
    """Try mutants; the exit code says whether a named one went unnoticed."""
    failures = 0
    scores = []
    names = []
    with_names = [one for one in named_mutants() if named or write]
    for file in dict.fromkeys(one.file for one in with_names):
        if not fnmatch.fnmatch(file, f"*{only}*"):
            continue
        mutants = [one for one in with_names if one.file == file]
        score = try_all(file, len(mutants), mutants, journal)
        failures += len(score.survivors)
        for mutant in mutants:
            names.append((mutant.what, mutant not in score.survivors))
            print(f"{'noticed' if names[-1][1] else 'UNNOTICED':<10} {mutant.what}", flush=True)
    if named:
        raise typer.Exit(bool(failures))
    for file in TESTS:
        if not fnmatch.fnmatch(file, f"*{only}*"):
            continue
        known, chosen = mutants_of(file, most, seed)
        if not chosen:
            continue
        score = try_all(file, known, chosen, journal)
        scores.append(score)
        print(
            f"{file:<28} {score.known:>5} mutants, {score.tried:>4} tried, {score.noticed:>4} noticed, "
            f"{score.seconds:6.1f} s",
            flush=True,
        )
        if write is not None:  # after each, so that a run that is cut off leaves what it has found
            write.write_text(page(scores, names, f"--most {most} --seed {seed}"), encoding="utf-8")
    tried, noticed = sum(score.tried for score in scores), sum(score.noticed for score in scores)
    print(f"{noticed} of {tried} noticed: {noticed / max(tried, 1):.1%}")
    raise typer.Exit(bool(failures))


def page(scores: Sequence[Score], names: Sequence[tuple[str, bool]], options: str) -> str:
    """The outcome as Markdown."""
    tried, noticed = sum(score.tried for score in scores), sum(score.noticed for score in scores)
    survivors = [mutant for score in scores for mutant in score.survivors]
    explained = [mutant for mutant in survivors if mutant.key in EXPLAINED]
    lines = [
        "# Mutation testing",
        "",
        f"Written by `./scripts/bench mutation {options} --write docs/mutation.md`: small changes of the code, made by "
        "cosmic-ray and tried one by one against the tests that ought to notice them, all without DDS. The draw and "
        "its seed are part of the command; `--most 1000` tries all.",
        "",
        f"**Of {tried} mutants {noticed} were noticed ({noticed / max(tried, 1):.1%}), and {len(explained)} of the "
        f"others are explained below: {(noticed + len(explained)) / max(tried, 1):.1%}.**",
        "",
        "| file | mutants | tried | noticed | seconds |",
        "| --- | --- | --- | --- | --- |",
        *(f"| {one.file} | {one.known:,} | {one.tried} | {one.noticed} | {one.seconds:.0f} |" for one in scores),
        "",
        "## Changes with a name",
        "",
        "Each of these once went unnoticed (`./scripts/bench mutation --named`).",
        "",
        "| change | noticed |",
        "| --- | --- |",
        *(f"| {name} | {'yes' if good else 'NO'} |" for name, good in names),
        "",
        "## Unnoticed",
        "",
        *(f"- {mutant}  \n  {EXPLAINED.get(mutant.key, 'not explained')}" for mutant in survivors),
    ]
    return "\n".join(lines) + "\n"


if __name__ == "__main__":
    typer.run(main)
