"""A linear shaper made aware of the limits that cut its output.

While nothing cuts it, a shaper leaves the swing that it was designed to leave. What a limit changes
is a second input, (sent - asked), and the swing it makes is the difference between the axis' sway
model, driven by what was sent, and a twin driven by what the shaper asked for. That difference is
damped by the same state feedback as in G_FF, with command zero:

    v* = y - K1 (angle - angle_twin) - K2 (rate - rate_twin)

With no limit acting the difference is zero, and the shaper is itself.
"""

import math
from typing import Protocol

from canshaper.shaping.fir import Fir
from canshaper.shaping.gff import Gff
from canshaper.shaping.sway import SwayModel

# Both poles of the feedback, in natural frequencies: quicker than the swing, and slow enough for a
# valve that takes a fifth of a second to full speed.
POLE_PER_OMEGA = -1.4


# A slow valve cannot follow quick poles, and feedback it cannot follow adds swing. What it can
# follow grows with the root of its rate, as for the poles of G_FF; 1.3 left least swing of 0.4 to
# 1.6 over valves of 0.7 to 5 full speeds per second.
POLE_PER_ROOT = -1.3


class _Shaper(Protocol):
    def wanted(self, command: float) -> float: ...


def carry_over(old: _Shaper, new: _Shaper, command: float) -> None:
    """Give a new shaper a memory: that of the one before it, where both are of one kind.

    Args:
        old: the one before.
        new: the new one.
        command: the command now; without a better memory it counts as the one for long.
    """
    if type(old) is type(new) and hasattr(new, "inherit"):
        new.inherit(old)
    elif hasattr(new, "begin_at"):
        new.begin_at(command)


class LimitAware:
    """A shaper with feedback of the swing that limits made.

    Args:
        sway: sway model of the axis; its owner steps it with what was sent.
        shaper: the shaper.
        rate_per_s: rate of the valve, full speeds per second.

    Raises:
        ValueError: the tick is too long for the feedback.
    """

    __slots__ = ("_asked", "_gff", "_shaper", "_sway", "_twin")

    def __init__(self, sway: SwayModel, shaper: Fir, rate_per_s: float = math.inf) -> None:
        omega, fastest = sway.mode.omega_rad_s, -1.0 / (POLE_PER_OMEGA * sway.tick_s)
        if omega > fastest:
            raise ValueError(
                f"natural frequency is {omega:g} rad/s, allowed is up to {fastest:g} rad/s"
                f" for this filter at a tick of {sway.tick_s:g} s"
            )
        pole = max(POLE_PER_OMEGA * omega, POLE_PER_ROOT * math.sqrt(rate_per_s * omega))
        self._gff = Gff(sway, (pole, pole))
        self._sway = sway
        self._twin = SwayModel(sway.mode, sway.tick_s)
        self._shaper = shaper
        self._asked = 0.0

    def inherit(self, old: "LimitAware") -> None:
        """Go on from where another one stands."""
        self._twin = old._twin.retuned(self._sway.mode, old._asked)
        self._asked = old._asked
        self._shaper.inherit(old._shaper)

    def begin_at(self, command: float) -> None:
        """Begin with a command that has long been there, and no swing that limits have made."""
        self._twin.angle, self._twin.rate = self._sway.angle, self._sway.rate
        self._asked = command
        self._shaper.begin_at(command)

    def wanted(self, command: float) -> float:
        """Output for this tick's command, before limits."""
        sway, twin = self._sway, self._twin
        twin.step(self._asked)
        if sway.angle == 0.0 == sway.rate:  # never moved, or started anew after a fault
            twin.angle = twin.rate = 0.0
        self._asked = asked = self._shaper.wanted(command)
        return (
            asked
            - self._gff.k1 * (sway.angle - twin.angle)
            - self._gff.k2 * (sway.rate - twin.rate)
        )
