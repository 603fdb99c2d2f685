"""``etac``: run scenarios, look at bags, draw reports."""

from __future__ import annotations

import io
import os
import sys
from enum import StrEnum
from pathlib import Path
from typing import Annotated

import typer

from etac_ros import __version__
from etac_ros.cli.streams import hold_standard_streams
from etac_ros.engines.ros.limits import refused_by_system
from etac_ros.engines.ros.liveness import QUIET_S
from etac_ros.errors import EtacError, ScenarioError

app = typer.Typer(
    name="etac",
    help="Event-triggered attitude control as a graph of networked modules over ROS 2.",
    no_args_is_help=True,
    add_completion=False,
    pretty_exceptions_enable=False,
    rich_markup_mode=None,
)

BAD_INPUT, FAILED_RUN, INTERRUPTED = 2, 1, 130


class Engine(StrEnum):
    """Who carries messages."""

    ros = "ros"
    inprocess = "inprocess"


class ClockKind(StrEnum):
    """Which time a run goes by."""

    sim = "sim"
    wall = "wall"


def rate_of_clock(clock: ClockKind, rate: float, strict: bool = False, priority: int = 0) -> float | None:
    """Simulated seconds a second; None in simulated time."""
    if clock is ClockKind.wall:
        return rate
    given = {"--strict": strict, f"--priority {priority}": priority != 0, f"--rate {rate:g}": rate != 1.0}
    for option, is_given in given.items():
        if is_given:
            raise ScenarioError(option, "is for --clock wall", "", "add --clock wall")
    return None


class Spread(StrEnum):
    """How nodes are spread over processes."""

    node = "node"
    namespace = "namespace"
    one = "one"


Clock = Annotated[ClockKind, typer.Option(help="Simulated time, or real time: docs/wallclock.md.")]
Rate = Annotated[float, typer.Option(help="For --clock wall: simulated seconds a second.")]
Strict = Annotated[bool, typer.Option("--strict", help="For --clock wall: end at the first missed tick.")]
Priority = Annotated[
    int, typer.Option(help="For --clock wall: real-time priority (SCHED_FIFO) of the processes, 1 to 99.")
]
ScenarioName = Annotated[str, typer.Argument(help="Name of a file in config/, or a path to one.")]
Variant = Annotated[str | None, typer.Option(help="A named block of overrides in the file.")]
Set = Annotated[list[str] | None, typer.Option("--set", metavar="KEY=VALUE", help="Override a value; repeatable.")]
QuietS = Annotated[
    float, typer.Option(min=5.0, help="A node that stands still or owes an answer for this long ends the run [s].")
]
BagPath = Annotated[Path, typer.Argument(metavar="BAG", help="Directory of a bag.")]


@app.command()
def run(
    scenario: ScenarioName,
    variant: Variant = None,
    set_: Set = None,
    engine: Annotated[Engine, typer.Option(help="Over DDS, or by calls in this process.")] = Engine.ros,
    processes: Annotated[Spread, typer.Option(help="One process a node, a namespace, or one.")] = Spread.node,
    baseline: Annotated[bool, typer.Option("--baseline", help="Run the baseline over the same engine, too.")] = False,
    bag: Annotated[Path | None, typer.Option(help="Directory of the bag; default: a new one in bags/.")] = None,
    json: Annotated[
        Path | None, typer.Option(help="Write the machine-readable summary to a file; - is standard output.")
    ] = None,
    domain: Annotated[
        int | None, typer.Option("--domain", "--join", help="ROS domain; default: ROS_DOMAIN_ID, or a free one.")
    ] = None,
    only: Annotated[
        str | None, typer.Option(help="Play the nodes of one namespace; start the others with the same --join ID.")
    ] = None,
    record_windows: Annotated[bool, typer.Option("--record-windows", help="Put windows into the bag.")] = False,
    quiet_s: QuietS = QUIET_S,
    clock: Clock = ClockKind.sim,
    rate: Rate = 1.0,
    strict: Strict = False,
    priority: Priority = 0,
) -> None:
    """Run a scenario, record it, and show what crossed the network."""
    from etac_ros.cli.run import STANDARD_OUTPUT, RunRequest, run_and_show
    from etac_ros.cli.show import make_console

    request = RunRequest(
        scenario,
        variant,
        tuple(set_ or ()),
        engine.value,
        processes.value,
        baseline,
        bag,
        json,
        domain,
        record_windows,
        only,
        quiet_s,
        rate_of_clock(clock, rate, strict, priority),
        strict,
        priority,
    )
    console = make_console()
    console.stderr = str(json) == STANDARD_OUTPUT  # what is for people is then out of the way
    run_and_show(request, console)


