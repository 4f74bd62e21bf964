"""A working cycle of a modelled operator: empty grapple out to the pile, log back.

A move ends when tip and swing have been within the tolerance for a while. A move that takes longer
than ``LIMIT_S`` counts as ``LIMIT_S``; so do the move in which the grapple swings above the
horizontal and all moves after it. Between two moves the grapple stands on pile or bunk, and the
joysticks are neutral. Lift and rotator do not move: their time is the same in every set-up.
"""

import math
import random
from dataclasses import dataclass, field, replace
from typing import NamedTuple

from canshaper.campaign.draw import driven_axes
from canshaper.campaign.run import Source
from canshaper.design.comparison.manoeuvres import Candidate, with_candidate
from canshaper.design.lockstep import DriveOptions, OnFrame, Simulation
from canshaper.design.profiles import choosing
from canshaper.errors import CampaignError
from canshaper.machine.deployment import Deployment
from canshaper_sim.axes import HOIST, NEAR_FAR, SLEW
from canshaper_sim.crane import Crane, CraneParameters
from canshaper_sim.operator_model import Known, OperatorModel, Skill
from canshaper_sim.parameters import changed_parameters
from canshaper_sim.strokes import Script, Stroke

MOVES, LIMIT_S, LOADS, AXES = 10, 30.0, ("empty", "log"), (SLEW, NEAR_FAR)
_HELD_S, _GRIP_S = 0.3 - 1e-9, 1.5  # time within the tolerance; rest between two moves, not counted
# Slew angle, degrees, and radius, m, of the bunk, behind the cab, and of the pile: as measured in
# loading (Hartsch et al. 2022, 2024: 45 to 135 degrees, 4 to 10 m), as far as this crane reaches.
_PLACES = ((-5.0, 5.0), (2.6, 3.4)), ((55.0, 125.0), (4.0, 7.0))
# A log of 600 kg in a grapple of 300 kg, .4 m lower: the heaviest load that a campaign draws.
_LOG_MASS, _LOG_M = 3.0, 0.4
_PRESS = (2.0, 3.2, 0.5, 0.0)  # start, duration, level, ramp
_STANDS = 0.01  # of the speed at the release: below it the axis stands


@dataclass(frozen=True)
class SetUp:
    """The filters that an operator works with.

    Attributes:
        name: name of the set-up; without a candidate the profile, "" for the filters of the file.
        bypass: anti-sway is off.
        candidate: filters that replace those of the file.
    """

    name: str = ""
    bypass: bool = False
    candidate: Candidate | None = field(default=None, compare=False)

    def deployment(self, source: Source) -> Deployment:
        """Return the deployment with the filters of this set-up."""
        loaded = source.load()
        return with_candidate(loaded, self.candidate) if self.candidate else loaded

    @property
    def options(self) -> DriveOptions:
        """Options of the simulated drives: anti-sway off, or a profile to choose."""
        if self.bypass or self.candidate or not self.name:
            return {"bypass": self.bypass}
        return {"prepare": choosing(self.name)}


@dataclass(frozen=True)
class Work:
    """One working cycle: set-up, operator, tolerance and places.

    Attributes:
        known: see ``learn``.
        techniques: (part of full speed, share of the swing that he catches) for each load.
        within: tolerance: (tip from the target, m; swing, degrees; infinite: any).
        seed: seed of places and operator.
    """

    set_up: SetUp
    operator: str
    skill: Skill
    known: tuple[Known, ...]
    techniques: tuple[tuple[float, float], ...]
    within: tuple[float, float]
    seed: str


class Move(NamedTuple):
    """Result of one move.

    Attributes:
        load: one of ``LOADS``.
        done: whether it ended within ``LIMIT_S``, and without a grapple above the horizontal.
        seconds: its duration; ``LIMIT_S`` where it is not done.
        taps: number of corrections and catches.
        waiting_s: time with every joystick neutral.
        peak_deg: largest tilt of the grapple.
        beyond_m: largest overshoot of an axis.
    """

    load: str
    done: bool = False
    seconds: float = LIMIT_S
    taps: int = 0
    waiting_s: float = 0.0
    peak_deg: float = 90.0
    beyond_m: float = 0.0


