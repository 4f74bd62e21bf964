"""Finding on a sway sensor: computed from a log, judged, shown, written into the file."""

import math
from collections.abc import Sequence
from dataclasses import dataclass, replace
from pathlib import Path

import numpy as np
from rich.table import Table

from canshaper.commissioning.identification.driven import Driven, stretches
from canshaper.commissioning.identification.series import Array, Command, Kind, Series, Value
from canshaper.commissioning.identification.swing import clipped
from canshaper.commissioning.identification.verdict import AxisFinding
from canshaper.commissioning.origins import confirmed, origin_of
from canshaper.commissioning.sensor.fit import SensorFit, fit_sensor
from canshaper.edit.edit import Change, FileValue, change, note
from canshaper.machine.deployment import Deployment
from canshaper.machine.sway_sensor import LEAST_SAMPLES, MOST_DELAY
from canshaper.machine.valves import BoundAxis
from canshaper.report.console import axis_title, new_table

# Seconds in which the axis has to be driven, at least.
LEAST_DRIVEN_S = 2.0
# Part of the swing beyond noise that the commands have to explain.
LEAST_EXPLAINED = 0.8
# Widest interval of a delay that may be used, s.
WIDEST_DELAY_S = 0.015
# Where the swing is larger or smaller than the full speed of the file makes by more than this
# factor, the unit in the DBC is wrong.
MOST_GAIN = 3.0
# Error of the model in the delay, s: large swings, and the lag of spools.
MODEL_DELAY_S = 0.01
# Measurements so close to each other differ by noise, s: the swing hardly moves meanwhile.
NOISE_S = 0.1
# A pendulum whose length differs by more is reported, %.
SAME_LENGTH_PCT = 15.0
# An offset above this part of offset_max_deg raises that to so many times the offset.
NEAR_OFFSET, MORE_OFFSET = 0.8, 1.5
SIGMAS = 2.0  # of 95 %
DRIVE_IT = (
    "drive it alone at some 40 % for about a second, forth and back, four times, with a pause of"
    " two swings after each, and let nothing touch the tool"
)


@dataclass
class SensorFinding(AxisFinding):
    """Sway sensor of one axis.

    Attributes:
        series: what it measured, rad or rad/s, with the sign of its signal.
        data: the stretches in which the axis was driven.
        fit: the model that explains it best; None where there was nothing to explain.
        noise: standard deviation of its noise, degrees or degrees per second.
    """

    series: Series
    data: Sequence[Driven] = ()
    fit: SensorFit | None = None
    noise: float = 0.0

    @property
    def unit(self) -> str:
        """Unit of swing and noise, for people."""
        return "degrees/s" if self.series.unit.kind is Kind.RATE else "degrees"

    @property
    def invert(self) -> bool:
        """Whether the signal has the opposite sign of the model's swing."""
        return self.fit is not None and self.fit.gain < 0.0

    @property
    def delay_s(self) -> Value:
        """Age of a measurement when it is received, s."""
        assert self.fit
        return Value(self.fit.delay_s, math.hypot(SIGMAS * self.fit.deviations[0], MODEL_DELAY_S))

    @property
    def offset(self) -> Value:
        """Offset in ``unit``, with the sign of the signal."""
        assert self.fit
        offsets = np.degrees(self.fit.offsets)
        spread = float(offsets.std(ddof=1)) if len(offsets) > 1 else 0.0
        swings = sum(len(one.time_s) for one in self.data) * NOISE_S
        return Value(float(offsets.mean()), SIGMAS * max(spread, self.noise / math.sqrt(swings)))

    @property
    def period_s(self) -> Value:
        """Period of the damped swing, s."""
        assert self.fit
        period = 2.0 * math.pi / self.fit.omega
        return Value(period, SIGMAS * period * self.fit.deviations[1] / self.fit.omega)

    @property
    def size_m_s(self) -> Value:
        """Full speed of the tip that makes as much swing as was measured, m/s."""
        assert self.fit
        size = abs(self.fit.gain)
        return Value(size, SIGMAS * size * self.fit.deviations[3])


