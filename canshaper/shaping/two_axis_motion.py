"""Slew and near-far as one motion: the tip goes where a grapple on the commanded path needs it.

The filters of both axes make a path of the grapple about the pillar, radius rho and angle phi; it
is read from their sway models. A hanging grapple follows it without any other swing where the tip
stands such that gravity makes the accelerations of the path (differential flatness; w5, w6: sway
modes of slew and near-far, which pull across and along the boom; psi: angle of the boom ahead of
the grapple)

    a_r = rho'' - rho phi'^2        tan psi = a_t / (w5^2 rho + a_r)
    a_t = rho phi'' + 2 rho' phi'   R = rho cos psi + (a_r cos psi + a_t sin psi) / w6^2

By themselves the filters put the tip at the angle L = phi'' / w5^2 ahead and at the radius rho + D,
D = rho'' / w6^2. The motion adds the rest, psi - L to slew and R - rho - D to near-far, as
velocities from one position to the next. The dampers of the joints are in L and D by the models; of
the rest they are taken to first order. Near-far alone gets nothing added; slew alone moves the tip
in on its circle.

A boom that luffs moves the tip in by h times its angle, h high above its joint: rho and D have a
part of it. The tip goes in an arc, so the joint itself makes up for what its filter does not know,
the centripetal acceleration and that of Coriolis in the boom's plane (theta, b: angle of the boom
that the grapple hangs on, and lead of the joint)

    R/h (theta'^2 / w^2 - b^2 / 2) + (2 theta' rho' / w^2 - b D) / R
"""

import math

from canshaper.shaping.moving_axis import GrapplePath, MovingAxis

# Time constant with which a measured radius corrects the predicted one: a jump of the signal moves
# nothing at once.
RADIUS_S = 1.0
# Time in which the added part fades when one of the axes becomes unable to follow.
FADE_S = 0.2
_REST: GrapplePath = 0.0, 0.0, 0.0, 0.0
# Least part of gravity that is left across the boom; with less the angles are no longer small.
_LEAST = 0.5
# Least radius of the grapple in the computation: a sensor may report 0.
_LEAST_RADIUS_M = 0.5


def farthest_m(path_m: float, *, damps: bool) -> float:
    """Return how far near-far may be moved while its operator leaves it alone, m.

    Args:
        path_m: farthest that slewing may move near-far, m.
        damps: whether a sway sensor of near-far damps, which may move it as far again.
    """
    return 2.0 * path_m if damps else path_m


