"""Driving one candidate through one manoeuvre, and all of them on all processors."""

import math
from collections.abc import Callable
from concurrent.futures import ProcessPoolExecutor, as_completed
from dataclasses import dataclass, replace
from pathlib import Path

from canshaper.design.comparison.candidates import Candidate, with_candidate
from canshaper.design.comparison.manoeuvres import Manoeuvre
from canshaper.design.lockstep import drive
from canshaper.machine.binding import load_deployment
from canshaper.machine.deployment import Deployment
from canshaper.report.metrics import axis_metrics
from canshaper_sim.crane import CraneParameters
from canshaper_sim.grapple import Sway
from canshaper_sim.recording import Recording

# Residual: largest swing later than this after the last stroke, as in the report of a drive.
DWELL_S = 2.5
_PLANE = {"slew": "slew", "near_far": "near_far"}
_OTHER = {"slew": "near_far", "near_far": "slew"}


@dataclass(frozen=True)
class Outcome:
    """What one candidate left in one manoeuvre at one length error.

    Attributes:
        residual_deg: largest swing after the dwell, in the plane of the axis.
        cross_deg: the same in the other plane.
        peak_deg: largest swing of the drive, in the plane of the axis.
        rise_s: time to 95 % of the asked speed.
        stop_s: run-on after release until the tip stays below 5 % of full speed.
        dip: largest fall of the command while the stick is held.
        re_rise: largest rise of the command after release.
    """

    candidate: str
    manoeuvre: str
    length_pct: int
    residual_deg: float
    cross_deg: float
    peak_deg: float
    rise_s: float | None = None
    stop_s: float | None = None
    dip: float | None = None
    re_rise: float | None = None


def measure(
    deployment: Deployment, axis: str, candidate: Candidate, task: Manoeuvre, length_pct: int
) -> Outcome:
    """Drive once and measure."""
    crane = CraneParameters()
    length_m = crane.grapple.l2_m * (1.0 + length_pct / 100.0)
    crane = replace(crane, grapple=replace(crane.grapple, l2_m=length_m))
    start = math.radians(task.initial_deg)
    sway = Sway(theta5_rad=start) if axis == "slew" else Sway(theta6_rad=start)
    recording = drive(
        with_candidate(deployment, axis, candidate), task.script, parameters=crane, sway=sway
    )
    quiet_s = max(s.end_s for s in task.script.strokes) + DWELL_S
    own, other = recording.axes[_PLANE[axis]], recording.axes[_OTHER[axis]]
    assert own.sway_deg is not None
    assert other.sway_deg is not None
    outcome = Outcome(
        candidate.name,
        task.name,
        length_pct,
        _largest(recording, own.sway_deg, quiet_s),
        _largest(recording, other.sway_deg, quiet_s),
        max(map(abs, own.sway_deg)),
    )
    if task.name != "pulse":
        return outcome
    found = axis_metrics(recording, axis)
    return replace(
        outcome,
        rise_s=found.time_to_95_s,
        stop_s=found.run_on_s,
        dip=found.dip,
        re_rise=found.re_rise,
    )


def measure_all(
    file: Path,
    axis: str,
    found: list[Candidate],
    tasks: list[Manoeuvre],
    *,
    on_progress: Callable[[float], None],
    processes: int | None = None,
) -> list[Outcome]:
    """Every candidate through every manoeuvre, on all processors.

    Args:
        file: deployment file, loaded again in every process.
        axis: the axis that is driven.
        found: the candidates.
        tasks: the manoeuvres.
        on_progress: called with the part done, 0 to 1.
        processes: number of processes; by default one a processor.
    """
    jobs = [(c, t, p) for c in found for t in tasks for p in t.lengths_pct]
    outcomes = []
    with ProcessPoolExecutor(processes, initializer=_load, initargs=(file,)) as pool:
        futures = [pool.submit(_measure, axis, *job) for job in jobs]
        try:
            for done, future in enumerate(as_completed(futures), 1):
                outcomes.append(future.result())
                on_progress(done / len(jobs))
        except BaseException:
            pool.shutdown(wait=False, cancel_futures=True)
            raise
    order = {(c.name, t.name, p): i for i, (c, t, p) in enumerate(jobs)}
    return sorted(outcomes, key=lambda o: order[o.candidate, o.manoeuvre, o.length_pct])


def _largest(recording: Recording, sway_deg: list[float], from_s: float) -> float:
    return max(abs(s) for t, s in zip(recording.t_s, sway_deg, strict=True) if t >= from_s)


_deployment: Deployment | None = None


def _load(file: Path) -> None:
    global _deployment  # noqa: PLW0603  (one deployment a process)
    _deployment = load_deployment(file)


def _measure(axis: str, candidate: Candidate, task: Manoeuvre, length_pct: int) -> Outcome:
    assert _deployment is not None
    return measure(_deployment, axis, candidate, task, length_pct)
