"""What every plant offers to the modules that read and drive it."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import dataclass
from typing import ClassVar, Protocol, TypeGuard

import numpy as np

from etac_ros.maths.rk4 import Stop
from etac_ros.parameters import FloatArray, Parameters
from etac_ros.plants.watch import Watch


class Plant(Protocol):
    """Continuous dynamics sampled on the tick grid under a held input: a servo with two states, for instance.

    What is more than that is a plant of another kind, which has the members of that kind besides: attitude, noisy
    sensors, a moving reference, watched quantities, elastic modes, several bodies.

    A plant is immutable: its state belongs to the module that simulates it, so a window of samples ahead can be
    computed and dropped without a trace.
    """

    Parameters: ClassVar[type[Parameters]]
    labels: tuple[str, ...]
    """Name of each state component, with its unit."""
    inputs: dict[str, int]
    """Size of each input port; the held input is their concatenation in this order."""

    def initial_state(self) -> FloatArray:
        """State at tick 0."""
        ...

    def propagate(self, state: FloatArray, tick: int, count: int, held: FloatArray) -> FloatArray:
        """States at ``tick + 1 .. tick + count``, shape (count, n), from the state at ``tick``."""
        ...


class MeasuredPlant(Plant, Protocol):
    """A plant whose sensors may be noisy. The sensors of a plain :class:`Plant` are ideal."""

    noise_width: int
    """Normal deviates that :meth:`measured` takes a sample; 0 where the sensors are ideal."""

    def measured(self, states: FloatArray, errors: FloatArray) -> FloatArray:
        """What sensors with the given errors see; ``errors`` has shape (n, noise_width)."""
        ...


def noise_width_of(plant: Plant) -> int:
    """Normal deviates that a plant's sensors take a sample; 0 where they are ideal."""
    found: int = getattr(plant, "noise_width", 0)
    return found


class StoppingPlant(Plant, Protocol):
    """A plant that can be told where computing ahead may end: that spares what would be dropped."""

    def propagate_until(self, stop: Stop, state: FloatArray, tick: int, count: int, held: FloatArray) -> FloatArray:
        """As :meth:`Plant.propagate`, but no further than the first state at which to stop: one row at least."""
        ...


class AttitudePlant(Plant, Protocol):
    """A plant that has an attitude. Of any other, no attitude is reported."""

    attitude_slice: slice
    """Where the attitude error stands in the state."""
    rate_slice: slice
    """Where the angular velocity error [rad/s] stands in the state."""

    def euler_angles(self, states: FloatArray) -> FloatArray:
        """Attitude error as 3-2-1 Euler angles [rad], shape (n, 3)."""
        ...

    def attitude_angle(self, states: FloatArray) -> FloatArray:
        """Attitude error as one angle [rad], shape (n,)."""
        ...


def has_attitude(plant: Plant) -> TypeGuard[AttitudePlant]:
    """Whether a plant has an attitude."""
    return hasattr(plant, "attitude_angle")


class GuidedPlant(Plant, Protocol):
    """A plant whose reference moves. A plant with a fixed one is just a :class:`Plant`, whose state is the error."""

    def errors(self, states: FloatArray, tick: int) -> FloatArray:
        """The states at ``tick``, ``tick + 1``, ... relative to the reference, laid out as the states are."""
        ...


def errors_of(plant: Plant, states: FloatArray, tick: int) -> FloatArray:
    """States from ``tick`` on relative to the reference: what angles and rates are reported of."""
    errors = getattr(plant, "errors", None)
    return states if errors is None else np.asarray(errors(states, tick))


class NotedPlant(Plant, Protocol):
    """A plant that has something to say of its parameters. A plant that has not is just a :class:`Plant`."""

    @property
    def notes(self) -> tuple[str, ...]:
        """What a user should know before the run, a sentence each."""
        ...


def notes_of(plant: Plant) -> tuple[str, ...]:
    """What a user should know of a plant's parameters."""
    return tuple(getattr(plant, "notes", ()))


class WatchedPlant(Plant, Protocol):
    """A plant with quantities that have to stay within bounds. A plant without them is just a :class:`Plant`."""

    def watches(self, states: FloatArray) -> tuple[Watch, ...]:
        """The quantities at given states."""
        ...


def watches_of(plant: Plant, states: FloatArray) -> tuple[Watch, ...]:
    """What a plant watches; nothing where it does not say."""
    watches = getattr(plant, "watches", None)
    return () if watches is None else tuple(watches(states))


class ElasticPlant(Plant, Protocol):
    """A plant with elastic modes. A plant without them is just a :class:`Plant`."""

    modes_slice: slice
    """Where the modal coordinates, without their rates, stand in the state; ``labels`` has their names and units."""


def modes_slice_of(plant: Plant) -> slice:
    """Where a plant's modal coordinates stand in its state; an empty slice where it has none."""
    found: slice = getattr(plant, "modes_slice", slice(0, 0))
    return found


class DrivenPlant(Plant, Protocol):
    """A plant with quantities that follow from states and torque together, for figures of a recorded run."""

    def driven(self, states: FloatArray, tick: int) -> Mapping[str, Callable[[FloatArray], FloatArray]]:
        """By name, what gives the quantity at states from ``tick`` on: a function of the torques, shape (n, m)."""
        ...


def driven_of(plant: Plant, states: FloatArray, tick: int) -> Mapping[str, Callable[[FloatArray], FloatArray]]:
    """Quantities of a plant that follow from states and torque; none where it does not say."""
    driven = getattr(plant, "driven", None)
    return {} if driven is None else dict(driven(states, tick))


REFERENCE = "reference"
"""What the frame is called relative to which an attitude is meant, unless a body says otherwise."""


@dataclass(frozen=True)
class Body:
    """One body of a plant, as reports show it.

    Attributes
    ----------
    name
        What it is; empty where the plant is one body.
    euler_angles
        Of states, as 3-2-1 Euler angles [rad], shape (n, 3).
    rates
        Of states, angular velocity error [rad/s], shape (n, 3).
    quaternions
        Of states, the attitude as unit quaternions ``q_BN``, scalar first, shape (n, 4); None where only Euler angles
        say it.
    frame
        What its body frame is called in recordings; empty where the plant is one body, whose frame has its name.
    parent
        The frame relative to which its attitude is meant: that of another body, or what the reference is called.
    port
        The plant's input port whose torque turns it, in its frame; empty for the first.
    """

    name: str
    euler_angles: Callable[[FloatArray], FloatArray]
    rates: Callable[[FloatArray], FloatArray]
    quaternions: Callable[[FloatArray], FloatArray] | None = None
    frame: str = ""
    parent: str = REFERENCE
    port: str = ""


def bodies_of(plant: Plant) -> tuple[Body, ...]:
    """The bodies of a plant: what its method ``bodies`` says, else the one whose error it controls, if it has any."""
    bodies = getattr(plant, "bodies", None)
    if bodies is not None:
        return tuple(bodies())
    if not has_attitude(plant):
        return ()
    quaternions = getattr(plant, "quaternions", None)
    return (Body("", plant.euler_angles, lambda states: states[:, plant.rate_slice], quaternions),)