class TwoAxisMotion:
    """Velocities that two axes add to keep the grapple on the path of its filters.

    Args:
        slew: the axis that turns.
        near_far: the axis that moves the tip in and out, or None.
        path_m: farthest that near-far is moved for slew, and as far again to damp its swing.

    Attributes:
        luffing: the axis that turns the boom up, or None. It adds to its own commands only.
        height_m: height of the tip above the joint of the boom, m.
        unattended: whether the joysticks of all its axes rested for longer than the tail, so that
            the limits of way and time begin again.
    """

    __slots__ = (
        "_radius_m",
        "_tip_m",
        "_weight",
        "height_m",
        "luffing",
        "near_far",
        "path_m",
        "slew",
        "unattended",
    )

    def __init__(self, slew: MovingAxis, near_far: MovingAxis | None, path_m: float) -> None:
        self.slew = slew
        self.near_far = near_far
        self.path_m = path_m
        self._radius_m: float | None = None  # of the grapple
        self._tip_m: float | None = None  # radius of the tip, as ``_bend`` follows it
        self._weight = 1.0
        self.luffing: MovingAxis | None = None
        self.height_m = 0.0
        self.unattended = False

    def step(self, elapsed_s: float, tip_m: float | None, circle_m: float | None = None) -> None:
        """Set ``added`` of each axis whose period begins now, and ``damps`` of near-far.

        Args:
            elapsed_s: time since the last step, seconds.
            tip_m: measured radius of the tip, or None where it is not known.
            circle_m: radius of the grapple as a number of the file, instead of ``tip_m``.
        """
        slew, near_far, luffing = self.slew, self.near_far, self.luffing
        commanded = slew.commanded or (near_far is not None and near_far.commanded)
        able = slew.able and (near_far is None or near_far.able)
        able = able and (luffing is None or luffing.able)
        weight = self._weight
        if weight < 1.0 or not able:
            fade = elapsed_s / FADE_S if able else -elapsed_s / FADE_S
            weight = self._weight = min(max(weight + fade, 0.0), 1.0)
        self.unattended = slew.unattended and (near_far is None or near_far.unattended)
        if near_far is not None:
            self._moved(near_far, elapsed_s)
        if luffing is not None and not luffing.ahead_s:
            self._bend(luffing, elapsed_s, tip_m if circle_m is None else circle_m)
        if not commanded or not weight:
            self._rest(over=not commanded)
            return
        radius_m = circle_m
        if near_far is not None and circle_m is None:
            radius_m = self._carried_m(near_far, elapsed_s, tip_m)
        turn = slew.path(slew.period_s)
        if near_far is None or radius_m is None:
            if not slew.ahead_s:  # the grapple stays on its circle, of whatever radius
                lead, _, speed, _ = turn
                bottom = max(1.0 - speed * speed / slew.stiffness, _LEAST)
                slew.add(math.atan2(lead, bottom) - lead, weight)
            if near_far is not None:
                near_far.add(near_far.reached, 0.0)
            return
        psi, way_m = self._tip(turn, slew.period_s, near_far, radius_m)
        if not slew.ahead_s:
            slew.add(psi - turn[0], weight)
        if near_far.ahead_s:
            return
        if near_far.period_s != slew.period_s:
            turn = slew.path(near_far.period_s)
            _, way_m = self._tip(turn, near_far.period_s, near_far, radius_m)
        path_m = self.path_m
        near_far.add(path_m if way_m > path_m else max(way_m, -path_m), weight)

    def stop(self) -> None:
        """Add nothing, because an axis has tripped; ``step`` fades in again once all are able."""
        self._weight = 0.0
        self._rest()

    def _rest(self, *, over: bool = False) -> None:
        self._radius_m = None
        for axis in (self.slew, self.near_far):
            if axis is not None:
                axis.added = axis.reached = axis.damped = 0.0
                axis.damps = False
                axis.joins = not over

    def _bend(self, luffing: MovingAxis, elapsed_s: float, tip_m: float | None) -> None:
        """Let the boom make up for the arc in which it moves the tip."""
        radius_m = self._tip_m
        if tip_m is not None:
            last_m = tip_m if radius_m is None else radius_m
            self._tip_m = radius_m = last_m + (tip_m - last_m) * min(1.0, elapsed_s / RADIUS_S)
        if not radius_m or not luffing.commanded or not self._weight:
            luffing.added = luffing.reached = 0.0
            luffing.joins = luffing.commanded
            return
        lead, _, speed, _ = luffing.path(luffing.period_s)
        stiffness, near_far = luffing.stiffness, self.near_far
        target = radius_m / self.height_m * (speed * speed / stiffness - 0.5 * lead * lead)
        if near_far is not None and near_far.commanded:
            out, _, out_rate, _ = near_far.path(luffing.period_s)
            across = 2.0 * speed * out_rate / stiffness - lead * out
            target += across / max(radius_m, _LEAST_RADIUS_M)
        luffing.add(target, self._weight)

    def _luffed(self, luffing: MovingAxis, after_s: float) -> GrapplePath:
        """Return how luffing alone moves tip and grapple outwards, as ``MovingAxis.path`` does."""
        height_m = self.height_m
        if not luffing.commanded:
            return _REST
        lead, rate, speed, acceleration = luffing.path(after_s)
        return -height_m * lead, -height_m * rate, -height_m * speed, -height_m * acceleration

    def _moved(self, near_far: MovingAxis, elapsed_s: float) -> None:
        """Count how far near-far was moved; let it damp only within ``path_m``, ``farthest``."""
        if near_far.commanded or self.unattended:
            near_far.damps, near_far.damped, near_far.way = False, 0.0, 0.0
            return
        passed = near_far.full_speed * elapsed_s
        near_far.damped += near_far.applied * passed
        near_far.way += near_far.sent * passed
        near_far.damps = (
            self._weight == 1.0
            and abs(near_far.damped) < self.path_m
            and near_far.largest <= near_far.room(math.copysign(1.0, near_far.way))
        )

    def _carried_m(
        self, near_far: MovingAxis, elapsed_s: float, tip_m: float | None
    ) -> float | None:
        """Return the grapple's radius by near-far's model, corrected by the tip's; None so far."""
        sway, full = near_far.sway, near_far.full_speed
        luffed_m, _, luffed_m_s, _ = self._luffed(self.luffing, 0.0) if self.luffing else _REST
        ahead_m = full * sway.angle + near_far.reached + luffed_m
        if self._radius_m is None:
            self._radius_m = None if tip_m is None else tip_m - ahead_m
        else:
            self._radius_m += (luffed_m_s - full * sway.rate) * elapsed_s
            if tip_m is not None:
                error_m = tip_m - ahead_m - self._radius_m
                self._radius_m += error_m * min(1.0, elapsed_s / RADIUS_S)
        return self._radius_m

    def _tip(
        self, turn: GrapplePath, after_s: float, near_far: MovingAxis, radius_m: float
    ) -> tuple[float, float]:
        """Return where the tip has to be: psi, and R - rho - D (see the formulas above).

        Args:
            turn: path of slew at that time.
            after_s: time from now, seconds.
            near_far: the other axis. At rest it has no speed, whatever its model has left.
            radius_m: radius of the grapple now.
        """
        lead, lead_rate, speed, acceleration = turn
        out, _, out_rate, out_acceleration = near_far.path(after_s) if near_far.commanded else _REST
        if self.luffing is not None:
            luffed_m, _, luffed_m_s, luffed_m_s2 = self._luffed(self.luffing, after_s)
            out, out_rate = out + luffed_m, out_rate + luffed_m_s
            out_acceleration += luffed_m_s2
        slew = self.slew
        across_2, along_2 = slew.stiffness, near_far.stiffness
        radius_m += after_s * out_rate
        if not radius_m > _LEAST_RADIUS_M:
            radius_m = _LEAST_RADIUS_M
        # Coriolis and centripetal acceleration, and their rates for the dampers.
        turning = 2.0 * out_rate * speed / radius_m
        turning_rate = (
            2.0 * (out_acceleration * speed + out_rate * acceleration) / radius_m
            - turning * out_rate / radius_m
        )
        inwards = radius_m * speed * speed
        inwards_rate = out_rate * speed * speed + 2.0 * radius_m * (
            speed * acceleration - across_2 * lead * lead_rate
        )
        pull_t = radius_m * (across_2 * lead + turning - slew.lag_s * turning_rate)
        pull_r = along_2 * out - inwards + near_far.lag_s * inwards_rate
        left = radius_m * across_2
        bottom = left + pull_r
        bottom = max(bottom, _LEAST * left)
        cosine = bottom / math.hypot(pull_t, bottom)
        sine = pull_t / bottom * cosine
        tip_m = radius_m * cosine + (pull_r * cosine + pull_t * sine) / along_2
        return math.atan2(pull_t, bottom), tip_m - radius_m - out