@dataclass(frozen=True, slots=True)
class _Joysticks(Script):
    """Joysticks in the hands of the modelled operator."""

    held: dict[str, float] = field(default_factory=dict)

    def command(self, axis: str, time_s: float) -> float:
        """Return the present joystick value of an axis, -1 to 1."""
        return self.held.get(axis, 0.0)


def places(crane: CraneParameters, seed: str) -> list[tuple[float, float]]:
    """Return (slew, rad; radius, m) of start and targets: bunk, pile, ..., as far as it reaches."""
    source = random.Random(f"places {seed}")
    side, at = source.choice((-1.0, 1.0)), []
    for number in range(MOVES + 1):
        degrees, metres = _PLACES[number % 2]
        slew, radius_m = math.radians(side * source.uniform(*degrees)), source.uniform(*metres)
        slew = min(max(slew, crane.slew_min_rad), crane.slew_max_rad)
        at.append((slew, min(max(radius_m, crane.radius_min_m), crane.radius_max_m)))
    return at


def learn(source: Source, set_up: SetUp) -> tuple[Known, ...]:
    """Measure what practice teaches of a crane: press and release each joystick once.

    Returns:
        What is known of slew, in rad where ``Known`` says m, and of near-far.

    Raises:
        CampaignError: the crane has no slew or no near-far axis, has a rope, or does not move.
        ConfigError: the deployment does not fit the machine.
    """
    deployment = set_up.deployment(source)
    nominal = changed_parameters([*source.changes], deployment)
    crane, axes = driven_axes(deployment)
    if not {*AXES} <= {*axes} or HOIST in axes:
        text = f"expected axes {' and '.join(AXES)}, got {', '.join(axes)}"
        text += ": its operator knows no rope" if HOIST in axes else ""
        raise CampaignError(f"{deployment.path}: {text}")
    middle_m, known = 0.5 * (nominal.radius_min_m + nominal.radius_max_m), []
    start = replace(nominal, start_radius_m=middle_m)
    options: DriveOptions = {"parameters": start, "crane": crane, **set_up.options}
    for axis in AXES:
        press = Stroke(axis, *_PRESS)
        simulation = Simulation(deployment, Script("press", (press,), 9.0), **options)
        speeds = list[float]()
        for time_ms in simulation.ticks():
            if time_ms < 1000.0 * press.end_s:
                speeds.clear()
            speeds.append(simulation.plant.crane.speed(axis))
        if speeds[0] <= 0.0:
            text = f"expected {axis} to move when its joystick is at {press.level:.0%}"
            raise CampaignError(f"{deployment.path}: {text}; it stood")
        fall = [speed / speeds[0] for speed in speeds]
        while len(fall) > 1 and abs(fall[-1]) < _STANDS:
            fall.pop()
        known.append(Known(speeds[0] / press.level, tuple(fall)))
    return tuple(known)


