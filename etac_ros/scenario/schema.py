"""The keys of a scenario that every scenario has; the parameters of classes stand with the classes."""

from __future__ import annotations

from enum import StrEnum
from typing import Annotated, Any

from pydantic import (
    AfterValidator,
    BeforeValidator,
    Field,
    FiniteFloat,
    NonNegativeFloat,
    NonNegativeInt,
    PositiveFloat,
    PositiveInt,
    model_validator,
)

from etac_ros.bag.compression import Compression
from etac_ros.graph.channel import Bursts, Jitter
from etac_ros.graph.faults import FaultKind
from etac_ros.graph.graph import USUAL_QOS, AfterLast, LinkKind, Qos, Reliability
from etac_ros.graph.wire import WireFormat
from etac_ros.media.medium import Full
from etac_ros.media.overhead import Profile
from etac_ros.parameters import Parameters, exactly_one


def _without_null(value: Any) -> Any:
    return {key: kept for key, kept in value.items() if kept is not None} if isinstance(value, dict) else value


class ComparesWith(StrEnum):
    """What a trigger rule takes to be held by the other side."""

    ACKNOWLEDGED = "acknowledged"
    SENT = "sent"


class AcknowledgedSection(Parameters):
    """How messages of a link are acknowledged, and sent again."""

    timeout_s: PositiveFloat = Field(description="from the end of a try to the next [s]")
    retries: NonNegativeInt = Field(default=3, description="tries beside the first")
    bytes: PositiveInt | None = Field(
        default=None, description="of the whole frame of an acknowledgement; default: as the medium's overhead has it"
    )
    by: str | tuple[str, ...] | None = Field(
        default=None, description="of several receivers: all, any, or a list of those that have to acknowledge"
    )
    after_last: AfterLast = Field(default=AfterLast.GIVE_UP, description="after the last try: give_up or halt")
    compares_with: ComparesWith | None = Field(
        default=None, description="the sender's trigger rule: acknowledged (the default where it decides) or sent"
    )


class LinkSection(Parameters):
    """One link: sender, receivers, and the channel between them."""

    sender: str = Field(alias="from", description="NODE or NODE:PORT")
    to: tuple[str, ...] = Field(min_length=1, description="NODE or NODE:PORT, one or more")
    kind: LinkKind
    topic: str | None = Field(default=None, description="default: the sender's namespace and the link's name")
    wire: WireFormat | None = Field(default=None, description="default: the scenario's wire")
    delay_ticks: NonNegativeInt = 0
    delay_s: PositiveFloat | None = Field(
        default=None, description="instead of delay_ticks; what is no whole tick is rounded up to the next"
    )
    jitter: Jitter | None = None
    loss: float = Field(default=0.0, ge=0.0, lt=1.0, description="of each message by itself")
    medium: str | None = Field(default=None, description="a shared medium that it crosses first: a key of media")
    bursts: Bursts | None = Field(default=None, description="losses in bursts, instead of loss")
    duplication: float = Field(default=0.0, ge=0.0, le=1.0, description="probability that a message arrives twice")
    acknowledged: AcknowledgedSection | None = Field(default=None, description="default: nothing is sent again")
    outages: dict[str, tuple[FiniteFloat, ...]] = Field(
        default={}, description="by receiving node: [from, until, ...] in seconds, when nothing gets through"
    )

    reliability: Reliability = Field(
        default=Reliability.RELIABLE, description="of DDS: whether it sends again what was lost; only of network links"
    )
    history: PositiveInt = Field(
        default=USUAL_QOS.history,
        le=2**31 - 1,  # a longer one is no depth to the middleware
        description="of DDS: the last so many messages are kept at both ends; likewise",
    )

    @model_validator(mode="after")
    def _qos_of_network(self) -> LinkSection:
        if self.kind is not LinkKind.NETWORK and Qos(self.reliability, self.history) != USUAL_QOS:
            raise ValueError(f"reliability and history are of network links; a {self.kind.value} one is a wire")
        return self

    @model_validator(mode="after")
    def _not_both(self) -> LinkSection:
        if self.delay_s is not None and self.delay_ticks:
            raise ValueError("delay_ticks and delay_s say the same thing: keep one of them")
        if self.bursts is not None and self.loss:
            raise ValueError("loss is of each message by itself, bursts has losses of its own: keep one of them")
        if self.acknowledged is not None and self.duplication:
            raise ValueError("what is acknowledged is taken once however often it comes: leave duplication out")
        if self.acknowledged is not None and self.kind is LinkKind.PHYSICAL:
            raise ValueError("nobody acknowledges light or torque: leave acknowledged out, or kind: network")
        return self


