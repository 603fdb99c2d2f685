"""Orders and reports as protocol notes."""

from __future__ import annotations

from typing import Any

from etac_ros.timing.orders import Close, Deliver, Fire, Look, MessageId, Open, Order, Report, Settled

_ORDERS: dict[str, type[Open | Look | Fire | Deliver | Close]] = {
    "open": Open,
    "look": Look,
    "fire": Fire,
    "deliver": Deliver,
    "close": Close,
}
_NAMES: dict[type[Order], str] = {kind: name for name, kind in _ORDERS.items()}


def order_note(order: Order) -> dict[str, Any]:
    """An order as a mapping with the key ``do``."""
    values = order._asdict()
    if not values.get("settled", True):
        del values["settled"]  # most orders have none, and their length is traffic
    return {"do": _NAMES[type(order)], **values}


def read_order(content: dict[str, Any]) -> Order:
    """The order in a note."""
    values = dict(content)
    kind = _ORDERS[values.pop("do")]
    if "messages" in values:
        values["messages"] = tuple(MessageId(link, sequence) for link, sequence in values["messages"])
    if "settled" in values:
        values["settled"] = tuple(Settled(*one) for one in values["settled"])
    return kind(**values)


def report_note(report: Report, tick: int, ahead: int | None) -> dict[str, Any]:
    """A report. ``ahead`` is the module's next own act after what it did, looked up unasked."""
    note = {
        "tick": tick,
        "sent": report.sent,
        "proposal": report.proposal,
        "fired": report.fired,
        "concluded": report.concluded,
        "halt": report.halt,
        "ahead": ahead,
    }
    if report.compared is not None:
        note["compared"] = report.compared
    return note


def read_report(content: dict[str, Any]) -> tuple[Report, int, int | None]:
    """The report in a note, the tick that it is about, and what the module saw ahead."""
    concluded, compared = content["concluded"], content.get("compared")
    report = Report(
        tuple(content["sent"]),
        content["proposal"],
        content["fired"],
        None if concluded is None else tuple(concluded),
        content["halt"],
        compared=None if compared is None else tuple(compared),
    )
    return report, content["tick"], content["ahead"]
