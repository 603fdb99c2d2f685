"""What was tried where a paper leaves a choice: `scripts/bench readings` runs it all and writes docs/readings.md.

Each search names the figures that a parameter was fitted to, and those that it was not: only the latter say anything.
"""

from __future__ import annotations

import argparse
import math
from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass, field
from pathlib import Path

import numpy as np

from etac_ros.errors import RunHalted
from etac_ros.metrics.published import published_figures
from etac_ros.metrics.summary import Summary, with_measured
from etac_ros.runs import run_in_process
from etac_ros.scenario.load import baseline_of, load
from etac_ros.scenario.schema import FigureKind
from etac_ros.theorems.xie2021 import held_torque

PAGE = Path(__file__).resolve().parents[1] / "docs" / "readings.md"
Figures = dict[str, float | None]


@dataclass(frozen=True)
class Reading:
    """One way to read a paper: what it is called, and what it measures."""

    label: str
    measure: Callable[[], Figures]


@dataclass(frozen=True)
class Search:
    """Readings beside each other.

    Attributes
    ----------
    name, text
        Heading, and what the choice is about.
    fitted, validated
        Published figures by column: those that the choice was made by, and those that it was not.
    readings
        All that were tried.
    """

    name: str
    text: str
    fitted: dict[str, float]
    validated: dict[str, float]
    readings: list[Reading] = field(default_factory=list)


def summary(scenario: str, variant: str | None, overrides: Sequence[str], baseline: bool = False) -> Summary:
    loaded = load(scenario, variant, list(overrides))
    found = run_in_process(loaded).summary
    other = baseline_of(loaded) if baseline else None
    return found if other is None else with_measured(found, run_in_process(other).summary)


def count(found: Summary, node: str) -> float:
    return float(found.triggers[node].count)


def wu2018() -> list[Search]:
    noisy = Search(
        "wu2018: the printed noise",
        "Section 5 prints sensor accuracies and gamma = 1e-6. Both together give thousands of triggers.",
        {"triggers": 84.0},
        {},
    )

    def of(variant: str | None, *overrides: str) -> Callable[[], Figures]:
        return lambda: {"triggers": count(summary("wu2018", variant, overrides), "/sensor")}

    noisy.readings.append(Reading("no noise, gamma 1e-6 (the default)", of(None)))
    noisy.readings.append(Reading("noise behind a low-pass of 1 s, gamma 1e-6", of("filtered-noise")))
    for gamma in ("1e-6", "1e-5", "2e-5", "3e-5", "4e-5", "5e-5", "6e-5", "1e-4"):
        noisy.readings.append(Reading(f"noise, gamma {gamma}", of("noise", f"sensor.trigger.gamma={gamma}")))
    starts = Search(
        "wu2018: the start",
        "The start stands only in fig. 2. Random starts of its size: 30 draws, each angle normal with 10, 5 and 5 deg.",
        {"triggers": 84.0},
        {},
    )

    def drawn() -> Figures:
        generator = np.random.Generator(np.random.Philox(18))
        counts = []
        for _ in range(30):
            angles = generator.normal(size=3) * [10.0, 5.0, 5.0]
            key = f"plant.dynamics.attitude_euler_deg={[round(float(angle), 3) for angle in angles]}"
            counts.append(count(summary("wu2018", None, [key]), "/sensor"))
        return {"fewest": min(counts), "mean": float(np.mean(counts)), "most": max(counts)}

    starts.readings.append(Reading("30 starts", drawn))
    return [noisy, starts]


