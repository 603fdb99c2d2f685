"""Cells of tables for what a summary holds, the same wherever it is shown."""

from __future__ import annotations

from collections.abc import Iterable, Mapping

from etac_ros.graph.faults import FaultKind
from etac_ros.metrics.accounts import AcknowledgementAccount, HoldAccount, LinkAccount, MediumAccount
from etac_ros.metrics.fault_account import Excursion, FaultAccount
from etac_ros.metrics.summary import Performance, PublishedValue, Summary, Topic, Totals, Watched
from etac_ros.metrics.verdict import GOOD, Spread, Verdict
from etac_ros.tables.numbers import band, bracketed, optional, type_words

KINDS = ("network", "internal", "emulation")
PERFORMANCE = ("error [deg]", "largest* [deg]", "rate [deg/s]", "largest* [deg/s]")
PERFORMANCE_SHORT = ("error [deg]", "largest*", "rate [deg/s]", "largest*")
"""The same where the columns stand beside each other. Behind both comes :func:`energy_heading`."""
WATCHED = ("largest", "at [s]", "axis", "largest*", "at the end", "notice", "limit")


def energy_heading(runs: Iterable[Performance]) -> str:
    """What the integral of the square of what inputs hold is called, of these plants together."""
    return "energy [N²m²s]" if all(one.of_torque for one in runs) else "input², integrated"


def performance_cells(figures: Performance) -> tuple[str, ...]:
    """In the order of ``PERFORMANCE``, then the energy; empty where a plant has no attitude."""
    angles = (
        figures.attitude_error_deg, figures.max_attitude_error_deg, figures.rate_deg_s, figures.max_rate_deg_s,
    )  # fmt: skip
    return (*(optional(angle, ".3g") for angle in angles), f"{figures.energy_n2m2s:.4g}")


def watched_cells(watched: Watched) -> tuple[str, ...]:
    """In the order of ``WATCHED``."""
    return (
        f"{watched.largest:.4g}",
        f"{watched.at_s:g}",
        watched.axis,
        f"{watched.steady:.3g}",
        f"{watched.final:.3g}",
        optional(watched.notice, "g"),
        optional(watched.bound, "g"),
    )


def watched_name(watched: Watched) -> str:
    """What is watched, with its unit."""
    return f"{watched.name}{bracketed(watched.unit)}"


LINK_ACCOUNT = (
    "sent", "delivered", "lost", "dropped", "given up", "superseded", "under way", "twice", "overtaken", "delay [s]",
    "99 %", "most", "age [s]", "peak",
)  # fmt: skip
"""Of a link that is not ideal, each message counted for each receiver; the first delay is the median."""
ACKNOWLEDGEMENT_ACCOUNT = ("messages acknowledged", "frames sent again", "acknowledgements", "their bytes")
"""Of a link that is acknowledged."""
HOLD_ACCOUNT = ("time to live [s]", "expired", "safe for [s]")
"""Of a zero-order hold with a time to live."""
MEDIUM_ACCOUNT = (
    "frames", "collided", "given up", "dropped", "payload", "overhead", "acknowledging", "collided bytes",
    "air time [s]", "used", "energy [J]", "first drop [s]",
)  # fmt: skip
"""Of a shared medium."""


def link_account_cells(account: LinkAccount) -> tuple[str, ...]:
    """In the order of ``LINK_ACCOUNT``."""
    counts = (
        account.sent, account.delivered, account.lost, account.dropped, account.given_up, account.superseded,
        account.under_way, account.duplicated, account.overtaken,
    )  # fmt: skip
    times = (
        account.median_delay_s, account.p99_delay_s, account.most_delay_s, account.mean_age_s, account.peak_age_s,
    )  # fmt: skip
    return (*(f"{count:,}" for count in counts), *(optional(time, ".3g") for time in times))


def acknowledgement_account_cells(account: AcknowledgementAccount) -> tuple[str, ...]:
    """In the order of ``ACKNOWLEDGEMENT_ACCOUNT``."""
    counts = (
        account.acknowledged, account.retransmitted, account.acknowledgements, account.acknowledgement_bytes,
    )  # fmt: skip
    return tuple(f"{count:,}" for count in counts)


def hold_account_cells(account: HoldAccount) -> tuple[str, ...]:
    """In the order of ``HOLD_ACCOUNT``."""
    return f"{account.time_to_live_s:g}", f"{account.expired:,}", f"{account.safe_s:.6g}"


FAULT_ACCOUNT = (
    "node", "does", "at [s]", "for [s]", "missed", "waited", "plant", "band [deg]", "largest", "of [s]", "left [s]",
    "back [s]",
)  # fmt: skip
"""Of a fault, a row a plant."""
FAULT_NOTE = (
    "missed: messages for the node that were lost to it; waited: that reached it when it went on; band: the largest "
    "error over the tenth of the run before"
)


