"""``etac play``: a bag as ROS topics."""

from __future__ import annotations

import os
from collections.abc import Sequence
from pathlib import Path

from rich.console import Console

from etac_ros.bag.clock import published_ns
from etac_ros.bag.read import read_bag
from etac_ros.cli.joining import join
from etac_ros.engines.ros.domain import check_domain, domain_of_environment
from etac_ros.engines.ros.several_machines import machines_of
from etac_ros.errors import BagError, ScenarioError
from etac_ros.plain_text import one_line


def play_bag(
    bag: Path,
    rate: float,
    domain: int | None,
    topics: Sequence[str],
    everything: bool,
    wait: bool,
    console: Console,
    peers: str | None = None,
    interface: str | None = None,
) -> None:
    """Publish what a bag holds.

    Parameters
    ----------
    bag
        Its directory.
    rate
        Seconds of the bag a second; infinity is as fast as possible.
    domain
        ROS domain; None takes that of the environment, or 0.
    topics
        Names of topics, or what they begin with; none means all but the emulation's.
    everything
        Whether the emulation's topics, which need our own readers, are published too.
    wait
        Whether to begin only when somebody listens.
    console
        For people.
    peers, interface
        As for :func:`~etac_ros.engines.ros.several_machines.machines_of`.

    Raises
    ------
    BagError, ScenarioError
        If the bag cannot be read, holds no such topic, or the rate or the domain makes no sense.
    """
    if not rate > 0.0:
        raise ScenarioError(f"--rate {rate:g}", "is no pace", "seconds of the bag a second, above 0; inf does not wait")
    domain = (domain_of_environment(os.environ) or 0) if domain is None else check_domain(domain, "--domain")
    found = read_bag(bag)
    chosen = [topic for topic in found.topics if everything or topics or topic.kind not in ("emulation", "derived")]
    for wanted in topics:
        if not any(topic.name.startswith(wanted) for topic in chosen):
            known = ", ".join(one_line(topic.name) for topic in found.topics)
            raise BagError(f"{bag}: --topic {wanted}", "no topic begins like that", f"one of: {known}")
    chosen = [topic for topic in chosen if not topics or topic.name.startswith(tuple(topics))]
    join(domain, machines_of(peers, interface))
    from etac_ros.engines.ros.player import PlayedMessage, PlayedTopic, message_class, play_messages

    left_out = [topic for topic in chosen if message_class(topic.type_name) is None]
    played = [topic for topic in chosen if topic not in left_out]
    for topic in left_out:
        console.print(f"{one_line(topic.name)}: left out, {one_line(topic.type_name)} is not installed", soft_wrap=True)
    names = {topic.name for topic in played}
    # By log time, which is the order of execution.
    messages = sorted((raw for raw in found.messages() if raw.topic.name in names), key=lambda raw: raw.log_time_ns)
    pace = "as fast as possible" if rate == float("inf") else f"at {rate:g} x"
    console.print(
        f"{bag}: {len(messages):,} messages of {len(played)} topics {pace}, in ROS domain {domain}", soft_wrap=True
    )
    count = play_messages(
        [PlayedTopic(topic.name, topic.type_name, topic.latched) for topic in played],
        [
            PlayedMessage(raw.topic.name, raw.cdr, published_ns(raw.log_time_ns, raw.publish_time_ns))
            for raw in messages
        ],
        rate,
        domain,
        wait,
        lambda words: console.print(words, soft_wrap=True),
    )
    console.print(f"played {count:,} messages")
