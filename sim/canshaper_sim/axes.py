"""Names of the axes a simulated machine can have, and what their positive direction is.

A crane with tip control is commanded in cylindrical coordinates of its tip, a conventional one
joint by joint. Slewing is the same axis in both.
"""

from typing import Final

SLEW: Final = "slew"  # positive: theta1 grows, counter-clockwise from above
NEAR_FAR: Final = "near_far"  # positive: outwards
LIFT: Final = "lift"  # positive: upwards
LIFT_CYLINDER: Final = "lift_cylinder"  # joint theta2; positive: the main boom rises
KNUCKLE: Final = "knuckle"  # joint theta3; positive: the outer boom folds out
EXTENSION: Final = "extension"  # joint d4; positive: the telescope goes out
ROTATOR: Final = "rotator"  # turns the grapple about itself; positive: counter-clockwise from above

TIP_AXES: Final = (SLEW, NEAR_FAR, LIFT)
JOINT_AXES: Final = (SLEW, LIFT_CYLINDER, KNUCKLE, EXTENSION)
ALL_AXES: Final = (*TIP_AXES, *JOINT_AXES[1:])