@app.command()
def compare(
    scenario: ScenarioName,
    variant: Annotated[
        list[str] | None, typer.Option(help="A variant; repeatable. Default: the scenario's own.")
    ] = None,
    set_: Set = None,
    clock: Clock = ClockKind.sim,
    rate: Rate = 1.0,
    priority: Priority = 0,
    processes: Annotated[Spread, typer.Option(help="For --clock wall.")] = Spread.node,
    bag: Annotated[Path | None, typer.Option(help="For --clock wall: directory of the bag.")] = None,
) -> None:
    """Run variants and show them beside each other and beside the paper; or one in real time beside simulated ones."""
    from etac_ros.cli.compare import compare as compare_variants
    from etac_ros.cli.show import make_console

    speed = rate_of_clock(clock, rate, priority=priority)
    if speed is not None:
        from etac_ros.cli.compare_clocks import compare_clocks
        from etac_ros.runs import RosOptions

        if len(variant or ()) > 1:
            raise ScenarioError("--variant", "is there more than once", "one, with --clock wall")
        options = RosOptions(processes.value, rate=speed, priority=priority)
        compare_clocks(scenario, variant[0] if variant else None, set_ or (), options, bag, make_console())
        return

    compare_variants(scenario, variant or (), set_ or (), make_console())


@app.command()
def sweep(
    scenario: ScenarioName,
    runs: Annotated[int, typer.Option(help="Runs at each point of the grid.")] = 100,
    variant: Variant = None,
    set_: Annotated[
        list[str] | None,
        typer.Option("--set", metavar="KEY=A[,B...]", help="Override a value; several make a grid; repeatable."),
    ] = None,
    dispersion: Annotated[
        list[str] | None,
        typer.Option(metavar="KEY=KIND:SIZE", help="normal, uniform or rotation_deg, or KEY=none; repeatable."),
    ] = None,
    no_dispersion: Annotated[bool, typer.Option("--no-dispersion", help="Draw nothing but noise and losses.")] = False,
    workers: Annotated[int | None, typer.Option(help="Processes; default: one a core.")] = None,
    scheduler: Annotated[str | None, typer.Option(help="Run on the workers of this dask scheduler.")] = None,
    output: Annotated[Path | None, typer.Option(help="Parquet file; default: one in sweeps/, named after it.")] = None,
    replay: Annotated[int | None, typer.Option(metavar="SAMPLE", help="Run one sample of the sweep alone.")] = None,
    engine: Annotated[Engine, typer.Option(help="For --replay.")] = Engine.inprocess,
    bag: Annotated[Path | None, typer.Option(help="For --replay: directory of a bag.")] = None,
    json: Annotated[Path | None, typer.Option(help="For --replay: write the summary to a file.")] = None,
) -> None:
    """Run a scenario many times over starts, noise and a grid of values; the same command goes on after a break."""
    from etac_ros.cli.show import make_console
    from etac_ros.cli.sweep import SweepRequest, sweep_and_show

    request = SweepRequest(
        scenario=scenario,
        runs=runs,
        variant=variant,
        overrides=tuple(set_ or ()),
        dispersions=tuple(dispersion or ()),
        dispersion=not no_dispersion,
        workers=workers,
        scheduler=scheduler,
        output=output,
        replay=replay,
        engine=engine.value,
        bag=bag,
        json=json,
    )
    if not sweep_and_show(request, make_console()):
        raise typer.Exit(INTERRUPTED)


@app.command()
def reproduce(
    scenarios: Annotated[list[str] | None, typer.Argument(help="Which; default: all.")] = None,
    engine: Annotated[Engine, typer.Option(help="For the measured figures.")] = Engine.ros,
    write: Annotated[Path | None, typer.Option(help="Write the table as Markdown.")] = None,
    json: Annotated[Path | None, typer.Option(help="Write the rows to a file.")] = None,
    bands: Annotated[
        bool, typer.Option("--bands", help="Make the stored sweeps that are stale anew, and nothing else.")
    ] = False,
    runs: Annotated[int, typer.Option(min=2, help="For --bands: dispersed runs of each variant, at least.")] = 12,
    workers: Annotated[int | None, typer.Option(min=1, help="For --bands: processes; default: one a core.")] = None,
) -> None:
    """Put every figure that the papers publish beside a measured one, its spread, and a verdict."""
    from etac_ros.cli.reproduce import make_bands
    from etac_ros.cli.reproduce import reproduce as reproduce_
    from etac_ros.cli.show import make_console

    if bands:
        make_bands(scenarios or (), runs, workers, make_console())
    else:
        reproduce_(scenarios or (), engine.value, make_console(), write, json)


