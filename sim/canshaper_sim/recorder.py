"""From frames on the buses to a recording: demand, sent frames and motion of the crane.

Sway of an axis: slewing swings the grapple across the boom (perpendicular); near_far and the joints
lift_cylinder, knuckle and extension swing it along the boom (parallel); lift by the tip excites no
sway. With joint commands the three boom joints thus show the same sway, each with its own strokes.
Bridge and trolley swing the load in their own directions; the hoist excites no sway.
"""

import math
from collections.abc import Callable, Mapping

from canshaper.codec.frame import NULL, Frame, MessageKey, with_source
from canshaper.codec.message import FieldSet
from canshaper.machine.deployment import Deployment
from canshaper.machine.joysticks import BoundJoystick
from canshaper.machine.valves import BoundAxis
from canshaper.shaping.states import Reason
from canshaper_sim.axes import SPEED_SIGNALS, SWAY_SIGNALS, kind_of, reported_in
from canshaper_sim.crane import CraneParameters
from canshaper_sim.grapple import offset_m
from canshaper_sim.parameters import changed_parameters
from canshaper_sim.recording import DWELL_S, AxisTrace, CraneTrace, Point, Recording

_Handler = Callable[[bytes, float], None]  # data of the right length, time in s

_SWAY_OF_GRAPPLE = reported_in("GrappleSway", SWAY_SIGNALS)
_SWAY_OF_LOAD = reported_in("LoadSway", SWAY_SIGNALS)
_ACROSS_ALONG = tuple(dict.fromkeys(_SWAY_OF_GRAPPLE.values()))


def dwell_s(deployment: Deployment) -> float:
    """Return the time in s after a release from which sway counts as residual.

    It is the longest ``tail_s`` of the axes if that exceeds 5 s, else 2.5 s.
    """
    longest = max(axis.config.limits.tail_s for axis in deployment.axes.values())
    return longest if longest > 2.0 * DWELL_S else DWELL_S