def flexible() -> list[Search]:
    beta = Search(
        "flexible: beta",
        "Table 2 is lost from the text that we have. Beta is fitted to the three counts.",
        {"rho 1e-6": 270.0, "rho 1e-5": 178.0, "rho 1e-4": 97.0},
        {"energy": 2.56, "mean interval": 10.08},
    )

    def of_beta(value: float) -> Figures:
        key = [f"sensor.trigger.alpha={value}"]
        some = {name: summary("flexible", name, key) for name in ("rho1e-6", "rho1e-5", "rho1e-4")}
        return {
            "rho 1e-6": count(some["rho1e-6"], "/sensor"),
            "rho 1e-5": count(some["rho1e-5"], "/sensor"),
            "rho 1e-4": count(some["rho1e-4"], "/sensor"),
            "energy": some["rho1e-6"].value("energy_n2m2s"),
            "mean interval": some["rho1e-5"].value("steady_mean_interval_s"),
        }

    for value in (0.3, 0.4, 0.45, 0.5, 0.55, 0.6, 0.7):
        beta.readings.append(Reading(f"beta {value:g}", lambda value=value: of_beta(value)))
    layer = Search(
        "flexible: the boundary layer of the sliding mode",
        "With d_max = 1 as printed and sign(s) smoothed as sat(s / width). The width is fitted to the two counts; a "
        "figure such as 1.9 N m shows a loop that no longer settles.",
        {"r 1e-6": 2118.0, "r 1e-5": 1168.0},
        {"energy": 6960.0, "torque after 100 s": 6.0e-3, "|eta|, steady": 1.1e-2, "mean interval, r 1e-5": 0.68},
    )

    def of_width(variant: str, *overrides: str) -> Figures:
        one, other = (summary("flexible", name, overrides) for name in (variant, f"{variant}-r1e-5"))
        return {
            "r 1e-6": count(one, "/sensor"),
            "r 1e-5": count(other, "/sensor"),
            "energy": one.value("energy_n2m2s"),
            "torque after 100 s": one.value("torque_at_100_s"),
            "|eta|, steady": one.value("steady_modes"),
            "mean interval, r 1e-5": other.value("steady_mean_interval_s"),
        }

    for width in (0.05, 0.1, 0.125, 0.15, 0.175, 0.2, 0.25, 0.3):
        key = f"controller.law.boundary_layer_rad_s={width}"
        layer.readings.append(Reading(f"width {width:g} rad/s", lambda key=key: of_width("smc", key)))
    for most in ("1e-3", "1e-2"):
        key = f"controller.law.disturbance_bound_nm={most}"
        layer.readings.append(Reading(f"sign as printed, d_max {most} N m", lambda key=key: of_width("smc-sign", key)))
    return [beta, layer]


ROWS = {"0": 200.0, "0.3": 204.0, "0.6": 210.0, "0.9": 225.0, "1.2": 384.0, "1.5": 509.0, "1.8": 1172.0}


def shi2022() -> list[Search]:
    search = Search(
        "shi2022: threshold, adaptation and axes",
        "Columns 0 to 1.8 are the rows of Table 1. chi is held inside its bound where a start is outside. The choice "
        "was made by the first row; the other rows and the sum of |u(t_k)| are not fitted. The counts are chaotic: "
        "neighbours in this table differ by dozens.",
        {"0": 200.0},
        {**{name: value for name, value in ROWS.items() if name != "0"}, "smaller sum of |u| [%]": 81.9},
    )

    def of(*overrides: str) -> Figures:
        found: Figures = {}
        for name in ROWS:
            size = 0.1 * float(name)
            rate = f"plant.dynamics.rate_rad_s={[size, size, -size]}"
            one = summary("shi2022", None, ["controller.law.start_outside=saturate", rate, *overrides], name == "0")
            found[name] = count(one, "/controller")
            if name == "0":
                found["smaller sum of |u| [%]"] = one.value("sent_reduction_percent")
        return found

    def add(label: str, *overrides: str) -> None:
        search.readings.append(Reading(label, lambda: of(*overrides)))

    for delta in ("0.05", "0.1", "0.1375", "0.2", "0.3"):
        add(f"delta {delta}, else as printed", f"controller.trigger.delta={delta}")
    add("as printed", "controller.trigger.delta=0.001")
    add("delta 0.1375, 1/rho in the gradient", "controller.law.gradient=rho")
    add("delta 0.1375, |s(0)|", "controller.law.start=magnitude")
    for axes in ("any", "each"):
        for at in ("samples", "events"):
            for absolute in (0.08, 0.09, 0.1, 0.11, 0.12):
                add(
                    f"delta 0.001, threshold {absolute:g} N m, axes {axes}, adaptation at {at}",
                    "controller.trigger.delta=0.001",
                    f"controller.trigger.absolute_nm={absolute}",
                    f"controller.trigger.axes={axes}",
                    f"controller.law.adaptation_at={at}",
                )
    add(
        "delta 0.001, threshold 0.1 N m, axes each, adaptation at events, |s(0)|",
        "controller.trigger.delta=0.001",
        "controller.trigger.absolute_nm=0.1",
        "controller.trigger.axes=each",
        "controller.law.adaptation_at=events",
        "controller.law.start=magnitude",
    )
    return [search]


NO_TORQUE = ("sine_nm=[0.0, 0.0, 0.0]", "cosine_nm=[0.0, 0.0, 0.0]")


