"""Who brings the nodes of a run together, begins it when all are there, and lets them go: the same with every clock."""

from __future__ import annotations

import os
import time
from collections.abc import Sequence
from fractions import Fraction
from typing import Any

from rclpy.context import Context
from rosgraph_msgs.msg import Clock
from std_msgs.msg import String

from etac_ros.engines.ros.domain import DOMAIN_VARIABLE
from etac_ros.engines.ros.endpoints import LATCHED, Spinner
from etac_ros.engines.ros.foreign import Foreign
from etac_ros.engines.ros.messages import open_note
from etac_ros.engines.ros.own_code import own_code
from etac_ros.engines.ros.plan import COORDINATOR, Plan
from etac_ros.engines.ros.run_node import RunNode
from etac_ros.errors import RunError
from etac_ros.graph.graph import Reliability
from etac_ros.graph.topics import CLOCK, END, FAULT, JOIN, LEAVE, SCENARIO, START, STOP

_LAST_WORD_S = 2.0
"""How long the coordinator waits to know that its last word has been heard by nodes that nobody else would end."""


def _shown(rate: str) -> str:
    """A rate as it was given; notes have it as a fraction."""
    return f"{float(Fraction(rate)):g}" if rate else "1"


class Convener(RunNode):
    """The node that begins and ends a run.

    Parameters
    ----------
    plan, spinner, context
        As for :class:`RunNode`.

    Attributes
    ----------
    leave_notes
        Last note of each node that has said it.
    fault
        Why the run has failed; empty otherwise.
    began, loop_s
        When it began, on the clock of ``time.perf_counter``, and how long it took [s].
    """

    foreign: Foreign

    def __init__(self, plan: Plan, spinner: Spinner, context: Context) -> None:
        super().__init__(plan, COORDINATOR, spinner, context)
        self.leave_notes: dict[str, dict[str, Any]] = {}
        self.fault = ""
        self.loop_s = 0.0
        self.began = 0.0
        self._greeted: dict[str, int] = {}
        self._heard = time.monotonic()
        self._start = self.publisher(String, START, latched=True)
        self._stop = self.publisher(String, STOP, latched=True)
        self._end = self.publisher(String, END, latched=True)
        self._clock = self.publisher(Clock, CLOCK)
        # Nobody of the run hears it, so nobody waits for it, and it is not counted.
        self._scenario = self.ros_node.create_publisher(String, SCENARIO, LATCHED)
        self._scenario.publish(self.note({**Convener._start_content(self), "clock": plan.clock, "text": plan.told}))

    def idle(self, patient: bool) -> None:
        """Called while nothing arrives: begins when all are there, and notices who has gone quiet.

        Parameters
        ----------
        patient
            Wait without end for nodes to appear, and say for whom; they are started by hand.

        Raises
        ------
        RunError
            Naming the nodes that owe an answer.
        """
        if not self.started:
            self._begin_if_all_are_there()
            for words in self.foreign.misfits():
                self.say(words)
        elif self.stop is None:
            self._look_after_run()
        if time.monotonic() - self._heard < self.plan.quiet_s:
            return
        self._heard = time.monotonic()
        if not self.started:
            missing = [name for name in self.plan.nodes if name not in self._greeted]
            if patient:
                self.say(self._waiting_for(missing))
                return
            raise RunError(
                f"node {', '.join(missing)}",
                f"has not appeared within {self.plan.quiet_s:g} s",
                "all nodes of the scenario, started with the same parameter file",
                "start it, or see what it printed",
            )
        if self.stop is None:
            self._blame_who_is_quiet()
            return
        missing = [name for name in self.plan.nodes if name not in self.leave_notes]
        found = f"has not left within {self.plan.quiet_s:g} s{self._may_be_lost()}"
        raise RunError(f"node {', '.join(missing)}", found)

    def _waiting_for(self, missing: Sequence[str]) -> str:
        absent = [*missing, *([] if missing else self.foreign.absent())]
        domain = os.environ.get(DOMAIN_VARIABLE, "0")
        return f"in ROS domain {domain}, still waiting for {', '.join(absent) or 'a foreign node'}"

    def excuse(self) -> None:
        """Silence counts from now on: a process of the run was stopped, or computes."""
        self._heard = time.monotonic()

    def end(self, fault: str) -> None:
        """End the run, now that it is over or has failed; all others hear of it."""
        self.fault = fault
        self.loop_s = time.perf_counter() - self.began if self.began else 0.0
        self._stop.publish(self.note({"fault": fault, **self._totals()}))

    def leave(self) -> None:
        """All counts are in: let everybody go, and know that they have heard it before this process ends."""
        self.leave_notes[self.name] = self.leave_note()
        self._end.publish(self.note({"tick": self.tick}))
        if not self.plan.token:  # else the launcher ends who has missed it; those who heard it are gone, unacknowledged
            self._end.drain(_LAST_WORD_S)
        self.finished = True

    @property
    def tick(self) -> int:
        """How far the run is."""
        raise NotImplementedError

    def _totals(self) -> dict[str, Any]:
        """What everybody has to know at the end."""
        raise NotImplementedError

    def _look_after_run(self) -> None:
        """Called now and then while the run goes on and nothing arrives."""

    def _blame_who_is_quiet(self) -> None:
        """Nothing was heard for too long while the run goes on."""

    def _may_be_lost(self) -> str:
        """A hint at links whose last message nobody misses but who waits for it."""
        links = self.plan.graph.links.values()
        topics = [link.topic for link in links if link.qos.reliability is Reliability.BEST_EFFORT]
        return (
            f"; or a message was lost that DDS does not send again (best effort: {', '.join(topics)})" if topics else ""
        )

    def _start_content(self) -> dict[str, Any]:
        """What the note that begins the run says."""
        return {"scenario": self.plan.scenario, "digest": self.plan.digest}

    def _hear_of_others(self) -> None:
        self.subscription(String, JOIN, self._on_join, latched=True, read=open_note)
        self.note_subscription(FAULT, self._on_fault, latched=True)
        self.note_subscription(LEAVE, self._on_leave, shared=True)

    def _on_join(self, join: Any, sequence: int) -> None:
        if not isinstance(join, dict) or not {"node", "scenario", "digest", "pid"} <= join.keys():
            return
        name = join["node"]
        ours = join.get("run") == self.plan.run_id
        if not ours and self.plan.token:
            return  # this run's processes know its token: whoever else joins is none of them
        self._heard = time.monotonic()
        if name not in self.plan.nodes:
            raise RunError(
                f"node {name}", f"of scenario '{join['scenario']}' is in this ROS domain", "only this run's nodes",
                "give each run a domain of its own",
            )  # fmt: skip
        if join["digest"] != self.plan.digest:
            raise RunError(
                f"node {name}",
                f"was started with another scenario ('{join['scenario']}', {join['digest']})",
                f"'{self.plan.scenario}', {self.plan.digest}",
                "start all nodes with the file that `etac resolve` prints, and with the same code of its classes",
            )
        if not self.plan.token and (theirs := join.get("code", "")) != own_code():
            raise RunError(
                f"node {name}", f"is of another etac_ros ({theirs or 'unknown'})", f"{own_code()}, as {COORDINATOR}",
                "install the same version on all machines",
            )  # fmt: skip
        if (theirs := join.get("clock", "")) != self.plan.clock:
            raise RunError(
                f"node {name}",
                f"runs in {theirs or 'simulated'} time",
                f"{self.plan.clock or 'simulated'} time, as the other nodes",
                "start all nodes with the same --clock",
            )
        rate = "" if self.plan.wall is None else str(self.plan.wall.rate)
        if (theirs := join.get("rate", "")) != rate:
            raise RunError(
                f"node {name}",
                f"runs at --rate {_shown(theirs)}",
                f"--rate {_shown(rate)}, as {COORDINATOR}, which keeps time",
                "start all nodes with the same --rate",
            )
        if self._greeted.setdefault(name, join["pid"]) != join["pid"]:
            raise RunError(
                f"node {name}", "is there twice in this ROS domain", "every node once",
                "give each run a domain of its own",
            )  # fmt: skip
        self._begin_if_all_are_there()

    def _begin_if_all_are_there(self) -> None:
        if len(self._greeted) == len(self.plan.nodes) and not self.started and self.foreign.is_ready():
            self.started = True
            self.begin_to_count()
            self.start = self._start_content()
            self._start.publish(self.note(self.start))
            self.on_start()

    def _on_fault(self, content: Any, sequence: int) -> None:
        if self.stop is None and not self.fault and content["node"] != self.name:
            raise RunError(f"node {content['node']}", content["fault"])

    def _on_leave(self, content: Any, sequence: int) -> None:
        self._heard = time.monotonic()
        self.leave_notes[content["node"]] = content
        self.settle()
