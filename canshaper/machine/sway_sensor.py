"""Binds the sway sensors of a deployment to the DBC."""

import math
from collections.abc import Mapping
from dataclasses import dataclass

from cantools.database.can import Signal

from canshaper.config.inputs import SwaySensorSection
from canshaper.config.schema import AxisSection
from canshaper.config.source import Place
from canshaper.machine.inputs import OF_MESSAGE, Bound, bind_input, check_source
from canshaper.machine.lookup import Lookup
from canshaper.machine.used_message import UsedMessage
from canshaper.shaping.free_swing import SensorGains, sensor_gains
from canshaper.shaping.registry import KINDS
from canshaper.shaping.sway import Measured, SensorLimits, SensorTiming, SwayMode

_ANGLES = {"deg": math.radians(1.0), "°": math.radians(1.0), "rad": 1.0, "mrad": 1e-3}
UNITS = {
    Measured.ANGLE: _ANGLES,
    Measured.RATE: {f"{unit}/s": factor for unit, factor in _ANGLES.items()},
}
"""Units that a DBC may give, by quantity, with their factors to rad or rad/s."""
# Fewest measurements in a swing: with fewer the observer lags behind the swing.
LEAST_SAMPLES = 6.0
# Largest delay, part of a swing: an older measurement says little about the present swing.
MOST_DELAY = 0.25
# Least time constant, in swings, with which an inclinometer corrects its gyro. Accelerations show
# no swing of a free pendulum: a shorter constant hides the swing and shifts the rest ahead in time.
LEAST_FUSION = 1.5
# Longest period of a second swing, part of the first: a slower one cannot be separated from it.
MOST_SECOND = 0.5
# Typical damping ratio of the second swing, of long logs; that of the first says little about it.
SECOND_DAMPING = 0.04


@dataclass(frozen=True)
class SensorMessage(Bound[SwaySensorSection]):
    """A message with measurements of sway.

    Attributes:
        signals: signals that axes read.
        merits: name of a signal's figure of merit, by signal, where it has one.
    """

    signals: tuple[Signal, ...]
    merits: Mapping[str, str]


@dataclass(frozen=True)
class BoundSwaySensor:
    """Sway sensor of an axis.

    Attributes:
        config: section of the sensor.
        message: message of the sensor, which other axes may read too.
        signal: signal with the measurement.
        factor: rad or rad/s per unit of the signal, with the sign of the sway model.
        cycle_s: time between two frames, seconds.
        timing: period, delay and lags of the measurements.
        limits: noise, offset and other bounds of the measurements.
        gains: gains of its observer, computed in advance because no control loop may wait for it.
    """

    config: SwaySensorSection
    message: SensorMessage
    signal: Signal
    factor: float
    cycle_s: float
    timing: SensorTiming
    limits: SensorLimits
    gains: SensorGains

    @property
    def name(self) -> str:
        """Name of the sensor, MESSAGE.SIGNAL."""
        return f"{self.message.message.name}.{self.signal.name}"


def sensor_limits(config: SwaySensorSection) -> SensorLimits:
    """Return noise, offset and range of length of a sensor, and its second swing."""
    noise, offset = math.radians(config.noise), math.radians(config.offset_max_deg)
    second_s = config.second_period_s
    second = SwayMode.from_period(second_s, SECOND_DAMPING) if second_s else None
    return SensorLimits(noise, offset, config.length_range_pct / 100.0, second)


def sensor_timing(config: SwaySensorSection, cycle_s: float, period_s: float) -> SensorTiming:
    """Return the timing of a sensor with this cycle, on an axis commanded every ``period_s``."""
    return SensorTiming(
        config.measured,
        period_s=max(cycle_s, period_s),
        delay_s=config.delay_ms / 1000.0,
        lag_s=config.valve_lag_ms / 1000.0,
        lost_s=config.timeout_ms / 1000.0,
    )


def bind_sway_sensors(lookup: Lookup, periods: Mapping[str, float]) -> dict[str, BoundSwaySensor]:
    """Bind the sway sensors; return the sensor of each axis without a problem, by axis.

    Args:
        lookup: shared data of the deployment.
        periods: seconds between two commands of an axis, by axis without a problem.
    """
    readers: dict[tuple[str, str], dict[str, SwaySensorSection]] = {}
    for name, axis in lookup.config.axes.items():
        if sensor := axis.sway_sensor:
            readers.setdefault((sensor.bus, sensor.message), {})[name] = sensor
    bound: dict[str, BoundSwaySensor] = {}
    for sensors in readers.values():
        bound |= _bind_message(lookup, sensors, periods)
    return bound


