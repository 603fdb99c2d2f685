"""What part a module plays in the time protocol: when it acts, and what others may rely on without asking."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from enum import StrEnum


class Acts(StrEnum):
    """What makes a module act."""

    BY_ITSELF = "by itself"
    """It names its next own act in ``scan``, and may take what arrives besides."""
    ON_ARRIVAL = "on arrival"
    """Only what arrives makes it act, and it decides then whether it sends. It may see a plant. Nobody asks it for its
    next act, so it costs no exchange while nothing arrives."""
    AT_ONCE = "at once"
    """It answers what arrives in one step with exactly one message on each connected output, whatever the tick. It need
    not report, and a foreign node that merely receives and publishes is one. It sees no plant."""


@dataclass(frozen=True, slots=True)
class Role:
    """The part that a module plays. Refused where its words contradict each other.

    Attributes
    ----------
    acts
        What makes it act.
    timed
        It answers at once and needs to know the tick. Over a stamped link the message tells it; otherwise it
        waits for an order.
    triggers
        The output port whose messages are the triggering instants that a run counts; empty where there are none.
    concludes
        It acts twice at its triggering instant: it fires, and then takes what arrives in the same tick, be that
        nothing. ``receive`` is called in the step after ``fire`` in any case.
    senses
        It takes samples inside itself, where others have a sensor and a link: they are counted.
    fires_on
        It sends one message on each of these output ports, and no others, whenever it fires, and on the port
        ``triggers`` when it concludes alone: so an order to fire needs no report. It has no watches.
    every
        It acts by itself at exactly the ticks that are multiples of this, sends one message on each connected output
        then, and takes nothing. Nobody needs to ask it, nor to hear from it.

    Raises
    ------
    ValueError
        If two of these cannot both be.
    """

    acts: Acts = Acts.BY_ITSELF
    timed: bool = False
    triggers: str = ""
    concludes: bool = False
    senses: bool = False
    fires_on: tuple[str, ...] | None = None
    every: int | None = None

    def __post_init__(self) -> None:
        self._check_types()
        by_itself = self.acts is Acts.BY_ITSELF
        at_once = self.acts is Acts.AT_ONCE
        never = f"a module that acts {self.acts.value} never fires by itself"
        rules = (
            (self.timed and not at_once, "timed", "only who answers at once may not know the tick: others always do"),
            (self.concludes and not by_itself, "concludes", never),
            (self.fires_on is not None and not by_itself, "fires_on", never),
            (self.every is not None and not by_itself, "every", never),
            (bool(self.triggers) and at_once, "triggers", "who answers at once does not report, so nobody counts it"),
            (self.senses and at_once, "senses", "who answers at once sees no plant"),
            (self.every is not None and self.concludes, "every", "who concludes waits for what arrives"),
            (self.every is not None and self.fires_on is not None, "every", "it says all that fires_on would"),
            (self.fires_on == (), "fires_on", "it names no port; leave it out"),
        )
        for broken, name, reason in rules:
            if broken:
                raise ValueError(
                    f"{name}={getattr(self, name)!r} cannot be together with {self._others(name)}: {reason}"
                )

    def check_ports(self, inputs: Mapping[str, int], outputs: Mapping[str, int]) -> None:
        """Refuse a role that does not fit a module's ports.

        Raises
        ------
        ValueError
            If it names an output port that there is not, or needs ports that are missing.
        """
        there = ", ".join(map(repr, outputs)) or "none"
        for name, ports in (("triggers", (self.triggers,) if self.triggers else ()), ("fires_on", self.fires_on or ())):
            for port in ports:
                if port not in outputs:
                    raise ValueError(f"{name} names the port {port!r}; output ports are {there}")
        if self.every is not None and inputs:
            raise ValueError(f"every={self.every} takes nothing, and there are input ports {', '.join(inputs)}")
        if self.acts is not Acts.BY_ITSELF and not inputs:
            raise ValueError(f"it acts {self.acts.value}, and there is no input port")

    def _check_types(self) -> None:
        for name in ("timed", "concludes", "senses"):
            if not isinstance(getattr(self, name), bool):
                raise ValueError(f"{name} is {getattr(self, name)!r}, neither True nor False")
        if not isinstance(self.acts, Acts):
            raise ValueError(f"acts is {self.acts!r}, none of {', '.join(f'Acts.{acts.name}' for acts in Acts)}")
        if not isinstance(self.triggers, str):
            raise ValueError(f"triggers is {self.triggers!r}, no port's name")
        ports = self.fires_on
        if ports is not None and not (isinstance(ports, tuple) and all(isinstance(port, str) for port in ports)):
            raise ValueError(f"fires_on is {ports!r}, no tuple of ports' names")
        if self.every is not None and not (type(self.every) is int and self.every >= 1):
            raise ValueError(f"every is {self.every!r}, no whole number of ticks from 1 on")

    def _others(self, name: str) -> str:
        """The rest of what is said, for a message."""
        said = [f"acts={self.acts.value!r}"]
        for other in ("timed", "triggers", "concludes", "senses", "fires_on", "every"):
            value = getattr(self, other)
            if other != name and value not in (False, "", None):
                said.append(f"{other}={value!r}")
        return ", ".join(said)
