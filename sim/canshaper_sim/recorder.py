"""From the frames on the buses to a recording: what was asked, sent, and what the crane did.

Sway of an axis: slewing swings the grapple across the boom (perpendicular), near_far and the joints
lift_cylinder, knuckle and extension swing it along the boom (parallel), lift by the tip excites
none. With joint commands the three boom joints thus show the same sway, each with its own strokes.
"""

import math
from typing import Any

from canshaper.codec.frame import Frame
from canshaper.codec.identifier import NULL, with_source
from canshaper.machine.deployment import Deployment
from canshaper.machine.inputs import BoundJoystick
from canshaper.shaping.limits import without_deadband
from canshaper.shaping.states import Reason
from canshaper_sim.axes import EXTENSION, KNUCKLE, LIFT, LIFT_CYLINDER, NEAR_FAR, SLEW
from canshaper_sim.crane import CraneParameters
from canshaper_sim.recording import AxisTrace, CraneTrace, Point, Recording

# Slewing is told by both; a machine moved by its tip need not send JointVelocity.
_SPEED_SIGNALS = {
    "TipVelocity": {SLEW: "SlewRate", NEAR_FAR: "RadialSpeed", LIFT: "VerticalSpeed"},
    "JointVelocity": {
        LIFT_CYLINDER: "LiftRate",
        KNUCKLE: "KnuckleRate",
        EXTENSION: "ExtensionSpeed",
    },
}
_SWAY_SIGNAL = {
    SLEW: "SwayPerpendicular",
    NEAR_FAR: "SwayParallel",
    LIFT_CYLINDER: "SwayParallel",
    KNUCKLE: "SwayParallel",
    EXTENSION: "SwayParallel",
}


class Recorder:
    """Takes every frame; one row for each sway feedback, from the first joystick frame on."""

    def __init__(self, deployment: Deployment, parameters: CraneParameters | None = None) -> None:
        crane = parameters or CraneParameters()
        self._full = {
            SLEW: crane.slew_full_speed_rad_s,
            NEAR_FAR: crane.near_far_full_speed_m_s,
            LIFT: crane.lift_full_speed_m_s,
            LIFT_CYLINDER: crane.joints.lift_cylinder_full_speed_rad_s,
            KNUCKLE: crane.joints.knuckle_full_speed_rad_s,
            EXTENSION: crane.joints.extension_full_speed_m_s,
        }
        self._grapple = crane.grapple
        self._tip = (0.0, 0.0)  # slew angle in rad, radius in m
        self._axes = deployment.axes
        self._handlers: dict[tuple[str, int, bool], Any] = {}
        self._joysticks: dict[str, BoundJoystick] = {}
        for joystick in deployment.joysticks.values():
            self._handlers[joystick.key] = (self._joystick, joystick.message)
            self._joysticks[joystick.message.name] = joystick
        self._valves: dict[str, list[str]] = {}
        for name, axis in deployment.axes.items():
            message = axis.valve_message
            self._handlers[axis.valve.message.sender.key] = (self._valve, message)
            self._valves.setdefault(message.name, []).append(name)
        for message_name, handler in (
            ("TipVelocity", self._speed),
            ("JointVelocity", self._speed),
            ("TipPosition", self._position),
            ("GrappleSway", self._sway),
            ("ShaperStatus", self._status),
        ):
            found = deployment.messages.find(message_name)
            if not isinstance(found, str):
                message = found[1]
                for bus in deployment.config.buses:
                    key = (bus, message.frame_id, message.is_extended_frame)
                    self._handlers[key] = (handler, message)
        self._start_s: float | None = None
        self._now = {name: [0.0, 0.0, 0.0, 0.0] for name in self._axes}
        self._t_s: list[float] = []
        self._rows: dict[str, list[list[float]]] = {name: [] for name in self._axes}
        self._crane: list[tuple[Point, Point, float]] = []  # tip, grapple, total swing
        self.missed_deadlines = 0
        self.seen: set[str] = set()

    def receive(self, frame: Frame, time_s: float) -> None:
        """Take a frame seen at this time (any origin, increasing)."""
        entry = self._handlers.get(frame[:3])
        if entry is None and frame.extended:  # of J1939, from any address
            entry = self._handlers.get((frame.bus, with_source(frame.can_id, NULL), True))
        if entry is None:
            return
        handler, message = entry
        self.seen.add(message.name)
        handler(message, frame.data, time_s)

    def recording(self) -> Recording:
        """Everything so far."""
        traces = {}
        for name, rows in self._rows.items():
            columns = [list(column) for column in zip(*rows, strict=True)] or [[], [], [], []]
            joystick, sent, speed, sway = columns
            traces[name] = AxisTrace(joystick, sent, speed, sway if name in _SWAY_SIGNAL else None)
        tip, grapple, sway = (
            map(list, zip(*self._crane, strict=True)) if self._crane else ([], [], [])
        )
        return Recording(list(self._t_s), traces, CraneTrace(tip, grapple, sway))

    @staticmethod
    def _raw(message: Any, data: bytes) -> Any:
        return message.decode(data, decode_choices=False, scaling=False)

    def _joystick(self, message: Any, data: bytes, time_s: float) -> None:
        if self._start_s is None:
            self._start_s = time_s
        joystick = self._joysticks[message.name]
        _, commands = joystick.codec.decode(data)
        for name, axis in self._axes.items():
            if axis.config.command.joystick == joystick.name:
                command = commands[axis.config.command.signal]
                self._now[name][0] = 0.0 if isinstance(command, Reason) else command

    def _valve(self, message: Any, data: bytes, _time_s: float) -> None:
        raw = self._raw(message, data)
        for name in self._valves[message.name]:
            axis = self._axes[name]
            command = (axis.valve.read(raw) or 0) / axis.valve.steps
            limits = axis.config.limits.output_limits()
            self._now[name][1] = (
                limits.curve.velocity(command)
                if limits.curve
                else without_deadband(command, limits.deadband)
            )

    def _speed(self, message: Any, data: bytes, _time_s: float) -> None:
        values = message.decode(data)
        for name, signal in _SPEED_SIGNALS[message.name].items():
            if name in self._now:
                self._now[name][2] = values[signal] / self._full[name]

    def _position(self, message: Any, data: bytes, _time_s: float) -> None:
        values = message.decode(data)
        self._tip = (math.radians(values["SlewAngle"]), values["Radius"])

    def _sway(self, message: Any, data: bytes, time_s: float) -> None:
        if self._start_s is None:
            return
        values = message.decode(data)
        self._t_s.append(time_s - self._start_s)
        across, along = values["SwayPerpendicular"], values["SwayParallel"]
        heading, radius_m = self._tip
        offset = self._grapple.offset_m(math.radians(across), math.radians(along))
        tip = _from_above(heading, radius_m, 0.0)
        grapple = _from_above(heading, radius_m + offset[0], offset[1])
        self._crane.append((tip, grapple, math.hypot(across, along)))
        for name, now in self._now.items():
            now[3] = values.get(_SWAY_SIGNAL.get(name), 0.0)
            self._rows[name].append(list(now))

    def _status(self, message: Any, data: bytes, _time_s: float) -> None:
        self.missed_deadlines = int(self._raw(message, data)["MissedDeadlines"])


def _from_above(heading: float, out_m: float, across_m: float) -> Point:
    """(x, y) about the pillar of a point that far out along the boom, and in slew direction."""
    cosine, sine = math.cos(heading), math.sin(heading)
    return out_m * cosine - across_m * sine, out_m * sine + across_m * cosine
