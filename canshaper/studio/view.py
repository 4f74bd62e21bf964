"""From the frames of one crane to what the page shows of it. No clock, no sockets."""

import math
from collections import deque
from collections.abc import Callable
from dataclasses import dataclass
from typing import Any

from cantools.database.can import Message

from canshaper.codec.frame import Frame
from canshaper.codec.identifier import NULL, with_source
from canshaper.codec.status import StatusCodec
from canshaper.controller.finder import InputFinder
from canshaper.controller.sets import profile_by_number
from canshaper.inputs.profile import OWN
from canshaper.machine.deployment import Deployment
from canshaper.machine.inputs import BoundJoystick
from canshaper.shaping.limits import without_deadband
from canshaper.shaping.states import MOVING, Reason, State
from canshaper.studio.words import fault_words, reason_words, state_words
from canshaper_sim.axes import EXTENSION, KNUCKLE, LIFT_CYLINDER, NEAR_FAR, SLEW

SILENT_S = 0.5
"""A daemon or a crane that has sent nothing for so long is shown as silent."""
LEAST_SWING_S = 1.0
"""Shortest time over which the largest sway counts as the swing."""

ACROSS, ALONG = "across", "along"
SWAY_OF = {
    SLEW: ACROSS,
    NEAR_FAR: ALONG,
    LIFT_CYLINDER: ALONG,
    KNUCKLE: ALONG,
    EXTENSION: ALONG,
}
"""Which swing an axis excites, across the boom or along it."""

Report = Callable[[str, str], None]
"""Takes a text and how bad that is: "info", "warn" or "bad"."""


@dataclass
class AxisView:
    """What is known of an axis; fractions of full, degrees."""

    joystick: float | None = None
    valve: float | None = None
    state: int | None = None
    reason: int | None = None
    predicted_deg: float | None = None
    profile: str | None = None


