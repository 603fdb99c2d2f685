"""The accounts of links and media, against execution traces that are computed by hand."""

from __future__ import annotations

from io import StringIO
from pathlib import Path
from typing import Any

import pytest
from conftest import FewFigures
from rich.console import Console
from toy import toy

from etac_ros.cli.show import show_summary
from etac_ros.engines.inprocess import InProcess
from etac_ros.errors import ProtocolError, RunHalted
from etac_ros.graph.channel import Channel
from etac_ros.graph.graph import Graph
from etac_ros.graph.recording import Recording
from etac_ros.graph.replay import deliveries
from etac_ros.media.frame import Outcome
from etac_ros.metrics.accounts import LinkAccount, MediumAccount, link_accounts, medium_accounts, overflows
from etac_ros.report import write_report
from etac_ros.runs import run_in_process
from etac_ros.scenario.load import load


def accounts(
    folder: Path, at: list[int], media: Any = None, **says: Any
) -> tuple[Graph, Recording, LinkAccount, dict[str, MediumAccount]]:
    """A run of 20 ticks of 0.1 s in which /b/sensor says something at given ticks, to /a/sensor and /b/brake."""
    scenario = toy(folder, {"b": {"at": at}}, media=media, b_says=says)
    graph = scenario.build()
    recording = InProcess(graph).run()
    return graph, recording, link_accounts(graph, recording)["b_says"], medium_accounts(graph, recording)


def test_a_delay_that_the_last_message_does_not_survive(tmp_path: Path) -> None:
    # Sent at 4, 10 and 18, with a delay of 3 ticks: they arrive at 7 and 13, and at 21, behind the end.
    _, _, account, _ = accounts(tmp_path, [4, 10, 18], delay_ticks=3)
    assert account.model_dump() == {
        "medium": None, "sent": 6, "delivered": 4, "lost": 0, "dropped": 0, "given_up": 0,
        "superseded": 0, "under_way": 2, "duplicated": 0, "overtaken": 0,
        "least_delay_s": 0.3, "median_delay_s": 0.3, "p99_delay_s": 0.3, "most_delay_s": 0.3,
        # From 7 to 13 the age goes from 3 to 9 ticks, from 13 to 20 from 3 to 10: (6 x 6 + 7 x 6.5) / 13 = 6.269...
        "mean_age_s": pytest.approx((6 * 6 + 7 * 6.5) / 13 / 10), "peak_age_s": 1.0,
        "acknowledgement": None,
    }  # fmt: skip


def test_an_outage_loses_for_one_receiver_only(tmp_path: Path) -> None:
    _, _, account, _ = accounts(tmp_path, [4, 10, 18], outages={"/a/sensor": [0.5, 1.5]})
    assert (account.sent, account.delivered, account.lost, account.under_way) == (6, 5, 1, 0)
    # /a/sensor hears at 4 and 18: its age grows to 14. /b/brake hears at 4, 10 and 18, ages up to 6, 8 and 2.
    mean_a, mean_b = (14 * 7 + 2 * 1) / 16, (6 * 3 + 8 * 4 + 2 * 1) / 16
    assert account.mean_age_s == pytest.approx((mean_a + mean_b) / 2 / 10)
    assert account.peak_age_s == 1.4