COUPLING_SCALES = ("sim/plant.dynamics.coupling_scale", "pm/relative_sensor.law.coupling_scale")
CASES = {
    "case 1": [],
    "case 2": ["pm/relative_sensor.trigger.delta=0.8"],
    "case 3": ["pm/relative_sensor.trigger.delta=0.8", "pm/relative_sensor.trigger.epsilon=50.0"],
}


def qi2022() -> list[Search]:
    search = Search(
        "qi2022: coupling, disturbances and what is held",
        "The factor is on Delta Delta'. It is fitted to the three counts; longest interval and the PM's remaining rate "
        "from 60 s on are not.",
        {"case 1": 196.0, "case 2": 208.0, "case 3": 232.0},
        {"longest interval": 3.45, "PM's rate": 5.0e-6},
    )
    unknown = [
        f"{node}.{key}"
        for node in (
            "pm/controller.law.disturbance_pm",
            "pm/relative_sensor.measurement.disturbance_pm",
            "pm/relative_sensor.law.disturbance_sm",
        )
        for key in NO_TORQUE
    ]
    feedback = ["pm/relative_sensor.law.feed_forward=false", "sim/plant.dynamics.continuous_feed_forward=true"]

    def of(overrides: Sequence[str]) -> Figures:
        one, two, three = (summary("qi2022", name, overrides) for name in ("case1", "case2", "case3"))
        sensor = "/pm/relative_sensor"
        return {
            "case 1": count(one, sensor),
            "case 2": count(two, sensor),
            "case 3": count(three, sensor),
            "longest interval": one.triggers[sensor].max_interval_s,
            "PM's rate": one.value("late_rate_pm_deg_s"),
        }

    for label, keys in (
        ("tau_d known, all held", []),
        ("tau_d unknown, all held", unknown),
        ("tau_d known, error feedback held", feedback),
    ):
        for scale in (0.7, 0.8, 0.85, 0.9, 1.0):
            overrides = [f"sim/plant.dynamics.coupling_scale={scale}", *keys]
            search.readings.append(Reading(f"coupling x {scale:g}, {label}", lambda overrides=overrides: of(overrides)))
    panels = Search(
        "qi2022: eq. (13) with the panels' acceleration",
        "Eq. (13) prints Delta eta_ddot too, which the default leaves out. Here the law has it, from modes that it "
        "knows; the law knows the coupling, too. Nothing is fitted.",
        {},
        {"case 1": 196.0, "case 2": 208.0, "case 3": 232.0},
    )
    for scale in (0.8, 0.85, 0.9, 1.0):
        for case, keys in CASES.items():
            overrides = [*(f"{key}={scale}" for key in COUPLING_SCALES), *keys]
            panels.readings.append(
                Reading(
                    f"coupling x {scale:g}, delta and epsilon of {case}",
                    lambda overrides=overrides, case=case: {
                        case: count(summary("qi2022", "panels", overrides), "/pm/relative_sensor")
                    },
                )
            )
    return [search, panels]


CRAFT = ("sc1", "sc2", "sc3", "sc4")
TABLE_2 = dict(zip(CRAFT, (181.0, 203.0, 170.0, 217.0), strict=True))
WITHIN = 0.1
DRAWS = 150


def within(found: Summary) -> float:
    """How many of the published figures are met within a tenth; reductions and limits are not counted."""
    printed = load("xie2021", found.variant)  # other starts have no figures of the paper's beside them
    published = {
        key: figure
        for key, figure in published_figures(printed, printed.build()).items()
        if "reduction" not in key.name and figure.kind_as(key.name) is not FigureKind.LIMIT
    }
    met = [
        key
        for key, figure in published.items()
        if key in found.figures and abs(found.figures[key] - figure.value) <= WITHIN * abs(figure.value)
    ]
    return float(len(met))


def of_formation(variant: str, overrides: Sequence[str] = ()) -> Figures:
    found = summary("xie2021", variant, overrides)
    counts = {name: count(found, f"/{name}/sensor") for name in CRAFT}
    return {**counts, "of 40 within 10 %": within(found)}


def signs(values: str, pattern: Sequence[int]) -> str:
    run = load("xie2021").nodes
    key = {"attitude_mrp": "attitude_mrp", "rate_rad_s": "rate_rad_s"}[values]
    sizes = [abs(float(number)) for name in CRAFT for number in run[f"/{name}/plant"]["dynamics"][key]]
    return f"formation.values.{values}={[size * sign for size, sign in zip(sizes, pattern, strict=True)]}"