class CraneView:
    """Takes every frame of a bus and keeps the last value of everything.

    Args:
        deployment: names the messages.
        report: called with what is an event.
    """

    def __init__(self, deployment: Deployment, report: Report) -> None:
        self._deployment = deployment
        self._report = report
        self.axes = {name: AxisView() for name in deployment.axes}
        self._profiles = {name: profile_by_number(axis) for name, axis in deployment.axes.items()}
        self.sway_deg: tuple[float, float] | None = None
        self.pose: tuple[float, float, float] | None = None
        self.joints: tuple[float, ...] | None = None
        self.missed = 0
        self.fault = 0
        self.late_us: int | None = None
        self._daemon_s = self._crane_s = -math.inf
        self._daemon_there = self._crane_there = False
        self._swings: deque[tuple[float, float]] = deque()
        modes = [axis.config.sway.mode() for axis in deployment.axes.values() if axis.config.sway]
        periods = [2.0 * math.pi / mode.omega_rad_s for mode in modes]
        self._swing_s = max([LEAST_SWING_S, *periods])
        self._joysticks = InputFinder(deployment.config.buses, deployment.joysticks.values())
        self._handlers: dict[tuple[str, int, bool], list[Any]] = {}
        self._find_messages()

    def _find_messages(self) -> None:
        deployment = self._deployment
        for name, axis in deployment.axes.items():
            self._on(axis.valve.message.sender.key, self._valve, name)
            if axis.status:
                self._on(axis.status.sender.key, self._axis_status, (name, axis.status))
        if deployment.status:
            self._on(deployment.status.sender.key, self._service_status, deployment.status)
        for message_name, handler in (
            ("GrappleSway", self._sway),
            ("TipPosition", self._position),
            ("JointPosition", self._joints),
        ):
            message = self._message(message_name)
            if message is not None:
                for bus in deployment.config.buses:
                    key = (bus, message.frame_id, message.is_extended_frame)
                    self._on(key, handler, message)

    def _message(self, name: str) -> Message | None:
        found = self._deployment.messages.find(name)
        return None if isinstance(found, str) else found[1]

    def _on(self, key: tuple[str, int, bool], handler: Any, what: Any) -> None:
        self._handlers.setdefault(key, []).append((handler, what))

    def receive(self, frame: Frame, now_s: float) -> None:
        """Take a frame, one that the page's joysticks sent too; what is none of ours is passed."""
        entries = self._handlers.get(frame[:3])
        if joystick := self._joysticks.find(frame, round(now_s * 1e9)):
            entries = [*(entries or ()), (self._joystick, joystick)]
        if entries is None and frame.extended:  # of J1939, from any address
            entries = self._handlers.get((frame.bus, with_source(frame.can_id, NULL), True))
        for handler, what in entries or ():
            try:
                handler(what, frame.data, now_s)
            except Exception:  # a frame shorter than its message: cantools has no base class
                continue

    def report_lateness(self, late_us: int) -> None:
        """Take what the daemon tells its service manager: how late it was in the last second."""
        self.late_us = late_us

    def check(self, now_s: float) -> None:
        """Report when the daemon or the crane falls silent, and when it is back."""
        if self.crane_there(now_s) is not self._crane_there:
            self._crane_there = not self._crane_there
            if not self._crane_there:
                self._report("the crane is silent; its pose is the last one", "bad")
                self.sway_deg = None
                self._swings.clear()
        there = self.daemon_there(now_s)
        if there is not self._daemon_there:
            self._daemon_there = there
            if there:
                self._report("the daemon is at work", "info")
            else:
                self._report("the daemon is silent; valves close by their own timeout", "bad")
                self.late_us = None
                for axis in self.axes.values():
                    axis.state = axis.reason = axis.valve = axis.profile = None

    def daemon_there(self, now_s: float) -> bool:
        """Whether the daemon has been heard lately."""
        return now_s - self._daemon_s < SILENT_S

    def crane_there(self, now_s: float) -> bool:
        """Whether the crane's own messages have been heard lately."""
        return now_s - self._crane_s < SILENT_S

    def swing_deg(self, now_s: float) -> float | None:
        """Largest sway, in any direction, of the last full swing; None before there is any."""
        while self._swings and self._swings[0][0] < now_s - self._swing_s:
            self._swings.popleft()
        return max((swing for _, swing in self._swings), default=None)

    def values(self, now_s: float) -> dict[str, Any]:
        """Everything for the page."""
        axes = {}
        for name, a in self.axes.items():
            axes[name] = {
                "joystick": _rounded(a.joystick),
                "valve": _rounded(a.valve),
                "predicted": _rounded(a.predicted_deg, 2),
                "state": None if a.state is None else state_words(a.state),
                "level": _level(a.state),
                "reason": None if a.reason is None else reason_words(a.reason),
                "profile": a.profile,
            }
        return {
            "daemon": self.daemon_there(now_s),
            "crane": self.crane_there(now_s),
            "pose": self.pose,
            "joints": self.joints,
            "sway": self.sway_deg or self._predicted(),
            "measured": self.sway_deg is not None,
            "swing": _rounded(self.swing_deg(now_s), 2),
            "missed": self.missed,
            "fault": fault_words(self.fault),
            "late_us": self.late_us,
            "axes": axes,
        }

    def _predicted(self) -> tuple[float, float] | None:
        """Sway that the daemon predicts, where none is measured."""
        found = {ACROSS: 0.0, ALONG: 0.0}
        known = False
        for name, axis in self.axes.items():
            if axis.predicted_deg is not None and name in SWAY_OF:
                found[SWAY_OF[name]] += axis.predicted_deg
                known = True
        return (found[ACROSS], found[ALONG]) if known else None

    # -- messages ------------------------------------------------------------------------------

    def _joystick(self, joystick: BoundJoystick, data: bytes, _now_s: float) -> None:
        _, commands = joystick.codec.decode(data)
        for name, axis in self._deployment.axes.items():
            if axis.config.command.joystick == joystick.name:
                command = commands[axis.config.command.signal]
                self.axes[name].joystick = None if isinstance(command, Reason) else command

    def _valve(self, name: str, data: bytes, now_s: float) -> None:
        axis = self._deployment.axes[name]
        raw = _raw(axis.valve_message, data)
        command = (axis.valve.read(raw) or 0) / axis.valve.steps
        limits = axis.config.limits.output_limits()
        curve = limits.curve
        self.axes[name].valve = (
            curve.velocity(command) if curve else without_deadband(command, limits.deadband)
        )
        self._daemon_s = now_s

    def _axis_status(self, what: tuple[str, StatusCodec[Any]], data: bytes, now_s: float) -> None:
        name, codec = what
        if (values := codec.decode(data)) is None:
            return
        view, state, reason = self.axes[name], int(values["State"]), int(values["Reason"])
        # The model lags behind the tip; across the boom that is the negative direction.
        sign = -1.0 if SWAY_OF.get(name) == ACROSS else 1.0
        view.predicted_deg = sign * values["PredictedSway"]
        if self.sway_deg is None and (predicted := self._predicted()):
            self._swings.append((now_s, math.hypot(*predicted)))
        if view.state is not None and (state, reason) != (view.state, view.reason):
            level = {"bad": "bad", "stop": "warn"}.get(_level(state), "info")
            self._report(f"{name}: {state_words(state)} — {reason_words(reason)}", level)
        view.state, view.reason = state, reason
        view.profile = self._profile(name, values.get("ActiveSet"))
        self._daemon_s = now_s

    def _profile(self, name: str, number: float | None) -> str | None:
        names = self._profiles[name]
        if number is None or not 0 <= number < len(names):
            return None
        return names[int(number)] or OWN

    def _service_status(self, codec: StatusCodec[Any], data: bytes, now_s: float) -> None:
        if (values := codec.decode(data)) is None:
            return
        fault = int(values["LastFault"])
        if fault not in (self.fault, 0):
            self._report(f"fault: {fault_words(fault)}", "warn")
        self.fault, self.missed = fault, int(values["MissedDeadlines"])
        self._daemon_s = now_s

    def _sway(self, message: Message, data: bytes, now_s: float) -> None:
        values: Any = message.decode(data)
        self.sway_deg = (float(values["SwayPerpendicular"]), float(values["SwayParallel"]))
        self._swings.append((now_s, math.hypot(*self.sway_deg)))
        self._crane_s = now_s

    def _position(self, message: Message, data: bytes, now_s: float) -> None:
        values: Any = message.decode(data)
        angle, radius, height = (float(values[n]) for n in ("SlewAngle", "Radius", "Height"))
        self.pose = (angle, radius, height)
        self._crane_s = now_s

    def _joints(self, message: Message, data: bytes, now_s: float) -> None:
        values: Any = message.decode(data)
        self.joints = tuple(float(values[n]) for n in ("LiftAngle", "KnuckleAngle", "Extension"))
        self._crane_s = now_s


def _raw(message: Message, data: bytes) -> Any:
    return message.decode(data, decode_choices=False, scaling=False)


def _level(state: int | None) -> str:
    """How a state is shown: off, wait, ready, move, stop or bad."""
    if state == State.TRIPPED:
        return "bad"
    if state == State.STOPPING:
        return "stop"
    if state in MOVING:
        return "move"
    return "off" if state is None else ("ready" if state == State.READY else "wait")


def _rounded(value: float | None, digits: int = 4) -> float | None:
    return None if value is None else round(value, digits)
