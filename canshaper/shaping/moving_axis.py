"""One axis of a two-axis motion: path of its grapple, and how far and long it may be moved."""

import math
from dataclasses import dataclass, field

from canshaper.shaping.sway import SwayModel

# Largest change of an added velocity between two ticks of an axis, fraction of full speed.
MOST_STEP = 0.1
_NOTHING = 1e-6
GrapplePath = tuple[float, float, float, float]
"""Lead of the tip and its rate, speed and acceleration of the grapple; rad or m, per second."""


@dataclass(slots=True)
class MovingAxis:
    """One of the two axes of a motion.

    Attributes:
        full_speed: rad/s of slew, m/s of near-far.
        period_s: time for which an added velocity is held, seconds.
        sway: sway model, stepped without the added velocity.
        applied: velocity that last drove the model, [-1, 1].
        ahead_s: time from now to the model's state, which is at the end of the present period; 0
            where the next period begins now.
        commanded: whether the operator demanded motion within the tail.
        unattended: whether its joystick rested for longer than the tail, see ``AddedTime``.
        able: whether the axis may carry out an added velocity.
        room_m: how far the axis may still move ahead of its end stops, rad or m: (back, ahead).
        added: velocity to add now, [-1, 1]; a result.
        sent: velocity that its valve got last, [-1, 1].
        farthest: how far the axis may be moved from where its operator left it, rad or m; see
            ``farthest_m``.
        largest: largest velocity of the axis while its operator leaves it alone, [0, 1].
        fall_per_s: fastest fall of its velocity, full speeds per second.
        damps: whether the axis may damp the swing that the other axis causes; a result.
        damped: how far this damping has moved the tip, m.
        way: how far the axis was moved since its operator left it, rad or m.
        reached: position that the added velocities reach at the end of the period, rad or m.
        joins: the axis joins a motion under way, and does not make up for what it did not add.
        stiffness, damping: w^2 (1/s^2) and 2 zeta w (1/s) of the sway mode.
        lag_s: 2 zeta / w, seconds.
    """

    full_speed: float
    period_s: float
    sway: SwayModel
    applied: float = 0.0
    ahead_s: float = 0.0
    commanded: bool = False
    unattended: bool = False
    able: bool = False
    sent: float = 0.0
    farthest: float = math.inf
    largest: float = 1.0
    fall_per_s: float = 5.0
    room_m: tuple[float, float] = (-math.inf, math.inf)
    added: float = 0.0
    damps: bool = False
    damped: float = 0.0
    way: float = 0.0
    reached: float = 0.0
    joins: bool = False
    stiffness: float = field(init=False)
    damping: float = field(init=False)
    lag_s: float = field(init=False)

    def __post_init__(self) -> None:
        self.follow(self.sway)

    def follow(self, sway: SwayModel) -> None:
        """Use this sway model of the axis from now on."""
        omega, ratio = sway.mode.omega_rad_s, sway.mode.damping_ratio
        self.sway = sway
        self.stiffness, self.damping = omega * omega, 2.0 * ratio * omega
        self.lag_s = 2.0 * ratio / omega

    def held(self, seconds: float) -> None:
        """Move ``reached`` on by ``added``, which the valve held for ``seconds`` without a step."""
        self.reached += self.added * self.full_speed * seconds

    def path(self, after_s: float) -> GrapplePath:
        """Return the grapple's motion after a time, with the applied velocity held until then."""
        after_s -= self.ahead_s
        sway, full, applied = self.sway, self.full_speed, self.applied
        stiffness, damping = self.stiffness, self.damping
        angle, rate = sway.angle, sway.rate + applied
        change = -after_s * (stiffness * angle + damping * rate)
        angle += after_s * (rate + 0.5 * change)
        rate += change
        # The grapple's speed is that of the tip less the lead's.
        pull = stiffness * angle + damping * rate
        return full * angle, full * rate, full * (applied - rate), full * pull

    def room(self, sign: float) -> float:
        """Return the largest |velocity| towards ``sign`` (1, -1) that stops before ``farthest``."""
        way = (self.farthest - sign * self.way) / self.full_speed
        if not way > 0.0:
            return 0.0
        # It falls by a step in each period: (v + (v - step) + ...) * period_s <= way.
        step = self.fall_per_s * self.period_s
        return 0.5 * (math.sqrt(step * step + 8.0 * self.fall_per_s * way) - step)

    def add(self, target: float, weight: float) -> None:
        """Set ``added`` so that the added position reaches a target at the end of the period.

        End stops, ``farthest``, ``MOST_STEP`` and full speed bound it; next to nothing becomes 0.

        Args:
            target: target of the added position, rad or m.
            weight: 1, or less while the motion fades out.
        """
        back, ahead = self.room_m
        target = min(max(target, self.reached + back), self.reached + ahead)
        if self.joins:
            self.joins, self.reached = False, target
        way = self.period_s * self.full_speed
        velocity = weight * (target - self.reached) / way
        last = self.added
        if velocity > last + MOST_STEP:
            velocity = last + MOST_STEP
        elif velocity < last - MOST_STEP:
            velocity = last - MOST_STEP
        if self.farthest < math.inf and not self.commanded:
            velocity = min(max(velocity, -self.room(-1.0)), self.room(1.0))
        if not _NOTHING <= abs(velocity) <= 1.0:
            if not abs(velocity) > 1.0:  # next to nothing, or not a number
                self.added = 0.0
                return
            velocity = math.copysign(1.0, velocity)
        self.added = velocity
        # A velocity that fading leaves out is not added later.
        self.reached = target if weight < 1.0 else self.reached + velocity * way


# Ticks beyond the tail until an axis counts as unattended. The gate waits for the tail alone, so it
# never renews the time of an axis later than the axis does.
UNATTENDED_TICKS = 3


class AddedTime:
    """Limits how long a motion may move an axis that no one commands.

    Args:
        ticks: longest time in motion, in ticks of the axis.
        tail: ticks for which the output may run on.

    Attributes:
        asked: whether the motion wanted to move the axis in the last tick.
        unattended: whether the joystick rested longer than the tail, in any state of the axis.
    """

    __slots__ = ("_left", "_rested", "_unattended", "asked", "ticks", "unattended")

    def __init__(self, ticks: int, tail: int) -> None:
        self.ticks = self._left = ticks
        self._unattended = tail + UNATTENDED_TICKS
        self.asked = self.unattended = False
        self._rested = 0  # ticks since the joystick was deflected

    def renew(self) -> None:
        """Give the axis its full time back, because no joystick of its motion is deflected."""
        self._left = self.ticks

    def allows(
        self, asked: bool, commanded: bool, moved: bool, deflected: bool = False, ticks: int = 1
    ) -> bool:
        """Count time, and return whether the motion may move the axis now.

        Args:
            asked: whether the motion wants to move the axis.
            commanded: whether the operator demanded motion within the tail; then the axis gets its
                full time back.
            moved: whether the valve was open. An axis at rest uses no time, and gets none back.
            deflected: whether the joystick is deflected.
            ticks: number of ticks that have passed.
        """
        self.asked = asked
        self._rested = 0 if deflected else self._rested + ticks
        self.unattended = self._rested > self._unattended
        if commanded:
            self._left = self.ticks
        elif moved:
            self._left -= ticks
        return asked and self._left > 0