class QueueSection(Parameters):
    """What waits at a sender while it may not send."""

    length: PositiveInt = Field(default=64, description="frames")
    full: Full = Field(
        default=Full.NEWEST, description="what is dropped when it is full; replace: only the latest of a link waits"
    )


class MediumSection(Parameters):
    """One shared medium."""

    rate_bit_s: PositiveFloat
    overhead: Profile = Field(default=Profile.NONE, description="bytes of a frame beside its payload, by protocol")
    smallest_bytes: NonNegativeInt = Field(default=0, description="what a shorter frame is filled up to")
    propagation_s: NonNegativeFloat = 0.0
    transmit_w: PositiveFloat | None = Field(default=None, description="power of a radio that sends [W]")
    receive_w: PositiveFloat | None = Field(default=None, description="power of a radio while a frame for it lasts [W]")
    access: dict[str, Any] = Field(
        default={"class": "etac_ros.media.fifo:Fifo"}, description="class of the access rule, and its parameters"
    )
    queue: QueueSection = QueueSection()

    @model_validator(mode="after")
    def _both_powers(self) -> MediumSection:
        if (self.transmit_w is None) != (self.receive_w is None):
            raise ValueError("transmit_w and receive_w belong together: give both, or neither")
        return self


class FaultSection(Parameters):
    """One fault of the process of a node."""

    at_s: NonNegativeFloat = Field(description="when it begins, simulated [s]")
    node: str = Field(description="whose process it is")
    do: FaultKind = Field(description="kill: for good; stall: it stands still; restart: a fresh one takes its place")
    for_s: PositiveFloat | None = Field(default=None, description="how long a stall or restart lasts [s]")

    @model_validator(mode="after")
    def _lasts(self) -> FaultSection:
        if self.do is FaultKind.KILL and self.for_s is not None:
            raise ValueError("a kill is for good: leave for_s out, or do: restart")
        if self.do is not FaultKind.KILL and self.for_s is None:
            raise ValueError(f"a {self.do.value} lasts a while: it needs the key 'for_s'")
        return self


class WindowSection(Parameters):
    """Lengths of windows; they change speed, never results."""

    first: PositiveInt = 64
    longest: PositiveInt = 1024

    @model_validator(mode="after")
    def _in_order(self) -> WindowSection:
        if self.first > self.longest:
            raise ValueError(f"first is {self.first}, and must be no longer than the longest, {self.longest}")
        return self


class Statistic(StrEnum):
    """How a figure is taken from a run."""

    COUNT = "count"
    """Triggering instants."""
    MIN_INTERVAL = "min_interval_s"
    MEAN_INTERVAL = "mean_interval_s"
    MAX_INTERVAL = "max_interval_s"
    LARGEST = "largest"
    """Largest norm of a quantity."""
    LARGEST_COMPONENT = "largest_component"
    MEAN = "mean"
    """Mean of the norm."""
    DEVIATION = "standard_deviation"
    """Standard deviation of the norm."""
    FINAL = "final"
    """Norm at the end."""
    SETTLING_TIME = "settling_time_s"
    """First instant after which every component stays within ``bound``."""
    ENERGY = "energy_n2m2s"
    """Integral of the square of the held torque."""


class Measure(Parameters):
    """What a figure is, where its name does not say it."""

    statistic: Statistic
    node: str | None = Field(
        default=None, description="a sensor for counts and intervals, else a plant; default: the one"
    )
    quantity: str | None = Field(default=None, description="attitude error, rate, torque or what the node watches")
    from_s: float = Field(default=0.0, ge=0.0)
    until_s: PositiveFloat | None = None
    bound: PositiveFloat | None = Field(default=None, description="for settling_time_s")

    @model_validator(mode="after")
    def _complete(self) -> Measure:
        if self.statistic is Statistic.SETTLING_TIME and self.bound is None:
            raise ValueError("settling_time_s needs the key 'bound'")
        if self.until_s is not None and self.until_s <= self.from_s:
            raise ValueError(f"until_s is {self.until_s:g}, and must be after from_s, {self.from_s:g}")
        return self


