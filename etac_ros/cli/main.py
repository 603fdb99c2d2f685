"""``etac``: run scenarios, look at bags, draw reports."""

from __future__ import annotations

import os
import sys
from enum import StrEnum
from pathlib import Path
from typing import Annotated, Any

import typer
from typer.core import TyperCommand, TyperGroup

from etac_ros import __version__
from etac_ros.cli import complete
from etac_ros.cli.interrupts import NOTHING_KEPT, Interrupted
from etac_ros.cli.shared_options import QUIET_LEAST_S, port_of_live, rate_in_real_time
from etac_ros.cli.streams import hold_standard_streams, outlive_readers
from etac_ros.engines.ros.limits import refused_by_system
from etac_ros.engines.ros.liveness import QUIET_S
from etac_ros.errors import EtacError, ScenarioError


class _Ended(Exception):
    """The user has interrupted a command; says what is kept."""


class _Commands(TyperGroup):
    """Commands whose interrupts are told: typer would end the process without a word."""

    def invoke(self, context: Any) -> Any:
        """Run a command."""
        try:
            return super().invoke(context)
        except KeyboardInterrupt as interrupt:
            kept = interrupt.kept if isinstance(interrupt, Interrupted) else NOTHING_KEPT
            raise _Ended(f"interrupted: {kept}") from None


app = typer.Typer(
    name="etac",
    cls=_Commands,
    help="Event-triggered attitude control as a graph of networked modules over ROS 2.",
    no_args_is_help=True,
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


class Spread(StrEnum):
    """How nodes are spread over processes."""

    node = "node"
    namespace = "namespace"
    one = "one"


class Format(StrEnum):
    """What tables are written as."""

    parquet = "parquet"
    csv = "csv"
    mat = "mat"
    npz = "npz"


Peers = Annotated[str | None, typer.Option(metavar="ADDRESS,...", help="Other machines of this run: docs/machines.md.")]
Interface = Annotated[
    str | None, typer.Option(metavar="NAME|ADDRESS", help="By which of its addresses this machine takes part.")
]
Clock = Annotated[ClockKind, typer.Option(help="Simulated time, or real time: docs/wallclock.md.")]
Rate = Annotated[
    float | None,
    typer.Option(help="Simulated seconds a second: of real time (default: 1), or at most, to watch simulated time."),
]
Strict = Annotated[bool, typer.Option("--strict", help="For --clock wall: end at the first missed tick.")]
Priority = Annotated[
    int, typer.Option(help="For --clock wall: real-time priority (SCHED_FIFO) of the processes, 1 to 99.")
]
ScenarioName = Annotated[
    str, typer.Argument(help="Name of a file in config/, or a path to one.", autocompletion=complete.scenarios)
]
Variant = Annotated[
    str | None,
    typer.Option(
        help="A named set of changes in the file; `etac list NAME` says which.", autocompletion=complete.variants
    ),
]
Quiet = Annotated[bool, typer.Option("--quiet", "-q", help="Show no tables and no progress; errors are still said.")]
Set = Annotated[list[str] | None, typer.Option("--set", metavar="KEY=VALUE", help="Override a value; repeatable.")]
QuietS = Annotated[
    float,
    typer.Option(min=QUIET_LEAST_S, help="A node that stands still or owes an answer for this long ends the run [s]."),
]
Live = Annotated[bool, typer.Option("--live", help="Show the run to Foxglove as it happens; see --rate.")]
LivePort = Annotated[int | None, typer.Option(min=1, max=65535, help="For --live; default: 8765.", show_default=False)]
BagPath = Annotated[Path, typer.Argument(metavar="BAG", help="Directory of a bag.")]


class CommandWithCapture(TyperCommand):
    """A command whose option ``--capture`` may have a value, or none: typer has no such options."""

    def parse_args(self, ctx: Any, args: list[str]) -> list[str]:
        """The word behind ``--capture`` is its value where it is the name of a pcapng file."""
        given = list(args)
        for place, word in enumerate(args):
            if word == "--capture" and not "".join(args[place + 1 : place + 2]).endswith(".pcapng"):
                given[place] = "--capture="
        return super().parse_args(ctx, given)


class Compress(StrEnum):
    """How the chunks of a bag are compressed: as :class:`etac_ros.bag.compression.Compression`, which loads more."""

    none = "none"
    lz4 = "lz4"
    zstd = "zstd"


@app.command(cls=CommandWithCapture)
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
    parameters: Annotated[
        bool, typer.Option("--parameters", help="Let ROS tools read the nodes' parameters and logs; starts slower.")
    ] = False,
    watch: Annotated[bool, typer.Option("--watch", help="Show the run here as it happens; see --rate.")] = False,
    live: Live = False,
    live_port: LivePort = None,
    state_rate: Annotated[
        float | None,
        typer.Option(min=0.0, help="Samples of /state in the bag a simulated second; 0: none; default: ~500 a run."),
    ] = None,
    truth: Annotated[
        str | None,
        typer.Option(
            metavar="all|none|N",
            help="Committed samples in the bag: all, none, or of every Nth tick; all messages stay.",
        ),
    ] = None,
    compression: Annotated[
        Compress | None, typer.Option(help="Of the bag's chunks; default: what the scenario says, else lz4.")
    ] = None,
    quiet_s: QuietS = QUIET_S,
    capture: Annotated[
        str | None,
        typer.Option(
            metavar="[FILE.pcapng]", help="Count every byte on the wire, by topic, cause and layer; keep the frames."
        ),
    ] = None,
    clock: Clock = ClockKind.sim,
    rate: Rate = None,
    strict: Strict = False,
    priority: Priority = 0,
    peers: Peers = None,
    interface: Interface = None,
    quiet: Quiet = False,
) -> None:
    """Run a scenario, record it, and show what crossed the network."""
    from etac_ros.cli.outputs import console_beside
    from etac_ros.cli.run import RunRequest, run_and_show, ticks_of_truth
    from etac_ros.engines.ros.several_machines import machines_of
    from etac_ros.runs import RosOptions

    port = port_of_live(live, live_port)
    if state_rate is not None:
        if state_rate == float("inf"):
            raise ScenarioError("--state-rate inf", "is no rate", "samples a simulated second, or 0", "leave it out")
        if engine is Engine.inprocess and bag is None and port is None:
            found = "is for the state in a bag, and by calls none is written unless --bag says where"
            raise ScenarioError(f"--state-rate {state_rate:g}", found, "", "add --bag DIR, or leave it out")
    if engine is Engine.inprocess and bag is None:
        for option, value in (("--truth", truth), ("--compression", compression and compression.value)):
            if value is not None:
                found = "is for a bag, and by calls none is written unless --bag says where"
                raise ScenarioError(f"{option} {value}", found, "", "add --bag DIR, or leave it out")
    options = RosOptions(
        processes.value,
        domain,
        record_windows,
        only,
        quiet_s,
        rate_in_real_time(clock is ClockKind.wall, rate, strict, priority),
        strict,
        capture is not None,
        Path(capture) if capture else None,
        rate if clock is ClockKind.sim else None,
        priority,
        machines_of(peers, interface),
        port,
        parameters,
    )
    request = RunRequest(
        scenario,
        variant,
        (
            *(set_ or ()),
            *(() if state_rate is None else (f"state_rate_hz={state_rate:g}",)),
            *(() if truth is None else (f"truth_every={ticks_of_truth(truth)}",)),
            *(() if compression is None else (f"bag_compression={compression.value}",)),
        ),
        engine.value,
        baseline,
        bag,
        json,
        options,
        watch,
    )
    run_and_show(request, console_beside(json, quiet))


