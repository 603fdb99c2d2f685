"""The keys of a scenario that every scenario has; the parameters of classes stand with the classes."""

from __future__ import annotations

from typing import Annotated

from pydantic import (
    AfterValidator,
    Field,
    FiniteFloat,
    NonNegativeInt,
    PositiveFloat,
    PositiveInt,
    model_validator,
)

from etac_ros.modules.graph import LinkKind
from etac_ros.modules.wire import WireFormat
from etac_ros.parameters import Parameters


def _network_wire(value: WireFormat) -> WireFormat:
    if value is WireFormat.EXACT:
        raise ValueError("'compact' or 'stamped'; exact is the emulation plane's own")
    return value


LinkWire = Annotated[WireFormat, AfterValidator(_network_wire)]


class LinkSection(Parameters):
    """One link: sender, receivers, and the channel between them."""

    sender: str = Field(alias="from", description="NODE or NODE:PORT")
    to: tuple[str, ...] = Field(min_length=1, description="NODE or NODE:PORT, one or more")
    kind: LinkKind
    topic: str | None = Field(default=None, description="default: the sender's namespace and the link's name")
    wire: LinkWire | None = Field(default=None, description="default: the scenario's wire")
    delay_ticks: NonNegativeInt = 0
    loss: float = Field(default=0.0, ge=0.0, lt=1.0)


class WindowSection(Parameters):
    """Lengths of windows; they change speed, never results."""

    first: PositiveInt = 64
    longest: PositiveInt = 1024

    @model_validator(mode="after")
    def _in_order(self) -> WindowSection:
        if self.first > self.longest:
            raise ValueError(f"first is {self.first}, and must be no longer than the longest, {self.longest}")
        return self


class PublishedFigure(Parameters):
    """A figure of the paper, and the band in which a single draw of it may lie."""

    value: FiniteFloat
    low: FiniteFloat
    high: FiniteFloat


class Published(Parameters):
    """What the paper publishes, by the name of the measured figure it stands beside."""

    model_config = {**Parameters.model_config, "extra": "allow"}
    __pydantic_extra__: dict[str, PublishedFigure]

    source: str = ""
    shown_in: dict[str, str] | None = Field(default=None, description="the paper's figures by figure of the report")

    @property
    def figures(self) -> dict[str, PublishedFigure]:
        """Figures by name."""
        return self.__pydantic_extra__


class RunSection(Parameters):
    """The section ``/**``: what concerns the whole run."""

    scenario: str
    title: str = ""
    ticks_per_second: PositiveInt
    duration_s: PositiveFloat
    seed: NonNegativeInt = 0
    wire: LinkWire = WireFormat.COMPACT
    windows: WindowSection = WindowSection()
    links: dict[str, LinkSection]
    baseline: str | None = None
    compare: tuple[str, ...] = Field(default=(), description="variants that `etac compare` shows beside each other")
    variant: str | None = Field(default=None, description="written by `etac resolve`: which variant this is")
    published: Published = Published()


class NodeSection(Parameters):
    """The keys that every node has; all others belong to its module class and its components."""

    model_config = {**Parameters.model_config, "extra": "allow"}

    module: str = Field(description="plant, sensor, controller, actuator or package.module:Class")
    reads: str | None = None
    external: bool = False
