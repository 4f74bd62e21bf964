"""Names of the axes that a simulated machine can have, each with its positive direction.

A crane with tip control is commanded in cylindrical coordinates of its tip, a conventional one
joint by joint. Slewing is the same axis in both. An overhead crane moves a trolley and a rope. A
deployment may name its axes differently: its ``coordinates`` map its names to these.
"""

from collections.abc import Iterable, Mapping
from typing import Final

SLEW: Final = "slew"  # positive: theta1 grows, counter-clockwise from above
NEAR_FAR: Final = "near_far"  # positive: outwards
LIFT: Final = "lift"  # positive: upwards
LIFT_CYLINDER: Final = "lift_cylinder"  # joint theta2; positive: the main boom rises
KNUCKLE: Final = "knuckle"  # joint theta3; positive: the outer boom folds out
EXTENSION: Final = "extension"  # joint d4; positive: the telescope goes out
BRIDGE: Final = "bridge"  # positive: along the runway
TROLLEY: Final = "trolley"  # positive: along the bridge
HOIST: Final = "hoist"  # positive: upwards, the rope gets shorter
ROTATOR: Final = "rotator"  # turns the grapple about itself; positive: counter-clockwise from above

TIP_AXES: Final = (SLEW, NEAR_FAR, LIFT)
JOINT_AXES: Final = (SLEW, LIFT_CYLINDER, KNUCKLE, EXTENSION)
OVERHEAD_AXES: Final = (BRIDGE, TROLLEY, HOIST)
ALL_AXES: Final = (*TIP_AXES, *JOINT_AXES[1:], *OVERHEAD_AXES)
WITHOUT_SWAY: Final = (LIFT, HOIST)  # they excite none by themselves

# MESSAGE.SIGNAL in which the simulated crane reports the speed of an axis. JointVelocity has slew
# too, but a machine moved by its tip need not send that message.
SPEED_SIGNALS: Final = {
    SLEW: "TipVelocity.SlewRate",
    NEAR_FAR: "TipVelocity.RadialSpeed",
    LIFT: "TipVelocity.VerticalSpeed",
    LIFT_CYLINDER: "JointVelocity.LiftRate",
    KNUCKLE: "JointVelocity.KnuckleRate",
    EXTENSION: "JointVelocity.ExtensionSpeed",
    BRIDGE: "CraneVelocity.BridgeSpeed",
    TROLLEY: "CraneVelocity.TrolleySpeed",
    HOIST: "CraneVelocity.HoistSpeed",
}
# The signal of the swing that an axis excites; those of WITHOUT_SWAY have none.
SWAY_SIGNALS: Final = {
    SLEW: "GrappleSway.SwayPerpendicular",
    **dict.fromkeys((NEAR_FAR, LIFT_CYLINDER, KNUCKLE, EXTENSION), "GrappleSway.SwayParallel"),
    BRIDGE: "LoadSway.SwayBridge",
    TROLLEY: "LoadSway.SwayTrolley",
}

# Machines by what their axes move.
TIP: Final = "tip"
JOINTS: Final = "joints"
OVERHEAD: Final = "overhead"
TOWER: Final = "tower"
LUFFING: Final = "luffing"
TOWER_AXES: Final = (SLEW, NEAR_FAR, HOIST)
LUFFING_AXES: Final = (SLEW, LIFT_CYLINDER, EXTENSION, HOIST)
# Machines whose load hangs from a rope.
ON_ROPE: Final = (OVERHEAD, TOWER, LUFFING)


def reported_in(message: str, signals: Mapping[str, str]) -> dict[str, str]:
    """Return axis -> signal of those `signals` (axis -> MESSAGE.SIGNAL) that this message has."""
    pairs = ((axis, name.split(".")) for axis, name in signals.items())
    return {axis: signal for axis, (of, signal) in pairs if of == message}


def kind_of(axes: Iterable[str]) -> str:
    """Return the kind of crane whose axes move these coordinates; the first that fits counts.

    With a boom joint other than slew it is a luffing crane if it has a hoist, else driven joint by
    joint. With slew or near_far it is a tower crane if it has a hoist, else moved by its tip. With
    a bridge, trolley or hoist it is an overhead crane. Any other is moved by its tip.
    """
    moved = {*axes}
    if moved & {*JOINT_AXES} - {SLEW}:
        return LUFFING if HOIST in moved else JOINTS
    if moved & {SLEW, NEAR_FAR}:
        return TOWER if HOIST in moved else TIP
    return OVERHEAD if moved & {*OVERHEAD_AXES} else TIP
