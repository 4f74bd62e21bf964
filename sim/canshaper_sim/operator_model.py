"""A person at the joysticks: sees late, predicts roughly, aims, corrects, and catches the swing.

Both axes move at once and arrive together (Kelso, Southard and Goodman 1979). The person releases
the joystick where the tip is expected to stop and corrects by taps, as an aiming hand does
(Woodworth 1899; Meyer et al. 1988). The expected stop is the place seen one reaction time ago plus
the way still to come from the person's own joystick input, by the learned run-on (Miall et al.
1993). The person takes one decision at a time (Welford 1952). The person catches a swing by a tap
towards the load when the load turns: by half of the load's offset, and by the other half on its way
back, as ZV does.

The literature gives the meaning of each number of `Skill`, and its size where a source stands
beside it. Every other size is chosen. The model takes no account of anti-sway. Places are in m.
"""

import math
import random
from collections import deque
from collections.abc import Sequence
from dataclasses import dataclass
from operator import mul
from typing import NamedTuple

from canshaper_sim.ranges import check_ranges

# name -> (lowest, highest) value of a skill.
_ALLOWED = dict.fromkeys(("reaction_s", "ramp_s"), (0.05, 1.0)) | dict.fromkeys(
    ("timing_s", "aim_m", "motor", "run_on", "dead_m", "catch"), (0.0, 1.0)
)
# Chosen: a tap lasts so long where full deflection is not needed, and has at least this one; parts
# of the tolerance that are worth a tap, and a catch.
_TAP_S, _LEAST_LEVEL, _WORTH_A_TAP, _WORTH_A_CATCH = 0.3, 0.15, 0.33, 0.7


@dataclass(frozen=True, slots=True)
class Skill:
    """Skill of a person; by default of one who catches the swing. Noise is given as one sigma."""

    # Simple visual reaction .19 s, .15 s more for each bit of a choice (Hick 1952; Luce 1986);
    # corrections by sight .19 to .26 s (Keele and Posner 1968); a pilot .15 to .25 s (McRuer 1967).
    reaction_s: float = 0.25
    ramp_s: float = 0.15  # neutral to full; arm and muscles lag by .1 s (McRuer and Jex 1967)
    timing_s: float = 0.06  # error of the instant: some % of the wait (Lewis and Miall 2009)
    aim_m: float = 0.04  # error of the assumed target
    motor: float = 0.12  # error of a tap, part of it (Harris and Wolpert 1998)
    run_on: float = 0.10  # error of the learned run-on, part of it
    dead_m: float = 0.08  # a smaller error is not corrected
    catch: float = 1.0  # most of a swing that is taken at one turn; 0: waits until it has decayed

    def __post_init__(self) -> None:
        check_ranges("operator", self, _ALLOWED)


@dataclass(frozen=True, slots=True)
class Operators:
    """Three persons at work. A novice reacts late, as one who chooses: .38 s (Laming 1968)."""

    catching: Skill = Skill()
    waiting: Skill = Skill(catch=0.0)
    novice: Skill = Skill(0.35, 0.20, 0.10, 0.08, 0.20, 0.30, catch=0.0)


class Known(NamedTuple):
    """What a person has learned of one axis: its speed, its run-on, the swing of its load."""

    full_m_s: float  # speed of the tip at full deflection
    # Of that speed, tick by tick, after the joystick is let go at once: so much of what the hand
    # did that long ago is still to come.
    fall: tuple[float, ...]
    omega_rad_s: float = 1.0  # frequency of the load's swing


class OperatorModel:
    """A person who makes one move of the load.

    Args:
        skill: skill of the person.
        technique: largest deflection, part of full, and part of a swing caught at one turn.
        task: for each axis, what the person knows of it, and the target of the tip, m.
        within: largest final distances in m: of the tip from its target, of the load from the tip.
        seed: of all random numbers; with the same seed the person aims and errs alike on any crane.
        tick_s: time between two calls of `see`.

    Attributes:
        joysticks: position of each axis, -1 .. 1.
        taps: number of corrections and catches begun.
    """

    def __init__(
        self,
        skill: Skill,
        technique: tuple[float, float],
        task: Sequence[tuple[Known, float]],
        within: tuple[float, float],
        *,
        seed: str,
        tick_s: float,
    ) -> None:
        self._skill, self._within, (self._speed, self._catch) = skill, within, technique
        self._axes = [
            _Axis(skill, known, target_m, random.Random(f"{seed} {number}"), tick_s)
            for number, (known, target_m) in enumerate(task)
        ]
        # States seen within the last reaction time: only the oldest has arrived.
        self._seen = deque[Sequence[tuple[float, float]]]()
        self._late = round(skill.reaction_s / tick_s)
        self._begun, self._free_s = False, 0.0
        self.joysticks, self.taps = [0.0] * len(task), 0

    def see(self, time_s: float, seen: Sequence[tuple[float, float]]) -> None:
        """See each axis' (place of the tip, offset of the load), m; move the hand for one tick.

        The hand rests until the first reaction time is over.
        """
        self._seen.append(seen)
        if len(self._seen) <= self._late:
            return
        for axis, (place_m, off_m) in zip(self._axes, self._seen.popleft(), strict=True):
            axis.watch(place_m, off_m)
        if not self._begun:
            self._begun = True
            times_s = [abs(axis.error_m) / axis.known.full_m_s for axis in self._axes]
            longest_s = max(times_s) or 1.0
            for axis, own_s in zip(self._axes, times_s, strict=True):
                axis.wanted = math.copysign(self._speed * own_s / longest_s, axis.error_m)
        swing_m, free = math.hypot(*(axis.swing_m for axis in self._axes)), time_s >= self._free_s
        swings = swing_m > _WORTH_A_CATCH * self._within[1]
        catch = min(self._skill.catch, self._catch) if swings else 0.0
        for axis in self._axes:
            if axis.let_go(time_s) and free:
                way_m = axis.caught_m(time_s, catch) if catch else axis.worth_m(self._within[0])
                if way_m:
                    axis.tap(time_s, way_m)
                    self.taps += 1
                    self._free_s = time_s + self._skill.reaction_s
        self.joysticks = [axis.advance() for axis in self._axes]


