"""State of one crane for the page, from its frames. No clock, no sockets."""

import math
from collections.abc import Callable, Mapping
from functools import partial
from typing import Any

from cantools.database.can import Message

from canshaper.codec.frame import NULL, Frame, MessageKey, with_source
from canshaper.codec.status import StatusCodec
from canshaper.controller.parameter_sets import profile_by_number
from canshaper.inputs.value import OWN
from canshaper.machine.deployment import Deployment
from canshaper.machine.joysticks import BoundJoystick
from canshaper.recording.channels import InputFinder
from canshaper.shaping.states import Reason
from canshaper.studio.seen import ACROSS, ALONG, AxisView, Sources, Swing, rounded, sway_of
from canshaper.studio.words import fault_words, reason_words, said, state_level, state_words
from canshaper_sim.axes import BRIDGE, SLEW, TROLLEY

SILENT_S = 0.5
"""A daemon or a crane that has sent nothing for so long, s, is shown as silent."""

_JOINTS, _TROLLEY = ("LiftAngle", "KnuckleAngle", "Extension"), ("Bridge", "Trolley", "RopeLength")
# Axes on which the predicted sway has the other sign: the load lags behind the tip.
_BEHIND = (SLEW, BRIDGE, TROLLEY)


Report = Callable[[str, str], None]
"""Takes a text and how bad that is: "info", "warn" or "bad"."""


