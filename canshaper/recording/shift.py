"""The work in logs: figures by shift, profile and anti-sway, from a replay of each log.

A replay gives joysticks, states and profiles. The valve commands are those of the valve frames in
the log, from any sender; without valve frames, those that the deployment would have sent. The swing
is that of the axis' model behind these commands, corrected by a sway sensor if there is one.
"""

import math
from collections import defaultdict
from collections.abc import Callable, Iterator, Mapping
from datetime import UTC, datetime
from typing import Any, NamedTuple

from canshaper.codec.frame import MessageKey
from canshaper.controller.axis_control import LEAST_RADIUS_M
from canshaper.controller.parameter_sets import profile_by_number
from canshaper.inputs.sway_sensor import SwaySensorInput, SwaySignal
from canshaper.inputs.value import PositionInput, Value
from canshaper.machine.deployment import Deployment
from canshaper.machine.valves import BoundAxis
from canshaper.recording.log import LogFile
from canshaper.recording.play import frames_of
from canshaper.recording.replay import Drive, Replay
from canshaper.recording.ticks import Row
from canshaper.report.shift import Figures, WorkCounter
from canshaper.shaping.observer import SwayObserver
from canshaper.shaping.states import State
from canshaper.shaping.sway import SwayModel
from canshaper_sim.cranes import axes_of, cranes

# The clock of a log that begins before this counts from its own start.
FIRST_DAY_NS = 1_000_000_000 * 1_000_000_000
# A status comes several times a second; for so long the last one counts.
STATUS_NS = 2_000_000_000
# Ticks computed in a pause of the log: after these any swing is over.
MOST_TICKS = 15_000


class LogOfWork(NamedTuple):
    """A log before it is counted: its machine, name for people and time of its first frame."""

    machine: str
    name: str
    start_ns: int
    deployment: Deployment
    drive: Drive


def first_ns(drive: Drive) -> int:
    """Return the time of a log's first frame, ns, or 0; raise LogError if it cannot be read."""
    frames = frames_of(drive.box) if drive.box else iter(LogFile(drive.path))
    return next((frame.time_ns for frame in frames), 0)


def day_of(time_ns: int) -> str:
    """Return the day of a time in a log as YYYY-MM-DD in UTC; empty if its clock has no date."""
    if time_ns < FIRST_DAY_NS:
        return ""
    return datetime.fromtimestamp(time_ns / 1e9, UTC).date().isoformat()


