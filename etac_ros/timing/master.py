"""The time master: one loop that decides who acts when.

It is written as a generator that yields batches of orders and is sent the reports on them, so that it contains no
I/O at all: the in-process engine answers with calls, the ros engine with messages, and both run this very object.
"""

from __future__ import annotations

from collections import defaultdict
from collections.abc import Generator, Mapping, Sequence, Set
from types import MappingProxyType

from etac_ros.errors import ProtocolError
from etac_ros.graph.acknowledged import End, Ended
from etac_ros.graph.channel import Way
from etac_ros.graph.graph import AfterLast, Graph, Link
from etac_ros.media.frame import Fate
from etac_ros.timing.digest import Places, acted, knows_ticks, received, settled
from etac_ros.timing.orders import (
    Close,
    Deliver,
    Fire,
    Forward,
    Look,
    MessageId,
    Open,
    Order,
    Report,
    Settled,
    Transit,
)
from etac_ros.timing.relays import MOST_STEPS_A_TICK, Relay, Relays
from etac_ros.timing.under_way import UnderWay
from etac_ros.timing.windows import WindowPolicy

Batches = Generator[Sequence[Order], Sequence[Report], None]

Bags = dict[str, list[MessageId | Settled]]
"""What comes to each module in one step."""


def _ways(link: Link) -> tuple[tuple[str, Way | None], ...]:
    """Receivers with what may become of a message on its way; None where nothing can: that costs nothing."""
    return tuple((name, None if link.channel.ideal else Way(link.channel, name)) for name in link.receivers)


