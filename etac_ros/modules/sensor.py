"""The sensor module: measures its plant, forms the signal, and transmits it when its trigger rule says so."""

from __future__ import annotations

from enum import StrEnum
from typing import Any

import numpy as np
from pydantic import Field

from etac_ros.graph.module import Context, Module, Outputs, Window
from etac_ros.graph.promises import Component, check_state_size, first_broken
from etac_ros.graph.role import Role
from etac_ros.laws.law import Signal, is_formed
from etac_ros.maths.compiled import kernel
from etac_ros.maths.finite import all_finite
from etac_ros.maths.noise import normals, stream_key
from etac_ros.maths.rk4 import Criterion, Stop
from etac_ros.modules.hold import Hold
from etac_ros.modules.triggering import NOTHING, Heard
from etac_ros.parameters import FloatArray, Parameters
from etac_ros.plants.plant import noise_width_of
from etac_ros.triggers.periodic import Periodic
from etac_ros.triggers.rule import AnyRule, is_held


class NoiseEnters(StrEnum):
    """Where measurement noise enters the loop."""

    NOWHERE = "nowhere"
    TRIGGER = "trigger"
    TRANSMITTED = "transmitted"
    BOTH = "both"


class Noise(Parameters):
    """Gaussian measurement noise, white on the tick grid."""

    enters: NoiseEnters = NoiseEnters.NOWHERE
    attitude_deg: float = Field(default=0.0, ge=0.0, description="1 sigma a body axis")
    rate_deg_s: float = Field(default=0.0, ge=0.0, description="1 sigma a body axis")


class SensorParameters(Parameters):
    """Parameters of :class:`Sensor` beside its signal and its trigger rule."""

    noise: Noise = Noise()
    low_pass_s: float = Field(default=0.0, ge=0.0, description="time constant on the measured signal; 0 is none")


@kernel
def _low_passed(signals, memory, gain, first):  # type: ignore[no-untyped-def]
    out = signals.copy()
    last = memory.copy()
    for i in range(first, signals.shape[0]):
        for j in range(signals.shape[1]):
            last[j] += gain * (signals[i, j] - last[j])
            out[i, j] = last[j]
    return out