class Shifts:
    """The table of the work in many logs; ``add`` takes the logs in the order of their times.

    Args:
        by: limit of a shift: ``gap``, ``day`` or ``file``.
        gap_s: time without a frame that ends a shift, s.
    """

    def __init__(self, by: str, gap_s: float) -> None:
        self._by, self._gap_ns = by, round(1e9 * gap_s)
        self._figures = defaultdict[tuple[str, ...], Figures](Figures)
        self._end_ns: dict[str, int] = {}  # by machine, the end of the counted time
        self._shift: dict[str, str] = {}

    def rows(self) -> list[dict[str, Any]]:
        """Return the rows of the table by column; rows without driving only if no row has any."""
        names = ("machine", "shift", "crane", "profile", "anti_sway")
        driven = {key: one for key, one in self._figures.items() if one.driven_s}
        return [
            dict(zip(names, key, strict=True)) | figures.columns()
            for key, figures in (driven or self._figures).items()
        ]

    def add(self, log: LogOfWork, progress: Callable[[float], None]) -> list[str]:
        """Count a log, but not times with a date that an earlier log of the machine has too.

        Returns:
            Notes on the log to read before relying on its figures.

        Raises:
            LogError: the log cannot be used (what came before is counted), or has no joystick
                frame; a log that is cut off is used up to its end.
        """
        replay, machine = Replay(log.deployment, log.drive), log.machine
        readers = _Readers(log.deployment)
        dated, last_ns, skipped = day_of(log.start_ns), 0, 0
        before_ns = self._end_ns.get(machine, 0) if dated else 0
        try:
            for tick, result in replay.run(progress):
                now_ns = tick.now_ns
                elapsed_ns = now_ns - last_ns if last_ns else readers.tick_ns
                last_ns = now_ns
                for time_ns, frame in (*tick.logged, *tick.received):
                    for read in readers.of.get(frame[:3], ()):
                        read(frame.data, time_ns)
                for name, axis in readers.axes.items():
                    axis.step(result.rows[name], now_ns, elapsed_ns // readers.tick_ns)
                if now_ns <= before_ns:
                    skipped += 1
                    continue
                self._begin(log, now_ns)
                if elapsed_ns > self._gap_ns:
                    elapsed_ns = readers.tick_ns
                    readers.end()
                for crane in readers.cranes:
                    key = (machine, self._shift[machine], *crane.part(result.rows))
                    crane.count(self._figures[key], result.rows, elapsed_ns / 1e9)
        finally:
            readers.end()
        replay.check_joysticks()
        notes = [*replay.warnings(), *(() if replay.exact else readers.notes())]
        if skipped:
            notes.append(f"{skipped * readers.tick_ns / 1e9:.0f} s are in a log before it too")
        return notes

    def _begin(self, log: LogOfWork, now_ns: int) -> None:
        """Set the machine's shift to that of a tick; one with a date ends its counted time."""
        machine, day = log.machine, day_of(now_ns)
        if self._by == "file" or not day:
            self._shift[machine] = log.name
        elif self._by == "day":
            self._shift[machine] = day
        elif machine not in self._end_ns or now_ns - self._end_ns[machine] > self._gap_ns:
            at = datetime.fromtimestamp(now_ns / 1e9, UTC)
            self._shift[machine] = f"{at:%Y-%m-%d %H:%M}"
        if day:
            self._end_ns[machine] = now_ns


class _Axis:
    """Motion of one axis in a log, tick by tick.

    ``velocity`` is -1 to 1 of full speed; ``foreign``: another program drives the axis.
    """

    def __init__(self, bound: BoundAxis, tick_s: float) -> None:
        config = bound.config
        self.bound, self.velocity, self.sway_rad = bound, 0.0, 0.0
        self.measured = self.foreign = False
        self.full_m_s = config.sway.full_speed_m_s if config.sway else 0.0
        self.model = SwayModel(config.sway.mode(), tick_s) if config.sway else None
        self.state = self._status = State.NEUTRAL_WAIT
        self.valve_ns = self._status_ns = self._measured_ns = -1  # none
        self._logged, self._limits = 0.0, config.limits.output_limits()
        self._observer: SwayObserver | None = None
        self.radius: Value | None = None

    def use_sensor(self, message: SwaySensorInput) -> None:
        """Also use the sway measurements of this message."""
        one, model = self.bound.sway_sensor, self.model
        assert one and model
        self._observer = SwayObserver(model, one.timing, one.limits, one.gains)
        self._signal, self._lost_ns = SwaySignal(message, one), 1e9 * one.timing.lost_s

    def on_valve_frame(self, data: bytes, time_ns: int) -> None:
        """Take a frame of the axis' valve from the log; ignore a wrong one."""
        layout, valve = self.bound.valve.message.fields.layout, self.bound.valve
        if len(data) == layout.length and (steps := valve.read(layout.decode(data))) is not None:
            self._logged, self.valve_ns = self._limits.velocity(steps / valve.steps), time_ns

    def on_status(self, data: bytes, time_ns: int) -> None:
        """Take a frame of the axis' status from the log; ignore a wrong one."""
        values = self.bound.status.decode(data) if self.bound.status else None
        if values and values["State"] in {*State}:
            self._status, self._status_ns = State(values["State"]), time_ns

    def step(self, row: Row, now_ns: int, ticks: int) -> None:
        """Advance by ``ticks`` to ``now_ns``, at which the replay of the axis gave ``row``."""
        self.velocity, self.state, self.foreign = row.applied, row.state, False
        if self.valve_ns >= 0:  # a silent valve closes by itself
            silent = now_ns - self.valve_ns > 1_000_000 * self.bound.config.valve.timeout_ms
            self.velocity = 0.0 if silent else self._logged
            if 0 <= self._status_ns >= now_ns - STATUS_NS:
                self.state = self._status
            else:
                self.foreign = self.bound.status is not None
        slewing = self.bound.config.slewing
        if self.radius and slewing and (radius_m := self.radius.fresh(now_ns)):
            self.full_m_s = max(radius_m, LEAST_RADIUS_M) * slewing.full_speed_rad_s
        if self.model and row.mode:
            added = 0.0 if self.foreign or not self.velocity else row.added
            self._swing(row, added, now_ns, ticks)

    def _swing(self, row: Row, added: float, now_ns: int, ticks: int) -> None:
        model, observer, own = self.model, self._observer, self.velocity - added
        assert model and row.mode
        if model.mode != row.mode:
            self.model = model = model.retuned(row.mode, own)
            if observer:
                observer.retune(model)
        scale = model.mode.angle_per_speed_rad * self.full_m_s
        for _ in range(min(max(ticks, 1), MOST_TICKS)):
            model.step(own)
            if observer:
                observer.step(own, added)
        self.sway_rad = model.angle * scale
        if observer:
            fresh = 0 <= self._measured_ns >= now_ns - self._lost_ns
            if (value := self._signal.new_value()) is not None:
                if fresh:
                    observer.correct(observer.errors(value, scale))
                else:
                    observer.begin(value, scale)
                self._measured_ns, fresh = now_ns, True
            self.measured = fresh
            if fresh:
                self.sway_rad = scale * observer.late.angle + observer.free.angle


class _Crane:
    """The axes of one crane, and the counter of its work."""

    def __init__(self, name: str, axes: Mapping[str, _Axis], still_deg: float) -> None:
        self._name, self._axes, self._anti_sway = name, axes, ""
        self._swinging = {name: one for name, one in axes.items() if one.model}
        turning = (name for name, one in self._swinging.items() if one.bound.config.slewing)
        self.counter = WorkCounter(next(turning, next(iter(self._swinging), "")), still_deg)
        profiles = ((name, profile_by_number(one.bound)) for name, one in axes.items())
        self._profiles = next(((name, names) for name, names in profiles if names), None)

    def part(self, rows: Mapping[str, Row]) -> tuple[str, str, str]:
        """Return (crane, profile, "on" or "off") of a tick: anti-sway of the last motion, or ""."""
        if moving := [one for one in self._swinging.values() if one.velocity]:
            off = any(one.foreign or one.state is State.BYPASS_ON for one in moving)
            self._anti_sway = "off" if off else "on"
        axis, names = self._profiles or ("", [])
        return self._name, names[rows[axis].active_set] if axis else "", self._anti_sway

    def count(self, figures: Figures, rows: Mapping[str, Row], seconds: float) -> None:
        """Add a tick of this many seconds to ``figures``."""
        joysticks, swings = {}, {}
        for name, one in self._axes.items():
            command = rows[name].command
            band = one.bound.config.command.neutral_pct / 100.0
            joysticks[name] = command if abs(command) > band else 0.0
        for name, one in self._swinging.items():  # a sensor that several axes read counts once
            sensor = one.bound.sway_sensor if one.measured else None
            swings[sensor.name if sensor else name] = one.sway_rad
        self.counter.add(
            figures,
            seconds,
            joysticks,
            {name: one.velocity * one.full_m_s for name, one in self._swinging.items()},
            math.degrees(math.hypot(*swings.values())),
            moving=any(one.velocity for one in self._axes.values()),
            measured=bool(swings) and all(one.measured for one in self._swinging.values()),
        )


class _Readers:
    """All objects that follow one log: axes and cranes, and the readers of each frame."""

    def __init__(self, deployment: Deployment) -> None:
        self.tick_ns = 1_000_000 * deployment.config.tick_ms
        axes = {n: _Axis(one, self.tick_ns / 1e9) for n, one in deployment.axes.items()}
        self.axes, self.cranes = axes, list[_Crane]()
        self.of = defaultdict[MessageKey, list[Callable[[bytes, int], object]]](list)
        for crane in cranes(deployment) or [""]:
            own = {n: axes[n] for n in axes_of(deployment, crane)} if crane else axes
            self.cranes.append(_Crane(crane, own, deployment.config.still_deg))
        sensors: dict[MessageKey, SwaySensorInput] = {}
        for axis in axes.values():
            bound = axis.bound
            self.of[bound.valve.message.key].append(axis.on_valve_frame)
            if bound.status:
                self.of[bound.status.message.key].append(axis.on_status)
            if bound.sway_sensor:
                message = bound.sway_sensor.message
                if message.key not in sensors:
                    sensors[message.key] = SwaySensorInput(message)
                    self.of[message.key].append(sensors[message.key].receive)
                axis.use_sensor(sensors[message.key])
        for motion in deployment.motions.values():
            if radius := motion.radius:
                position = PositionInput(radius)
                self.of[radius.key].append(position.receive)
                axes[motion.config.slew].radius = position.read(radius)

    def end(self) -> None:
        """End the pauses of all cranes, and add their waiting times."""
        for crane in self.cranes:
            crane.counter.end()

    def notes(self) -> Iterator[str]:
        """Yield a line for each kind of frame that the log lacks, with its substitute."""
        if computed := [name for name, one in self.axes.items() if one.valve_ns < 0]:
            yield f"no valve frames of {', '.join(computed)}: taken is what the file would send"
        if foreign := [name for name, one in self.axes.items() if one.foreign]:
            yield f"valve frames but no status of {', '.join(foreign)}: without anti-sway"