class _Axis:
    """One axis: the person's estimate of its motion, and the hand on its joystick."""

    def __init__(
        self, skill: Skill, known: Known, target_m: float, source: random.Random, tick_s: float
    ) -> None:
        self.known, self._skill, self._source, self._tick_s = known, skill, source, tick_s
        self._target_m = target_m + skill.aim_m * source.gauss()
        stretch = max(0.1, 1.0 + skill.run_on * source.gauss())
        self._run_on_s = stretch * tick_s * sum(known.fall)
        self._late_s = skill.timing_s * source.gauss()
        self.error_m = self.swing_m = self._off_m = self._rate_m_s = self._coming_m = 0.0
        self._joystick = self.wanted = self._ready_s = 0.0
        self._until_s = math.inf  # end of a tap; infinite for a stroke that ends at the target
        # Past joystick positions, the newest first, and the part of each still to come.
        count = round(stretch * len(known.fall))
        fall = [known.fall[min(int(k / stretch), len(known.fall) - 1)] for k in range(count)]
        self._to_come = [1.0] * round(skill.reaction_s / tick_s) + fall
        self._done = deque([0.0] * len(self._to_come), maxlen=len(self._to_come))

    def watch(self, place_m: float, off_m: float) -> None:
        """See tip and load as they were one reaction time ago; estimate where the tip will stop."""
        self._rate_m_s, self._off_m = (off_m - self._off_m) / self._tick_s, off_m
        self.swing_m = math.hypot(off_m, self._rate_m_s / self.known.omega_rad_s)
        coming = math.fsum(map(mul, self._done, self._to_come))
        self._coming_m = self.known.full_m_s * self._tick_s * coming
        self.error_m = self._target_m - place_m - self._coming_m

    def let_go(self, time_s: float) -> bool:
        """Release the joystick where a stroke or tap ends; return whether a tap may begin now."""
        if not self.wanted:
            return time_s >= self._ready_s
        hand_s = 0.5 * self._joystick * abs(self._joystick) * self._skill.ramp_s
        more_m = self.known.full_m_s * (hand_s + self.wanted * self._late_s)
        there = self._until_s == math.inf and (self.error_m - more_m) * self.wanted <= 0.0
        if there or time_s >= self._until_s:  # the effect is seen one reaction time later
            self.wanted, self._ready_s = 0.0, time_s + self._skill.reaction_s
            self._late_s = self._skill.timing_s * self._source.gauss()
        return False

    def worth_m(self, within_m: float) -> float:
        """Return the way in m of a correction; 0 if the error, by this tolerance, is too small."""
        worth_m = max(self._skill.dead_m, _WORTH_A_TAP * within_m)
        worth_m += self._skill.run_on * abs(self._coming_m)
        return self.error_m if abs(self.error_m) > worth_m else 0.0

    def caught_m(self, time_s: float, part: float) -> float:
        """Return the way in m of a tap that is half done when the load turns; 0 if not due now.

        It takes half of the remaining error and half of this part of the swing.
        """
        omega = self.known.omega_rad_s
        phase = math.atan2(-self._rate_m_s / omega, self._off_m)  # the swing turns at each pi
        for turn in range(math.ceil(phase / math.pi), math.ceil(phase / math.pi) + 3):
            turns_s = time_s - self._skill.reaction_s + (turn * math.pi - phase) / omega
            way_m = 0.5 * (self.error_m + part * (-self.swing_m if turn % 2 else self.swing_m))
            hand_s = 0.5 * (self._shape(way_m)[0] + self._skill.ramp_s)
            if abs(turns_s + self._late_s - self._run_on_s - hand_s - time_s) <= self._tick_s:
                return way_m
        return 0.0

    def _shape(self, way_m: float) -> tuple[float, float]:
        """Return the duration of a tap in s, and its deflection, -1 .. 1."""
        level = abs(way_m) / (self.known.full_m_s * _TAP_S)
        level = min(1.0, max(_LEAST_LEVEL, level))
        return abs(way_m) / (self.known.full_m_s * level), math.copysign(level, way_m)

    def tap(self, time_s: float, way_m: float) -> None:
        """Begin a tap that moves the tip by way_m, with the noise of the hand."""
        noise = 1.0 + self._skill.motor * self._source.gauss()
        lasts_s, self.wanted = self._shape(way_m * noise)
        self._until_s = time_s + lasts_s

    def advance(self) -> float:
        """Move the hand for one tick; return the position of the joystick until the next tick."""
        most = self._tick_s / self._skill.ramp_s
        self._joystick += min(max(self.wanted - self._joystick, -most), most)
        self._done.appendleft(self._joystick)
        return self._joystick