def examine(axis: BoundAxis, series: Series) -> SensorFinding:
    """Return the finding on the sensor of an axis, by its signal and commands in a log."""
    assert axis.config.sway and axis.sway_sensor
    finding = SensorFinding(axis.name, series, notes=list(series.notes))
    mode = axis.config.sway.mode()
    if fault := _useless(axis.name, series, mode.period_s):
        finding.problems.append(fault)
        return finding
    finding.data = [
        one for part in _alone(series, mode.period_s) for one in stretches(part, mode.period_s)
    ]
    if not finding.data:
        text = "no stretch of driving with measurements all the time"
        finding.problems.append(f"{series.source}: {text}: {DRIVE_IT}")
        return finding
    config = axis.sway_sensor.config
    finding.fit = fit_sensor(finding.data, mode, config.valve_lag_ms / 1000.0)
    finding.noise = math.degrees(_noise(finding.data, finding.fit.fitted))
    finding.problems += _faults(axis, finding)
    longer_pct = 100.0 * ((finding.period_s.value / mode.period_s) ** 2 - 1.0)
    if abs(longer_pct) > SAME_LENGTH_PCT:
        finding.notes.append(
            f"it swings like a pendulum {abs(longer_pct):.0f} %"
            f" {'longer' if longer_pct > 0 else 'shorter'} than the file says; canshaper identify"
            " finds what it is"
        )
    return finding


def _useless(axis: str, series: Series, period_s: float) -> str | None:
    """Return why a signal cannot be used; None where it can."""
    time, value, source = series.time_s, series.value, series.source
    if series.command is None:
        return f"expected commands of {axis} in the log, got none: log its valve or its joystick"
    if len(time) < 2 or float(np.median(np.diff(time))) > period_s / LEAST_SAMPLES:
        return (
            f"{source}: expected {LEAST_SAMPLES:g} measurements or more in a swing of"
            f" {period_s:.2g} s, got {len(time)} in all: is it on, and its cycle right?"
        )
    if float(np.ptp(value)) == 0.0:
        return f"{source}: it stands at {value[0]:g}: is it the right signal, and the sensor on?"
    if (seconds := sum(one.driven_s for one in _alone(series, period_s))) < LEAST_DRIVEN_S:
        return (
            f"expected {axis} driven alone for {LEAST_DRIVEN_S:g} s or more, got {seconds:.1f} s;"
            f" what moves the tool without a command shows no sign: {DRIVE_IT}"
        )
    return clipped(series, None)


def _alone(series: Series, period_s: float) -> list[Series]:
    """Return the parts of a signal in which no other axis moves, or did within a period before."""
    command = series.command
    assert command
    parts, begin = [], -math.inf
    for first, last in [*sorted(series.others), (math.inf, math.inf)]:
        if first > begin:
            of_time = (series.time_s >= begin) & (series.time_s < first)
            of_command = (command.time_s >= begin) & (command.time_s < first)
            its = Command(command.time_s[of_command], command.speed[of_command])
            time_s, value = series.time_s[of_time], series.value[of_time]
            parts.append(replace(series, time_s=time_s, value=value, command=its))
        begin = max(begin, last + period_s)
    return parts


def _noise(data: Sequence[Driven], fitted: Sequence[Array]) -> float:
    """Return the deviation of noise, in the data's unit: how residuals .1 s apart differ."""
    squares, count = 0.0, 0
    for one, model in zip(data, fitted, strict=True):
        apart = max(1, round(NOISE_S / float(np.median(np.diff(one.time_s)))))
        left = one.value - model
        step = left[apart:] - left[:-apart]
        squares += 0.5 * float(step @ step)
        count += len(step)
    return math.sqrt(squares / count)


def _faults(axis: BoundAxis, finding: SensorFinding) -> list[str]:
    """Return why the fit cannot be used."""
    fit, source = finding.fit, finding.series.source
    assert fit and axis.config.sway
    explained = fit.explained(math.radians(finding.noise))
    if explained < LEAST_EXPLAINED:
        return [
            f"{source}: expected the commands of {axis.name} to explain"
            f" {100 * LEAST_EXPLAINED:.0f} % of the swing, got {100 * max(0.0, explained):.0f} %:"
            f" does it measure the plane of this axis? If so, {DRIVE_IT}"
        ]
    faults = []
    if (half := finding.delay_s.half) > WIDEST_DELAY_S:
        swing = math.degrees(math.sqrt(fit.square / fit.count))
        faults.append(
            f"{source}: expected the delay to {1000 * WIDEST_DELAY_S:.0f} ms, got it to"
            f" {1000 * half:.1f} ms, by {swing:.2g} {finding.unit} of swing in a noise of"
            f" {finding.noise:.2g}: drive it more often, or faster"
        )
    least_m_s = most_m_s = axis.config.sway.full_speed_m_s
    if slewing := axis.config.slewing:
        most_m_s = slewing.full_speed_rad_s * slewing.largest_radius_m
    if not least_m_s / MOST_GAIN < finding.size_m_s.value < MOST_GAIN * most_m_s:
        faults.append(
            f"{source}: its swing needs a full speed of {finding.size_m_s.value:.2g} m/s, the file"
            f" has {least_m_s:g}: is the unit in the DBC right?"
        )
    most_s = MOST_DELAY * axis.config.sway.mode().period_s
    if finding.delay_s.value > most_s:
        faults.append(
            f"{source}: expected a delay up to {1000 * most_s:.0f} ms, a quarter of a swing, got"
            f" {1000 * finding.delay_s.value:.0f} ms: take a quicker sensor, or cycle"
        )
    return faults