def _shortest(value: float) -> str:
    """The fewest digits of a number, in the form of a paper: 84, 97.5, 2e-05."""
    return f"{value:.0f}" if value.is_integer() and abs(value) < 1e9 else repr(value)


class FigureKind(StrEnum):
    """What kind of a figure a published one is: only the first four say anything when they are met."""

    COUNT = "count"
    """Of events: chaotic, one draw of many."""
    CONTINUOUS = "continuous"
    LIMIT = "limit"
    """The paper says that it is kept."""
    PERCENTAGE = "percentage"
    """Of a count, with which it stands or falls."""
    CONSTRUCTED = "constructed"
    """Follows from what the scenario prescribes, whatever the law does."""
    FITTED = "fitted"
    """A parameter was chosen so that this very figure is met."""


class PublishedFigure(Parameters):
    """A figure of the paper. In what band a run may lie is no key: the stored sweep says it."""

    figure: str = Field(
        default="", pattern=r"^\S*$", description="which figure of a run it stands beside; default: its own key"
    )
    node: str | None = Field(
        default=None, description="whose figure; default: that of its measure, of the only sensor, or of the whole run"
    )
    value: FiniteFloat = Field(description="best as text, with the digits that the paper prints: '97.50'")
    printed: str = Field(default="", description="these digits; default: those of the value")
    label: str = Field(default="", description="what it is called in tables")
    where: str = Field(default="", description="where the paper prints it: table, figure, section")
    reason: str = Field(default="", description="why it is not reproduced, or cannot be tested")
    measure: Measure | None = Field(default=None, description="how it is measured, where its name does not say it")
    kind: FigureKind | None = Field(
        default=None,
        description="limit and constructed have to be said; default: count, percentage or continuous, by the name",
    )
    fitted_to: str = Field(default="", description="what was chosen so that this figure is met; only where it was")

    @model_validator(mode="before")
    @classmethod
    def _digits(cls, given: Any) -> Any:
        """A value that is text keeps its digits; of a number that is none, the trailing zeros are not known."""
        if not isinstance(given, dict) or "value" not in given or given.get("printed"):
            return given
        value = given["value"]
        if isinstance(value, str):
            try:
                return {**given, "printed": value, "value": float(value)}
            except ValueError:
                return given
        if isinstance(value, bool) or not isinstance(value, (int, float)):
            return given
        return {**given, "printed": _shortest(float(value))}

    @model_validator(mode="after")
    def _same(self) -> PublishedFigure:
        try:
            same = float(self.printed) == self.value
        except ValueError:
            same = False
        if not same:
            raise ValueError(f"the printed digits are '{self.printed}', and must be those of the value, {self.value:g}")
        return self

    def kind_as(self, name: str) -> FigureKind:
        """Its kind under the name of the measured figure: as said, or as the name has it.

        That a figure is a limit has to be said.
        """
        if self.fitted_to:
            return FigureKind.FITTED
        if self.kind is not None:
            return self.kind
        if "percent" in name:
            return FigureKind.PERCENTAGE
        counted = name.startswith(("triggers", "network_", "baseline_messages", "baseline_more_triggers"))
        return FigureKind.COUNT if counted else FigureKind.CONTINUOUS

    @model_validator(mode="after")
    def _fit(self) -> PublishedFigure:
        if self.fitted_to and self.kind not in (None, FigureKind.FITTED):
            raise ValueError(f"what is fitted ({self.fitted_to}) has the kind fitted, not {self.kind}")
        if self.kind is FigureKind.FITTED and not self.fitted_to:
            raise ValueError("the kind fitted needs the key 'fitted_to': what was chosen so that this figure is met")
        return self


class Published(Parameters):
    """What the paper publishes, each under a key of its own."""

    model_config = {**Parameters.model_config, "extra": "allow"}
    __pydantic_extra__: dict[str, PublishedFigure]

    source: str = ""
    shown_in: Annotated[dict[str, str], BeforeValidator(_without_null)] | None = Field(
        default=None, description="the paper's figures by figure of the report; null in a variant takes one away"
    )

    @property
    def figures(self) -> dict[str, PublishedFigure]:
        """Figures by key."""
        return self.__pydantic_extra__