class Sensor(Module):
    """Measures, triggers, transmits.

    Parameters
    ----------
    context
        Its plant and the wire format of the port ``signal``.
    parameters
        Noise and low-pass filter.
    signal
        What is formed from the measurement.
    trigger
        When it is transmitted; the first sample always is.
    """

    Parameters = SensorParameters
    components = ("signal", "trigger")
    role = Role(triggers="signal")
    hears_acknowledgements = True

    def __init__(self, context: Context, parameters: SensorParameters, signal: Signal, trigger: AnyRule) -> None:
        super().__init__(context)
        if context.plant is None:
            raise ValueError("a sensor needs a plant, named by the key 'reads'")
        self._sends_other = hasattr(signal, "sent")
        if self._sends_other and not hasattr(signal, "sent_size"):
            raise ValueError(f"{type(signal).__name__} has 'sent' and no 'sent_size'")
        self.outputs = {"signal": signal.sent_size if hasattr(signal, "sent_size") else signal.size}
        self.signal = signal
        self.trigger = trigger
        rule: object = trigger
        if isinstance(rule, Periodic):
            self.role = Role(triggers="signal", every=rule.period)
        self._senses = Component(context.name, context.plant)
        self._component = Component(context.name, signal)
        self.hold = Hold(self, "signal", trigger)
        self._noise = parameters.noise
        self._key = stream_key(context.seed, context.name)
        sigmas = [np.radians(parameters.noise.attitude_deg)] * 3 + [np.radians(parameters.noise.rate_deg_s)] * 3
        # Attitude and rate of each body that the plant measures.
        bodies, rest = divmod(noise_width_of(context.plant), len(sigmas))
        if self._noise.enters is not NoiseEnters.NOWHERE and (bodies == 0 or rest):
            raise ValueError(
                f"noise is described for {len(sigmas)} deviates a sample (attitude and rate) of each body; "
                f"the plant's sensors draw {noise_width_of(context.plant)}"
            )
        self._sigmas = np.tile(sigmas, bodies)
        check_state_size(signal, context.plant)
        period = 1.0 / context.ticks_per_second
        self._gain = 1.0 - np.exp(-period / parameters.low_pass_s) if parameters.low_pass_s > 0.0 else 1.0
        self._criterion: Criterion | None = None
        self._plain = self._noise.enters is NoiseEnters.NOWHERE and self._gain == 1.0
        if self._plain and is_formed(signal) and is_held(trigger):
            before, behind = signal.form_parameters, trigger.holds_parameters
            self._numbers = np.concatenate([before, behind])
            self._criterion = Criterion(signal.form, signal.size, trigger.holds, before.size)
            self.stops = True
        self._memory: tuple[int, FloatArray, FloatArray] | None = None
        self._seen: tuple[Any, FloatArray, FloatArray] | None = None

    def scan(self, window: Window | None, after: int) -> int | None:
        """First tick at which the trigger rule holds."""
        assert window is not None
        _, _, start, samples = window
        offset = after + 1 - start
        if offset >= len(samples):
            return None
        watched, sent = self._signals(window)
        rows = watched[offset:] if offset else watched
        due = self.hold.first(rows, after + 1)
        if sent is watched and all_finite(rows):
            return due
        # What is no number is named at its tick, if that comes to be: no sample of a window is certain.
        given = window.samples[offset:]
        broken = [first for values in (rows, sent[offset:]) if (first := first_broken(values, given)) is not None]
        ticks = [after + 1 + row for row in broken] + ([] if due is None else [due])
        return min(ticks, default=None)

    def stop(self) -> Stop | None:
        """Where the trigger rule holds, of a signal and a rule that can be compiled into the plant's formula."""
        compared = self.hold.compared
        return None if compared is None else self.stop_at(compared)

    def stop_at(self, compared: FloatArray) -> Stop | None:
        """Where the trigger rule holds, compared with what another process's sensor has sent last."""
        return None if self._criterion is None else Stop(self._criterion, self._numbers, compared)

    @property
    def stopping(self) -> tuple[Criterion, FloatArray] | None:
        """What :meth:`stop` goes by, and its numbers; None where it cannot tell."""
        return None if self._criterion is None or self.hold.has_memory else (self._criterion, self._numbers)

    def advance(self, tick: int, window: Window) -> None:
        """Keep what was watched and what would be sent at ``tick``, and the memories of filter and rule."""
        watched, sent = self._signals(window)
        index = tick - window.start
        if self.hold.has_memory:
            last = window.start - 1 if self._memory is None else max(self._memory[0], window.start - 1)
            self.hold.advance(watched[last + 1 - window.start : index + 1], last + 1)
        row = watched[index].copy()
        self._memory = tick, row, row if sent is watched else sent[index].copy()

    def fire(self, tick: int, sample: FloatArray | None) -> Outputs:
        """Transmit the signal of this tick; the trigger rule compares with it from now on."""
        assert self._memory is not None
        assert sample is not None
        last, watched, sent = self._memory
        assert last == tick
        if not all_finite(watched):
            self._refuse("evaluate", watched, tick, sample)
        if sent is not watched and not all_finite(sent):
            self._refuse("sent", sent, tick, sample)
        return {"signal": self.hold.send(sent, tick, watched if self._sends_other else None)}

    def _refuse(self, method: str, values: FloatArray, tick: int, sample: FloatArray) -> None:
        """What is no number, and follows from numbers, is not sent."""
        if all_finite(sample):
            found = f"gives {values.tolist()} at tick {tick} for a state of finite numbers"
            raise self._component.broken(method, found, "finite numbers")

    def settle(self, port: str, tick: int, acknowledged: bool) -> None:
        """Go by what was acknowledged."""
        self.hold.settle(tick, acknowledged)

    @property
    def watched_label(self) -> str:
        """Symbol of the signal."""
        return self.signal.label

    @property
    def watched_unit(self) -> str:
        """Unit of the signal; empty where it does not say."""
        return str(getattr(self.signal, "unit", ""))

    def watched(self, window: Window | None, heard: Heard = NOTHING) -> FloatArray:
        """What the trigger rule is shown of each sample, through noise and low-pass filter."""
        assert window is not None
        return self._signals(window)[0]

    def held_by(self, value: FloatArray, tick: int) -> FloatArray:
        """What the trigger rule compares with after a message: its value, or what was watched then."""
        if not self._sends_other:
            return value
        assert self._seen is not None
        window, watched, _ = self._seen
        return watched[tick - window.start]  # type: ignore[no-any-return]

    def formed(self, states: FloatArray, tick: int) -> FloatArray:
        """The signal of states from a tick on, free of noise and filters."""
        return self._formed("evaluate", self.signal.size, states, tick)

    def _formed(self, method: str, size: int, states: FloatArray, tick: int) -> FloatArray:
        count = states.shape[0]
        if not self._component.takes(method, "ticks"):
            return self._component.rows(count, size, method, states)
        return self._component.rows(count, size, method, states, np.arange(tick, tick + count, dtype=np.int64))

    def _signals(self, window: Window) -> tuple[FloatArray, FloatArray]:
        """What the trigger watches and what would be sent, for each sample of a window that is not committed."""
        if self._seen is not None and self._seen[0] is window:
            return self._seen[1], self._seen[2]
        watched, sent = self._both(window.samples, window.start)
        if self._plain:
            self._seen = (window, watched, sent)
            return watched, sent
        if self._noise.enters is not NoiseEnters.NOWHERE:
            count = window.samples.shape[0]
            errors = normals(self._key, window.start, count, self._sigmas.size) * self._sigmas
            measured = self._senses.rows(count, window.samples.shape[1], "measured", window.samples, errors)
            noisy, noisy_sent = self._both(measured, window.start)
            watched = noisy if self._noise.enters in (NoiseEnters.TRIGGER, NoiseEnters.BOTH) else watched
            sent = noisy_sent if self._noise.enters in (NoiseEnters.TRANSMITTED, NoiseEnters.BOTH) else sent
        if self._gain != 1.0:
            last, *memory = self._memory or (window.start - 1, watched[0], sent[0])
            committed = max(0, last + 1 - window.start)
            watched, sent = (
                _low_passed(raw, before, self._gain, committed)
                for raw, before in zip((watched, sent), memory, strict=True)
            )
        self._seen = (window, watched, sent)
        return watched, sent

    def _both(self, states: FloatArray, tick: int) -> tuple[FloatArray, FloatArray]:
        """What is watched and what would be sent of states."""
        watched = self.formed(states, tick)
        return watched, self._formed("sent", self.outputs["signal"], states, tick) if self._sends_other else watched
