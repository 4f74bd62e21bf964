"""Drive one candidate through one manoeuvre, or all candidates through all on all processors."""

import math
from collections.abc import Callable
from dataclasses import dataclass, replace
from functools import cache, partial
from itertools import pairwise
from pathlib import Path

from canshaper.design.comparison.manoeuvres import (
    AXES,
    LOAD_M,
    LOAD_MASS,
    Candidate,
    Manoeuvre,
    with_candidate,
)
from canshaper.design.lockstep import drive
from canshaper.design.parallel import Processes
from canshaper.machine.binding import load_deployment
from canshaper.machine.deployment import Deployment
from canshaper.report.metrics import axis_metrics
from canshaper.report.stroke_metrics import crane_metrics, integral
from canshaper.report.strokes import RESIDUAL_DWELL_S
from canshaper_sim.crane import CraneParameters
from canshaper_sim.grapple import Grapple, Sway
from canshaper_sim.recording import Recording

# Below this part of full speed the tip stands still; the next motion is another movement.
STANDS = 0.01


@dataclass(frozen=True)
class Outcome:
    """Measures of one candidate in one manoeuvre at one length error.

    Attributes:
        residual_deg: largest swing after the dwell: tilt of the grapple in both planes together.
        peak_deg: largest tilt during the drive.
        path: total way of the tip on both axes, there and back, in s of full speed.
        travel: in a tap: way of the tip along the axis, in s of full speed.
        movements: in a tap: number of times that the tip began to move.
        rise_s: in a pulse: time to 95 % of the commanded speed.
        still_s: in a pulse: time from release until the tilt stays below ``still_deg`` of the file.
        swings_on: in a pulse: ``still_s`` is a lower bound, since the drive ended before.
        stop_s: in a pulse: run-on after release until the tip stays below 5 % of full speed.
        run_on_m: in a pulse: travel after release; for slew on the largest radius.
        dip: in a pulse: largest fall of the command while the joystick is held, part of full.
        re_rise: in a pulse: largest rise of the command after release, part of full.
    """

    candidate: str
    manoeuvre: str
    work: str
    axis: str | None
    length_pct: int
    residual_deg: float
    peak_deg: float
    path: float
    travel: float | None = None
    movements: int | None = None
    still_s: float | None = None
    swings_on: bool | None = None
    rise_s: float | None = None
    stop_s: float | None = None
    run_on_m: float | None = None
    dip: float | None = None
    re_rise: float | None = None


def measure(
    deployment: Deployment, candidate: Candidate, task: Manoeuvre, length_pct: int
) -> Outcome:
    """Drive a candidate once through a manoeuvre and measure the drive."""
    grapple = task.crane.grapple.longer(length_pct)
    recording = drive(
        with_candidate(deployment, candidate),
        task.script,
        parameters=replace(task.crane, grapple=grapple),
        sway=Sway(theta6_rad=math.radians(task.initial_deg)),
        loads=() if task.load_s is None else ((task.load_s, _loaded(grapple)),),
    )
    assert recording.crane is not None  # a crane with a tip measures both planes
    tilt_deg = recording.crane.sway_deg
    quiet_s = max(s.end_s for s in task.script.strokes) + RESIDUAL_DWELL_S
    outcome = Outcome(
        candidate.name,
        task.name,
        task.work,
        task.axis,
        length_pct,
        residual_deg=max(a for t, a in zip(recording.t_s, tilt_deg, strict=True) if t >= quiet_s),
        peak_deg=max(tilt_deg),
        path=sum(integral(recording.t_s, [*map(abs, recording.axes[a].speed)]) for a in AXES),
    )
    if task.work == "tap" and task.axis:
        speed = recording.axes[task.axis].speed
        travel = integral(recording.t_s, speed)
        return replace(outcome, travel=travel, movements=_movements(speed))
    if task.work == "pulse" and task.axis:
        return _with_metrics(outcome, recording, task.axis, deployment)
    return outcome


def _loaded(grapple: Grapple) -> Grapple:
    return replace(grapple, m2_kg=LOAD_MASS * grapple.m2_kg, l2_m=grapple.l2_m + LOAD_M)


def _movements(speed: list[float]) -> int:
    moves = [abs(v) > STANDS for v in speed]
    return sum(now and not before for before, now in pairwise([False, *moves]))


def _with_metrics(
    outcome: Outcome, recording: Recording, axis: str, deployment: Deployment
) -> Outcome:
    """Return the outcome with the pulse's rise, run-on, dip and time until still."""
    of_axis = axis_metrics(recording, axis)
    assert recording.crane is not None  # a crane with a tip measures both planes
    of_crane = crane_metrics(recording, recording.crane, deployment.config.still_deg)
    crane = CraneParameters()
    full_m_s = crane.near_far_full_speed_m_s
    if axis == "slew":
        slewing = deployment.axes[axis].config.slewing
        radius_m = slewing.largest_radius_m if slewing else crane.radius_max_m
        full_m_s = crane.slew_full_speed_rad_s * radius_m
    return replace(
        outcome,
        still_s=of_crane.still_s,
        swings_on=of_crane.swings_on,
        rise_s=of_axis.time_to_95_s,
        stop_s=of_axis.run_on_s,
        run_on_m=(of_axis.run_on_travel or 0.0) * full_m_s,
        dip=of_axis.dip,
        re_rise=of_axis.re_rise,
    )


def measure_all(
    file: Path,
    candidates: list[Candidate],
    tasks: list[Manoeuvre],
    *,
    on_progress: Callable[[float], None],
    processes: int | None = None,
) -> list[Outcome]:
    """Drive every candidate through every manoeuvre; return the outcomes in this order.

    An interrupt ends it and its processes at once.

    Args:
        file: deployment file, loaded again in every process.
        on_progress: called with the part done, 0 to 1.
        processes: number of processes; by default one for each processor.
    """
    jobs = [(c, t, p) for c in candidates for t in tasks for p in t.lengths_pct]
    outcomes = []
    for done, (_, outcome) in enumerate(Processes(processes).run(partial(_measure, file), jobs), 1):
        outcomes.append(outcome)
        on_progress(done / len(jobs))
    order = {(c.name, t.name, p): i for i, (c, t, p) in enumerate(jobs)}
    return sorted(outcomes, key=lambda o: order[o.candidate, o.manoeuvre, o.length_pct])


def _measure(file: Path, job: tuple[Candidate, Manoeuvre, int]) -> Outcome:
    return measure(_deployment(file), *job)


@cache  # loaded once a process
def _deployment(file: Path) -> Deployment:
    return load_deployment(file)