def test_who_is_overtaken_and_who_comes_twice(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    # Sent at 2, 3, 4: the first comes at 9 and again at 12, the second at 5, the third at 5 and at 6.
    plan = {1: (9, 12), 2: (5,), 3: (5, 6)}
    monkeypatch.setattr(Channel, "arrivals", lambda self, receiver, sequence, *rest, **more: plan[sequence])
    _, _, account, _ = accounts(tmp_path, [2, 3, 4], jitter={"uniform_s": 1.0}, duplication=0.5)
    assert (account.sent, account.delivered, account.duplicated) == (6, 6, 4)
    assert account.overtaken == 2  # the first, at each receiver
    assert (account.least_delay_s, account.median_delay_s, account.most_delay_s) == (0.1, 0.2, 0.7)
    # The newest from 5 on is what was sent at 4: old information that comes later makes nothing younger.
    assert account.mean_age_s == pytest.approx((1 + 16) / 2 / 10)
    assert account.peak_age_s == 1.6


RADIO = {"rate_bit_s": 200.0, "overhead": "none"}
"""A frame of 4 bytes, one float32, takes 0.16 s: what is sent at tick n is there at n + 2."""


def test_a_queue_that_overflows(tmp_path: Path) -> None:
    # Sent at ticks 0 to 4. On the air 0-0.16, 0.16-0.32, 0.32-0.48 s; one may wait. At 0.1 s #2 waits, at 0.2 s it is
    # on the air and #3 waits, at 0.3 s #4 finds the place taken, at 0.4 s #3 is on the air and #5 waits until 0.48 s.
    media = {"air": {**RADIO, "queue": {"length": 1}}}
    _, recording, account, on_air = accounts(tmp_path, [0, 1, 2, 3, 4], media, medium="air")
    assert [(fate.sequence, fate.outcome) for fate in recording.air] == [
        (1, Outcome.SENT), (2, Outcome.SENT), (4, Outcome.DROPPED), (3, Outcome.SENT), (5, Outcome.SENT),
    ]  # fmt: skip
    assert (account.medium, account.sent, account.delivered, account.dropped) == ("air", 10, 8, 2)
    # They land at 0.16, 0.32, 0.48 and 0.64 s, ticks 2, 4, 5 and 7: delays of 2, 3, 3 and 3 ticks.
    assert (account.least_delay_s, account.median_delay_s, account.most_delay_s) == (0.2, 0.3, 0.3)
    assert on_air["air"].model_dump() == {
        "frames": 4, "collided": 0, "given_up": 0, "dropped": 1, "payload_bytes": 16, "overhead_bytes": 0,
        "acknowledgement_bytes": 0, "collided_bytes": 0, "air_time_s": 0.64, "utilisation": 0.32, "energy_j": None,
        "overflow_s": 0.3, "overflow_of": "/b/sensor",
    }  # fmt: skip
    assert overflows(on_air, 10) == ("medium air: the queue of /b/sensor passed its length at 0.3 s (tick 3)",)
    assert overflows({}, 10) == ()


def test_where_only_the_latest_waits_no_queue_passes_its_length(tmp_path: Path) -> None:
    media = {"air": {**RADIO, "queue": {"full": "replace"}}}
    _, _, _, on_air = accounts(tmp_path, [0, 1, 2, 3, 4], media, medium="air")
    assert on_air["air"].dropped > 0
    assert on_air["air"].overflow_of is None
    assert overflows(on_air, 10) == ()


def test_bytes_by_layer_and_what_is_on_the_air_at_the_end(tmp_path: Path) -> None:
    # 4 bytes and 12 of Proximity-1 take 0.64 s. Sent at 0 and at 19: the second is on the air when the run ends at 20.
    media = {"air": {"rate_bit_s": 200.0, "overhead": "ccsds-proximity-1", "propagation_s": 0.1}}
    _, _, account, on_air = accounts(tmp_path, [0, 19], media, medium="air")
    assert (account.sent, account.delivered, account.under_way, account.most_delay_s) == (4, 2, 2, 0.8)
    medium = on_air["air"]
    assert (medium.frames, medium.payload_bytes, medium.overhead_bytes) == (2, 8, 24)
    assert medium.air_time_s == pytest.approx(0.64 + 0.1)
    assert medium.utilisation == pytest.approx(0.37)


def test_collisions_are_bytes_on_the_air_for_nothing(tmp_path: Path) -> None:
    # One slot to draw from: whoever waits begins at once, so /a and /b collide whenever both have something to say.
    access = {"class": "etac_ros.media.csma:Csma", "slot_s": 0.01, "window": 1, "window_most": 1, "tries": 2}
    says = {"medium": "air"}
    sensors = {"a": {"at": [0]}, "b": {"at": [0, 10]}}
    media = {"air": {**RADIO, "transmit_w": 2.0, "receive_w": 0.5, "access": access}}
    scenario = toy(tmp_path, sensors, media=media, a_says=says, b_says=says)
    graph = scenario.build()
    recording = InProcess(graph).run()
    account = link_accounts(graph, recording)["b_says"]
    assert (account.sent, account.delivered, account.given_up) == (4, 2, 2)
    medium = medium_accounts(graph, recording)["air"]
    assert (medium.frames, medium.collided, medium.given_up, medium.payload_bytes) == (5, 4, 2, 4)
    assert medium.collided_bytes == 16
    # Each of five tries: 0.16 s of a sender with 2 W and of two receivers with 0.5 W.
    assert medium.energy_j == pytest.approx(5 * 0.16 * (2.0 + 2 * 0.5))
    assert medium.air_time_s == pytest.approx(3 * 0.16)  # what collides is on the air at the same time


def test_a_message_that_nobody_accounts_for_is_an_error(tmp_path: Path) -> None:
    graph, recording, _, _ = accounts(tmp_path, [4, 10], {"air": RADIO}, medium="air")
    twice = Recording(recording.messages, recording.truth, recording.air)
    twice.messages["b_says"] = [recording.messages["b_says"][0], *recording.messages["b_says"]]
    with pytest.raises(ProtocolError, match=r"link b_says: 6 messages were sent .* accounted for"):
        link_accounts(graph, twice)


def test_terminal_and_report_show_the_accounts(tmp_path: Path, few_figures: FewFigures) -> None:
    few_figures("torque")
    media = "media={air: {rate_bit_s: 2000.0, overhead: ieee-802.15.4}}"
    overrides = ["duration_s=20", media, "links.filtered_error={medium: air, loss: 0.2}"]
    scenario = load("wu2018", overrides=overrides)
    run = run_in_process(scenario, tmp_path / "bag")
    console = Console(record=True, width=200, file=StringIO())
    show_summary(scenario, run.summary, console)
    page = write_report(tmp_path / "bag").read_text(encoding="utf-8")
    account = run.summary.links["filtered_error"]
    assert account.sent == account.delivered + account.lost > account.lost > 0
    for text in (console.export_text(), page):
        assert "overtaken" in text
        assert "collided bytes" in text
    ideal = run_in_process(load("wu2018", overrides=["duration_s=20"]), tmp_path / "ideal")
    assert ideal.bag is not None
    assert "overtaken" not in write_report(ideal.bag).read_text(encoding="utf-8")


def test_an_ideal_link_has_no_account_and_its_run_no_medium() -> None:
    summary = run_in_process(load("wu2018", overrides=["duration_s=20"])).summary
    assert summary.links == {}
    assert summary.media == {}


def test_the_pair_survives_fades_only_because_of_acknowledgements() -> None:
    """What the comments of the scenarios say of their bad radio."""
    with pytest.raises(RunHalted, match=r"halted at simulated time 2\.6 s: .*angle between the modules"):
        run_in_process(load("qi2022", "bad-radio", ["links.relative.acknowledged=null"]))
    for name in ("wu2018", "qi2022", "shi2022"):
        summary = run_in_process(load(name, "bad-radio")).summary
        assert sum(account.given_up for account in summary.links.values()) > 0
        assert all(plant.max_attitude_error_deg < 1.0 for plant in summary.performance.values())


def test_the_account_of_a_run_that_a_watch_ends_goes_no_further_than_it(tmp_path: Path) -> None:
    # Nothing gets through from 1 s on, and the pair touches: what is still to be sent again then is not given up.
    keys = ["links.relative={outages: {sm/controller: [1.0, 90.0]}, acknowledged: {timeout_s: 2.0}}"]
    graph = load("qi2022", None, keys).build()
    engine = InProcess(graph)
    recording = engine.run()
    assert engine.master.halted
    last = recording.samples("/sim/plant")[1].shape[0] - 1
    account = link_accounts(graph, recording)["relative"]
    arrived = deliveries(graph, recording, graph.links["relative"], "/sm/controller")
    assert account.delivered == sum(one.tick <= last for one in arrived)
    assert account.under_way == 1
    assert account.given_up == 0
    assert account.peak_age_s is not None
    assert account.peak_age_s <= (last + 1) / graph.ticks_per_second