def _bind_message(
    lookup: Lookup, sensors: dict[str, SwaySensorSection], periods: Mapping[str, float]
) -> dict[str, BoundSwaySensor]:
    """Bind the sensors of all axes that read one message; return them by axis."""
    first, *others = sensors
    config = sensors[first]
    for other in others:
        text = f"axes.{first}.sway_sensor, which reads the message too"
        lookup.diagnostics.check_same(
            _place(other), sensors[other], (*OF_MESSAGE, "node"), config, text
        )
    if (result := bind_input(lookup, _place(first), config)) is None:
        return {}
    used, bound = result
    check_source(used, "a sway sensor")
    lookup.check_node(_place(first), config.bus, config.node)
    factors = {name: _factor(used, name, one) for name, one in sensors.items()}
    for name, one in sensors.items():
        _check(lookup, used, name, one)
    merits = {s.signal: merit for name, s in sensors.items() if (merit := _merit(used, name, s))}
    signals = tuple(signal for signal, _ in filter(None, factors.values()))
    message = SensorMessage(**vars(bound), signals=signals, merits=merits)
    cycle_s = (used.message.cycle_time or 0) / 1000.0
    complete = {}
    for name, signal_factor in factors.items():
        period_s, sway = periods.get(name), lookup.config.axes[name].sway
        if signal_factor and period_s and sway:
            limits = sensor_limits(sensors[name])
            timing = sensor_timing(sensors[name], cycle_s, period_s)
            gains = sensor_gains(sway.mode(), period_s, timing, limits)
            complete[name] = BoundSwaySensor(
                sensors[name], message, *signal_factor, cycle_s, timing, limits, gains
            )
    return complete


def _place(axis: str) -> Place:
    return ("axes", axis, "sway_sensor")


def _factor(used: UsedMessage, axis: str, sensor: SwaySensorSection) -> tuple[Signal, float] | None:
    """Return the sensor signal of an axis, and its factor to rad or rad/s with the model's sign."""
    place = (*_place(axis), "signal")
    signal = used.find(place, sensor.signal)
    if signal is None:
        return None
    used.use(place, signal, f"the sway of {axis}")
    used.check_errors(signal)
    units = UNITS[sensor.measured]
    factor = units.get((signal.unit or "").strip())
    if factor is None:
        text = f"expected one in {', '.join(units)} for the kind {sensor.kind}"
        used.diagnostics.add(place, f"{text}, got {signal.name!r} in {signal.unit!r}")
        return None
    return signal, -factor if sensor.invert else factor


def _merit(used: UsedMessage, axis: str, sensor: SwaySensorSection) -> str | None:
    """Return the name of the sensor's figure of merit, which several may share; None without."""
    place = (*_place(axis), "merit")
    signal = used.find(place, sensor.merit)
    if signal is None:
        return None
    use = "a figure of merit"
    if signal.is_float:
        used.diagnostics.add(place, f"expected a signal of whole numbers, got {signal.name!r}")
    elif used.uses.get(signal.name) != use:
        used.use(place, signal, use)
        used.check_switch(place, signal.name, {0: "good"}, "no measurement")
    return signal.name


def _check(lookup: Lookup, used: UsedMessage, name: str, sensor: SwaySensorSection) -> None:
    """Report settings of a sway sensor that cannot work on its axis."""
    add, axis = lookup.diagnostics.add, lookup.config.axes[name]
    if axis.sway is None:
        add(_place(name), f"expected an axis with sway, got {name!r} without")
        return
    swing_ms = 1000.0 * axis.sway.mode().period_s
    cycle_ms = used.message.cycle_time or 0
    second_s, most_s = sensor.second_period_s, swing_ms / 1000.0 * MOST_SECOND
    if second_s and second_s > most_s:
        most = f"expected up to {most_s:.2f} s, half of the first swing"
        add((*_place(name), "second_period_s"), f"{most}, got {second_s:g} s")
    quickest_ms = 1000.0 * second_s if second_s else swing_ms
    if cycle_ms > quickest_ms / LEAST_SAMPLES:
        most = f"expected {LEAST_SAMPLES:g} messages or more in a swing of {quickest_ms:.0f} ms"
        add((*_place(name), "message"), f"{most}, got one in {cycle_ms} ms")
    if sensor.delay_ms > swing_ms * MOST_DELAY:
        most = f"expected up to {swing_ms * MOST_DELAY:.0f} ms, a quarter of a swing"
        add((*_place(name), "delay_ms"), f"{most}, got {sensor.delay_ms:g} ms")
    if fault := _fusion_fault(sensor, swing_ms / 1000.0):
        add((*_place(name), "fusion_s"), fault)
    if sensor.use == "damp":
        for kind in _not_limit_aware(axis):
            text = f"expected watch with the filter {kind}: it does not feed the swing back"
            add((*_place(name), "use"), text)


def _fusion_fault(sensor: SwaySensorSection, swing_s: float) -> str | None:
    """Return why ``fusion_s`` does not suit the sensor, or None."""
    fusion_s, least_s = sensor.fusion_s, LEAST_FUSION * swing_s
    if sensor.kind != "inclination":
        text = f"expected it with the kind inclination only, got it with {sensor.kind}"
        return text if fusion_s is not None else None
    least = f"expected {least_s:.1f} s or more, {LEAST_FUSION:g} swings"
    if fusion_s is None:
        return f"{least}, got none"
    if not fusion_s:
        return f"{least}, got 0: without a gyro an inclinometer shows nothing on a free pendulum"
    return f"{least}, got {fusion_s:g} s" if fusion_s < least_s else None


def _not_limit_aware(axis: AxisSection) -> list[str]:
    filters = [axis.filter, *(profile.filter for profile in axis.profiles.values())]
    return sorted({one.kind for one in filters if not KINDS[one.kind].limit_aware})