class CraneView:
    """Takes every frame of a crane's buses and keeps the last value of each quantity.

    Args:
        deployment: names the messages and their buses.
        report: called with text and level of each event.
    """

    def __init__(self, deployment: Deployment, report: Report) -> None:
        self.deployment = deployment
        self._moves = deployment.coordinates
        self._sway_of = sway_of(self._moves)
        self._report = report
        self.axes = {name: AxisView() for name in deployment.axes}
        self._profiles = {name: profile_by_number(axis) for name, axis in deployment.axes.items()}
        self.sway_deg: tuple[float, float] | None = None
        self.pose: tuple[float, float, float] | None = None
        self.joints: tuple[float, ...] | None = None
        self.trolley: tuple[float, ...] | None = None  # along runway, bridge and rope, m
        self.sling: tuple[float, ...] | None = None  # angles below the hook, degrees
        self.rope_m: float | None = None  # from the tip to the load
        self.aim: tuple[float, float] | None = None  # slewed, degrees, and radius, m
        self.simulated = False
        self.missed = 0
        self.fault = 0
        self.late_us: int | None = None
        self._daemon_s = self._crane_s = -math.inf
        self._daemon_there = self._crane_there = False
        models = [axis.config.sway for axis in deployment.axes.values()]
        self._swing = Swing((m for m in models if m), deployment.config.still_deg)
        self._joysticks = InputFinder(deployment.config.buses, deployment.joysticks.values())
        self._handlers: dict[MessageKey, list[Any]] = {}
        self._find_messages()
        names = [_source_of(joystick) for joystick in deployment.joysticks.values()]
        for entries in self._handlers.values():
            names += [message for _, _, message in entries]
        self.sources = Sources(names)

    def _find_messages(self) -> None:
        deployment = self.deployment
        for name, axis in deployment.axes.items():
            self._on(axis.valve.message.key, self._valve, name, axis.valve_message.name)
            if axis.status and (status := axis.config.status):
                what = (name, axis.status)
                self._on(axis.status.message.key, self._axis_status, what, status.message)
        service = deployment.config.status
        if deployment.status and service:
            key = deployment.status.message.key
            self._on(key, self._service_status, deployment.status, service.message)
        for motion in deployment.motions.values():
            if motion.aim and motion.config.aim:
                self._on(motion.aim.message.key, self._aim, motion.aim, motion.config.aim.message)
        for message_name, handler in (
            ("GrappleSway", partial(self._sway, "SwayPerpendicular", "SwayParallel")),
            ("TipPosition", partial(self._measured, "pose", ("SlewAngle", "Radius", "Height"))),
            ("JointPosition", partial(self._measured, "joints", _JOINTS)),
            ("LoadSway", partial(self._sway, "SwayBridge", "SwayTrolley")),
            ("CranePosition", partial(self._measured, "trolley", _TROLLEY)),
            ("SlingSway", partial(self._measured, "sling", ("SlingBridge", "SlingTrolley"))),
            ("HookPosition", self._hook),
        ):
            entry = deployment.messages.find(message_name)
            if isinstance(entry, str):
                continue
            _, message = entry
            for bus in deployment.config.buses:
                key = (bus, message.frame_id, message.is_extended_frame)
                self._on(key, handler, message, message_name)

    def _on(self, key: MessageKey, handler: Any, what: Any, message: str) -> None:
        self._handlers.setdefault(key, []).append((handler, what, message))

    def receive(self, frame: Frame, now_s: float) -> None:
        """Take a frame, also of the page's joysticks; ignore unknown and too short ones."""
        entries = self._handlers.get(frame[:3])
        if joystick := self._joysticks.find(frame, round(now_s * 1e9)):
            entries = [*(entries or ()), (self._joystick, joystick, _source_of(joystick))]
        if entries is None and frame.extended:  # a J1939 frame from any address
            entries = self._handlers.get((frame.bus, with_source(frame.can_id, NULL), True))
        sources = set()
        for handler, what, source in entries or ():
            try:
                handler(what, frame.data, now_s)
            except Exception:  # a frame shorter than its message: cantools has no base class
                continue
            sources.add(source)
        for source in sources:
            self.sources.on_frame(source, now_s)

    def simulate(
        self,
        pose: tuple[float, float, float],
        joints: tuple[float, ...] | None,
        sway_deg: tuple[float, float],
        now_s: float,
    ) -> None:
        """Take pose (slew, radius, height), joints, sway; degrees, m. They count as unmeasured."""
        self.simulated = True
        self.pose, self.joints = pose, joints
        self._sway_at(sway_deg, now_s)

    def report_lateness(self, late_us: int) -> None:
        """Take the daemon's lateness in the last second, us, as its service manager gets it."""
        self.late_us = late_us

    def check(self, now_s: float) -> None:
        """Report that the crane falls silent, or that the daemon falls silent or is back.

        Forget what a silent crane, daemon or joystick has sent last: sway, axes, positions.
        """
        for joystick in self.deployment.joysticks.values():
            age_s = self.sources.age_s(_source_of(joystick), now_s)
            if age_s is None or age_s >= SILENT_S:
                self._joystick_at(joystick.name, {})
        if self.crane_there(now_s) is not self._crane_there:
            self._crane_there = not self._crane_there
            if not self._crane_there:
                self._report(said("nocrane"), "bad")
                self.sway_deg = None
                self._swing.invalidate()
        there = self.daemon_there(now_s)
        if there is not self._daemon_there:
            self._daemon_there = there
            if there:
                self._report(said("daemon"), "info")
            else:
                self._report(said("nodaemon"), "bad")
                self.late_us = None
                for axis in self.axes.values():
                    axis.state = axis.reason = axis.valve = axis.profile = None

    @property
    def received_any(self) -> bool:
        """True if ``daemon_there`` or ``crane_there`` has ever been true."""
        return max(self._daemon_s, self._crane_s) > -math.inf

    def daemon_there(self, now_s: float) -> bool:
        """Return whether the daemon has sent a valve or status frame in the last ``SILENT_S``."""
        return now_s - self._daemon_s < SILENT_S

    def crane_there(self, now_s: float) -> bool:
        """Return whether the crane has sent pose, joints or sway in the last ``SILENT_S``."""
        return now_s - self._crane_s < SILENT_S

    def values(self, now_s: float) -> dict[str, Any]:
        """Return everything that the page shows of the crane, by name; None for what is unknown."""
        still_s, swings = self._swing.still_s(now_s)
        return {
            "daemon": self.daemon_there(now_s),
            "crane": self.crane_there(now_s),
            "pose": self.pose,
            "joints": self.joints,
            "trolley": self.trolley,
            "sling": self.sling,
            "rope": self.rope_m,
            "aim": self.aim if self.daemon_there(now_s) else None,
            "sway": self.sway_deg or self._predicted(),
            "measured": self.sway_deg is not None and not self.simulated,
            "simulated": self.simulated,
            "swing": rounded(self._swing.largest_deg(now_s), 2),
            "still": rounded(still_s, 1),
            "swings": swings,
            "missed": self.missed,
            "fault": fault_words(self.fault),
            "late_us": self.late_us,
            "axes": {name: axis.values() for name, axis in self.axes.items()},
            "sources": self.sources.values(now_s),
        }

    def _predicted(self) -> tuple[float, float] | None:
        """Return the predicted sway (across, along), degrees; None if no axis has a prediction."""
        predicted = {ACROSS: 0.0, ALONG: 0.0}
        known = False
        for name, axis in self.axes.items():
            if axis.predicted_deg is not None and name in self._sway_of:
                predicted[self._sway_of[name]] += axis.predicted_deg
                known = True
        return (predicted[ACROSS], predicted[ALONG]) if known else None

    # -- messages ------------------------------------------------------------------------------

    def _joystick(self, joystick: BoundJoystick, data: bytes, now_s: float) -> None:
        _, commands = joystick.decode(data)
        if commands:  # none in other frames of a multiplexed message
            self._joystick_at(joystick.name, commands)
        axes = self.deployment.axes.items()
        bands = ((self.axes[n].joystick, a.config.command.neutral_pct / 100.0) for n, a in axes)
        moved = any(abs(at or 0.0) > band for at, band in bands)
        self._swing.move(now_s, moved=moved, drives=any(a.valve for a in self.axes.values()))

    def _joystick_at(self, joystick: str, commands: Mapping[str, float | Reason]) -> None:
        """Keep a joystick's demand (by signal) for its axes; an invalid or missing one is None."""
        for name, axis in self.deployment.axes.items():
            if axis.config.command.joystick == joystick:
                command = commands.get(axis.config.command.signal)
                self.axes[name].joystick = None if isinstance(command, Reason) else command

    def _valve(self, name: str, data: bytes, now_s: float) -> None:
        axis = self.deployment.axes[name]
        raw: Any = axis.valve_message.decode(data, decode_choices=False, scaling=False)
        command = (axis.valve.read(raw) or 0) / axis.valve.steps
        self.axes[name].opening = command
        self.axes[name].valve = axis.config.limits.output_limits().velocity(command)
        self._daemon_s = now_s

    def _axis_status(self, what: tuple[str, StatusCodec[Any]], data: bytes, now_s: float) -> None:
        name, codec = what
        if (values := codec.decode(data)) is None:
            return
        view, state, reason = self.axes[name], int(values["State"]), int(values["Reason"])
        sign = -1.0 if self._moves.get(name) in _BEHIND else 1.0
        view.predicted_deg = sign * values["PredictedSway"]
        if self.sway_deg is None and (predicted := self._predicted()):
            self._swing.add(predicted, now_s)
        if view.state is not None and (state, reason) != (view.state, view.reason):
            level = {"bad": "bad", "stop": "warn"}.get(state_level(state), "info")
            words = {"state": state_words(state), "reason": reason_words(reason)}
            self._report(said("axis", axis=name, **words), level)
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
            self._report(said("fault", fault=fault_words(fault)), "warn")
        self.fault, self.missed = fault, int(values["MissedDeadlines"])
        self._daemon_s = now_s

    def _aim(self, codec: StatusCodec[Any], data: bytes, _now_s: float) -> None:
        if (values := codec.decode(data)) is not None:
            self.aim = None
            if values["AimKnown"] and self.pose:
                self.aim = self.pose[0] + values["AimSlew"], self.pose[1] + values["AimReach"]

    def _sway(self, across: str, along: str, message: Message, data: bytes, now_s: float) -> None:
        values: Any = message.decode(data)
        self._sway_at((float(values[across]), float(values[along])), now_s)

    def _sway_at(self, sway_deg: tuple[float, float], now_s: float) -> None:
        self.sway_deg = sway_deg
        self._swing.add(sway_deg, now_s)
        self._crane_s = now_s

    def _measured(
        self, what: str, signals: tuple[str, ...], message: Message, data: bytes, now_s: float
    ) -> None:
        values: Any = message.decode(data)
        setattr(self, what, tuple(float(values[name]) for name in signals))
        self._crane_s = now_s

    def _hook(self, message: Message, data: bytes, _now_s: float) -> None:
        values: Any = message.decode(data)
        self.rope_m = float(values["RopeLength"])


def _source_of(joystick: BoundJoystick) -> str:
    return f"joystick {joystick.name}"