@app.command()
def compare(
    scenario: ScenarioName,
    variant: Annotated[
        list[str] | None, typer.Option(help="A variant; repeatable. Default: the scenario's own.")
    ] = None,
    set_: Set = None,
    clock: Clock = ClockKind.sim,
    rate: Rate = None,
    priority: Priority = 0,
    processes: Annotated[Spread, typer.Option(help="For --clock wall.")] = Spread.node,
    bag: Annotated[Path | None, typer.Option(help="For --clock wall: directory of the bag.")] = None,
) -> None:
    """Run variants and show them beside each other and beside the paper; or one in real time beside simulated ones."""
    from etac_ros.cli.compare import compare as compare_variants
    from etac_ros.cli.show import make_console

    speed = rate_in_real_time(clock is ClockKind.wall, rate, priority=priority)
    if speed is not None:
        from etac_ros.cli.compare_clocks import compare_clocks
        from etac_ros.runs import RosOptions

        if len(variant or ()) > 1:
            raise ScenarioError("--variant", "is there more than once", "one, with --clock wall")
        options = RosOptions(processes.value, rate=speed, priority=priority)
        compare_clocks(scenario, variant[0] if variant else None, set_ or (), options, bag, make_console())
        return
    if rate is not None:
        raise ScenarioError(f"--rate {rate:g}", "is for --clock wall", "", "add --clock wall")

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
    json: Annotated[
        Path | None, typer.Option(help="For --replay: write the summary to a file; - is standard output.")
    ] = None,
    quiet: Quiet = False,
) -> None:
    """Run a scenario many times over starts, noise and a grid of values; the same command goes on after a break."""
    from etac_ros.cli.outputs import console_beside
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
    sweep_and_show(request, console_beside(json, quiet))