def xie2021() -> list[Search]:
    held = [f"{name}/sensor.signal.knowledge=held" for name in CRAFT]
    one = Search(
        "xie2021, Case 1: what is known of the neighbours",
        "With the signs of the default, which were searched for the counts of Table 2.",
        dict(TABLE_2),
        {"of 40 within 10 %": 40.0},
    )
    two = Search(
        "xie2021, Case 2",
        "Nothing was fitted to these.",
        {},
        {**dict(zip(CRAFT, (33.0, 36.0, 30.0, 36.0), strict=True)), "of 40 within 10 %": 40.0},
    )
    for label, variant, keys in (
        ("own triggers renew, neighbours extrapolated (the default)", "case1", []),
        ("own triggers renew, neighbours held", "case1", held),
        ("neighbours known at every instant", "continuous", []),
        ("neighbours' triggers renew too, extrapolated", "renewed", []),
        ("neighbours' triggers renew too, held", "renewed", held),
    ):
        one.readings.append(Reading(label, lambda variant=variant, keys=keys: of_formation(variant, keys)))
        other = {"case1": "case2", "renewed": "renewed-case2"}.get(variant)
        if other is not None:
            two.readings.append(Reading(label, lambda other=other, keys=keys: of_formation(other, keys)))
    drawn = Search(
        "xie2021, Case 1: the signs of the starts",
        f"The text has lost 24 signs. Random ones, {DRAWS} draws, with the default's knowledge and with torques that "
        "neighbours renew.",
        dict(TABLE_2),
        {},
    )

    def random_signs(variant: str, keys: Sequence[str]) -> Figures:
        generator = np.random.Generator(np.random.Philox(24))
        counts, met = [], []
        for _ in range(DRAWS):
            pattern = [int(sign) for sign in 2 * generator.integers(0, 2, 24) - 1]
            overrides = [signs("attitude_mrp", pattern[:12]), signs("rate_rad_s", pattern[12:]), *keys]
            found = summary("xie2021", variant, overrides)
            counts.append([count(found, f"/{name}/sensor") for name in CRAFT])
            met.append(within(found))
        table = np.array(counts)
        off = np.abs(table / np.array(list(TABLE_2.values())) - 1.0).mean(axis=1)
        return {
            **{f"{name}, fewest": float(table[:, i].min()) for i, name in enumerate(CRAFT)},
            **{f"{name}, most": float(table[:, i].max()) for i, name in enumerate(CRAFT)},
            "least mean error [%]": float(100.0 * off.min()),
            "at most, of 40 within 10 %": max(met),
        }

    drawn.readings.append(
        Reading(f"own triggers renew (the default), {DRAWS} draws", lambda: random_signs("case1", []))
    )
    drawn.readings.append(
        Reading(f"neighbours' triggers renew too, {DRAWS} draws", lambda: random_signs("renewed", []))
    )
    return [one, two, drawn]


SCENARIOS: dict[str, Callable[[], list[Search]]] = {
    "wu2018": wu2018,
    "qi2022": qi2022,
    "flexible": flexible,
    "shi2022": shi2022,
    "xie2021": xie2021,
}


def number(value: float | None) -> str:
    """A figure for people."""
    if value is None:
        return "-"
    return f"{value:,.0f}" if float(value).is_integer() and abs(value) < 1e9 else f"{value:.4g}"


def _measured(reading: Reading) -> tuple[str, Figures]:
    """What a reading is called and gives; nothing where a run ends before its time."""
    try:
        return reading.label, reading.measure()
    except RunHalted as error:
        return f"{reading.label}: the run ends, {str(error).partition('halted at ')[2].partition(':')[0]}", {}


def rows(search: Search) -> Iterator[str]:
    """A search as lines of Markdown."""
    yield f"## {search.name}"
    yield ""
    yield f"{search.text} Readings tried: {len(search.readings)}."
    yield ""
    found = [_measured(reading) for reading in search.readings]
    columns = list(dict.fromkeys(name for _, figures in found for name in figures))
    yield f"| reading | {' | '.join(columns).replace('|eta|', '&#124;eta&#124;').replace('|u|', '&#124;u&#124;')} |"
    yield f"|---|{'---|' * len(columns)}"
    published = {**search.fitted, **search.validated}
    marked = [
        "" if name not in published else f"{number(published[name])}{' (fitted)' if name in search.fitted else ''}"
        for name in columns
    ]
    yield f"| *paper* | {' | '.join(marked)} |"
    for label, figures in found:
        cells = " | ".join(number(figures[name]) if name in figures else "" for name in columns)
        yield f"| {label.replace('|', '&#124;')} | {cells} |"
    yield ""


