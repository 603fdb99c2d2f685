"""Publishers count and know when they are heard; subscriptions number what comes and notice what is missing."""

from __future__ import annotations

from types import SimpleNamespace
from typing import Any

import pytest
from fake_ros import Bus, WaitSet
from rclpy.serialization import deserialize_message, serialize_message
from std_msgs.msg import Float64MultiArray, String

from etac_ros.engines.ros import endpoints
from etac_ros.engines.ros.endpoints import DATA, Publisher, Spinner, Subscription, name_of
from etac_ros.errors import RunError

TOPIC = "/talk"
Taken = list[tuple[Any, int]]


def listener(bus: Bus, name: str, namespace: str = "/", **options: Any) -> tuple[Subscription, Taken]:
    taken: Taken = []
    end = Subscription(
        bus.node(name, namespace),  # type: ignore[arg-type]
        String,
        TOPIC,
        lambda content, number: taken.append((text(content), number)),
        **options,
    )
    return end, taken


def text(content: Any) -> Any:
    """What a serialized string says."""
    return deserialize_message(content, String).data if isinstance(content, bytes) else content


def speaker(bus: Bus, name: str = "speaker", *arguments: Any, **options: Any) -> Publisher:
    return Publisher(bus.node(name), String, TOPIC, *arguments, **options)  # type: ignore[arg-type]


def say(publisher: Publisher, *texts: str) -> None:
    for text in texts:
        publisher.publish(String(data=text))


def test_a_publisher_counts_messages_and_bytes() -> None:
    bus = Bus()
    publisher = speaker(bus)
    assert [publisher.publish(String(data=text)) for text in ("a", "bcd")] == [1, 2]
    assert publisher.count.messages == 2
    assert publisher.count.cdr_bytes == sum(len(serialize_message(String(data=text))) for text in ("a", "bcd"))
    assert bus.said(TOPIC) == [serialize_message(String(data=text)) for text in ("a", "bcd")]


def test_it_is_matched_when_all_its_listeners_are_there_by_name() -> None:
    bus = Bus()
    publisher = speaker(bus, "speaker", ["/ear", "/far/ear"])
    assert not publisher.matched
    assert publisher.missing() == f"{TOPIC} (no subscription of /ear, /far/ear)"
    listener(bus, "ear")
    listener(bus, "stranger")
    assert not publisher.matched  # two are there, and one of them is not expected
    assert publisher.missing() == f"{TOPIC} (no subscription of /far/ear)"
    listener(bus, "ear", "/far")
    assert publisher.matched
    assert publisher.missing() == TOPIC
    bus.readers.clear()
    assert publisher.matched  # once is enough


def test_foreign_listeners_have_no_names() -> None:
    bus = Bus()
    publisher = speaker(bus, "speaker", ["/ear"], 2)
    listener(bus, "ear")
    listener(bus, "somebody")
    assert not publisher.matched
    assert publisher.missing() == f"{TOPIC} (no subscription of a foreign node)"
    listener(bus, "another")
    assert publisher.matched
    alone = speaker(bus, "alone", [], 0)
    assert alone.matched
    assert alone.missing() == TOPIC


def test_its_own_listener_twice_is_no_foreign_one() -> None:
    bus = Bus()
    publisher = speaker(bus, "speaker", ["/ear"], 1)
    listener(bus, "ear")
    listener(bus, "ear")
    assert not publisher.matched


def test_it_can_wait_until_all_is_acknowledged() -> None:
    bus = Bus()
    publisher = speaker(bus)
    assert publisher.drain(0.1) is True
    bus.acknowledges = False
    assert publisher.drain(0.1) is False


def test_messages_come_in_order_with_their_numbers() -> None:
    bus = Bus()
    publisher = speaker(bus)
    end, taken = listener(bus, "ear")
    more: Taken = []
    end.also(lambda message, number: more.append((text(message), number)))
    say(publisher, "a", "b")
    end.take()
    say(publisher, "c")
    end.take()
    assert taken == more == [("a", 1), ("b", 2), ("c", 3)]
    assert (end.count.messages, end.strangers) == (3, 0)


def test_messages_are_weighed_as_the_bytes_that_they_were() -> None:
    bus = Bus()
    end, taken = listener(bus, "ear")
    sent = [serialize_message(String(data=said)) for said in ("a", "bcd")]
    assert [speaker(bus).publish(data) for data in sent] == [1, 1]
    end.handle.waiting[1] = (sent[1], 2, 0)
    end.take()
    assert taken == [("a", 1), ("bcd", 2)]
    assert end.count.cdr_bytes == len(sent[0]) + len(sent[1])