def changes(axis: BoundAxis, finding: SensorFinding) -> dict[str, FileValue]:
    """Return values for the section of the sensor, by key; a negative delay shortens its lag."""
    assert axis.sway_sensor
    config = axis.sway_sensor.config
    delay_ms = round(1000.0 * finding.delay_s.value)
    values: dict[str, FileValue] = {
        "invert": finding.invert,
        "delay_ms": max(0, delay_ms),
        "noise_deg": float(f"{max(0.01, finding.noise):.2g}"),
    }
    if delay_ms < 0:  # the valve is quicker than the file says
        values["valve_lag_ms"] = max(0, round(config.valve_lag_ms + delay_ms))
    if abs(finding.offset.value) > NEAR_OFFSET * config.offset_max_deg:
        values["offset_max_deg"] = math.ceil(MORE_OFFSET * abs(finding.offset.value))
    return values


def heading(finding: SensorFinding) -> str:
    """Return a heading: what was examined, and whether the data is enough."""
    text = f"{axis_title(finding.axis)}, {finding.series.source}"
    if finding.fit is None:
        return f"{text}: nothing found"
    driven = len(finding.data)
    explained = 100.0 * max(0.0, finding.fit.explained(math.radians(finding.noise)))
    text += f": {driven} driven stretch{'es' * (driven != 1)}, {explained:.0f} % explained"
    return finding.marked(text)


def table(axis: BoundAxis, finding: SensorFinding) -> Table:
    """Return a table of the finding next to the values of the file."""
    assert axis.sway_sensor and axis.config.sway
    config, sway = axis.sway_sensor.config, axis.config.sway
    unit, rows = finding.unit.replace("degrees", "deg"), new_table("", "file", "found")
    inverted = {False: "as the model", True: "inverted"}
    rows.add_row("sign", inverted[config.invert], inverted[finding.invert])
    rows.add_row("delay, ms", f"{config.delay_ms:g}", _shown(finding.delay_s, 1000.0, 0))
    rows.add_row(f"offset, {unit}", f"up to {config.offset_max_deg:g}", _shown(finding.offset))
    rows.add_row(f"noise, {unit}", f"{config.noise:g}", f"{finding.noise:.2g}")
    rows.add_row("period, s", f"{sway.mode().period_s:.2f}", _shown(finding.period_s))
    rows.add_row("full speed, m/s", f"{sway.full_speed_m_s:g}", _shown(finding.size_m_s))
    return rows


def _shown(value: Value, factor: float = 1.0, digits: int = 2) -> str:
    half = max(factor * value.half, 10.0**-digits)
    return f"{factor * value.value:.{digits}f} ± {half:.{digits}f}"


def write_sensors(
    deployment: Deployment, findings: Sequence[SensorFinding], log: Path | None, *, live: bool
) -> list[str]:
    """Write the results of each sensor with their origin; return the lines that have changed.

    Args:
        deployment: the machine.
        findings: of its sensors; those with problems are left out.
        log: the log of a person, None for a drive of this program.
        live: whether the buses were listened to.

    Raises:
        ConfigError: the file cannot be changed.
    """
    buses = deployment.config.buses.values() if live else ()
    origin = origin_of("sensor", [log] if log else [], deployment.messages, live=buses)
    written: list[Change] = []
    measured: list[str] = []
    for finding in findings:
        if not finding.problems:
            values = changes(deployment.axes[finding.axis], finding) | {"origin": origin}
            written.append((("axes", finding.axis, "sway_sensor"), values, note("sensor")))
            measured += (f"axes.{finding.axis}.sway_sensor.{key}" for key in values)
    if not written:
        return []
    return change(deployment.path, [*written, *confirmed(deployment.path, measured)])