class TimeMaster:
    """Advances a graph of modules from tick 0 to its end.

    Parameters
    ----------
    graph
        Modules and links.
    windows
        How far plants compute ahead.
    self_ending
        Plants whose windows end by themselves where their reader acts, and how long these are otherwise.
    with_history
        Keep ``done``: in one process there is nobody who could have done something else.
    forwarding
        Say with one order what follows from messages to modules that only answer (:mod:`etac_ros.timing.relays`): for
        whoever obeys all orders in one process, and without history. An attribute, too.

    Attributes
    ----------
    tick
        The tick that is being worked on, or was last.
    message_log
        The place in time of every message sent since the message log was last taken.
    fired
        Number of triggering instants so far of each module that triggers.
    halted
        Why a watch ended the run; empty otherwise.
    done
        A running digest of what each module was told to do and when (:mod:`etac_ros.timing.digest`).
    """

    def __init__(
        self,
        graph: Graph,
        windows: WindowPolicy,
        self_ending: Mapping[str, int] = MappingProxyType({}),
        with_history: bool = True,
        forwarding: bool = False,
    ) -> None:
        self.tick = 0
        self.halted = ""
        self.fired = {name: 0 for name in graph.reporters if graph.modules[name].triggers}
        self._last_fired = dict.fromkeys(self.fired, -1)
        self.sent: dict[str, int] = dict.fromkeys(graph.links, 0)
        self.message_log: list[Transit] = []
        self._air = UnderWay(graph) if graph.media or graph.acknowledged else None
        self._graph = graph
        self._end = graph.end_tick
        self._told = graph.told
        self._policy = windows
        self._longest = windows.longest
        self._self_ending = self_ending
        self._with_history = with_history
        self.forwarding = forwarding
        self._relays = Relays(graph)
        self._triggers = frozenset(
            link.name for name in self.fired for link in graph.sends[name] if link.port == graph.modules[name].triggers
        )
        self.done: dict[str, int] = dict.fromkeys(graph.modules, 0)
        self._numbers = Places(graph.links)
        self._knows_ticks = {name: knows_ticks(module) for name, module in graph.modules.items()}
        self._place = {name: index for index, name in enumerate(graph.modules)}
        self._link_place = {name: index for index, name in enumerate(graph.links)}
        self._ways = {name: _ways(link) for name, link in graph.links.items()}
        self._at_once = {name: tuple(link.receivers) for name, link in graph.links.items() if link.is_ideal}
        self._reads = {name: graph.reads.get(name, "") for name in graph.modules}
        self._concludes = frozenset(name for name, module in graph.modules.items() if module.concludes)
        self._on_air = frozenset(name for name, link in graph.links.items() if link.medium or link.acknowledged)
        self._plants = frozenset(graph.plants)
        self._lookers = frozenset(graph.lookers)
        self._looking = {plant: self._lookers.intersection(readers) for plant, readers in graph.readers.items()}
        # A window ends before a module goes on after a fault: what it is then and knows, no window shows before.
        self._last_before = sorted({fault.until_tick - 1 for fault in graph.faults})
        self._concluding = frozenset(
            name
            for name, module in graph.modules.items()
            if module.concludes and not any(name in link.receivers for link in graph.sends[name])
        )
        self._proposals: dict[str, int] = {}
        self._calendar: dict[int, Bags] = {}
        self._granted: dict[str, Report] = {}
        self._starts: dict[str, int] = {}
        self._opened: dict[str, int] = {}
        self._lengths: dict[str, int] = {}

    def take_message_log(self) -> list[Transit]:
        """The transits of the ticks closed since the last call."""
        taken, self.message_log = self.message_log, []
        return taken

    def take_air_log(self) -> list[Fate]:
        """What has become of frames on the air since the last call."""
        return [] if self._air is None else self._air.take_log()

    def skip_to_end(self, fired: Mapping[str, int], sent: Mapping[str, int]) -> None:
        """Take a run for done that needed no orders: how often who fired, and what was sent on each link."""
        self.tick = self._end
        self.fired.update(fired)
        self.sent.update(sent)

    def shorten_windows(self) -> None:
        """Open shorter windows from now on: these took too long. Only speed depends on it."""
        self._longest = max(1, min(self._longest, max(self._lengths.values(), default=1)) // 2)
        self._self_ending = {plant: min(most, self._longest) for plant, most in self._self_ending.items()}

    def is_halted(self) -> bool:
        """Whether a watch has ended the run."""
        return bool(self.halted)

    def run(self) -> Batches:
        """The loop. Yields batches of orders; wants a report on each order, in the same order.

        Raises
        ------
        ProtocolError
            If the messages of one tick go round without end.
        """
        end = self._graph.end_tick
        plants = self._graph.plants
        yield from self._look(-1, plants, self._lookers)
        while not self.is_halted() and (tick := self._earliest()) < end:
            self.tick = tick
            if self._air is not None:
                self._land(self._air, tick)
            touched = yield from self._act(tick)
            if not self.is_halted():
                # Whose input has changed, and whose window is used up.
                renewed = [plant for plant in plants if plant in touched or self._proposals[plant] == tick]
                touched = self._lookers.intersection(touched)
                yield from self._look(tick, renewed, touched)
        if not self.is_halted():
            self.tick = end
        if self._air is not None:
            self._land(self._air, self.tick)
        yield from self._close(self.tick)

    def _earliest(self) -> int:
        earliest = min(self._proposals.values())
        if self._calendar:
            earliest = min(earliest, min(self._calendar))
        if self._air is not None:
            event = self._air.next_tick()
            if event is not None:
                earliest = min(earliest, event)
        return earliest

    def _land(self, air: UnderWay, tick: int) -> None:
        """Move what is on the air on to this tick; what comes of it is as if it had been in the calendar."""
        for one in air.advance(tick):
            if isinstance(one, Ended):
                self._settle(one, tick, None)
            elif one.tick < self._graph.end_tick:
                self._later(one.tick)[one.receiver].append(one.message)

    def _settle(self, ended: Ended, tick: int, arriving: Bags | None) -> None:
        """The sender's wait is over: tell it in the next step, if that makes a difference to it."""
        link = self._graph.links[ended.link]
        acknowledged = ended.end is End.ACKNOWLEDGED
        assert link.acknowledged is not None
        if not acknowledged and link.acknowledged.after_last is AfterLast.HALT and not self.halted:
            tries = 1 + link.acknowledged.retries
            what = f"message {ended.sequence} on {ended.link}"
            self.halted = f"{link.sender}: {what} is not acknowledged after {tries} tries"
        if link.acknowledged.told and tick < self._graph.end_tick:
            bags = self._later(tick) if arriving is None else arriving
            bags.setdefault(link.sender, []).append(Settled(ended.link, ended.sequence, acknowledged))

    def _later(self, tick: int) -> Bags:
        return self._calendar.setdefault(tick, defaultdict(list))

    def _act(self, tick: int) -> Generator[Sequence[Order], Sequence[Report], Set[str]]:
        """Fire, then deliver step by step until nothing is in flight. Returns who acted or received."""
        due = [name for name, when in self._proposals.items() if when == tick and name not in self._plants]
        if len(due) > 1:
            due.sort(key=self._place.__getitem__)
        asked = [name for name in due if name not in self._granted]
        if asked:
            alone = len(due) == 1 and tick not in self._calendar and due[0] in self._concluding
            reports = yield [Fire(name, tick, self._epoch(name), alone) for name in asked]
            self._granted.update(zip(asked, reports, strict=True))
        if self.forwarding and due and tick not in self._calendar:
            relay = self._relay(due)
            if relay is not None:
                return (yield from self._forward(tick, due, relay))
        touched = set(due)
        arriving: Bags = self._calendar.pop(tick, {})
        concluded: dict[str, Report] = {}
        for name in due:
            report = self._granted.pop(name)
            del self._proposals[name]
            if self._with_history:
                self.done[name] = acted(self.done[name], tick, self._epoch(name))
            self._note(name, report, tick, 0, arriving)
            if report.concluded is not None:
                if self._with_history:
                    self._delivered(name, tick, ())
                concluded[name] = Report(report.concluded)
            elif name in self._concludes:
                arriving.setdefault(name, [])
        step = 1
        while arriving or concluded:
            if step > MOST_STEPS_A_TICK:
                raise self._endless(tick, arriving)
            if len(arriving) == 1 and not concluded:
                ((name, bag),) = arriving.items()
                (report,) = yield (self._deliver(name, tick, step, bag),)
                arriving = {}
                touched.add(name)
                self._note(name, report, tick, step, arriving)
                step += 1
                continue
            receivers = sorted(arriving, key=self._place.__getitem__)
            answers = concluded
            if receivers:
                orders = [self._deliver(name, tick, step, arriving[name]) for name in receivers]
                reports = yield orders
                answers = {**concluded, **dict(zip(receivers, reports, strict=True))}
            arriving, concluded = {}, {}
            for name in sorted(answers, key=self._place.__getitem__):
                touched.add(name)
                self._note(name, answers[name], tick, step, arriving)
            step += 1
        return touched

    def _relay(self, due: Sequence[str]) -> Relay | None:
        """What follows from the acts of those who are due, where it is known beforehand."""
        if not self._concludes.isdisjoint(due):
            return None
        sent = self._granted[due[0]].sent
        for name in due[1:]:
            sent += self._granted[name].sent
        return self._relays.of(sent)

    def _forward(
        self, tick: int, due: Sequence[str], relay: Relay
    ) -> Generator[Sequence[Order], Sequence[Report], Set[str]]:
        """As :meth:`_act`, where all that follows is known beforehand."""
        for name in due:
            report = self._granted.pop(name)
            del self._proposals[name]
            if report.halt:
                self._halt(name, report)
            if not self._triggers.isdisjoint(report.sent):
                self._last_fired[name] = tick
                self.fired[name] += 1
        (report,) = yield (Forward(due[0], tick, relay),)
        messages = relay.messages
        if report.halt and not self.halted:
            self.halted = report.halt
        if report.missing:
            messages = tuple(one for place, one in enumerate(messages) if place not in report.missing)
        sent, log = self.sent, self.message_log
        for link, step in messages:
            sequence = sent[link] = sent[link] + 1
            log.append(Transit(link, sequence, tick, step))
        return relay.touched.union(due)

    def _deliver(self, module: str, tick: int, step: int, bag: Sequence[MessageId | Settled]) -> Deliver:
        """The order to take what comes in one step."""
        ends: tuple[Settled, ...] = ()
        if module in self._told:
            ends = tuple(sorted((one for one in bag if isinstance(one, Settled)), key=self._in_order))
            if ends:
                if self._with_history:
                    numbers = self._numbers.of_settled(ends)
                    self.done[module] = settled(self.done[module], tick, self._epoch(module), numbers)
                bag = [one for one in bag if isinstance(one, MessageId)]
        in_order = bag if len(bag) == 1 else sorted(bag, key=self._in_order)
        messages: tuple[MessageId, ...] = tuple(in_order)  # type: ignore[arg-type]  # what was settled is out by now
        if self._with_history and (messages or not ends):
            self._delivered(module, tick, messages)
        return Deliver(module, tick, step, messages, self._opened.get(self._reads[module], 0), ends)

    def _delivered(self, module: str, tick: int, messages: tuple[MessageId, ...]) -> None:
        told = tick if self._knows_ticks[module] else None
        self.done[module] = received(self.done[module], told, self._epoch(module), self._numbers.of(messages))

    def _note(self, sender: str, report: Report, tick: int, step: int, arriving: Bags) -> None:
        """Number what was sent and hand it to the channel: now, later or never."""
        if report.halt:
            self._halt(sender, report)
        for name in report.sent:
            if name in self._triggers and self._last_fired[sender] != tick:
                self._last_fired[sender] = tick
                self.fired[sender] += 1
            sequence = self.sent[name] = self.sent[name] + 1
            message = MessageId(name, sequence)
            self.message_log.append(Transit(name, sequence, tick, step))
            at_once = self._at_once.get(name)
            if at_once is not None:
                for receiver in at_once:
                    if receiver in arriving:
                        arriving[receiver].append(message)
                    else:
                        arriving[receiver] = [message]
                continue
            if self._air is not None and name in self._on_air:
                self._hand_to(self._air, message, tick, arriving)
                continue
            for receiver, way in self._ways[name]:
                for when in (tick,) if way is None else way.arrivals(sequence, tick):
                    if when == tick:
                        arriving.setdefault(receiver, []).append(message)
                    elif when < self._graph.end_tick:
                        self._later(when)[receiver].append(message)

    def _hand_to(self, air: UnderWay, message: MessageId, tick: int, arriving: Bags) -> None:
        for one in air.offer(message, tick):
            if isinstance(one, Ended):
                self._settle(one, tick, arriving)
            elif one.tick == tick:
                arriving.setdefault(one.receiver, []).append(one.message)

    def _halt(self, module: str, report: Report) -> None:
        if report.halt and not self.halted:
            self.halted = f"{module}: {report.halt}"

    def _close(self, tick: int) -> Batches:
        plants = self._graph.plants
        reports = yield [Close(plant, tick) for plant in plants]
        for plant, report in zip(plants, reports, strict=True):
            self._halt(plant, report)

    def _look(self, tick: int, renewed: Sequence[str], touched: Set[str]) -> Batches:
        """Commit the plants whose input changed or whose window is used up; let whom it concerns look again."""
        if not renewed and not touched:
            return
        if len(renewed) == 1 and touched <= self._looking[renewed[0]] and len(self._looking[renewed[0]]) == 1:
            yield from self._look_alone(tick, renewed[0])
            return
        lookers = set(touched)
        for plant in renewed:
            lookers.update(self._looking[plant])
        for name in lookers:
            self._proposals.pop(name, None)
        ordered = list(lookers)
        if len(lookers) > 1:
            # Who still has its window says first when it acts, so that the others may get leave to act until then.
            waiting = {name for name in lookers if self._reads[name] in renewed}
            settled = sorted(lookers - waiting, key=self._place.__getitem__)
            if settled and waiting:
                reports = yield [Look(name, tick, -1) for name in settled]
                self._propose(settled, reports)
            ordered = sorted(waiting or lookers, key=self._place.__getitem__)
        for plant in renewed:
            self._renew(plant, tick)
        grant = self._grant(ordered[0]) if len(ordered) == 1 else -1
        orders: list[Order] = [Open(plant, tick, self._proposals[plant] - tick, grant) for plant in renewed]
        orders += [Look(name, tick, grant) for name in ordered]
        reports = yield orders
        for plant, report in zip(renewed, reports, strict=False):
            if report.halt:
                self._halt(plant, report)
            if report.last is not None:
                self._proposals[plant] = report.last
        self._propose(ordered, reports[len(renewed) :])

    def _look_alone(self, tick: int, plant: str) -> Batches:
        """As :meth:`_look`, where it concerns one plant and its only reader, as mostly."""
        (reader,) = self._looking[plant]
        self._proposals.pop(reader, None)
        self._renew(plant, tick)
        grant = self._grant(reader)
        opened, looked = yield (Open(plant, tick, self._proposals[plant] - tick, grant), Look(reader, tick, grant))
        if opened.halt:
            self._halt(plant, opened)
        if opened.last is not None:
            self._proposals[plant] = opened.last
        if looked.proposal is not None:
            self._proposals[reader] = looked.proposal
            if looked.fired:
                self._granted[reader] = looked

    def _renew(self, plant: str, tick: int) -> None:
        """Open a window of a plant."""
        length = self._lengths[plant] = self._next_length(plant, tick)
        self._starts[plant] = tick
        self._opened[plant] = self._opened.get(plant, 0) + 1
        end = self._end
        if self._last_before:
            end = next((last for last in self._last_before if last > tick), end)
        until = tick + length
        self._proposals[plant] = until if until < end else end

    def _grant(self, module: str) -> int:
        """Last tick up to which a module may act without asking; if it has to be alone then, one tick less."""
        earliest = self._earliest() if self._proposals else self._end
        return min(earliest, self._end) - 1 if module in self._concluding else min(earliest, self._end - 1)

    def _propose(self, modules: Sequence[str], reports: Sequence[Report]) -> None:
        for name, report in zip(modules, reports, strict=True):
            proposal = report.proposal
            if proposal is not None:
                self._proposals[name] = proposal
                if report.fired:
                    self._granted[name] = report

    def _next_length(self, plant: str, tick: int) -> int:
        if plant not in self._lengths:
            wanted = self._policy.first
        elif plant in self._self_ending:
            return self._self_ending[plant]
        elif self._proposals[plant] == tick:
            wanted = self._policy.after_quiet(self._lengths[plant])
        else:
            wanted = self._policy.after_hit(tick - self._starts[plant])
        return min(wanted, self._longest)

    def _epoch(self, module: str) -> int:
        return self._opened.get(self._reads[module], 0)

    def _in_order(self, message: MessageId | Settled) -> tuple[int, int]:
        return self._link_place[message.link], message.sequence

    def _endless(self, tick: int, arriving: Bags) -> ProtocolError:
        going = [
            message.link for name, arrivals in arriving.items() if name not in self._plants for message in arrivals
        ]
        links = sorted(set(going))
        return ProtocolError(
            where=f"links {', '.join(links)}",
            found=f"after {MOST_STEPS_A_TICK} steps the messages of tick {tick} still go round",
            expected="a loop of links has a delay somewhere",
            remedy="set delay_ticks of one of these links to 1 or more",
        )
