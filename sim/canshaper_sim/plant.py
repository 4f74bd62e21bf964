"""The crane as a node on CAN: valve frames in, feedback frames out. No clock, no sockets."""

import math
from collections.abc import Mapping

from canshaper.can.binding import Deployment
from canshaper.can.codecs import Sender, ValveCodec
from canshaper.can.frame import Frame
from canshaper.can.signals import find_signal
from canshaper.config.source import DeploymentError, Problem
from canshaper_sim.crane import AXES, Crane, CraneParameters

# Feedback messages and their signals, in the order they are sent; they close with the sway.
FEEDBACK: Mapping[str, tuple[str, ...]] = {
    "TipPosition": ("SlewAngle", "Radius", "Height"),
    "TipVelocity": ("SlewRate", "RadialSpeed", "VerticalSpeed"),
    "GrappleSway": ("SwayPerpendicular", "SwayParallel"),
}
# A valve that hears nothing for this long closes; makers give 100 to 300 ms.
VALVE_TIMEOUT_S = 0.2


class _ValveInput:
    """Commands for one valve, and how old the last one is."""

    def __init__(self, axis: str, deployment: Deployment) -> None:
        bound = deployment.axes[axis]
        self.axis = axis
        self._message = bound.valve_message
        self._codec: ValveCodec = bound.valve
        self._signal = bound.config.valve.signal
        self.command = 0.0
        self.age_s = 0.0

    def receive(self, data: bytes) -> None:
        """Take a command; what is none (wrong length, no velocity) closes the valve."""
        self.age_s = 0.0
        self.command = 0.0
        if len(data) == self._message.length:
            raw = self._message.decode(data, decode_choices=False, scaling=False)
            steps = self._codec.velocity_steps(int(raw[self._signal]))  # type: ignore
            if abs(steps) <= self._codec.steps:
                self.command = steps / self._codec.steps


class PlantNode:
    """Valves, crane and grapple behind the valve messages of a deployment.

    Raises:
        DeploymentError: an axis that this crane does not have, or no feedback messages in the
            DBC files.
    """

    def __init__(self, deployment: Deployment, parameters: CraneParameters | None = None) -> None:
        unknown = [name for name in deployment.axes if name not in AXES]
        problems = [
            Problem(str(deployment.path), None, f"axes.{name}", f"the crane has {', '.join(AXES)}")
            for name in unknown
        ]
        bus = next(iter(deployment.axes.values())).config.valve.bus
        self._senders: dict[str, Sender] = {}
        for name, signals in FEEDBACK.items():
            found = deployment.messages.find(name)
            if isinstance(found, str):
                problems.append(Problem(str(deployment.path), None, "dbc", found))
            elif missing := [s for s in signals if not find_signal(found[1], s)]:
                problems.append(found[0].problem(found[1], f"lacks {', '.join(missing)}"))
            else:
                self._senders[name] = Sender(bus, found[1])
        if problems:
            raise DeploymentError(problems)
        self.crane = Crane(parameters)
        inputs = [_ValveInput(name, deployment) for name in deployment.axes]
        self._valves = {
            (
                deployment.axes[v.axis].config.valve.bus,
                deployment.axes[v.axis].valve_message.frame_id,
            ): v
            for v in inputs
        }

    def receive(self, frame: Frame) -> None:
        """Take a frame from a bus; those that are no valve commands are passed over."""
        valve = self._valves.get((frame.bus, frame.can_id))
        if valve is not None:
            valve.receive(frame.data)

    def advance(self, dt_s: float) -> None:
        """Let time pass with the last commands held, as long as the valves hold them."""
        commands = {}
        for valve in self._valves.values():
            if valve.age_s >= VALVE_TIMEOUT_S:
                valve.command = 0.0
            valve.age_s += dt_s
            commands[valve.axis] = valve.command
        self.crane.step(dt_s, commands)

    def feedback(self) -> list[Frame]:
        """Pose, speeds and sway as frames."""
        state = self.crane.state
        slew_deg = math.degrees(math.remainder(state.theta1_rad, 2.0 * math.pi))
        values = {
            "TipPosition": (slew_deg, state.radius_m, state.height_m),
            "TipVelocity": (state.theta1_rate_rad_s, state.radius_rate_m_s, state.height_rate_m_s),
            "GrappleSway": (math.degrees(state.theta5_rad), math.degrees(state.theta6_rad)),
        }
        frames = []
        for name, signals in FEEDBACK.items():
            sender = self._senders[name]
            raw = {s: sender.fields.raw(s, v) for s, v in zip(signals, values[name], strict=True)}
            frames.append(sender.frame(raw))
        return frames
