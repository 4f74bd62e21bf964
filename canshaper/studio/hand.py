"""The levers as they are held on the page: stick positions in, joystick frames out."""

import math
from collections.abc import Mapping
from dataclasses import dataclass, field

from canshaper.can.codecs import Sender
from canshaper.can.deployment import Deployment
from canshaper.can.frame import Frame
from canshaper.can.inputs import BoundInput, BoundLever
from canshaper_sim.levers import JOYSTICK_ADDRESS


@dataclass(frozen=True)
class Held:
    """What a hand does with the levers.

    Attributes:
        sticks: position by axis, -1 .. 1; an axis that is not there stands in neutral.
        enable: the enable switch.
        reset: the reset switch.
        anti_sway: the anti-sway switch.
    """

    sticks: Mapping[str, float] = field(default_factory=dict)
    enable: bool = False
    reset: bool = False
    anti_sway: bool = True


class Hand:
    """All levers of a deployment, and its emergency stop, which is never pressed.

    Args:
        deployment: names the joystick messages and their switches.
    """

    def __init__(self, deployment: Deployment) -> None:
        self._levers = [_Lever(lever, deployment) for lever in deployment.levers.values()]
        self._stop = deployment.emergency_stop
        cycles = [lever.cycle_ms for lever in self._levers]
        if self._stop:
            self._stop_sender = _sender(self._stop)
            self._stop_cycle_ms = self._stop.message.cycle_time or 20
            cycles.append(self._stop_cycle_ms)
        self.cycle_ms = math.gcd(*cycles)

    def frames(self, time_ms: int, held: Held) -> list[Frame]:
        """Frames that are due at this multiple of ``cycle_ms``."""
        frames = [lever.frame(held) for lever in self._levers if time_ms % lever.cycle_ms == 0]
        if self._stop and time_ms % self._stop_cycle_ms == 0:
            frames.append(self._stop_sender.frame({self._stop.config.signal: 0}))
        return frames


class _Lever:
    """One joystick message."""

    def __init__(self, lever: BoundLever, deployment: Deployment) -> None:
        self.cycle_ms = lever.message.cycle_time or 20
        self._config = lever.config
        self._sender = _sender(lever)
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

    def frame(self, held: Held) -> Frame:
        """The next frame."""
        raw, fields, config = dict(self._base), self._sender.fields, self._config
        raw[config.enable] = int(held.enable)
        if config.reset:
            raw[config.reset] = int(held.reset)
        if config.anti_sway_off:
            raw[config.anti_sway_off] = int(not held.anti_sway)
        for axis, stick in self._sticks.items():
            command = held.sticks.get(axis, 0.0)
            if flags := stick.flags:
                raw[flags.neutral] = int(command == 0.0)
                raw[flags.negative] = int(command < 0.0)
                raw[flags.positive] = int(command > 0.0)
                command = abs(command)
            elif stick.negative:  # a rocker with a signal for each direction
                back = max(-command, 0.0)
                raw[stick.negative] = fields.raw(stick.negative, self._full[stick.negative] * back)
                command = max(command, 0.0)
            raw[stick.signal] = fields.raw(stick.signal, self._full[stick.signal] * command)
        return self._sender.frame(raw)


def _sender(bound: BoundInput) -> Sender:
    # Of J1939 from the address that is asked for.
    source = JOYSTICK_ADDRESS if bound.any_source else bound.key[1] & 0xFF
    return Sender(bound.config.bus, bound.message, source, bound.protection)