@app.command()
def papers(write: Annotated[Path | None, typer.Option(help="Write the lists as Markdown.")] = None) -> None:
    """List every equation, table, figure, remark and theorem of the papers with its command, or why it has none."""
    from etac_ros.cli.papers import papers as papers_
    from etac_ros.cli.show import make_console

    papers_(make_console(), write)


@app.command()
def theorems(
    scenario: Annotated[str | None, typer.Argument(help="Which; default: all of the papers.")] = None,
    variant: Variant = None,
    set_: Set = None,
    write: Annotated[Path | None, typer.Option(help="Write the tables as Markdown.")] = None,
) -> None:
    """Compute every bound that the papers prove, and check it along a run."""
    from etac_ros.cli.show import make_console
    from etac_ros.cli.theorems import theorems as theorems_

    theorems_(scenario, variant, set_ or (), make_console(), write)


@app.command()
def tradeoff(
    scenarios: Annotated[list[str] | None, typer.Argument(help="Which; default: all with a section tradeoff.")] = None,
    runs: Annotated[int, typer.Option(min=1, help="Perturbed runs at each point.")] = 5,
    write: Annotated[Path | None, typer.Option(metavar="FOLDER", help="Write pictures and tradeoffs.md there.")] = None,
    workers: Annotated[int | None, typer.Option(min=1, help="Processes; default: one a core.")] = None,
) -> None:
    """Vary a trigger's parameters: traffic against steady error and energy, event-triggered against periodic."""
    from etac_ros.cli.show import make_console
    from etac_ros.cli.tradeoff import tradeoff as tradeoff_

    tradeoff_(scenarios or (), runs, make_console(), write, workers)


@app.command()
def robustness(
    scenarios: Annotated[list[str] | None, typer.Argument(help="Which; default: all.")] = None,
    losses: Annotated[str, typer.Option(help="Probabilities of loss, with commas.")] = "0,0.05,0.2,0.4",
    delays: Annotated[str, typer.Option(help="Delays [s], with commas.")] = "0,0.05,0.2,1",
    factor: Annotated[
        float, typer.Option(min=1.0, help="A run holds up to so many times the steady error of ideal links.")
    ] = 3.0,
    set_: Set = None,
    write: Annotated[Path | None, typer.Option(help="Write the maps as Markdown.")] = None,
) -> None:
    """Map loss and delay on the network to messages and steady error: which loops hold, and how far."""
    from etac_ros.cli.robustness import robustness_and_show
    from etac_ros.cli.show import make_console

    robustness_and_show(scenarios or (), losses, delays, factor, set_ or (), make_console(), write)


@app.command()
def check(
    scenario: ScenarioName,
    variant: Variant = None,
    set_: Set = None,
    ticks: Annotated[int, typer.Option(min=1, help="How far, at most.")] = 4000,
) -> None:
    """Look for classes with hidden state, and for results that depend on windows; exit code 1 if there are any."""
    from etac_ros.cli.check import check_and_show
    from etac_ros.cli.show import make_console
    from etac_ros.scenario.load import load

    if not check_and_show(load(scenario, variant, set_ or ()), ticks, make_console()):
        raise typer.Exit(FAILED_RUN)


@app.command()
def resolve(scenario: ScenarioName, variant: Variant = None, set_: Set = None) -> None:
    """Print the complete parameter file of a run, for nodes that are started by hand."""
    from etac_ros.metrics.published import for_others
    from etac_ros.scenario.load import load

    loaded = load(scenario, variant, set_ or ())
    for note in loaded.rounded:
        typer.echo(f"# {note}")
    typer.echo(for_others(loaded).text, nl=False)


@app.command()
def contract(
    scenario: ScenarioName,
    node: Annotated[str, typer.Argument(help="Full name of a node, as /sensor.")],
    variant: Variant = None,
    set_: Set = None,
) -> None:
    """Print what a foreign node has to subscribe to and publish in the place of a node."""
    from etac_ros.cli.contract import show_contract
    from etac_ros.cli.show import make_console
    from etac_ros.scenario.load import load

    show_contract(load(scenario, variant, set_ or ()), node, make_console())