@app.command()
def reproduce(
    scenarios: Annotated[list[str] | None, typer.Argument(help="Which; default: all.")] = None,
    engine: Annotated[Engine, typer.Option(help="For the measured figures.")] = Engine.ros,
    write: Annotated[Path | None, typer.Option(help="Write the table as Markdown.")] = None,
    json: Annotated[Path | None, typer.Option(help="Write the rows to a file; - is standard output.")] = None,
    afresh: Annotated[
        bool, typer.Option("--afresh", help="Measure anew what an interrupted call has left, too.")
    ] = False,
    bands: Annotated[
        bool, typer.Option("--bands", help="Make the stored sweeps that are stale anew, and nothing else.")
    ] = False,
    runs: Annotated[int, typer.Option(min=2, help="For --bands: dispersed runs of each variant, at least.")] = 12,
    workers: Annotated[int | None, typer.Option(min=1, help="For --bands: processes; default: one a core.")] = None,
    quiet: Quiet = False,
) -> None:
    """Put every figure of the papers beside a measured one, with a verdict; the same command goes on after a break."""
    from etac_ros.cli.outputs import console_beside
    from etac_ros.cli.reproduce import make_bands
    from etac_ros.cli.reproduce import reproduce as reproduce_

    console = console_beside(json, quiet)
    if bands:
        make_bands(scenarios or (), runs, workers, console)
    else:
        reproduce_(scenarios or (), engine.value, console, write, json, afresh)


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
    spacecraft: Annotated[
        str, typer.Option(help="Sizes of a formation on its radio, with commas; empty for none.")
    ] = "4,8,12,16,24,32",
    set_: Set = None,
    write: Annotated[Path | None, typer.Option(help="Write all as Markdown, with pictures beside it.")] = None,
) -> None:
    """Map loss and delay to messages and steady error; cost of retransmission; how many spacecraft share a medium."""
    from etac_ros.cli.robustness import robustness_and_show
    from etac_ros.cli.show import make_console

    robustness_and_show(scenarios or (), losses, delays, factor, set_ or (), spacecraft, make_console(), write)


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
def layout(
    scenario: ScenarioName,
    variant: Variant = None,
    set_: Set = None,
    output: Annotated[Path, typer.Option(help="Folder for the files; made if it is not there.")] = Path("."),
) -> None:
    """Write layouts for Foxglove and PlotJuggler that fit the bags of a scenario; share/ has those of our own."""
    from etac_ros.runs import layouts_of
    from etac_ros.scenario.load import load

    texts = layouts_of(load(scenario, variant, set_ or ()))
    output.mkdir(parents=True, exist_ok=True)
    for name, text in texts.items():
        (output / name).write_text(text, encoding="utf-8")
        typer.echo(f"layout: {output / name}")


@app.command()
def contract(
    scenario: ScenarioName,
    node: Annotated[str, typer.Argument(help="Full name of a node, as /sensor.")],
    variant: Variant = None,
    set_: Set = None,
) -> None:
    """Print what a foreign node has to subscribe to and publish in the place of a node."""
    from etac_ros.cli.contract import show_contract
    from etac_ros.scenario.load import load
    from etac_ros.tables.terminal import make_console

    show_contract(load(scenario, variant, set_ or ()), node, make_console())


@app.command("list")
def list_(
    scenario: Annotated[
        str | None, typer.Argument(help="Say what each variant of this one changes.", autocompletion=complete.scenarios)
    ] = None,
) -> None:
    """List the scenarios and their variants."""
    from etac_ros.cli.listing import list_scenarios, list_variants
    from etac_ros.tables.terminal import make_console

    if scenario is None:
        list_scenarios(make_console())
    else:
        list_variants(scenario, make_console())


@app.command()
def node(
    name: Annotated[str, typer.Argument(help="Full name of the node, as /sensor.")],
    params_file: Annotated[Path, typer.Argument(help="What `etac resolve` printed, or a scenario's name.")],
    bag: Annotated[Path | None, typer.Option(help="For /recorder: directory of the bag.")] = None,
    quiet_s: QuietS = QUIET_S,
    clock: Clock = ClockKind.sim,
    rate: Rate = None,
    strict: Strict = False,
    priority: Priority = 0,
    live: Live = False,
    live_port: LivePort = None,
    peers: Peers = None,
    interface: Interface = None,
) -> None:
    """Play one node of a run in this terminal."""
    from etac_ros.cli.nodes import join_domain, play
    from etac_ros.scenario.load import load

    domain = join_domain(peers, interface)
    play(
        name,
        load(str(params_file)),
        domain,
        bag,
        quiet_s,
        rate_in_real_time(clock is ClockKind.wall, rate, strict, priority),
        strict,
        priority,
        rate if clock is ClockKind.sim else None,
        port_of_live(live, live_port),
    )


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
    figures: Annotated[
        Path | None, typer.Option(metavar="FOLDER", help="Write the figures as SVG and PDF there, for papers.")
    ] = None,
    trust: Annotated[bool, typer.Option("--trust", help="Import the classes of others that the bags name.")] = False,
) -> None:
    """Draw the paper's figures from bags alone: PNG files and one self-contained HTML page."""
    from etac_ros.cli.interrupts import keeping
    from etac_ros.cli.progress import steps
    from etac_ros.cli.show import make_console
    from etac_ros.report import write_report

    first, *others = bags
    unfinished = f"{output or first / 'report'} is not complete; the same command draws it anew"
    with steps(make_console(), f"{first}: reading") as say, keeping(unfinished):
        others += against or ()
        page = write_report(first, others, output, trust=trust, figures=figures, say=say, forks=True)
    typer.echo(f"report: {page}")