def case_two() -> Iterator[str]:
    """Why no held torque gives the tables of xie2021's Case 2."""
    # Tables 3 and 5, spacecraft 1; J1; sigma_d's acceleration, as a rate of a body that follows it: 4 sigma_d''.
    found = held_torque(8.657, 35.0, (0.15, 0.058), (0.0014, 0.0011), 18.0, 4.0 * 3.0e-3 * 0.2**2)
    yield "## xie2021, Case 2: what its own tables exclude"
    yield ""
    yield (
        "Tables 3 and 5 of spacecraft 1: a longest interval of 8.657 s within the 35 s over which |u| has a mean of "
        "0.15 N m and a deviation of 0.058 N m. A torque that is held through a share f of the time is no further from "
        "the mean than sd sqrt((1 - f) / f), so that it is at least "
        f"{found.least_torque_nm:.3f} N m throughout. With the largest moment of inertia, and the reference going "
        f"along, it makes the mean square of |omega_e| at least {found.least_rate_square:.2g} rad^2/s^2; Table 5 has "
        f"{found.printed_rate_square:.2g}. "
        + ("The tables allow it." if found.possible else "So the torque of Tables 3 and 5 was not held.")
    )
    yield ""


def environment() -> Iterator[str]:
    """The four torques of qi2022's Table 1 that are left out, by their size."""
    mu, radius = 3.986004418e14, 6.778137e6
    speed = math.sqrt(mu / radius)
    moments = {"PM": (20.06, 19.97), "SM": (22.37, 20.49)}
    lever, area = 0.1, 1.0
    yield "## qi2022: torques of the environment"
    yield ""
    yield (
        "Table 1 names a gravity model, a magnetic field, an atmosphere and radiation pressure, and no area, dipole, "
        "lever or drag coefficient, so that its torques cannot be had; it also prints tau_dp and tau_ds, which stand "
        "in for all of them here. They are left out. Their size, with 1 m^2 at a lever of 0.1 m, a residual dipole of "
        "0.1 A m^2, a drag coefficient of 2.2, 2.8e-12 kg/m^3 at 400 km (mean solar activity), 5e-5 T and 4.5e-6 N/m^2:"
    )
    yield ""
    yield "| torque | size [N m] |"
    yield "|---|---|"
    for name, (most, least) in moments.items():
        gradient = 1.5 * mu / radius**3 * (most - least)
        yield f"| gravity gradient on the {name}, 1.5 mu / r^3 (J_max - J_min) | {gradient:.1e} |"
    yield f"| magnetic | {0.1 * 5e-5:.1e} |"
    yield f"| drag | {0.5 * 2.8e-12 * speed**2 * 2.2 * area * lever:.1e} |"
    yield f"| radiation pressure, reflectivity 0.6 | {4.5e-6 * 1.6 * area * lever:.1e} |"
    yield "| *tau_dp, as printed* | 1.0e-05 |"
    yield "| *tau_ds, as printed* | 1.0e-03 |"
    yield ""
    yield ("On the SM all are below tau_ds by a factor of fifty and more; on the PM drag is of the size of tau_dp.")
    yield ""


HEAD = [
    "# The readings that were tried",
    "",
    "Written by `./scripts/bench readings`; every figure is a run in process. Where a paper leaves a choice, this page "
    "says which readings were tried, how many, what a parameter was fitted to, and what the same reading gives for "
    "figures that it was not fitted to. A parameter that meets what it was fitted to says nothing.",
    "",
]


def page(names: Sequence[str]) -> str:
    """The whole page."""
    lines = list(HEAD)
    for name in names:
        for search in SCENARIOS[name]():
            print(f"{search.name}: {len(search.readings)} readings", flush=True)
            lines += rows(search)
        if name == "xie2021":
            lines += case_two()
        if name == "qi2022":
            lines += environment()
    return "\n".join(lines).rstrip("\n") + "\n"


def main() -> None:
    """Write the page, or show a part of it."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("scenario", nargs="*", choices=[*SCENARIOS, []], help="show these only, and write nothing")
    names = parser.parse_args().scenario
    text = page(names or list(SCENARIOS))
    if names:
        print(text)
    else:
        PAGE.write_text(text, encoding="utf-8")
        print(f"written: {PAGE}")


if __name__ == "__main__":
    main()