def test_one_message_at_a_time_is_taken_where_others_wait(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(endpoints, "_rclpy", SimpleNamespace(WaitSet=WaitSet))
    monkeypatch.setattr(endpoints.time, "sleep", lambda seconds: None)
    for gather_s, rounds in ((0.0, [["a"], ["a", "b"], ["a", "b"]]), (0.005, [["a", "b"], ["a", "b"]])):
        bus = Bus()
        end, taken = listener(bus, "ear")
        spinner = Spinner(SimpleNamespace(handle=None), gather_s)
        spinner.add(end)
        say(speaker(bus), "a", "b")
        for number, wanted in enumerate(rounds):
            assert spinner.once(0.0) is (number < len(rounds) - 1)
            assert [said for said, _ in taken] == wanted


@pytest.mark.parametrize(
    ("numbers", "found", "after"),
    [([2], 2, 1), ([1, 3], 3, 2), ([1, 1], 1, 2), ([1, 2, 4], 4, 3), ([1, 2, 3, 2], 2, 4)],
)
def test_a_gap_and_a_message_twice_are_noticed(numbers: list[int], found: int, after: int) -> None:
    bus = Bus()
    end, taken = listener(bus, "ear")
    data = serialize_message(String(data="x"))
    end.handle.waiting.extend((data, number, 0) for number in numbers)
    with pytest.raises(RunError, match=f"topic {TOPIC}: message {found} of its publisher came as number {after}"):
        end.take()
    assert [number for _, number in taken] == numbers[:-1]


@pytest.mark.parametrize("kind", ["latched", "shared"])
def test_where_several_publish_numbers_tell_nothing(kind: str) -> None:
    bus = Bus()
    end, taken = listener(bus, "ear", **{kind: True})
    for name in ("one", "other"):
        say(speaker(bus, name), "a", "b")
    end.take()
    assert [number for _, number in taken] == [1, 2, 1, 2]
    assert end.count.messages == 4


def test_a_latched_message_is_heard_by_who_comes_late() -> None:
    bus = Bus()
    say(speaker(bus, "lasting", latched=True), "old", "news")
    say(speaker(bus, "passing"), "gone")
    end, taken = listener(bus, "late", latched=True)
    end.take()
    assert taken == [("news", 2)]
    end, taken = listener(bus, "usual")
    end.take()
    assert taken == []


def test_a_foreign_publisher_counts_from_the_beginning_of_the_run() -> None:
    bus = Bus()
    publisher = speaker(bus)
    end, taken = listener(bus, "ear", foreign=True)
    say(publisher, "before", "before")
    end.take()
    assert (taken, end.count.messages, end.strangers) == ([], 0, 2)
    end.open()
    say(publisher, "a", "b", "c")
    end.take()
    assert taken == [("a", 1), ("b", 2), ("c", 3)]
    assert (end.count.messages, end.strangers) == (3, 2)
    end.handle.waiting.append((serialize_message(String(data="x")), 7, 0))
    with pytest.raises(RunError, match="message 5 of its publisher came as number 4"):
        end.take()


def test_what_is_not_of_this_run_is_counted_and_else_ignored() -> None:
    bus = Bus()
    end, taken = listener(bus, "ear", shared=True, read=lambda data: text(data).removeprefix("ours: ") or None)
    say(speaker(bus), "ours: a", "", "ours: b")
    end.take()
    assert taken == [("a", 1), ("b", 3)]
    assert (end.count.messages, end.strangers) == (2, 1)


def test_a_strange_message_leaves_no_gap_behind_it() -> None:
    """A stranger publishes on its own, so it takes none of the numbers of ours."""
    bus = Bus()
    end, taken = listener(bus, "ear", read=lambda data: text(data) or None)
    say(speaker(bus, "ours"), "a")
    say(speaker(bus, "stranger"), "", "")
    end.take()
    say(speaker(bus, "next"), "b")
    with pytest.raises(RunError):  # somebody else's first message is not our second
        end.take()
    assert taken == [("a", 1)]
    assert end.strangers == 2


def test_whether_somebody_publishes() -> None:
    bus = Bus()
    end, _ = listener(bus, "ear")
    assert not end.matched
    assert end.deserted()
    speaker(bus)
    assert end.matched
    assert not end.deserted()
    bus.writers.clear()
    assert end.matched
    assert end.deserted()


def test_names_of_ends() -> None:
    assert name_of(SimpleNamespace(node_namespace="/", node_name="a")) == "/a"
    assert name_of(SimpleNamespace(node_namespace="/b/c", node_name="a")) == "/b/c/a"


def test_a_spinner_hands_out_what_is_there_in_the_order_of_its_subscriptions(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(endpoints, "_rclpy", SimpleNamespace(WaitSet=WaitSet))
    bus = Bus()
    order: list[str] = []
    context: Any = SimpleNamespace(handle=None)
    spinner = Spinner(context)
    ends = []
    for name in ("first", "second"):
        end = Subscription(bus.node(name), String, f"/{name}", lambda _, __, name=name: order.append(name))  # type: ignore
        spinner.add(end)
        ends.append(end)
    assert spinner.once(0.0) is False
    for name in ("second", "first"):
        Publisher(bus.node("x"), String, f"/{name}").publish(String(data=""))  # type: ignore[arg-type]
    assert spinner.once(0.0) is True
    assert order == ["first", "second"]
    assert spinner.once(0.0) is False
    late = Subscription(bus.node("late"), String, "/late", lambda _, __: order.append("late"))  # type: ignore[arg-type]
    spinner.add(late)
    Publisher(bus.node("x"), String, "/late").publish(String(data=""))  # type: ignore[arg-type]
    assert spinner.once(0.0) is True
    assert order[2:] == ["late"]


def test_what_a_process_sends_to_itself_is_taken_without_waiting_and_others_have_their_turn(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    waits: list[list[int]] = []

    class Watched(WaitSet):
        def wait(self, nanoseconds: int) -> None:
            waits.append([handle.pointer for handle in self._handles])

    monkeypatch.setattr(endpoints, "_rclpy", SimpleNamespace(WaitSet=Watched))
    monkeypatch.setattr(endpoints, "_OWN_IN_TURN", 3)
    bus = Bus()
    heard: list[str] = []
    spinner = Spinner(SimpleNamespace(handle=None))
    ends = {}
    for name in ("own", "other"):
        ends[name] = Subscription(bus.node(name), String, f"/{name}", lambda _, __, name=name: heard.append(name))  # type: ignore
        spinner.add(ends[name])
    own = Publisher(bus.node("own"), String, "/own")  # type: ignore[arg-type]
    own.on_sent = spinner.sent
    say(own, *"abcde")
    say(Publisher(bus.node("far"), String, "/other"), "x")  # type: ignore[arg-type]
    for _ in range(3):
        assert spinner.once(1.0)
    assert (heard, waits) == (["own"] * 3, [])
    assert spinner.once(1.0)  # a glance at what comes from elsewhere
    assert heard == ["own"] * 3 + ["other"]
    assert waits == [[ends["other"].handle.pointer]]
    assert spinner.once(1.0)
    assert spinner.once(1.0)
    assert heard[4:] == ["own"] * 2
    assert spinner.once(0.0) is False
    assert len(waits[-1]) == 2


def test_nodes_of_a_process_share_what_is_told_to_all(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(endpoints, "_rclpy", SimpleNamespace(WaitSet=WaitSet))
    bus = Bus()
    heard: list[str] = []
    spinner = Spinner(SimpleNamespace(handle=None))
    ends = []
    for name in ("one", "other"):

        def callback(message: Any, number: int, name: str = name) -> None:
            heard.append(name)

        def make(callback: Any = callback) -> Subscription:
            return Subscription(bus.node("any"), String, TOPIC, callback)  # type: ignore[arg-type]

        ends.append(spinner.for_all(TOPIC, make, callback))
    assert ends[0] is ends[1]
    assert len(bus.readers) == 1
    say(speaker(bus), "x")
    assert spinner.once(0.0)
    assert heard == ["one", "other"]


def test_it_waits_as_long_as_it_is_told(monkeypatch: pytest.MonkeyPatch) -> None:
    waited: list[tuple[str, float]] = []

    class Patient(WaitSet):
        def wait(self, nanoseconds: int) -> None:
            waited.append(("wait", nanoseconds))

    monkeypatch.setattr(endpoints, "_rclpy", SimpleNamespace(WaitSet=Patient))
    monkeypatch.setattr(endpoints, "time", SimpleNamespace(sleep=lambda seconds: waited.append(("gather", seconds))))
    Spinner(SimpleNamespace(handle=None)).once(0.25)
    assert waited == [("wait", 250_000_000)]
    Spinner(SimpleNamespace(handle=None), 0.005).once(0.0)
    assert waited[1:] == [("gather", 0.005), ("wait", 0)]


def test_another_type_on_the_topic_is_another_matter() -> None:
    bus = Bus()
    Publisher(bus.node("x"), Float64MultiArray, "/else").publish(Float64MultiArray())  # type: ignore[arg-type]
    end, taken = listener(bus, "ear")
    end.take()
    assert taken == []


def test_two_publishers_of_a_topic_are_both_named() -> None:
    bus = Bus()
    end, _ = listener(bus, "ear")
    speaker(bus).publish(String(data="a"))
    bus.node("intruder", "/far").create_publisher(String, TOPIC, DATA).publish(String(data="b"))
    with pytest.raises(RunError, match=r"/far/intruder and /\w+ publish on it: one of them does not belong here"):
        end.take()
