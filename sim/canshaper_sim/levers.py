"""The operator's levers as a node on CAN: a script in, joystick frames out."""

import math

from canshaper.can.codecs import Sender
from canshaper.can.deployment import Deployment
from canshaper.can.frame import Frame
from canshaper.can.inputs import BoundInput, BoundLever, BoundStop
from canshaper_sim.axes import JOINT_AXES, SLEW
from canshaper_sim.strokes import Script

# Source address of a joystick on J1939 where any will do; 0x33 to 0x38 are what makers use.
JOYSTICK_ADDRESS = 0x33


class _Message:
    """A message with its protection."""

    def __init__(self, bound: BoundInput) -> None:
        config = bound.config
        self.cycle_ms = bound.message.cycle_time or 20
        # Of J1939 from the address that is asked for.
        source = JOYSTICK_ADDRESS if bound.any_source else bound.key[1] & 0xFF
        self._sender = Sender(config.bus, bound.message, source, bound.protection)
        self._base: dict[str, int] = {}

    def frame(self, script: Script, time_s: float) -> Frame:
        """The next frame, at a time of the script."""
        return self._sender.frame({**self._base, **self.sticks(script, time_s)})

    def sticks(self, script: Script, time_s: float) -> dict[str, int]:
        """Raw values that the script moves."""
        return {}


class _Lever(_Message):
    """One joystick message."""

    def __init__(self, lever: BoundLever, deployment: Deployment, *, bypass: bool) -> None:
        super().__init__(lever)
        config = lever.config
        self._sticks = {
            name: axis.config.stick
            for name, axis in deployment.axes.items()
            if axis.config.stick.lever == lever.name
        }
        self._full = {s.name: float(s.maximum or 0.0) for s in lever.message.signals}
        # Sticks that no axis listens to stand in neutral too.
        self._base = {
            s.name: 0
            for s in lever.message.signals
            if s.maximum is not None and s.minimum is not None and s.minimum < 0 < s.maximum
        }
        self._base[config.enable] = 1
        if config.anti_sway_off:
            self._base[config.anti_sway_off] = int(bypass)

    def sticks(self, script: Script, time_s: float) -> dict[str, int]:
        """Raw values of the sticks."""
        fields, raw = self._sender.fields, {}
        for axis, stick in self._sticks.items():
            command = script.stick(axis, time_s)
            if flags := stick.flags:
                raw[flags.neutral] = int(command == 0.0)
                raw[flags.negative] = int(command < 0.0)
                raw[flags.positive] = int(command > 0.0)
                command = abs(command)
            elif stick.negative:
                back = max(-command, 0.0)
                raw[stick.negative] = fields.raw(stick.negative, self._full[stick.negative] * back)
                command = max(command, 0.0)
            raw[stick.signal] = fields.raw(stick.signal, self._full[stick.signal] * command)
        return raw


class _Stop(_Message):
    """The emergency stop, never pressed."""

    def __init__(self, stop: BoundStop) -> None:
        super().__init__(stop)
        self._base = {stop.config.signal: 0}


class LeverNode:
    """All levers of a deployment, moved by a script, with the enable switch held.

    Args:
        deployment: names the joystick messages and their switches.
        script: what the operator does.
        bypass: the operator has switched anti-sway off.

    Raises:
        ValueError: the script was made for the other kind of crane, one driven by its tip or by
            its joints. Axes that a crane merely lacks are left out.
    """

    def __init__(self, deployment: Deployment, script: Script, *, bypass: bool = False) -> None:
        joints = {*JOINT_AXES} - {SLEW}
        foreign = {*script.axes} - {*deployment.axes}
        if foreign & joints or (foreign and joints & deployment.axes.keys()):
            raise ValueError(
                f"script {script.name} moves {', '.join(script.axes)};"
                f" the deployment has {', '.join(deployment.axes)}"
            )
        self.script = script
        self._messages: list[_Message] = [
            _Lever(lever, deployment, bypass=bypass) for lever in deployment.levers.values()
        ]
        if deployment.emergency_stop:
            self._messages.append(_Stop(deployment.emergency_stop))
        self.cycle_ms = math.gcd(*(message.cycle_ms for message in self._messages))

    def frames(self, time_ms: int) -> list[Frame]:
        """Frames that are due at this time of the script."""
        return [
            message.frame(self.script, time_ms / 1000.0)
            for message in self._messages
            if time_ms % message.cycle_ms == 0
        ]

    def frames_of_tick(self, time_ms: int, tick_ms: int) -> list[Frame]:
        """Frames that came since the last tick, in order; the newest of each lever counts."""
        return [
            frame
            for ms in range(max(0, time_ms - tick_ms + 1), time_ms + 1)
            for frame in self.frames(ms)
        ]