def range_with_added(
    held: float,
    recent_low: float,
    recent_high: float,
    own: float,
    largest: float,
    *,
    maximum: float,
    no_run_on: bool = False,
) -> tuple[float, float]:
    """Return the range of an axis' own velocity and the added one together, up to ``maximum``.

    - Against a joystick that is held: no further than the own velocity already runs on.
    - In a direction that was commanded within the tail: no faster than commanded there.
    - In a direction that no one commanded, with the joystick released: no faster than ``largest``.

    Args:
        held: velocity at which the operator holds the joystick, [-1, 1].
        recent_low: smallest demand within the tail, 0 or negative.
        recent_high: largest demand within the tail, 0 or positive.
        own: the axis' own velocity, before the ramp.
        largest: largest velocity that may be added where no one commanded.
        maximum: largest |velocity| of the axis, which ``own`` does not exceed.
        no_run_on: neither is faster than the joystick nor, in neutral, than ``largest``.

    Returns:
        (low, high) with low <= 0 <= high and low <= own <= high.
    """
    low, high = recent_low, recent_high
    if no_run_on:
        low = held if held < 0.0 else max(low, -largest)
        high = held if held > 0.0 else min(high, largest)
    if held > 0.0:
        low = 0.0
    elif held < 0.0:
        high = 0.0
    else:
        if low == 0.0:
            low = -largest
        if high == 0.0:
            high = largest
    return max(min(own, low), -maximum), min(max(own, high), maximum)
