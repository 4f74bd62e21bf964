"""The machines a plant can be: the axes of their valves, and how the valves move the crane.

- ``tip``: one valve for each tip coordinate; no joints: the tip follows its valves exactly.
- ``tip-controller``: tip commands go to the machine's tip controller, which drives the joints.
- ``joints``: one valve for each joint; the operator drives the joints.
- ``overhead``: bridge, trolley and hoist, one drive each; the load hangs from a rope.
- ``tower``: slew, trolley and hoist, one drive each; the load hangs from a rope.
- ``luffing``: slew, luffing, telescope and hoist, one valve each; the load hangs from a rope.
"""

import math
from collections.abc import Iterable, Mapping
from typing import Final, Protocol

from canshaper.errors import DesignError
from canshaper_sim.axes import (
    JOINT_AXES,
    JOINTS,
    LUFFING,
    LUFFING_AXES,
    ON_ROPE,
    OVERHEAD,
    OVERHEAD_AXES,
    ROTATOR,
    TIP,
    TIP_AXES,
    TOWER,
    TOWER_AXES,
    kind_of,
)
from canshaper_sim.crane import Crane, CraneParameters, RopeCrane, joint_crane
from canshaper_sim.grapple import Sway
from canshaper_sim.joints import JointBoom
from canshaper_sim.tip_controller import TipController

TIP_CONTROLLER: Final = "tip-controller"
AXES_OF: Final[Mapping[str, tuple[str, ...]]] = {
    TIP: TIP_AXES,
    TIP_CONTROLLER: TIP_AXES,
    JOINTS: JOINT_AXES,
    OVERHEAD: OVERHEAD_AXES,
    TOWER: TOWER_AXES,
    LUFFING: LUFFING_AXES,
}
MACHINES: Final = tuple(AXES_OF)

# Instants nearer than this are the same: rounding of summed steps.
_SAME_TIME_S = 1e-9


class Machine(Protocol):
    """A crane with everything behind its valve frames: a tip controller if any, valves, boom."""

    @property
    def crane(self) -> Crane:
        """Crane and grapple."""

    def step(self, dt_s: float, commands: Mapping[str, float]) -> None:
        """Hold the commands (axis -> value of its valve frame, -1 .. 1) for dt_s seconds.

        An axis that is not in `commands` keeps its last command.
        """


class ValveDrivenCrane:
    """A crane whose valves take the commands directly, without a tip controller."""

    def __init__(self, crane: Crane) -> None:
        self.crane = crane

    def step(self, dt_s: float, commands: Mapping[str, float]) -> None:
        """Hold the commands for dt_s seconds (see `Crane.step`)."""
        self.crane.step(dt_s, commands)


class TipControlledCrane:
    """A crane driven joint by joint, with a tip controller before its valves."""

    def __init__(self, parameters: CraneParameters | None = None, sway: Sway | None = None) -> None:
        self.crane = joint_crane(parameters, sway)
        boom = self.crane.boom
        assert isinstance(boom, JointBoom)
        self._boom = boom
        p = self.crane.parameters
        self._controller = TipController(
            p.tip_controller,
            p.joints,
            (p.slew_full_speed_rad_s, p.near_far_full_speed_m_s, p.lift_full_speed_m_s),
        )
        self._commands = dict.fromkeys(TIP_AXES, 0.0)
        self._joint_commands: dict[str, float] = {}
        self._to_tick_s = 0.0

    def step(self, dt_s: float, commands: Mapping[str, float]) -> None:
        """Hold the tip commands for dt_s seconds; the tip controller ticks at its own period.

        An axis not in `commands` keeps its last command. ``rotator`` bypasses the controller.
        Raises DesignError for an unknown axis, ValueError for dt_s <= 0 or a command not finite.
        """
        if not 0.0 < dt_s < math.inf:
            raise ValueError(f"crane: dt_s: expected a positive value, got {dt_s}")
        for name, command in commands.items():
            if name not in (*self._commands, ROTATOR):
                raise DesignError(
                    f"crane: axis: expected one of {', '.join(TIP_AXES)}, got {name!r}"
                )
            if not math.isfinite(command):
                raise ValueError(f"tip controller: command: expected a finite value, got {command}")
            self._commands[name] = command
        rest_s = dt_s
        while rest_s > _SAME_TIME_S:
            if self._to_tick_s <= _SAME_TIME_S:
                self._joint_commands = self._controller.tick(self._commands, self._boom.joints)
                if ROTATOR in self._commands:  # past the controller
                    self._joint_commands[ROTATOR] = self._commands[ROTATOR]
                self._to_tick_s += self._controller.period_s
            part_s = min(rest_s, self._to_tick_s)
            self.crane.step(part_s, self._joint_commands)
            rest_s -= part_s
            self._to_tick_s -= part_s


def build_machine(
    name: str, parameters: CraneParameters | None = None, sway: Sway | None = None
) -> Machine:
    """Return the machine of that name in its start pose, its grapple with this initial sway.

    Raises:
        DesignError: no such machine, or a joint would start outside its range.
        ValueError: the joints do not reach the start pose.
    """
    if name == TIP:
        return ValveDrivenCrane(Crane(parameters, sway))
    if name == TIP_CONTROLLER:
        return TipControlledCrane(parameters, sway)
    if name == JOINTS:
        return ValveDrivenCrane(joint_crane(parameters, sway))
    if name in ON_ROPE:
        return ValveDrivenCrane(RopeCrane(parameters, sway, name))
    raise DesignError(f"machine: expected one of {', '.join(MACHINES)}, got {name!r}")


def machine_for(axes: Iterable[str], requested: str | None = None) -> str:
    """Return the name of the machine for a deployment whose axes move these coordinates.

    `requested` may name the machine; without it ``kind_of`` derives the machine from the axes.

    Raises:
        DesignError: no machine has the requested name.
    """
    if requested is None:
        return kind_of(axes)
    if requested not in AXES_OF:
        raise DesignError(f"machine: expected one of {', '.join(MACHINES)}, got {requested!r}")
    return requested
