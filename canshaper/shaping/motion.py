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
"""

import math
from dataclasses import dataclass, field

from canshaper.shaping.sway import SwayModel

# Time constant with which a measured radius corrects the one that is carried on: a jump of the
# signal moves nothing at once.
RADIUS_S = 1.0
# Time in which the added part ends where one of the axes can no more.
FADE_S = 0.2
# Largest change of an added velocity between two ticks of an axis, fraction of full speed.
MOST_STEP = 0.1
_NOTHING = 1e-6
# Lead of the tip and its rate, speed and acceleration of the grapple; rad or m, per second.
_Path = tuple[float, float, float, float]
_REST: _Path = 0.0, 0.0, 0.0, 0.0
# Least part of gravity that is left across the boom; beyond it the small angles are none.
_LEAST = 0.5
# Least radius of the grapple that the map takes: a sensor may say 0.
_LEAST_RADIUS_M = 0.5


def farthest_m(path_m: float, *, damps: bool) -> float:
    """How far near-far is moved at most while its operator leaves it alone.

    Args:
        path_m: for what slewing adds, m.
        damps: a sway sensor of near-far damps; it may move it as far again.
    """
    return 2.0 * path_m if damps else path_m


@dataclass(slots=True)
class MovingAxis:
    """One of the two axes, as the motion sees it.

    Attributes:
        full_speed: rad/s of slew, m/s of near-far.
        period_s: time for which an added velocity is held.
        sway: sway model, stepped without the added part.
        applied: velocity that the model was driven by last, [-1, 1].
        ahead_s: from now to the time of the model's state: to the end of the period that runs, 0
            where the next one begins now.
        commanded: the operator asked for motion within the tail.
        able: it may carry out what is added.
        added: velocity to add now, [-1, 1]; the result.
        sent: velocity that its valve was given last, [-1, 1].
        farthest: how far this axis may be moved from where its operator left it, rad or m; see
            ``farthest_m``.
        largest: fastest velocity that it has there, [0, 1].
        fall_per_s: fastest fall of its velocity, full speeds per second.
        damps: the other axis makes this one swing, which may be damped; a result.
        damped: how far the tip was moved for that, m.
        way: how far it was moved since its operator left it, rad or m.
        reached: position that the added velocities reach at the end of the period, rad or m.
        joins: the other axis moves already; what was not added before is not made up for.
        stiffness, damping: w^2 and 2 zeta w of the sway mode, rad/s.
        lag_s: 2 zeta / w.
    """

    full_speed: float
    period_s: float
    sway: SwayModel
    applied: float = 0.0
    ahead_s: float = 0.0
    commanded: bool = False
    able: bool = False
    sent: float = 0.0
    farthest: float = math.inf
    largest: float = 1.0
    fall_per_s: float = 5.0
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
        """The axis has this sway model now."""
        omega, ratio = sway.mode.omega_rad_s, sway.mode.damping_ratio
        self.sway = sway
        self.stiffness, self.damping = omega * omega, 2.0 * ratio * omega
        self.lag_s = 2.0 * ratio / omega

    def held(self, seconds: float) -> None:
        """The last output was held for so much longer."""
        self.reached += self.added * self.full_speed * seconds

    def path(self, after_s: float) -> _Path:
        """The grapple's motion at a time from now, the applied velocity held until then."""
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
        """Fastest velocity in a direction from which it still stops before ``farthest``."""
        way = (self.farthest - sign * self.way) / self.full_speed
        if not way > 0.0:
            return 0.0
        # It falls by a step in each period: (v + (v - step) + ...) * period_s <= way.
        step = self.fall_per_s * self.period_s
        return 0.5 * (math.sqrt(step * step + 8.0 * self.fall_per_s * way) - step)

    def add(self, target: float, weight: float) -> None:
        """Run to a position of the added part within the period.

        Args:
            target: the position, rad or m.
            weight: 1, or less where the added part ends.
        """
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
        # What a fading part leaves out is not made up for.
        self.reached = target if weight < 1.0 else self.reached + velocity * way