class Dispersion(Parameters):
    """How a value of a node is drawn anew for each run of a sweep, around what the scenario says.

    ``normal`` and ``uniform`` are added to a number, or to each number of a list.
    """

    normal: PositiveFloat | None = Field(default=None, description="standard deviation, in the value's unit")
    uniform: PositiveFloat | None = Field(default=None, description="half width, in the value's unit")
    rotation_deg: PositiveFloat | None = Field(
        default=None, description="standard deviation of a body-fixed rotation about each axis, for an attitude [deg]"
    )

    @model_validator(mode="after")
    def _one_kind(self) -> Dispersion:
        exactly_one(self, "normal", "uniform", "rotation_deg")
        return self


def _each_once(values: tuple[float, ...]) -> tuple[float, ...]:
    if not values or len(set(values)) < len(values):
        raise ValueError("one number or more, each once")
    return values


def _one_or_two(vary: dict[str, tuple[float, ...]]) -> dict[str, tuple[float, ...]]:
    if not 1 <= len(vary) <= 2:
        names = ", ".join(vary) or "none"
        raise ValueError(f"one key or two, as NODE.KEY: [values], are varied along a curve; found: {names}")
    return vary


def _some(curves: dict[str, TradeoffCurve]) -> dict[str, TradeoffCurve]:
    if not curves:
        raise ValueError("one curve or more, by name")
    return curves


Varied = Annotated[tuple[int | FiniteFloat, ...], AfterValidator(_each_once)]


class TradeoffCurve(Parameters):
    """One curve of a trade-off: a variant with one key varied, or with a grid of two."""

    label: str = Field(default="", description="what it is called; default: its name")
    variant: str | None = Field(default=None, description="default: the file as it stands")
    vary: Annotated[dict[str, Varied], AfterValidator(_one_or_two)] = Field(description="values by NODE.KEY")


class TradeoffSection(Parameters):
    """What `etac tradeoff` lays beside each other: traffic against steady error and energy."""

    error: str = Field(
        default="max_attitude_error_deg",
        description="the steady error: a figure of a run, or a published one with a measure; the largest of all plants",
    )
    paper: tuple[str, ...] = Field(
        default=(), description="variants that are the paper's own points; default: the file as it stands"
    )
    curves: Annotated[dict[str, TradeoffCurve], AfterValidator(_some)]
    periodic: TradeoffCurve = Field(description="the time-triggered curve with which the others are compared")


class RunSection(Parameters):
    """The section ``/**``: what concerns the whole run."""

    scenario: str
    title: str = ""
    ticks_per_second: PositiveInt
    duration_s: PositiveFloat
    seed: NonNegativeInt = 0
    wire: WireFormat = WireFormat.COMPACT
    windows: WindowSection = WindowSection()
    state_rate_hz: NonNegativeFloat | None = Field(
        default=None,
        description="samples of attitude, rate and torque that a bag shows a simulated second; 0: none; default: "
        "about five hundred a run",
    )
    truth_every: NonNegativeInt = Field(
        default=1, description="of the committed samples a bag keeps those at multiples of so many ticks; 0: none"
    )
    bag_compression: Compression = Field(default=Compression.LZ4, description="of the chunks of a bag")
    links: dict[str, LinkSection]
    media: dict[str, MediumSection] = Field(default={}, description="shared media, which links join")
    faults: dict[str, FaultSection] = Field(default={}, description="of the processes of nodes, by a name for each")
    steady_from_s: float | None = Field(
        default=None, ge=0.0, description="steady figures are taken from here on; default: over the last 40 %"
    )
    baseline: str | None = None
    compare: tuple[str, ...] = Field(default=(), description="variants that `etac compare` shows beside each other")
    variant: str | None = Field(default=None, description="written by `etac resolve`: which variant this is")
    dispersion: dict[str, Dispersion | None] = Field(
        default={}, description="what `etac sweep` draws anew for each run, by NODE.KEY; null draws nothing"
    )
    tradeoff: TradeoffSection | None = None
    published: Published = Published()


class NodeSection(Parameters):
    """The keys that every node has; all others belong to its module class and its components."""

    model_config = {**Parameters.model_config, "extra": "allow"}

    module: str = Field(description="plant, sensor, controller, actuator or package.module:Class")
    reads: str | None = None
    external: bool = False
