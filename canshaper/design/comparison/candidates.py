"""The filters that are compared, made for one axis of a deployment."""

from dataclasses import dataclass, replace

from canshaper.config.filters import Filter, filter_of
from canshaper.config.motion import Motion
from canshaper.config.schema import Slewing
from canshaper.design.swinging import swinging_axis
from canshaper.design.tuning.robust import RobustShaper, least_residual
from canshaper.machine.deployment import Deployment
from canshaper.machine.motion import BoundMotion
from canshaper.shaping.registry import KINDS
from canshaper.shaping.sway import SwayMode

# Time of the run-on that every filter is given: longer than the longest of them takes.
TAIL_S = 3.0
# Impulse responses: duration in swings, and the range of pendulum length they are made for.
DESIGNS = ((0.41, 30.0), (0.7, 30.0), (0.73, 15.0), (0.77, 15.0), (0.82, 15.0), (1.0, 30.0))


@dataclass(frozen=True)
class Candidate:
    """A filter with a name for tables, and whether it is one of ours.

    Attributes:
        name: what it is called.
        filter: as it would stand in a deployment file.
        ours: limit-aware, as G_FF and the robust shaper are.
        motion: with the two-axis motion (slew axes).
    """

    name: str
    filter: Filter
    ours: bool = False
    motion: bool = False


def candidates(deployment: Deployment, axis: str) -> list[Candidate]:
    """Every filter for this axis; the impulse responses are designed for its valve's rate.

    Raises:
        DesignError: there is no such axis, or it has no sway data.
    """
    bound, sway = swinging_axis(deployment, axis)
    config = bound.config
    mode = sway.mode()
    tick_s = bound.period_ticks * deployment.config.tick_ms / 1000.0
    rate = config.limits.slowest_per_s
    period = mode.period_s
    found = [
        Candidate(label, filter_of(kind.name, **parameters), ours=kind.limit_aware)
        for kind in sorted(KINDS.values(), key=lambda kind: kind.limit_aware)
        for label, parameters in kind.settings(mode, tick_s).items()
    ]
    for periods, range_pct in DESIGNS:
        shaper = least_residual(
            mode,
            tick_s=tick_s,
            duration_s=round(periods * period / tick_s) * tick_s,
            range_pct=range_pct,
            rate_per_s=rate,
        )
        name = f"robust {shaper.duration_s:.1f} s ±{range_pct:g} %"
        found.append(Candidate(name, robust_filter(shaper, tick_s), ours=True))
    if motion_of(deployment, axis) is not None:
        robust = [c for c in found if c.name.startswith("robust")]
        with_motion = [c for c in found if c.name in ("G_FF near-far poles", "G_FF third pole -4")]
        with_motion += robust[2:]
        found += [replace(c, name=f"{c.name} +motion", motion=True) for c in with_motion]
    return found


def robust_filter(shaper: RobustShaper, tick_s: float) -> Filter:
    """A designed impulse response as it stands in a deployment file."""
    taps = [round(tap, 8) for tap in shaper.taps]
    return filter_of("robust", tick_ms=round(1000.0 * tick_s), taps=taps)


def motion_of(deployment: Deployment, axis: str) -> BoundMotion | None:
    """Two-axis motion of a slew axis: that of the file, or one for the simulated crane."""
    for motion in deployment.motions.values():
        if motion.config.slew == axis:
            return motion
    near_far = deployment.axes.get("near_far")
    if axis != "slew" or near_far is None or near_far.config.sway is None:
        return None
    return BoundMotion(Motion(slew=axis, near_far="near_far", radius_m=3.0))


def with_candidate(deployment: Deployment, axis: str, candidate: Candidate) -> Deployment:
    """The deployment with this filter on the axis, and with time enough to run on."""
    bound = deployment.axes[axis]
    limits = bound.config.limits.model_copy(update={"tail_s": TAIL_S})
    slewing = bound.config.slewing or Slewing(full_speed_rad_s=0.5, largest_radius_m=9.6)
    changes = {"filter": candidate.filter, "limits": limits, "slewing": slewing}
    config = bound.config.model_copy(update=changes)
    motion = motion_of(deployment, axis) if candidate.motion else None
    axes = {**deployment.axes, axis: replace(bound, config=config)}
    return replace(deployment, axes=axes, motions={"crane": motion} if motion else {})


def nominal_mode(deployment: Deployment, axis: str) -> SwayMode:
    """Sway mode of the axis as the deployment has it."""
    sway = deployment.axes[axis].config.sway
    assert sway is not None  # candidates() has refused it
    return sway.mode()
