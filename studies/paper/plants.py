"""The two plants on which the paper's strokes are driven.

Both carry the nonlinear grapple with the assumed parameters of `Grapple`; the paper publishes none.

- ``linear``: what the paper's simulation presumably had. Eq. 13 alone, its numerator from l2 for
  both axes as printed, sampled with the exact zeros; a valve that only lags by 100 ms: no limit of
  flow or rate, no deadband, no resolution.
- ``real``: the shipped controller with its limits, through CAN frames in lock-step, on valves with
  rate limit and deadband. The numerator is that of the axis' own swing.
"""

import math
from dataclasses import replace
from functools import cache
from typing import Final

from canshaper.config.filters import filter_of
from canshaper.design.lockstep import drive
from canshaper.machine.deployment import Deployment
from canshaper.report.strokes import RESIDUAL_DWELL_S
from canshaper.shaping.shapers.gff import Gff
from canshaper.shaping.sway import SwayMode, SwayModel
from canshaper_sim.actuator import Actuator
from canshaper_sim.axes import LIFT, NEAR_FAR, SLEW
from canshaper_sim.crane import Crane, CraneParameters
from canshaper_sim.grapple import Grapple, Sway
from canshaper_sim.recording import AxisTrace, Recording
from canshaper_sim.strokes import Script, Stroke
from canshaper_sim.tip_boom import TipBoom
from canshaper_sim.valve import ValveParameters
from studies.paper.printed import optimal_poles
from studies.paper.runs import Run

LINEAR, REAL = "linear", "real"
PLANTS: Final = (LINEAR, REAL)
TICK_S: Final = 0.02  # the paper gives no sampling time; commands are held over it
# Full deflection for 3 s, pressed and released at once, then 5 s of rest: the paper gives no times.
PRESS_S, HOLD_S, REST_S = 0.5, 3.0, 5.0
# The linear valve opens this much farther than a full command: no pole pair up to -10, -10 meets
# its end (12 times the command at l2 = 1.2 m).
_HEAD_ROOM = 40.0
_LAG_ONLY = ValveParameters(deadband=0.0, rate_limit_1_s=math.inf)


def stroke(axis: str, rest_s: float = REST_S) -> Script:
    """The stroke that every figure is driven with, and seconds of rest after it."""
    duration_s = PRESS_S + HOLD_S + rest_s
    return Script(f"paper-{axis}", (Stroke(axis, PRESS_S, HOLD_S, 1.0, 0.0),), duration_s)


def printed_mode(grapple: Grapple) -> SwayMode:
    """Sway mode of the numerator of Eq. 13 as printed: from l2, for both axes."""
    return SwayMode.from_grapple(grapple.l2_m, grapple.c6_n_m_s_rad, grapple.m2_kg)


def linear_run(
    axis: str,
    poles_rad_s: tuple[float, float],
    grapple: Grapple | None = None,
    rest_s: float = REST_S,
) -> Run:
    """The stroke without and with Eq. 13 on the linear valve.

    Args:
        axis: slew or near_far.
        poles_rad_s: poles of the filter, rad/s.
        grapple: the grapple, known to the filter; by default the assumed one.
        rest_s: how long the drive goes on after the release, s.
    """
    script, grapple = stroke(axis, rest_s), grapple or Grapple()
    raw, shaped = (_linear_drive(axis, script, poles, grapple) for poles in (None, poles_rad_s))
    return Run(axis, LINEAR, _slow_first(poles_rad_s), raw, shaped)


def real_run(deployment: Deployment, axis: str, poles_rad_s: tuple[float, float]) -> Run:
    """The stroke with anti-sway off and on, on the simulated machine of the deployment.

    Args:
        deployment: as shipped; only the poles of the filter of this axis are replaced.
        axis: slew or near_far.
        poles_rad_s: poles of the filter, rad/s.
    """
    bound = deployment.axes[axis]
    config = bound.config.model_copy(
        update={"filter": filter_of("gff", poles_rad_s=list(poles_rad_s))}
    )
    tuned = replace(deployment, axes={**deployment.axes, axis: replace(bound, config=config)})
    raw = drive(deployment, stroke(axis), bypass=True)
    return Run(axis, REAL, _slow_first(poles_rad_s), raw, drive(tuned, stroke(axis)))


