"""A recorded drive: the operator's demand, the sent valve frames, and the motion of the crane."""

from dataclasses import dataclass
from typing import Final

DWELL_S: Final = 2.5  # the slowest shapers have stopped the crane by then (stop 2.4 s)
Point = tuple[float, float]  # from above, (x, y) about the pillar, m


@dataclass(frozen=True)
class AxisTrace:
    """One axis over a drive; every list is as long as the recording's ``t_s``.

    Attributes:
        joystick: demand of the operator, [-1, 1] of full speed.
        sent: velocity setpoint in the valve frame (deadband compensation undone), [-1, 1].
        speed: speed of what the axis moves (tip, joint, trolley), fraction of its full speed.
        sway_deg: swing of the grapple in the plane of this axis (slew: theta5, near-far: theta6),
            degrees; None for an axis that excites no swing (lift).
    """

    joystick: list[float]
    sent: list[float]
    speed: list[float]
    sway_deg: list[float] | None


@dataclass(frozen=True)
class CraneTrace:
    """Tip and grapple over a drive; every non-empty list is as long as the recording's ``t_s``.

    Attributes:
        tip_m: tip of the boom from above, m; x points along the boom that has not slewed. Of an
            overhead crane the trolley, x along the runway. Empty if no sensor measures it.
        grapple_m: grapple from above, m; empty if no sensor measures it.
        sway_deg: root of the sum of squares of both planes' swing, of an overhead crane the angle
            from the vertical; degrees.
    """

    tip_m: list[Point]
    grapple_m: list[Point]
    sway_deg: list[float]


@dataclass(frozen=True)
class Recording:
    """A drive on a common time base (seconds from its start, increasing).

    ``crane`` is None if the drive has neither the place of the tip nor the total swing. From
    ``dwell_s`` seconds after a release on, swing counts as residual.
    """

    t_s: list[float]
    axes: dict[str, AxisTrace]
    crane: CraneTrace | None = None
    dwell_s: float = DWELL_S
