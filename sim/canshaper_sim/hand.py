"""The operator's hand on all joysticks of a deployment: positions in, joystick frames out."""

import math
from collections.abc import Mapping
from dataclasses import dataclass, field

from canshaper.codec.frame import Frame
from canshaper.codec.message import SentMessage
from canshaper.codec.signals import full_scale
from canshaper.config.schema import EmergencyStop
from canshaper.machine.deployment import Deployment
from canshaper.machine.inputs import Bound, BoundInput
from canshaper.machine.joysticks import BoundJoystick, BoundSwitches

# Source address of a joystick on J1939 where any will do; 0x33 to 0x38 are what makers use.
JOYSTICK_ADDRESS = 0x33


@dataclass(frozen=True)
class Held:
    """What a hand holds at one instant: joystick positions and switches. Immutable.

    Attributes:
        joysticks: position by axis, -1 .. 1; an axis that is not a key is in neutral.
        enable: the enable switch is held.
        reset: the reset switch is held.
        anti_sway: the anti-sway switch is on.
        next_profile: the next-profile button, of the first joystick that has one, is held.
    """

    joysticks: Mapping[str, float] = field(default_factory=dict)
    enable: bool = False
    reset: bool = False
    anti_sway: bool = True
    next_profile: bool = False


class Hand:
    """All joysticks of a deployment, their enabling switches, and its unpressed emergency stop.

    Args:
        deployment: names the joystick messages and their switches.

    Attributes:
        cycle_ms: greatest common divisor of all cycles; frames are due only at its multiples.
        cycles_ms: cycle of each joystick message, in the order of the file.
    """

    def __init__(self, deployment: Deployment) -> None:
        joysticks = [_Joystick(one, deployment) for one in deployment.joysticks.values()]
        for behind in [one for one in joysticks if one.next_profile][1:]:
            behind.next_profile = None  # pressed on both it would be two presses
        self.cycles_ms = [one.cycle_ms for one in joysticks]
        self._messages: list[_Message] = [*joysticks]
        self._messages += [_Switches(one, deployment) for one in deployment.switches]
        if deployment.emergency_stop:
            self._messages.append(_Stop(deployment.emergency_stop))
        self.cycle_ms = math.gcd(*(message.cycle_ms for message in self._messages))

    def due(self, time_ms: int, tick_ms: int) -> range:
        """Return the times in ms, in the last tick_ms up to time_ms, at which frames may be due."""
        first_ms = (time_ms - tick_ms) // self.cycle_ms * self.cycle_ms + self.cycle_ms
        return range(max(0, first_ms), time_ms + 1, self.cycle_ms)

    def frames(self, time_ms: int, held: Held) -> list[Frame]:
        """Return the frames that are due at this time in ms; none between two cycles."""
        return [one.frame(held) for one in self._messages if time_ms % one.cycle_ms == 0]


class _Message:
    """One message that the hand sends, with alive counter and checksum where the file asks."""

    def __init__(self, bound: BoundInput) -> None:
        self.cycle_ms = bound.message.cycle_time or 20
        # A J1939 message comes from the expected address.
        source = JOYSTICK_ADDRESS if bound.any_source else bound.key[1] & 0xFF
        sent = SentMessage(bound.config.bus, bound.message, source, bound.protection)
        self._sender = sent.sender()
        self._held: Held | None = None
        self._values: dict[str, int] = {}

    def frame(self, held: Held) -> Frame:
        """Return the next frame for this state of the hand."""
        if held is not self._held:
            self._held, self._values = held, self._raw(held)
        return self._sender.frame(self._values)

    def _raw(self, held: Held) -> dict[str, int]:
        """Return the raw values of the signals that the hand moves."""
        raise NotImplementedError


class _Joystick(_Message):
    """The message of one joystick: its axes, its switches, and those that enable joysticks."""

    def __init__(self, joystick: BoundJoystick, deployment: Deployment) -> None:
        super().__init__(joystick)
        self._config = joystick.config
        self.next_profile = joystick.config.next_profile
        self._joysticks = {
            name: axis.config.command
            for name, axis in deployment.axes.items()
            if axis.config.command.joystick == joystick.name
        }
        self._enable = {
            one.name: i == 0
            for bound in deployment.joysticks.values()
            for i, one in reversed([*enumerate(bound.conditions)])
            if one.joystick == joystick.name
        }
        self._full = {s.name: full_scale(s) for s in joystick.message.signals}
        # Joysticks that no axis listens to stand in neutral too.
        self._base = {
            s.name: self._sender.fields.raw(s.name, 0.0)
            for s in joystick.message.signals
            if not s.is_float
            and (s.maximum is not None and s.minimum is not None and s.minimum < 0 < s.maximum)
        }

    def _raw(self, held: Held) -> dict[str, int]:
        raw, fields, config = dict(self._base), self._sender.fields, self._config
        for signal, pressed in self._enable.items():
            raw[signal] = int(held.enable or not pressed)
        if config.reset:
            raw[config.reset] = int(held.reset)
        if config.anti_sway_off:
            raw[config.anti_sway_off] = int(not held.anti_sway)
        if self.next_profile:
            raw[self.next_profile] = int(held.next_profile)
        for axis, joystick in self._joysticks.items():
            command = held.joysticks.get(axis, 0.0)
            if flags := joystick.flags:
                raw[flags.neutral] = int(command == 0.0)
                raw[flags.negative] = int(command < 0.0)
                raw[flags.positive] = int(command > 0.0)
                command = abs(command)
            elif joystick.negative:  # a rocker with a signal for each direction
                back = max(-command, 0.0)
                raw[joystick.negative] = fields.raw(
                    joystick.negative, self._full[joystick.negative] * back
                )
                command = max(command, 0.0)
            raw[joystick.signal] = fields.raw(
                joystick.signal, self._full[joystick.signal] * command
            )
        return raw


class _Switches(_Message):
    """Switches that enable joysticks: a joystick's first follows ``enable``, the rest are on."""

    def __init__(self, bound: BoundSwitches, deployment: Deployment) -> None:
        super().__init__(bound)
        self._on = dict(bound.switches.values())
        pressed = {one.conditions[0].name for one in deployment.joysticks.values()}
        self._pressed = {one[0] for name, one in bound.switches.items() if name in pressed}

    def _raw(self, held: Held) -> dict[str, int]:
        return {
            signal: on if held.enable or signal not in self._pressed else int(on == 0)
            for signal, on in self._on.items()
        }


class _Stop(_Message):
    """The emergency stop, never pressed."""

    def __init__(self, stop: Bound[EmergencyStop]) -> None:
        super().__init__(stop)
        self._released = {stop.config.signal: 0}

    def _raw(self, held: Held) -> dict[str, int]:
        return self._released
