"""Sway sensors of a deployment, bound to the DBC."""

import math
from dataclasses import dataclass, replace

from cantools.database.can import Signal

from canshaper.config.input import Input
from canshaper.config.schema import AxisConfig
from canshaper.config.source import Place
from canshaper.config.sway_sensor import SwaySensor
from canshaper.machine.inputs import BoundInput, bind_input, check_source
from canshaper.machine.lookup import Lookup
from canshaper.machine.used_message import UsedMessage
from canshaper.shaping.observer import Measured, SensorTiming
from canshaper.shaping.registry import KINDS
from canshaper.shaping.trust import SensorLimits

_ANGLES = {"deg": math.radians(1.0), "°": math.radians(1.0), "rad": 1.0, "mrad": 1e-3}
UNITS = {
    Measured.ANGLE: _ANGLES,
    Measured.RATE: {f"{unit}/s": factor for unit, factor in _ANGLES.items()},
}
"""Units that a DBC may have, with their factors to rad or rad/s."""
# Measurements in a swing, at least: with fewer the observer is behind it.
LEAST_SAMPLES = 6.0
# Largest delay, part of a swing: what is older says little about the swing now.
MOST_DELAY = 0.25
# What of a section is about its message: the same for every axis that reads it.
_OF_MESSAGE = tuple(Input.model_fields)


@dataclass(frozen=True)
class SensorMessage(BoundInput):
    """A message with measurements of sway.

    Attributes:
        signals: those that are read.
    """

    signals: tuple[Signal, ...] = ()


@dataclass(frozen=True)
class BoundSwaySensor:
    """Sway sensor of an axis.

    Attributes:
        config: its section.
        message: its message, which other axes may read too.
        signal: its signal.
        factor: rad or rad/s per unit of the signal, with the sign of the sway model.
        cycle_s: time between two frames.
    """

    config: SwaySensor
    message: SensorMessage
    signal: Signal
    factor: float
    cycle_s: float

    @property
    def limits(self) -> SensorLimits:
        """What it may show."""
        noise, offset = self.config.noise, self.config.offset_max_deg
        return SensorLimits(math.radians(noise), math.radians(offset))

    def timing(self, period_s: float) -> SensorTiming:
        """For an axis whose command is sent every so many seconds."""
        config = self.config
        return SensorTiming(
            config.measured,
            period_s=max(self.cycle_s, period_s),
            delay_s=config.delay_ms / 1000.0,
            lag_s=config.valve_lag_ms / 1000.0,
            lost_s=config.timeout_ms / 1000.0,
        )


def bind_sway_sensors(lookup: Lookup) -> dict[str, BoundSwaySensor]:
    """Every sway sensor without a problem, by the name of its axis."""
    readers: dict[tuple[str, str], dict[str, SwaySensor]] = {}
    for name, axis in lookup.config.axes.items():
        if sensor := axis.sway_sensor:
            readers.setdefault((sensor.bus, sensor.message), {})[name] = sensor
    bound: dict[str, BoundSwaySensor] = {}
    for sensors in readers.values():
        bound |= _bind_message(lookup, sensors)
    return bound


def _bind_message(lookup: Lookup, sensors: dict[str, SwaySensor]) -> dict[str, BoundSwaySensor]:
    """The axes that read one message."""
    first, *others = sensors
    for other in others:
        for key in _OF_MESSAGE:
            if getattr(sensors[other], key) != getattr(sensors[first], key):
                text = f"expected the same as axes.{first}.sway_sensor, which reads the message too"
                lookup.diagnostics.add((*_place(other), key), text)
    config = sensors[first]
    if (result := bind_input(lookup, SensorMessage, _place(first), config)) is None:
        return {}
    used, message = result
    check_source(used, "a sway sensor")
    factors = {name: _factor(used, name, one) for name, one in sensors.items()}
    for name, one in sensors.items():
        _check(lookup, used, name, one)
    message = replace(message, signals=tuple(s for s, _ in filter(None, factors.values())))
    cycle_s = (used.message.cycle_time or 0) / 1000.0
    return {
        name: BoundSwaySensor(sensors[name], message, *found, cycle_s)
        for name, found in factors.items()
        if found
    }


def _place(axis: str) -> Place:
    return ("axes", axis, "sway_sensor")


def _factor(used: UsedMessage, axis: str, sensor: SwaySensor) -> tuple[Signal, float] | None:
    """The signal of an axis, and rad or rad/s per unit of it, with the sign of the model."""
    place = (*_place(axis), "signal")
    signal = used.find(place, sensor.signal)
    if signal is None:
        return None
    used.use(place, signal, f"the sway of {axis}")
    units = UNITS[sensor.measured]
    factor = units.get((signal.unit or "").strip())
    if factor is None:
        text = f"has the unit {signal.unit!r}; expected one of {', '.join(units)}"
        used.add_fault(f"{signal.name} {text} for a sensor of kind {sensor.kind}")
        return None
    return signal, -factor if sensor.invert else factor


def _check(lookup: Lookup, used: UsedMessage, name: str, sensor: SwaySensor) -> None:
    """What cannot work on an axis."""
    add, axis = lookup.diagnostics.add, lookup.config.axes[name]
    if axis.sway is None:
        add(_place(name), f"expected an axis with sway, got {name!r} without")
        return
    swing_ms = 1000.0 * axis.sway.mode().period_s
    cycle_ms = used.message.cycle_time or 0
    if cycle_ms > swing_ms / LEAST_SAMPLES:
        most = f"expected {LEAST_SAMPLES:g} messages or more in a swing of {swing_ms:.0f} ms"
        add((*_place(name), "message"), f"{most}, got one in {cycle_ms} ms")
    if sensor.delay_ms > swing_ms * MOST_DELAY:
        most = f"expected up to {swing_ms * MOST_DELAY:.0f} ms, a quarter of a swing"
        add((*_place(name), "delay_ms"), f"{most}, got {sensor.delay_ms:g} ms")
    if sensor.use == "damp":
        for kind in _not_limit_aware(axis):
            text = f"expected watch with the filter {kind}: it does not feed the swing back"
            add((*_place(name), "use"), text)


def _not_limit_aware(axis: AxisConfig) -> list[str]:
    filters = [axis.filter, *(profile.filter for profile in axis.profiles.values())]
    return sorted({one.kind for one in filters if not KINDS[one.kind].limit_aware})