def do_work(
    source: Source, work: Work, on_frame: OnFrame | None = None, moves: int = MOVES
) -> list[Move]:
    """Do one working cycle, or its first moves; ``on_frame`` gets all frames, with times in s."""
    deployment = work.set_up.deployment(source)
    nominal = changed_parameters([*source.changes], deployment)
    at, tick_s = places(nominal, work.seed), deployment.config.tick_ms / 1000.0
    joysticks = _Joysticks("work", (), (MOVES + 1) * (_GRIP_S + LIMIT_S))
    options: DriveOptions = {
        "parameters": replace(nominal, start_theta1_rad=at[0][0], start_radius_m=at[0][1]),
        "crane": driven_axes(deployment)[0],
        **work.set_up.options,
    }
    simulation = Simulation(deployment, joysticks, on_frame, **options)
    crane, ticks, done = simulation.plant.crane, simulation.ticks(), list[Move]()
    for number, (slew_rad, radius_m) in enumerate(at[1 : 1 + moves]):
        load, grapple = LOADS[number % 2], nominal.grapple
        if crane.swung_over:
            done.append(Move(load))
            continue
        if load == "log":
            mass_kg, length_m = _LOG_MASS * grapple.m2_kg, grapple.l2_m + _LOG_M
            grapple = replace(grapple, m2_kg=mass_kg, l2_m=length_m)
        modes = grapple.mode5, grapple.mode6
        unit = replace(grapple, c5_n_m_s_rad=1.0, c6_n_m_s_rad=1.0)
        c5, c6 = 1.0 / unit.mode5.zeta, 1.0 / unit.mode6.zeta  # critical: it stands on the ground
        crane.pick_up(replace(grapple, c5_n_m_s_rad=c5, c6_n_m_s_rad=c6))
        for _ in range(round(_GRIP_S / tick_s)):
            next(ticks)
        crane.pick_up(grapple)
        tip_m, most_deg = work.within
        axes = zip(work.known, (slew_rad, radius_m), (radius_m, 1.0), modes, strict=True)
        task = [
            (Known(one.full_m_s * metre, one.fall, mode.omega_rad_s), target * metre)
            for one, target, metre, mode in axes
        ]
        within = tip_m, math.radians(most_deg) * (grapple.l1_m + grapple.l2_m)
        way, seed = work.techniques[number % 2], f"{work.seed} {number}"
        operator = OperatorModel(work.skill, way, task, within, seed=seed, tick_s=tick_s)
        begin, *_ = _seen(crane, radius_m)
        seconds = held_s = waiting_s = peak_deg = beyond_m = 0.0
        while held_s < _HELD_S and seconds < LIMIT_S and not crane.swung_over:
            next(ticks)
            seconds += tick_s
            seen, tilt_deg, swing_deg = _seen(crane, radius_m)
            operator.see(seconds, seen)
            joysticks.held.update(zip(AXES, operator.joysticks, strict=True))
            waiting_s += tick_s * (not any(operator.joysticks))
            off_m = [place - target for (place, _), (_, target) in zip(seen, task, strict=True)]
            for (start, _), (_, target), off in zip(begin, task, off_m, strict=True):
                beyond_m = max(beyond_m, math.copysign(1.0, target - start) * off)
            peak_deg = max(peak_deg, tilt_deg)
            near = math.hypot(*off_m) <= tip_m and swing_deg <= most_deg
            held_s = held_s + tick_s if near else 0.0
        joysticks.held.clear()
        in_time = held_s >= _HELD_S
        took_s = seconds if in_time else LIMIT_S
        done.append(Move(load, in_time, took_s, operator.taps, waiting_s, peak_deg, beyond_m))
    return done


def _seen(crane: Crane, radius_m: float) -> tuple[list[tuple[float, float]], float, float]:
    """Return (tip, load from the tip) of slew and near-far, m; then tilt and swing, degrees.

    Slew is the way along the arc at ``radius_m``; swing is the largest tilt that follows without
    motion of the tip. A lean in the wind is neither.
    """
    state, grapple, (across, along) = crane.state, crane.parameters.grapple, crane.rest_rad
    tilt = state.theta5_rad - across, state.theta6_rad - along
    out_m, across_m = grapple.offset_m(*tilt)
    rate5 = state.theta5_rate_rad_s / grapple.mode5.omega_rad_s
    rate6 = state.theta6_rate_rad_s / grapple.mode6.omega_rad_s
    seen = [(state.theta1_rad * radius_m, across_m), (state.radius_m, out_m)]
    return seen, math.degrees(math.hypot(*tilt)), math.degrees(math.hypot(*tilt, rate5, rate6))