class TwoAxisMotion:
    """What both axes add so that the grapple stays on the path of its filters.

    Args:
        slew: the axis that turns.
        near_far: the axis that moves the tip in and out, or None.
        path_m: farthest that near-far is moved for slew, and as far again to damp its swing.
    """

    __slots__ = ("_near_far", "_path_m", "_radius_m", "_slew", "_weight")

    def __init__(self, slew: MovingAxis, near_far: MovingAxis | None, path_m: float) -> None:
        self._slew = slew
        self._near_far = near_far
        self._path_m = path_m
        self._radius_m: float | None = None  # of the grapple
        self._weight = 1.0

    def step(self, elapsed_s: float, tip_m: float | None, circle_m: float | None = None) -> None:
        """Find what is added from now on, by each axis whose period begins now: its ``added``.

        Args:
            elapsed_s: time since the last step.
            tip_m: measured radius of the tip, or None where it is not known.
            circle_m: instead of it: radius of the grapple, where that is a number of the file.
        """
        slew, near_far = self._slew, self._near_far
        commanded = slew.commanded or (near_far is not None and near_far.commanded)
        able = slew.able and (near_far is None or near_far.able)
        weight = self._weight
        if weight < 1.0 or not able:
            fade = elapsed_s / FADE_S if able else -elapsed_s / FADE_S
            weight = self._weight = min(max(weight + fade, 0.0), 1.0)
        if not commanded or not weight:
            self._rest(over=not commanded)
            return
        if near_far is not None:
            self._moved(near_far, elapsed_s)
        if near_far is None:
            radius_m = None
        elif circle_m is None:
            radius_m = self._carried_m(near_far, elapsed_s, tip_m)
        else:
            radius_m = circle_m
        turn = slew.path(slew.period_s)
        if near_far is None or radius_m is None:
            if not slew.ahead_s:
                slew.add(_psi(turn, slew.stiffness) - turn[0], weight)
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
        path_m = self._path_m
        near_far.add(path_m if way_m > path_m else max(way_m, -path_m), weight)

    def stop(self) -> None:
        """One of the axes has tripped: nothing is added any more, at once."""
        self._weight = 0.0
        self._rest()

    def _rest(self, *, over: bool = False) -> None:
        self._radius_m = None
        for axis in (self._slew, self._near_far):
            if axis is not None:
                axis.added = axis.reached = axis.damped = 0.0
                axis.damps = False
                axis.joins = not over
                if over:
                    axis.way = 0.0

    def _moved(self, near_far: MovingAxis, elapsed_s: float) -> None:
        """Count how far near-far was moved; it damps no farther than it may be moved."""
        if near_far.commanded:
            near_far.damps, near_far.damped, near_far.way = False, 0.0, 0.0
            return
        passed = near_far.full_speed * elapsed_s
        near_far.damped += near_far.applied * passed
        near_far.way += near_far.sent * passed
        near_far.damps = (
            self._weight == 1.0
            and abs(near_far.damped) < self._path_m
            and near_far.largest <= near_far.room(math.copysign(1.0, near_far.way))
        )

    def _carried_m(
        self, near_far: MovingAxis, elapsed_s: float, tip_m: float | None
    ) -> float | None:
        """Radius of the grapple: carried on by the near-far model, corrected by the tip's."""
        sway, full = near_far.sway, near_far.full_speed
        ahead_m = full * sway.angle + near_far.reached
        if self._radius_m is None:
            self._radius_m = None if tip_m is None else tip_m - ahead_m
        else:
            self._radius_m -= full * sway.rate * elapsed_s
            if tip_m is not None:
                error_m = tip_m - ahead_m - self._radius_m
                self._radius_m += error_m * min(1.0, elapsed_s / RADIUS_S)
        return self._radius_m

    def _tip(
        self, turn: _Path, after_s: float, near_far: MovingAxis, radius_m: float
    ) -> tuple[float, float]:
        """Where the tip has to be: psi, and R - rho - D.

        Args:
            turn: the path of slew at that time.
            after_s: the time, from now.
            near_far: the other axis. At rest it has no speed, whatever its model has left.
            radius_m: radius of the grapple now.
        """
        lead, lead_rate, speed, acceleration = turn
        out, _, out_rate, out_acceleration = near_far.path(after_s) if near_far.commanded else _REST
        slew = self._slew
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


def _psi(turn: _Path, stiffness: float) -> float:
    """Angle of the boom ahead of a grapple that stays on its circle, of whatever radius."""
    lead, _, speed, _ = turn
    return math.atan2(lead, max(1.0 - speed * speed / stiffness, _LEAST))
