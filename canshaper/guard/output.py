"""The output guard: the last look at a valve frame before the socket, by its bytes alone.

It knows nothing of how the frame was made (docs/decisions/0005-output-guard.md). A frame that moves
a valve passes only if

- no emergency stop is pressed or missing, the joystick's enable was not seen released, and no other
  switch that enables it is off or missing,
- the joystick is not silent for longer than its timeout and the longest stop,
- it is a command: no signal in it contradicts another,
- its velocity is not beyond the maximum, nor beyond what a joystick frame within the tail commanded
  in that direction, but for what falls at the valve's rate since then,
- the valve's rates lead from the last frame to this one.

Neutral always passes.
"""

from collections.abc import Sequence

from canshaper.codec.frame import Frame
from canshaper.codec.identifier import group_of
from canshaper.config.enable import Condition
from canshaper.guard.axis import BEFORE, At, GuardedAxis
from canshaper.guard.inputs import (
    NEVER,
    GuardedInput,
    GuardedJoystick,
    GuardedSwitch,
    GuardedSwitches,
)
from canshaper.machine.deployment import Deployment
from canshaper.machine.inputs import BoundInput

Key = tuple[str, int, bool]


class GuardedAxes:
    """Several axes with their commands in one valve message: each frame is looked at again."""

    span = slice(0, 0)
    part = None
    valid_until_ns = NEVER
    at = BEFORE

    def __init__(self, axes: Sequence[GuardedAxis]) -> None:
        self._axes = axes

    def moves(self, data: bytes) -> bool:
        """Whether a frame is anything but neutral."""
        return any(axis.moves(data) for axis in self._axes)

    def refusal(self, data: bytes, _part: bytes, now_ns: int, at: At) -> str:
        """Why a frame may not leave; empty where it may: see ``GuardedAxis``."""
        for axis in self._axes:
            if why := axis.refusal(data, data[axis.span], now_ns, at):
                return why
        return ""


class OutputGuard:
    """All valves of a deployment.

    Attributes:
        inputs: joysticks and emergency stop, by bus, id and format; see ``note``.
        axes: by their names.
        valves: what looks at a frame, by bus, id and format.
        at: number of this deadline, and of this tick, which does not count those missed.
    """

    def __init__(self, deployment: Deployment) -> None:
        config, bound = deployment.config, deployment.joysticks
        joysticks = {n: GuardedJoystick(one, one.enable) for n, one in bound.items()}
        inputs: list[tuple[BoundInput, GuardedInput]] = [
            (one, joysticks[name]) for name, one in bound.items()
        ]
        inputs += _switches(deployment, joysticks)
        stops = []
        if button := deployment.emergency_stop:
            message = GuardedSwitches(button)
            stops = [GuardedSwitch(button, button.config.signal, 0, "emergency-stop")]
            message.switches += stops
            inputs.append((button, message))
        self.at = BEFORE
        self._stood_still = False
        self._joysticks = list(joysticks.values())
        self.inputs: dict[Key, GuardedInput] = {}
        self._groups: dict[tuple[str, int], GuardedInput] = {}
        for one, entry in inputs:
            if one.any_source:
                self._groups[one.key[0], group_of(one.key[1])] = entry
            else:
                self.inputs |= dict.fromkeys(one.keys, entry)
        self._own = {name: bus.j1939.address for name, bus in config.buses.items() if bus.j1939}
        self.axes = _axes(deployment, joysticks, stops)
        self.valves = _valves(deployment, self.axes)

    def note(self, frame: Frame, now_ns: int) -> None:
        """Take a frame that has come in, and is none of ``inputs``."""
        if self._groups and frame[2]:
            group = self._groups.get((frame.bus, group_of(frame.can_id)))
            source = frame.can_id & 0xFF
            if group is None or source == self._own.get(frame.bus):
                return
            if not group.from_other(source, now_ns):
                group.note(frame.data, now_ns)

    def stalled(self) -> None:
        """The loop stood still: nothing that was commanded before its next tick holds."""
        self._stood_still = True

    def begin(self, missed: int) -> At:
        """A tick begins; so many deadlines were missed before it: ``at`` of it."""
        number, tick = self.at
        self.at = at = number + 1 + missed, tick + 1
        if self._stood_still:
            self._stood_still = False
            for joystick in self._joysticks:
                joystick.clear()
        return at


def _switches(
    deployment: Deployment, joysticks: dict[str, GuardedJoystick]
) -> list[tuple[BoundInput, GuardedInput]]:
    """Messages of switches; those that enable a joystick, wherever they are, are noted with it."""
    messages: list[tuple[BoundInput, GuardedInput]] = []
    switches: dict[Condition, GuardedSwitch] = {}
    for bound in deployment.switches:
        message = GuardedSwitches(bound)
        messages.append((bound, message))
        for name, (signal, on) in bound.switches.items():
            switch = switches[Condition(None, name)] = GuardedSwitch(bound, signal, on, "enable")
            message.switches.append(switch)
    for name, joystick in deployment.joysticks.items():
        for i, condition in enumerate(joystick.conditions):
            if i == 0 and joystick.enable is not None:
                continue  # it reads that itself
            if condition not in switches:
                assert condition.joystick is not None  # the others are there
                of = condition.joystick
                switch = GuardedSwitch(deployment.joysticks[of], condition.name, 1, "enable")
                switches[condition] = switch
                joysticks[of].switches.append(switch)
            joysticks[name].needed.append(switches[condition])
    return messages


def _axes(
    deployment: Deployment,
    joysticks: dict[str, GuardedJoystick],
    stops: Sequence[GuardedSwitch],
) -> dict[str, GuardedAxis]:
    axes: dict[str, GuardedAxis] = {}
    for name, bound in deployment.axes.items():
        joystick = joysticks[bound.config.command.joystick]
        axes[name] = GuardedAxis(deployment, bound, joystick, (*stops, *joystick.needed))
    for motion in (bound.config for bound in deployment.motions.values()):
        if motion.near_far is not None:
            slew, near_far = axes[motion.slew], axes[motion.near_far]
            slew.moves_with(near_far, motion.max_pct / 100.0)
            near_far.moves_with(slew, motion.max_pct / 100.0)
    return axes


def _valves(
    deployment: Deployment, axes: dict[str, GuardedAxis]
) -> dict[Key, GuardedAxis | GuardedAxes]:
    by_message: dict[Key, list[GuardedAxis]] = {}
    for name, bound in deployment.axes.items():
        by_message.setdefault(bound.valve.message.key, []).append(axes[name])
    return {
        key: GuardedAxes(several) if len(several) > 1 else several[0]
        for key, several in by_message.items()
    }
