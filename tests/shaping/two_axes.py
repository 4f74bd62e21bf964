"""Two axes and a point mass on springs in a plane that stands still."""

import math
from collections.abc import Callable

from canshaper.shaping.moving_axis import MovingAxis
from canshaper.shaping.shapers.fir import Fir, zv_taps
from canshaper.shaping.sway import SwayMode, SwayModel
from canshaper.shaping.two_axis_motion import TwoAxisMotion

SLEW, NEAR_FAR = SwayMode(2.67, 0.04), SwayMode(2.86, 0.06)
TURN_RAD_S, OUT_M_S = 0.5, 1.0
TICK_S = 0.02
INNER = 40
Command = Callable[[float], float]


class Axis:
    """Zero-vibration filter and sway model, driven by a command over time."""

    def __init__(self, mode: SwayMode, full: float, period_s: float) -> None:
        self.sway = SwayModel(mode, period_s)
        self.filter = Fir(zv_taps(mode, period_s))
        self.moving = MovingAxis(full, period_s, self.sway)
        self.sent = 0.0

    def run(self, command: float) -> None:
        self.moving.applied = self.filter.step(command)
        self.sent = self.moving.applied + self.moving.added
        self.sway.step(self.moving.applied)


class Drive:
    """A grapple on two springs with dampers, which turn with the boom; it does not know the map."""

    def __init__(self, *, near_far_ticks: int = 1, start_m: float = 3.0) -> None:
        self.slew = Axis(SLEW, TURN_RAD_S, TICK_S)
        self.near_far = Axis(NEAR_FAR, OUT_M_S, near_far_ticks * TICK_S)
        self.ticks = near_far_ticks
        self.motion = TwoAxisMotion(self.slew.moving, self.near_far.moving, path_m=1.0)
        self.angle, self.radius_m = 0.0, start_m
        self.mass = (start_m, 0.0, 0.0, 0.0)
        self.radius_error_m = 0.0

    def run(self, slew: Command, near_far: Command, *, until_s: float, motion: bool) -> float:
        """Largest distance, m, of grapple and tip in the last 2.4 s."""
        worst = 0.0
        for tick in range(round(until_s / TICK_S)):
            time_s = tick * TICK_S
            due = tick % self.ticks == 0
            for axis in (self.slew, self.near_far):
                axis.moving.commanded = axis.moving.able = motion
            self.near_far.moving.ahead_s = -(tick % self.ticks) % self.ticks * TICK_S
            self.motion.step(TICK_S, self.radius_m + self.radius_error_m)
            self.slew.run(slew(time_s))
            if due:
                self.near_far.run(near_far(time_s))
            for _ in range(INNER):
                off = self._inner(TICK_S / INNER)
                if time_s > until_s - 2.4:
                    worst = max(worst, off)
        return worst

    def _inner(self, h: float) -> float:
        turn = TURN_RAD_S * self.slew.sent
        out = OUT_M_S * self.near_far.sent
        self.angle += h * turn
        self.radius_m += h * out
        x, y, vx, vy = self.mass
        c, s = math.cos(self.angle), math.sin(self.angle)
        along, across = x * c + y * s, y * c - x * s
        along_rate = vx * c + vy * s + turn * across - out
        across_rate = vy * c - vx * s - turn * along
        pull_r = NEAR_FAR.omega_rad_s**2 * (along - self.radius_m)
        pull_r += 2 * NEAR_FAR.damping_ratio * NEAR_FAR.omega_rad_s * along_rate
        pull_t = SLEW.omega_rad_s**2 * across
        pull_t += 2 * SLEW.damping_ratio * SLEW.omega_rad_s * across_rate
        vx -= h * (pull_r * c - pull_t * s)
        vy -= h * (pull_r * s + pull_t * c)
        self.mass = (x + h * vx, y + h * vy, vx, vy)
        return math.hypot(along - self.radius_m, across)


def stroke(begin_s: float, seconds: float, level: float = 1.0) -> Command:
    return lambda time_s: level if begin_s <= time_s < begin_s + seconds else 0.0


STILL = stroke(0.0, 0.0)


def slewing(path_m: float = 0.3) -> tuple[TwoAxisMotion, MovingAxis, MovingAxis]:
    """Slew commanded, near-far left alone."""
    slew = MovingAxis(TURN_RAD_S, TICK_S, SwayModel(SLEW, TICK_S), commanded=True, able=True)
    near_far = MovingAxis(OUT_M_S, TICK_S, SwayModel(NEAR_FAR, TICK_S), able=True)
    return TwoAxisMotion(slew, near_far, path_m), slew, near_far