@app.command("list")
def list_() -> None:
    """List the scenarios and their variants."""
    from etac_ros.scenario.load import config_folders, load

    for path in sorted({path for folder in config_folders() for path in folder.glob("*.yaml")}):
        found = load(str(path))
        typer.echo(f"{found.name:12} {found.run.title}")
        if found.variants:
            typer.echo(f"{'':12} variants: {', '.join(found.variants)}")


@app.command()
def node(
    name: Annotated[str, typer.Argument(help="Full name of the node, as /sensor.")],
    params_file: Annotated[Path, typer.Argument(help="What `etac resolve` printed, or a scenario's name.")],
    bag: Annotated[Path | None, typer.Option(help="For /recorder: directory of the bag.")] = None,
    quiet_s: QuietS = QUIET_S,
    clock: Clock = ClockKind.sim,
    rate: Rate = 1.0,
    strict: Strict = False,
    priority: Priority = 0,
) -> None:
    """Play one node of a run in this terminal."""
    from etac_ros.cli.nodes import play

    play(name, [str(params_file)], bag, quiet_s, rate_of_clock(clock, rate, strict, priority), strict, priority)


@app.command()
def schema() -> None:
    """Print the JSON schema of what --json writes."""
    from etac_ros.metrics.summary import summary_schema

    typer.echo(summary_schema(), nl=False)


@app.command()
def info(bag: BagPath) -> None:
    """List a bag's topics, types, counts, bytes and duration."""
    from etac_ros.cli.show import make_console, show_bag

    show_bag(bag, make_console())


@app.command()
def recover(
    bag: BagPath,
    output: Annotated[Path | None, typer.Option(help="Write the repaired bag here instead.")] = None,
) -> None:
    """Repair a bag that was cut off."""
    from etac_ros.cli.show import make_console, show_recovery

    show_recovery(bag, output, make_console())


@app.command()
def report(
    bags: Annotated[list[Path], typer.Argument(metavar="BAG...", help="The run's bag; more of them are laid over it.")],
    output: Annotated[Path | None, typer.Option(help="Folder of the report; default: report in the first bag.")] = None,
    against: Annotated[list[Path] | None, typer.Option(help="One more bag, as if it stood behind the others.")] = None,
    trust: Annotated[bool, typer.Option("--trust", help="Import the classes of others that the bags name.")] = False,
) -> None:
    """Draw the paper's figures from bags alone: PNG files and one self-contained HTML page."""
    from etac_ros.report import write_report

    first, *others = bags
    typer.echo(f"report: {write_report(first, [*others, *(against or ())], output, trust=trust)}")


def _version(wanted: bool) -> None:
    if wanted:
        typer.echo(f"etac_ros {__version__}")
        raise typer.Exit


@app.callback()
def _options(
    version: Annotated[
        bool, typer.Option("--version", callback=_version, is_eager=True, help="Print the version.")
    ] = False,
) -> None:
    pass


def _drop_output() -> None:
    """What is still to be written cannot be; without this Python would try again when it exits."""
    os.dup2(os.open(os.devnull, os.O_WRONLY), 1)


def main() -> None:
    """Entry point. Errors are for people: no traceback, and an exit code that tells bad input from a failed run."""
    hold_standard_streams()
    for stream in (sys.stdout, sys.stderr):
        if isinstance(stream, io.TextIOWrapper):  # a terminal without these letters shows others
            stream.reconfigure(errors="replace")
    try:
        app()
        sys.stdout.flush()  # while there is somebody to tell that it failed
    except EtacError as error:
        print(f"etac: {error}", file=sys.stderr)
        sys.exit(BAD_INPUT if isinstance(error, ScenarioError) else FAILED_RUN)
    except BrokenPipeError:  # whoever read our output has seen enough
        _drop_output()
        sys.exit(FAILED_RUN)
    except (MemoryError, ImportError, OSError) as error:
        refused: object = refused_by_system(error, "this process")
        if refused is None and isinstance(error, OSError):
            refused = f"{error.filename or 'standard output'}: {error.strerror or error}"
        if refused is None:
            raise
        print(f"etac: {refused}", file=sys.stderr)
        _drop_output()
        sys.exit(FAILED_RUN)
    except KeyboardInterrupt:
        print("etac: interrupted; what had happened until then is in the bag", file=sys.stderr)
        sys.exit(INTERRUPTED)