@app.command()
def export(
    bag: BagPath,
    to: Annotated[Format, typer.Option(help="parquet, csv: a file a table; mat, npz: one file of arrays.")],
    output: Annotated[Path | None, typer.Option(help="Folder of the files; default: export in the bag.")] = None,
    table: Annotated[
        list[str] | None, typer.Option(help="attitude, rate, torque, state, watched, triggers, messages; default: all.")
    ] = None,
    rate: Annotated[float | None, typer.Option(help="Samples a simulated second at most; default: all.")] = None,
    trust: Annotated[bool, typer.Option("--trust", help="Import the classes of others that the bag names.")] = False,
) -> None:
    """Write a bag as tables: samples, triggers and messages, for pandas, MATLAB, Octave and numpy."""
    from etac_ros.export import open_bag, write_tables

    if rate is not None and not rate > 0.0:
        raise ScenarioError(f"--rate {rate:g}", "is no rate", "samples a simulated second, more than 0")
    folder = bag / "export" if output is None else output
    tables = open_bag(bag, rate_hz=rate, trust=trust)
    for path in write_tables(tables, to.value, folder, table or ()):
        typer.echo(f"table: {path}")
    if not table:
        for name, why in tables.left_out.items():
            typer.echo(f"etac: no table '{name}': {why}", err=True)


@app.command()
def play(
    bag: BagPath,
    rate: Annotated[float, typer.Option(help="Seconds of the bag a second; inf: as fast as possible.")] = 1.0,
    domain: Annotated[int | None, typer.Option(help="ROS domain; default: ROS_DOMAIN_ID, or 0.")] = None,
    topic: Annotated[
        list[str] | None, typer.Option(help="A topic, or what it begins with; repeatable. Default: all but /emulation.")
    ] = None,
    everything: Annotated[bool, typer.Option("--all", help="Publish /emulation too.")] = False,
    wait: Annotated[bool, typer.Option("--wait", help="Begin only when somebody listens.")] = False,
    peers: Peers = None,
    interface: Interface = None,
) -> None:
    """Publish a bag as ROS topics, with /clock: for rviz, Foxglove's bridge, or a node of one's own."""
    from etac_ros.cli.play import play_bag
    from etac_ros.cli.show import make_console

    play_bag(bag, rate, domain, topic or (), everything, wait, make_console(), peers, interface)


@app.command()
def watch(
    scenario: Annotated[
        str | None,
        typer.Argument(help="What runs; default: what the run says of itself.", autocompletion=complete.scenarios),
    ] = None,
    variant: Variant = None,
    set_: Set = None,
    domain: Annotated[
        int | None, typer.Option(help="ROS domain; default: ROS_DOMAIN_ID, or that of the one run on this machine.")
    ] = None,
    peers: Peers = None,
    interface: Interface = None,
    quiet: Quiet = False,
) -> None:
    """Show a run that goes on elsewhere, as it happens; listens only."""
    from etac_ros.cli.outputs import console_beside
    from etac_ros.cli.watch import watch_run

    watch_run(scenario, variant, set_ or (), domain, console_beside(None, quiet), peers, interface)


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
    outlive_readers()
    try:
        app()
        sys.stdout.flush()  # while there is somebody to tell that it failed
    except EtacError as error:
        print(f"etac: {error}", file=sys.stderr)
        sys.exit(BAD_INPUT if isinstance(error, ScenarioError) else FAILED_RUN)
    except (MemoryError, ImportError, OSError) as error:
        refused: object = refused_by_system(error, "this process")
        if refused is None and isinstance(error, OSError):
            refused = f"{error.filename or 'standard output'}: {error.strerror or error}"
        if refused is None:
            raise
        print(f"etac: {refused}", file=sys.stderr)
        _drop_output()
        sys.exit(FAILED_RUN)
    except _Ended as ended:
        print(f"etac: {ended}", file=sys.stderr)
        sys.exit(INTERRUPTED)
