"""One joystick: its last good frame, and the checked input that it gives an axis."""

from typing import Protocol, Self

from canshaper.codec.frame import FrameFault
from canshaper.inputs.input import GOOD, Input, Raw, Switch
from canshaper.machine.joysticks import BoundJoystick
from canshaper.shaping.states import CommandInput, Reason

_new = tuple.__new__  # CommandInput(...) in half the time


class CommandSource(Protocol):
    """Source of an axis' input: a joystick, or a measurement in its place."""

    def command(
        self, signal: str, now_ns: int, releases: int, trip: Reason | None, neutral_band: float
    ) -> tuple[CommandInput, int]:
        """Return the input of the axis, and the releases; see ``JoystickInput.command``."""


class JoystickInput(Input):
    """Receives the frames of one joystick, and gives each axis its checked input.

    Attributes:
        pressed: the enable switch to press, if it is in another message; else None.
        releases: number of frames that showed its own enable switch released, accepted or not.
        presses: how often its button for the next profile was pressed.
        commands: velocity, [-1, 1], of each signal in the last accepted frame, or why it has none.
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
        self._next_held = True  # a button that is held when first seen was not pressed
        self._released = False
        self._doubted = 0  # number of the last release in a frame that was not accepted

    def watch(self, signal: str) -> Switch:
        """Return another switch in its message, on at 1, which enables this or another joystick."""
        return self._switches.setdefault(signal, Switch(self, signal, 1))

    def on_frame(self, raw: Raw, arrived_ns: int, accepted: bool) -> FrameFault:
        """Take a frame: any can show a release of enable, only an accepted one ends it.

        Only an accepted one gives profile button and velocities; its fault is an invalid code of
        enable or of a velocity.
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
        """Count a press of the profile button, unless the first frame or one after a gap has it."""
        received_ns = self._received_ns
        if received_ns is None or arrived_ns - received_ns > self._timeout_ns:
            self._next_held = True
        self.presses += code == 1 and not self._next_held
        self._next_held = code != 0  # nor does a code that is neither on nor off end a press

    def copy_state(self, before: Self) -> None:
        """Keep enable released until an accepted frame says otherwise."""
        super().copy_state(before)
        self._released = before._released
        released = {signal: one.released for signal, one in before._switches.items()}
        for signal, switch in self._switches.items():
            switch.released = released.get(signal, False)

    def command(
        self, signal: str, now_ns: int, releases: int, trip: Reason | None, neutral_band: float
    ) -> tuple[CommandInput, int]:
        """Return the input of the axis that this signal drives, and the releases of enable so far.

        A release counts when its frame is read, however old the frame is. All else is as old as the
        arrival of its frame.

        Args:
            signal: name of the velocity signal.
            now_ns: monotonic time.
            releases: number of releases at the last tick of this axis.
            trip: a cause for neutral at once, handed through.
            neutral_band: largest |velocity|, part of full, that is neutral: it may stand still
                there forever.
        """
        pressed = self.pressed
        known = self.releases if pressed is None else pressed.releases
        now_released = self._released if pressed is None else pressed.released
        released = now_released or known > releases
        if pressed is not None and (gone := pressed.lost(now_ns)):
            # A lost switch does not enable, and its return is no press.
            return CommandInput(fault=gone, enabled=False, reset=True, trip=trip), known
        received_ns = self._received_ns
        if received_ns is None or now_ns - received_ns > self._timeout_ns:
            lost = self.lost(now_ns)
            # A release that was seen outranks the loss: neutral at once, not a shaped stop.
            released = known > releases or (
                now_released and (pressed is not None or lost is Reason.JOYSTICK_UNTRUSTED)
            )
            # The switches are not known meanwhile: one that is on at the return was not pressed.
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
        elif enable != 1:  # it is not 0 either, which is a release
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
            fault = Reason.JOYSTICK_UNTRUSTED  # it moves nothing, and its end is no press
        elif fault is None:
            return CommandInput(command, enabled=False, reset=reset, trip=trip), known
        return CommandInput(fault=fault, enabled=not released, reset=reset, trip=trip), known
