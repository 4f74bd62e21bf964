"""State of one joystick: its last good frame, and the input that an axis may use."""

from typing import Protocol, Self

from canshaper.codec.frame import FrameFault
from canshaper.inputs.input import GOOD, Input, Raw, Switch
from canshaper.machine.joysticks import BoundJoystick
from canshaper.shaping.states import CommandInput, Reason

_new = tuple.__new__  # CommandInput(...) in half the time


class CommandSource(Protocol):
    """Source of the joystick command of an axis."""

    def command(
        self, signal: str, now_ns: int, releases: int, trip: Reason | None, neutral_band: float
    ) -> tuple[CommandInput, int]:
        """Return the input that the axis may use now, and the releases: see ``JoystickInput``."""


class JoystickInput(Input):
    """Receives the frames of one joystick; answers what an axis may use of them at a moment.

    Attributes:
        pressed: the switch to press, where it is in another message.
        releases: number of frames that showed its own switch released, accepted or not.
        presses: how often its button for the next profile was pressed.
        commands: its velocities in the last frame that counted, or why there is none, by signal.
    """

    def __init__(self, joystick: BoundJoystick) -> None:
        super().__init__(joystick)
        config = joystick.config
        self._velocities = joystick.velocities
        self.commands: dict[str, float | Reason] = {}
        self._enable = joystick.enable
        self.pressed: Switch | None = None
        self._switches: dict[str, Switch] = {}  # others in its message, by signal
        self._reset = config.reset
        self._off = config.anti_sway_off
        self._next = config.next_profile
        self._frozen_ns = round(config.stuck_s * 1e9)
        self._changed_ns: dict[str, int] = {}
        self.releases = self.presses = 0
        self._next_held = True  # what is held when it is first seen was not pressed
        self._released = False
        self._doubted = 0  # number of the last release in a frame that does not count

    def watch(self, signal: str) -> Switch:
        """Watch another switch in its message, which enables it or another joystick."""
        return self._switches.setdefault(signal, Switch(self, signal, 1))

    def on_frame(self, raw: Raw, arrived_ns: int, accepted: bool) -> FrameFault:
        """Note when each deflection last changed; a code that is no measurement is a fault.

        Any frame can show a released enable, however short; only an accepted one ends it.
        """
        for switch in self._switches.values():
            switch.on_frame(raw, accepted)
        enable = 1 if self._enable is None else raw[self._enable]
        if enable == 0:
            self.releases += 1
            self._released = True
            if not accepted:
                self._doubted = self.releases
        elif accepted:
            self._released = False
        if not accepted:
            return GOOD
        if self._next is not None:
            self._press(raw[self._next], arrived_ns)
        valid = enable in (0, 1)
        commands = self.commands
        for velocity in self._velocities:
            name, command = velocity.name, velocity.read(raw)
            if command != commands.get(name):
                self._changed_ns[name] = arrived_ns
            commands[name] = command
            if type(command) is Reason:
                valid = False
        return GOOD if valid else FrameFault.INVALID_SIGNAL

    def _press(self, code: int, arrived_ns: int) -> None:
        """Count a press whose beginning was seen; one held after a gap does not count."""
        received_ns = self._received_ns
        if received_ns is None or arrived_ns - received_ns > self._timeout_ns:
            self._next_held = True
        self.presses += code == 1 and not self._next_held
        self._next_held = code != 0  # nor does a code that is neither on nor off end a press

    def copy_state(self, before: Self) -> None:
        """An enable that is released stays so until a frame that counts says otherwise."""
        super().copy_state(before)
        self._released = before._released
        released = {signal: one.released for signal, one in before._switches.items()}
        for signal, switch in self._switches.items():
            switch.released = released.get(signal, False)

    def command(
        self, signal: str, now_ns: int, releases: int, trip: Reason | None, neutral_band: float
    ) -> tuple[CommandInput, int]:
        """Return the input of the axis that this signal drives, and how often enable was released.

        A release counts when it is read, however long ago its frame arrived; all that has an age is
        as old as its arrival.

        Args:
            signal: name of its velocity signal.
            now_ns: monotonic time.
            releases: as they were at the last tick of this axis.
            trip: a cause for neutral at once, handed through.
            neutral_band: |joystick| up to which it counts as neutral and may stand still forever.
        """
        pressed = self.pressed
        known = self.releases if pressed is None else pressed.releases
        now_released = self._released if pressed is None else pressed.released
        released = now_released or known > releases
        if pressed is not None and (gone := pressed.lost(now_ns)):
            # Not known is not enabled; that it is known again is no press.
            return CommandInput(fault=gone, enabled=False, reset=True, trip=trip), known
        received_ns = self._received_ns
        if received_ns is None or now_ns - received_ns > self._timeout_ns:
            lost = self.lost(now_ns)
            # Seen released is more than lost: an immediate stop, not the shaped one.
            released = known > releases or (
                now_released and (pressed is not None or lost is Reason.JOYSTICK_UNTRUSTED)
            )
            # What the switches did meanwhile is not known; one that is held was not pressed.
            return CommandInput(fault=lost, enabled=not released, reset=True, trip=trip), known
        raw = self.raw
        command = self.commands[signal]
        bypass = self._off is not None and raw[self._off] == 1
        reset = self._reset is not None and raw[self._reset] == 1
        enable = 1 if self._enable is None else raw[self._enable]
        if type(command) is Reason:
            fault: Reason | None = command
        elif released:
            fault = None
        elif enable != 1:  # nor 0, which is released
            fault = Reason.SWITCH_INVALID
        elif abs(command) > neutral_band and now_ns - self._changed_ns[signal] > self._frozen_ns:
            fault = Reason.JOYSTICK_FROZEN
        else:
            return _new(CommandInput, (command, None, True, bypass, reset, trip)), known
        if pressed is None:
            doubted = enable != 0 and (self._released or self._doubted > releases)
        else:
            doubted = pressed.doubted(releases)
        if released and doubted:
            fault = Reason.JOYSTICK_UNTRUSTED  # it moves nothing, and is no press
        elif fault is None:
            return CommandInput(command, enabled=False, reset=reset, trip=trip), known
        return CommandInput(fault=fault, enabled=not released, reset=reset, trip=trip), known
