"""Built-in operator scripts: pulses, a demonstration, loading; for tips, joints and ropes."""

from canshaper_sim.axes import (
    BRIDGE,
    EXTENSION,
    HOIST,
    KNUCKLE,
    LIFT,
    LIFT_CYLINDER,
    NEAR_FAR,
    OVERHEAD_AXES,
    SLEW,
    TROLLEY,
)
from canshaper_sim.strokes import Script, Stroke

_PULSE_RAMP_S = 0.10


def _pulse(
    axis: str, level: float = 1.0, press_s: float = 3.0, rest_s: float = 5.0, of: str = ""
) -> Script:
    # By default 3 s of deflection and 5 s of rest: the test input of the paper's section 4.
    stroke = Stroke(axis, 0.5, press_s, level, _PULSE_RAMP_S)
    return Script(f"pulse-{axis}{of}", (stroke,), 0.5 + press_s + rest_s)


# Both joysticks at once, as a person drives: out to the pile, and in over the bunk with a
# correction to the other side.
_DEMO = Script(
    "demo",
    (
        Stroke(NEAR_FAR, 0.5, 2.4, 0.8),
        Stroke(SLEW, 0.9, 2.0, 0.9),
        Stroke(LIFT, 1.4, 1.2, -0.5),
        Stroke(LIFT, 8.4, 1.6, 0.8),
        Stroke(NEAR_FAR, 9.0, 2.2, -0.7),
        Stroke(NEAR_FAR, 11.2, 0.4, 0.4),
        Stroke(SLEW, 9.3, 2.2, -0.8),
        Stroke(SLEW, 11.5, 0.5, 0.4),
    ),
    17.5,
)

_ONE_BY_ONE = Script(
    "one-by-one",
    (
        # Slewing comes first, close to the pillar: swing grows with the radius.
        Stroke(SLEW, 0.5, 3.0, 1.0),
        Stroke(NEAR_FAR, 8.0, 3.0, 1.0),
        # A piece of a loading cycle: back over the bunk, in and down, with corrections.
        Stroke(SLEW, 15.0, 1.5, -0.4),
        Stroke(NEAR_FAR, 15.3, 1.5, -0.6),
        Stroke(LIFT, 15.5, 0.5, 0.6),
        Stroke(LIFT, 16.0, 0.9, -0.8),
        Stroke(SLEW, 16.8, 0.5, -0.3),
        Stroke(SLEW, 17.3, 0.4, 0.3),
        Stroke(NEAR_FAR, 17.0, 0.5, 0.3),
        Stroke(LIFT, 17.4, 0.7, -0.4),
        Stroke(NEAR_FAR, 17.8, 0.5, -0.4),
    ),
    19.5,
)

_LOADING = Script(
    "loading",
    (
        # Out to the pile, the boom a little down on the way, a correction at the log.
        Stroke(SLEW, 0.5, 3.0, 0.6),
        Stroke(NEAR_FAR, 1.0, 2.9, 0.7),
        Stroke(LIFT, 2.5, 1.8, -0.7),
        Stroke(NEAR_FAR, 4.4, 0.6, -0.4),
        Stroke(NEAR_FAR, 5.2, 0.4, 0.3),
        Stroke(LIFT, 5.0, 0.9, -0.5),
        # Gripping: joysticks neutral. Then up, in, and back over the bunk.
        Stroke(LIFT, 8.0, 2.4, 0.9),
        Stroke(NEAR_FAR, 9.0, 2.2, -0.6),
        Stroke(SLEW, 10.0, 2.8, -0.6),
        Stroke(SLEW, 13.0, 0.4, -0.35),
        Stroke(SLEW, 13.4, 0.4, 0.25),
        # Lower the log into the bunk, a correction, release, up again.
        Stroke(LIFT, 14.0, 1.6, -0.6),
        Stroke(NEAR_FAR, 14.6, 0.5, 0.4),
        Stroke(LIFT, 17.5, 1.5, 0.8),
        # The second log lies farther out; a reversal in the middle of the slew.
        Stroke(SLEW, 18.5, 2.4, 0.6),
        Stroke(SLEW, 20.9, 0.6, -0.3),
        Stroke(NEAR_FAR, 18.8, 3.2, 0.7),
        Stroke(LIFT, 21.0, 1.6, -0.8),
        Stroke(NEAR_FAR, 22.6, 0.5, -0.3),
        Stroke(LIFT, 23.4, 0.7, -0.4),
        Stroke(LIFT, 26.0, 2.0, 1.0),
        Stroke(NEAR_FAR, 26.8, 3.0, -0.6),
        Stroke(SLEW, 27.6, 2.8, -0.5),
        Stroke(SLEW, 31.0, 0.5, -0.3),
        Stroke(LIFT, 31.4, 1.4, -0.7),
        Stroke(NEAR_FAR, 32.0, 0.6, -0.35),
        Stroke(LIFT, 34.5, 1.2, 0.8),
        Stroke(NEAR_FAR, 35.5, 0.8, 0.5),
        Stroke(SLEW, 36.5, 0.8, 0.6),
    ),
    40.0,
)