class Recorder:
    """Takes every frame; keeps one row for each sway frame, from the first joystick frame on.

    Args:
        parameters: the crane's full speeds and lengths; by default those of the file.

    Attributes:
        missed_deadlines: as the last status message said.
        seen: names of the messages that came.
    """

    def __init__(self, deployment: Deployment, parameters: CraneParameters | None = None) -> None:
        crane = parameters or changed_parameters([], deployment)
        self._moves = deployment.coordinates
        self._full = crane.full_speeds(kind_of(self._moves.values()))
        self._hangs = crane.grapple.l1_m, crane.grapple.l2_m
        self._dwell_s = dwell_s(deployment)
        self._tip = (0.0, 0.0)  # slew angle in rad, radius in m
        self._hook = (0.0, 0.0, 0.0)  # bridge, trolley, rope of an overhead crane, m
        self._start_s: float | None = None
        # [joystick, sent, speed, sway] of each axis.
        self._now = {name: [0.0, 0.0, 0.0, 0.0] for name in deployment.axes}
        self._t_s: list[float] = []
        self._rows: dict[str, list[list[float]]] = {name: [] for name in deployment.axes}
        self._crane: list[tuple[Point, Point, float]] = []  # tip, grapple, total swing
        self.missed_deadlines = 0
        self.seen: set[str] = set()
        self._handlers: dict[MessageKey, tuple[str, int, _Handler]] = {}
        for joystick in deployment.joysticks.values():
            handler = self._joystick(joystick, deployment.axes)
            self._handlers[joystick.key] = joystick.message.name, joystick.message.length, handler
        valves: dict[MessageKey, dict[str, BoundAxis]] = {}
        for name, axis in deployment.axes.items():
            valves.setdefault(axis.valve.message.key, {})[name] = axis
        for key, axes in valves.items():
            message = next(iter(axes.values())).valve_message
            self._handlers[key] = message.name, message.length, self._valve(axes)
        for name, feedback in (
            ("TipVelocity", self._speed),
            ("JointVelocity", self._speed),
            ("CraneVelocity", self._speed),
            ("CranePosition", self._trolley),
            ("HookPosition", self._hook_position),
            ("LoadSway", self._load),
            ("TipPosition", self._position),
            ("GrappleSway", self._sway),
            ("ShaperStatus", self._status),
        ):
            entry = deployment.messages.find(name)
            if not isinstance(entry, str):
                message = entry[1]
                handler = feedback(FieldSet(message))
                for bus in deployment.config.buses:
                    key = (bus, message.frame_id, message.is_extended_frame)
                    self._handlers[key] = name, message.length, handler

    def receive(self, frame: Frame, time_s: float) -> None:
        """Take a frame seen at time_s (any origin, increasing); ignore one that is not recorded."""
        entry = self._handlers.get(frame[:3])
        if entry is None and frame.extended:  # a J1939 frame from any address
            entry = self._handlers.get((frame.bus, with_source(frame.can_id, NULL), True))
        if entry is None:
            return
        name, length, handler = entry
        if len(frame.data) == length:
            self.seen.add(name)
            handler(frame.data, time_s)

    def recording(self) -> Recording:
        """Return the recording of all frames taken so far."""
        traces = {}
        for name, rows in self._rows.items():
            columns = [list(column) for column in zip(*rows, strict=True)] or [[], [], [], []]
            joystick, sent, speed, sway = columns
            swings = self._moves.get(name) in SWAY_SIGNALS
            traces[name] = AxisTrace(joystick, sent, speed, sway if swings else None)
        tip, grapple, sway = (
            map(list, zip(*self._crane, strict=True)) if self._crane else ([], [], [])
        )
        crane = CraneTrace(tip, grapple, sway)
        return Recording(list(self._t_s), traces, crane, self._dwell_s)

    def _joystick(self, joystick: BoundJoystick, axes: Mapping[str, BoundAxis]) -> _Handler:
        commanded = [
            (self._now[name], axis.config.command.signal)
            for name, axis in axes.items()
            if axis.config.command.joystick == joystick.name
        ]

        def receive(data: bytes, time_s: float) -> None:
            if self._start_s is None:
                self._start_s = time_s
            _, commands = joystick.decode(data)
            for now, signal in commanded if commands else ():
                command = commands[signal]
                now[0] = 0.0 if isinstance(command, Reason) else command

        return receive

    def _valve(self, axes: Mapping[str, BoundAxis]) -> _Handler:
        driven = [
            (self._now[name], axis.valve, axis.config.limits.output_limits())
            for name, axis in axes.items()
        ]
        layout = next(iter(axes.values())).valve.message.fields.layout

        def receive(data: bytes, _time_s: float) -> None:
            raw = layout.decode(data)
            for now, valve, limits in driven:
                now[1] = limits.velocity((valve.read(raw) or 0) / valve.steps)

        return receive

    def _speed(self, fields: FieldSet) -> _Handler:
        value, signals = fields.value, reported_in(fields.message.name, SPEED_SIGNALS)
        speeds = [
            (self._now[name], signals[moved], self._full[moved])
            for name, moved in self._moves.items()
            if moved in signals
        ]

        def receive(data: bytes, _time_s: float) -> None:
            raw = fields.layout.decode(data)
            for now, signal, full in speeds:
                now[2] = value(signal, raw[signal]) / full

        return receive

    def _position(self, fields: FieldSet) -> _Handler:
        value = fields.value

        def receive(data: bytes, _time_s: float) -> None:
            raw = fields.layout.decode(data)
            heading = math.radians(value("SlewAngle", raw["SlewAngle"]))
            self._tip = heading, value("Radius", raw["Radius"])

        return receive

    def _sway(self, fields: FieldSet) -> _Handler:
        rows = [
            (self._now[name], self._rows[name], _SWAY_OF_GRAPPLE.get(self._moves.get(name, ""), ""))
            for name in self._now
        ]

        def receive(data: bytes, time_s: float) -> None:
            if self._start_s is None:
                return
            raw = fields.layout.decode(data)
            sways = {signal: fields.value(signal, raw[signal]) for signal in _ACROSS_ALONG}
            self._t_s.append(time_s - self._start_s)
            across, along = sways.values()
            heading, radius_m = self._tip
            offset = offset_m(*self._hangs, math.radians(across), math.radians(along))
            tip = _from_above(heading, radius_m, 0.0)
            grapple = _from_above(heading, radius_m + offset[0], offset[1])
            self._crane.append((tip, grapple, math.hypot(across, along)))
            for now, kept, signal in rows:
                now[3] = sways.get(signal, 0.0)
                kept.append(now.copy())

        return receive

    def _hook_position(self, fields: FieldSet) -> _Handler:
        def receive(data: bytes, _time_s: float) -> None:
            raw = fields.layout.decode(data)
            self._hangs = 0.0, fields.value("RopeLength", raw["RopeLength"])

        return receive

    def _trolley(self, fields: FieldSet) -> _Handler:
        value = fields.value

        def receive(data: bytes, _time_s: float) -> None:
            raw = fields.layout.decode(data)
            bridge, trolley, rope = (
                value(name, raw[name]) for name in ("Bridge", "Trolley", "RopeLength")
            )
            self._hook = bridge, trolley, rope

        return receive

    def _load(self, fields: FieldSet) -> _Handler:
        rows = [
            (self._now[name], self._rows[name], _SWAY_OF_LOAD.get(self._moves.get(name, ""), ""))
            for name in self._now
        ]

        def receive(data: bytes, time_s: float) -> None:
            if self._start_s is None:
                return
            raw = fields.layout.decode(data)
            sways = {s: fields.value(s, raw[s]) for s in _SWAY_OF_LOAD.values()}
            self._t_s.append(time_s - self._start_s)
            along, across = (math.tan(math.radians(angle)) for angle in sways.values())
            x, y, rope = self._hook
            tilt = math.hypot(along, across)
            down = rope / math.hypot(1.0, tilt)
            total = math.degrees(math.atan(tilt))
            self._crane.append(((x, y), (x + down * along, y + down * across), total))
            for now, kept, signal in rows:
                now[3] = sways.get(signal, 0.0)
                kept.append(now.copy())

        return receive

    def _status(self, fields: FieldSet) -> _Handler:
        def receive(data: bytes, _time_s: float) -> None:
            self.missed_deadlines = int(fields.layout.decode(data)["MissedDeadlines"])

        return receive


def _from_above(heading: float, out_m: float, across_m: float) -> Point:
    """Return (x, y) about the pillar, m, of a point given from a boom at `heading`, rad."""
    cosine, sine = math.cos(heading), math.sin(heading)
    return out_m * cosine - across_m * sine, out_m * sine + across_m * cosine