def _slow_first(poles_rad_s: tuple[float, float]) -> tuple[float, float]:
    return max(poles_rad_s), min(poles_rad_s)


def swinging_deg(start_deg: float) -> tuple[float, float]:
    """Swing along the boom later than 2.5 s after a near-far stroke, begun while it swings so much.

    Returns:
        With the printed near-far filter, and of a crane that stands still all the time.
    """
    script, grapple = stroke(NEAR_FAR), Grapple()
    still = replace(script, strokes=())
    poles = optimal_poles(NEAR_FAR)
    settled = round((PRESS_S + HOLD_S + RESIDUAL_DWELL_S) / TICK_S)
    left = []
    for one in (script, still):
        sway = _linear_drive(NEAR_FAR, one, poles, grapple, start_deg).axes[NEAR_FAR].sway_deg
        assert sway is not None
        left.append(max(map(abs, sway[settled:])))
    return left[0], left[1]


class _LinearBoom(TipBoom):
    """A boom whose valves lag and do nothing else."""

    __slots__ = ()

    def __init__(self, parameters: CraneParameters) -> None:
        p = parameters

        def free(full_speed: float, start: float) -> Actuator:
            return Actuator(_LAG_ONLY, _HEAD_ROOM * full_speed, start, -math.inf, math.inf)

        self._slew = free(p.slew_full_speed_rad_s, p.start_theta1_rad)
        self._near_far = free(p.near_far_full_speed_m_s, p.start_radius_m)
        self._lift = free(p.lift_full_speed_m_s, p.start_height_m)
        self.axes = {SLEW: self._slew, NEAR_FAR: self._near_far, LIFT: self._lift}


@cache
def _linear_drive(
    axis: str,
    script: Script,
    poles_rad_s: tuple[float, float] | None,
    grapple: Grapple,
    start_deg: float = 0.0,
) -> Recording:
    """The stroke on the linear valve; one row a tick, as the recorder of the plant writes them."""
    parameters = CraneParameters(grapple=grapple)
    start = Sway(theta6_rad=math.radians(start_deg))
    crane = Crane(parameters, start, _LinearBoom(parameters))
    sway = SwayModel(printed_mode(grapple), TICK_S)
    shaper = Gff(sway, poles_rad_s) if poles_rad_s else None
    full = {
        SLEW: parameters.slew_full_speed_rad_s,
        NEAR_FAR: parameters.near_far_full_speed_m_s,
    }
    rows: list[tuple[float, float, float, float, float, float]] = []
    for k in range(round(script.duration_s / TICK_S)):
        joystick = script.command(axis, k * TICK_S)
        sent = shaper.step(joystick) if shaper else joystick
        sway.step(sent)
        crane.step(TICK_S, {axis: sent / _HEAD_ROOM})
        state = crane.state
        rate = state.theta1_rate_rad_s if axis == SLEW else state.radius_rate_m_s
        angles = (math.degrees(state.theta5_rad), math.degrees(state.theta6_rad))
        rows.append(((k + 1) * TICK_S, joystick, sent, rate / full[axis], *angles))
    t_s, joysticks, commands, speeds, theta5, theta6 = (list(c) for c in zip(*rows, strict=True))
    still = [0.0] * len(t_s)
    traces = {
        name: AxisTrace(joysticks, commands, speeds, angle)
        if name == axis
        else AxisTrace(still, still, still, angle)
        for name, angle in ((SLEW, theta5), (NEAR_FAR, theta6))
    }
    return Recording(t_s, traces)