def fault_notes(accounts: Mapping[str, FaultAccount], in_real_time: bool) -> tuple[str, ...]:
    """What is to be said below the table of faults; in real time more than what its columns are."""
    notes = [FAULT_NOTE]
    for name, account in accounts.items():
        if in_real_time and account.do is FaultKind.RESTART:
            was = "never in the run" if account.joined_s is None else f"in the run at {account.joined_s:.6g} s"
            notes.append(f"{name}: {account.node} was started again at {account.until_s:.6g} s, and was {was}")
        if account.unknown:
            notes.append(
                f"{name}: of {account.unknown:,} messages to and from {account.node} nobody knows whether it had taken "
                "or noted them: the last account of a process that was killed is lost with it"
            )
    return tuple(notes)


def steady_note(from_s: float, end_s: float) -> str:
    """When the figures marked * are taken; a run that is over before, by itself or by a watch, has those of its end."""
    return f"* from {from_s:g} s on" if from_s < end_s else f"* at the end, which comes before {from_s:g} s"


def fault_account_cells(account: FaultAccount) -> list[tuple[str, ...]]:
    """In the order of ``FAULT_ACCOUNT``: a row a plant, or one where none has an attitude."""
    whose = (
        account.node, account.do.value, f"{account.at_s:.6g}", optional(account.for_s, ".6g"), f"{account.missed:,}",
        f"{account.waited:,}",
    )  # fmt: skip
    rows = [(*whose, name, *_excursion_cells(one)) for name, one in account.plants.items()]
    return rows or [(*whose, *[""] * (len(FAULT_ACCOUNT) - len(whose)))]


def _excursion_cells(one: Excursion) -> tuple[str, ...]:
    back = optional(one.back_s, ".6g")
    if one.back_s is None:
        back = "never left" if one.left_s is None else "not back"
    return (
        f"{one.band_deg:.3g}", f"{one.largest_deg:.3g}", f"{one.largest_at_s:.6g}", optional(one.left_s, ".6g"), back,
    )  # fmt: skip


def medium_account_cells(account: MediumAccount) -> tuple[str, ...]:
    """In the order of ``MEDIUM_ACCOUNT``."""
    counts = (
        account.frames, account.collided, account.given_up, account.dropped, account.payload_bytes,
        account.overhead_bytes, account.acknowledgement_bytes, account.collided_bytes,
    )  # fmt: skip
    used = f"{100.0 * account.utilisation:.3g} %"
    last = (optional(account.energy_j, ".4g"), optional(account.overflow_s, ".6g"))
    return (*(f"{count:,}" for count in counts), f"{account.air_time_s:.4g}", used, *last)


def topic_cells(counted: Totals) -> tuple[str, str, str]:
    """Messages, payload and CDR bytes; nothing stands for no bytes."""
    payload = f"{counted.payload_bytes:,}" if counted.payload_bytes else ""
    return f"{counted.messages:,}", payload, f"{counted.cdr_bytes:,}"


def topic_type(topic: Topic) -> str:
    """The message type of a topic."""
    return type_words(topic.type)


def totals_of(summary: Summary, kind: str) -> Totals:
    """Totals of the topics of a kind."""
    return {"network": summary.network, "internal": summary.internal, "emulation": summary.emulation}[kind]


BAND = "5 to 95 %"
"""Head of the column with the spread over dispersed starts."""


def paper_cells(figure: PublishedValue | None) -> tuple[str, str]:
    """The paper's figure, and where runs with dispersed starts lie."""
    return ("", "") if figure is None else (printed(figure), spread_cell(figure.spread))


def spread_cell(spread: Spread | None) -> str:
    """Where 90 % of the dispersed runs lie; empty where none are stored, or all are alike."""
    return "" if spread is None else band(spread.p5, spread.p95)


def printed(figure: PublishedValue) -> str:
    """The paper's figure with its digits; a limit is marked."""
    return f"{'≤ ' if figure.is_limit else ''}{digits(figure.printed)}"


def digits(text: str) -> str:
    """Printed digits, with thousands apart where they are many."""
    return f"{int(text):,}" if text.isdigit() else text


def falls_short(measured: float | None, figure: PublishedValue | None) -> bool:
    """Whether a figure was measured and is not the paper's, by the one rule: near, not reproduced, kept or met."""
    if figure is None:
        return False
    verdict = figure.judge(measured).verdict
    return verdict is not Verdict.NOT_TESTABLE and verdict not in GOOD
