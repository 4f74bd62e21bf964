"""The scripted operator: built-in and random scripts by name."""

import math
import random
from collections.abc import Sequence

from canshaper.errors import DesignError, did_you_mean
from canshaper.machine.deployment import Deployment
from canshaper_sim.axes import (
    ALL_AXES,
    BRIDGE,
    EXTENSION,
    HOIST,
    KNUCKLE,
    LIFT,
    LIFT_CYLINDER,
    LUFFING,
    NEAR_FAR,
    SLEW,
    TOWER,
    TROLLEY,
    kind_of,
)
from canshaper_sim.axes import TIP_AXES as AXES
from canshaper_sim.scripts import SCRIPTS
from canshaper_sim.strokes import Script, Stroke

__all__ = ["SCRIPTS", "Script", "Stroke", "random_script", "script_for", "script_named"]


def random_script(seed: int, duration_s: float = 30.0, axes: Sequence[str] = AXES) -> Script:
    """Return a script `random-<seed>`: plateaus and reversals, neutral about 40 % of the time.

    Ramps last 0.1 .. 0.4 s, plateaus 0.4 .. 2.5 s. The same arguments always give the same script.
    Strokes that would carry the boom far away from the start pose of the default crane are reversed
    or cut short. The last second is neutral. Raises DesignError for an unknown axis.
    """
    strokes: list[Stroke] = []
    reach = reach_s(axes)
    for axis in axes:
        if axis not in ALL_AXES:
            raise DesignError(
                f"random script: axis: expected one of {', '.join(ALL_AXES)}, got {axis!r}"
            )
        # A source for each axis: its strokes do not depend on which other axes move. A string
        # seeds the same way in every Python version.
        source = random.Random(f"canshaper operator {seed} {axis}")
        strokes += _random_strokes(source, axis, duration_s - 1.0, reach[axis])
    return Script(f"random-{seed}", tuple(strokes), duration_s)


# How far from the start the strokes of an axis may add up to, in seconds of full speed, and the
# largest level. With more reach or faster slewing an unshaped grapple swings above the horizontal,
# where no operator takes it and the model ends; the default crane's stops are farther away.
REACH_S = {
    SLEW: (-math.inf, math.inf),
    NEAR_FAR: (-0.6, 1.0),
    LIFT: (-1.8, 1.8),
    LIFT_CYLINDER: (-1.6, 0.0),
    KNUCKLE: (-0.6, 1.4),
    EXTENSION: (0.0, 1.8),
    BRIDGE: (-40.0, 40.0),
    TROLLEY: (-20.0, 20.0),
    HOIST: (-6.0, 6.0),
}
# Reach of cranes that are large for their speeds.
_REACH_OF = {
    TOWER: {NEAR_FAR: (-15.0, 15.0)},
    LUFFING: {LIFT_CYLINDER: (-4.0, 4.0), EXTENSION: (-4.0, 10.0)},
}
LARGEST_LEVEL = {
    SLEW: 0.6,
    NEAR_FAR: 1.0,
    LIFT: 1.0,
    LIFT_CYLINDER: 0.7,
    KNUCKLE: 0.6,
    EXTENSION: 0.8,
    BRIDGE: 1.0,
    TROLLEY: 1.0,
    HOIST: 1.0,
}
# Share of pauses among the segments that makes the joystick neutral 40 % of the time: pauses last
# longer than strokes, and so do the rests at both ends.
_PAUSE_SHARE = 0.33


def reach_s(axes: Sequence[str]) -> dict[str, tuple[float, float]]:
    """Return axis -> (lowest, highest) sum of random strokes, s of full speed, with such axes."""
    return REACH_S | _REACH_OF.get(kind_of(axes), {})


def _random_strokes(
    source: random.Random, axis: str, end_s: float, reach_s: tuple[float, float]
) -> list[Stroke]:
    strokes: list[Stroke] = []
    low_s, high_s = reach_s
    travel_s = 0.0
    start_s = source.uniform(0.2, 1.0)
    # One ramp for all strokes up to the next pause, so that level to level is one movement.
    ramp_s = source.uniform(0.1, 0.4)
    while True:
        duration_s = source.uniform(0.4, 2.5)
        if source.random() < _PAUSE_SHARE:
            ramp_s = source.uniform(0.1, 0.4)
            start_s += duration_s + 0.4  # the joystick first needs the ramp to get to neutral
            continue
        # A fifth of the strokes is full deflection.
        level = LARGEST_LEVEL[axis] * min(1.0, source.uniform(0.25, 1.2))
        level *= source.choice((-1.0, 1.0))
        if not low_s <= travel_s + level * duration_s <= high_s:
            level = math.copysign(level, 0.5 * (low_s + high_s) - travel_s)
            if not low_s <= travel_s + level * duration_s <= high_s:
                duration_s = 0.4
        if start_s + duration_s + ramp_s > end_s:
            return strokes
        strokes.append(Stroke(axis, start_s, duration_s, level, ramp_s))
        travel_s += level * duration_s
        start_s += duration_s


def script_named(name: str, axes: Sequence[str] = AXES) -> Script:
    """Return a built-in script, or `random-<seed>` of 30 s on these axes.

    `axes` are coordinates. On the joints of a boom, `demo` and `loading` are the same work joint by
    joint; on the axes of a crane with a rope, `demo` is the one for that crane.

    Raises:
        DesignError: there is no script of that name; the message lists the names.
    """
    script = SCRIPTS.get(f"{name}-{kind_of(axes)}") or SCRIPTS.get(name)
    if script is not None:
        return script
    kind, _, seed = name.partition("-")
    if kind == "random" and seed.isdecimal():
        return random_script(int(seed), axes=axes)
    names = f"{', '.join(SCRIPTS)}, random-<seed>"
    raise DesignError(f"script: expected one of {names}, got {name!r}{did_you_mean(name, SCRIPTS)}")


def script_for(deployment: Deployment, name: str) -> Script:
    """Return a script by its name, for the axes of a deployment.

    ``pulse-NAME`` may also give the deployment's own name of an axis. For a file with a section
    ``crane`` the strokes have the deployment's names, and those of absent axes are dropped.

    Raises:
        DesignError: there is no script of that name, or it moves no axis of this crane.
    """
    moves = deployment.coordinates
    axes = deployment.by_coordinate
    pulse, _, axis = name.partition("-")
    if pulse == "pulse" and axis in moves:
        name = f"{pulse}-{moves[axis]}"
    script = script_named(name, [moved for moved in ALL_AXES if moved in axes])
    if script.strokes and not {*script.axes} & axes.keys():
        has = ", ".join(axes) or "none that a script moves; the section crane names them"
        raise DesignError(f"script {name} moves {', '.join(script.axes)}; the crane has {has}")
    return script.moving(axes) if deployment.config.crane else script