_DEMO_JOINTS = Script(
    "demo-joints",
    (
        Stroke(SLEW, 0.5, 2.6, 0.6),
        Stroke(KNUCKLE, 0.8, 2.0, 0.6),
        Stroke(LIFT_CYLINDER, 1.1, 2.0, -0.5),
        Stroke(EXTENSION, 1.6, 1.5, 0.7),
        Stroke(SLEW, 9.0, 2.2, -0.6),
        Stroke(SLEW, 11.2, 0.5, 0.3),
        Stroke(KNUCKLE, 9.2, 2.0, -0.5),
        Stroke(LIFT_CYLINDER, 9.4, 1.4, 0.5),
        Stroke(EXTENSION, 9.6, 1.6, -0.6),
        Stroke(EXTENSION, 11.2, 0.4, 0.4),
    ),
    17.5,
)

# The same work with a joystick for each joint: three of them make what near_far and lift do above.
_LOADING_JOINTS = Script(
    "loading-joints",
    (
        # Out to the pile: outer boom out, main boom down, telescope; a correction at the log.
        Stroke(SLEW, 0.5, 3.0, 0.6),
        Stroke(KNUCKLE, 1.0, 2.0, 0.6),
        Stroke(LIFT_CYLINDER, 1.4, 2.5, -0.6),
        Stroke(EXTENSION, 2.2, 1.5, 0.7),
        Stroke(KNUCKLE, 4.2, 0.5, -0.3),
        Stroke(KNUCKLE, 4.9, 0.5, 0.3),
        Stroke(LIFT_CYLINDER, 4.8, 1.2, -0.5),
        # Gripping: joysticks neutral. Then up, in, and back over the bunk.
        Stroke(LIFT_CYLINDER, 8.5, 2.0, 0.9),
        Stroke(EXTENSION, 9.2, 1.4, -0.7),
        Stroke(KNUCKLE, 9.6, 2.4, -0.6),
        Stroke(SLEW, 10.4, 2.8, -0.6),
        Stroke(SLEW, 13.4, 0.4, -0.35),
        Stroke(SLEW, 13.8, 0.4, 0.25),
        # Lower the log into the bunk, a correction, release, up again.
        Stroke(LIFT_CYLINDER, 14.4, 1.4, -0.4),
        Stroke(KNUCKLE, 15.0, 0.5, 0.3),
        Stroke(LIFT_CYLINDER, 18.0, 1.2, 0.6),
    ),
    23.0,
)

# A load over the hall: up and away with both at once, the rope shorter on the way, down at the end
# and a correction.
_DEMO_OVERHEAD = Script(
    "demo-overhead",
    (
        Stroke(HOIST, 0.5, 4.0, 1.0),
        Stroke(BRIDGE, 2.0, 8.0, 1.0),
        Stroke(TROLLEY, 3.0, 6.0, 0.8),
        Stroke(HOIST, 24.0, 4.0, -1.0),
        Stroke(BRIDGE, 25.0, 5.0, -0.7),
        Stroke(BRIDGE, 30.0, 0.6, 0.4),
        Stroke(TROLLEY, 26.0, 3.0, -1.0),
    ),
    52.0,
)

# A tower crane: a load goes round and out with both axes at once, back on a shorter rope.
_DEMO_TOWER = Script(
    "demo-tower",
    (
        Stroke(HOIST, 0.5, 6.0, 1.0),
        Stroke(SLEW, 2.0, 10.0, 1.0),
        Stroke(NEAR_FAR, 4.0, 8.0, 0.8),
        Stroke(SLEW, 34.0, 8.0, -0.8),
        Stroke(NEAR_FAR, 36.0, 6.0, -1.0),
        Stroke(SLEW, 46.0, 0.8, 0.4),
        Stroke(HOIST, 38.0, 6.0, -1.0),
    ),
    68.0,
)

# A telehandler: up, round and out, back with a correction.
_DEMO_LUFFING = Script(
    "demo-luffing",
    (
        Stroke(HOIST, 0.5, 4.0, 1.0),
        Stroke(LIFT_CYLINDER, 1.0, 4.0, 1.0),
        Stroke(SLEW, 3.0, 8.0, 1.0),
        Stroke(EXTENSION, 4.0, 6.0, 1.0),
        Stroke(SLEW, 22.0, 6.0, -1.0),
        Stroke(EXTENSION, 23.0, 5.0, -1.0),
        Stroke(SLEW, 31.0, 0.6, 0.5),
        Stroke(HOIST, 24.0, 3.0, -1.0),
    ),
    46.0,
)

# From the start pose of the default boom each joint stays clear of its stops.
_JOINT_PULSES = ((LIFT_CYLINDER, -0.6), (KNUCKLE, 0.8), (EXTENSION, 0.9))

SCRIPTS: dict[str, Script] = {
    script.name: script
    for script in (
        _pulse(NEAR_FAR),
        _pulse(SLEW),
        _DEMO,
        _ONE_BY_ONE,
        _LOADING,
        *(_pulse(axis, level) for axis, level in _JOINT_PULSES),
        _DEMO_JOINTS,
        _LOADING_JOINTS,
        *(_pulse(axis, press_s=6.0, rest_s=25.0) for axis in OVERHEAD_AXES),
        _DEMO_OVERHEAD,
        *(_pulse(axis, press_s=8.0, rest_s=25.5, of="-tower") for axis in (SLEW, NEAR_FAR)),
        _DEMO_TOWER,
        *(
            _pulse(axis, press_s=5.0, rest_s=16.5, of="-luffing")
            for axis in (SLEW, LIFT_CYLINDER, EXTENSION)
        ),
        _DEMO_LUFFING,
    )
}
