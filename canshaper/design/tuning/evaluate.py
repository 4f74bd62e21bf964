"""Measures of a filter setting: joystick and swing, also with wrong sway data.

The module is pure and works for every filter: it runs the deployed code tick by tick. Times are in
s and speeds in fractions of full speed. Residual sway is a fraction of the sway that the same
joystick movement leaves without the filter.
"""

import cmath
import math
from collections.abc import Callable, Sequence
from dataclasses import dataclass, field
from itertools import accumulate
from typing import Self

from canshaper.config.filters import Filter
from canshaper.design.tuning.formulation import SETTLED, at_length, gain_at
from canshaper.machine.valves import BoundAxis
from canshaper.shaping.axis import ShapedAxis
from canshaper.shaping.limits import OutputLimits
from canshaper.shaping.registry import build_shaper
from canshaper.shaping.shapers.gff import Gff
from canshaper.shaping.shapers.kind import Shaper
from canshaper.shaping.states import CommandInput
from canshaper.shaping.sway import SwayMode, SwayModel
from canshaper.shaping.transfer import Off

# (speed before, commands sent in each tick) of the press and of the release.
Moves = Sequence[tuple[float, list[float]]]
ShaperFor = Callable[[SwayModel], Shaper]

LENGTHS_PCT = (-30, -20, -10, 0, 10, 20, 30)
RISEN = 0.95
# A response is watched until it stays this close to its end, and no longer than this.
_AT_END, _LONGEST_S, _HELD_S = 1e-9, 120.0, 4.0
STILL = 0.02
_LAGS = 10.0  # lags of the valve until it has followed
# Longer than any plateau between two taps: half of the longest swing, 12 s of most tools.
_STILL_S, _STILL_PERIODS = 8.0, 0.6


@dataclass(frozen=True, slots=True)
class Machine:
    """Valve and limits between filter and crane.

    Attributes:
        limits: output limits of the axis.
        neutral_band: largest |joystick| that counts as neutral.
        stop_s: longest shaped stop of the axis.
        grid_steps: raw steps of the valve frame from zero to full command.
        lag_s: time constant of valve and actuator.
    """

    limits: OutputLimits = field(default_factory=OutputLimits)
    neutral_band: float = 0.02
    stop_s: float = 2.0
    grid_steps: int = 125
    lag_s: float = 0.1

    @classmethod
    def of(cls, bound: BoundAxis) -> Self:
        """Return the machine of an axis by its deployment; ``lag_s`` stays the default."""
        limits = bound.config.limits
        return cls(
            limits=limits.output_limits(),
            neutral_band=bound.config.command.neutral_pct / 100.0,
            stop_s=limits.stop_s,
            grid_steps=bound.valve.steps,
        )


@dataclass(frozen=True, slots=True)
class Residual:
    """Residual sway at one true pendulum length.

    Attributes:
        length_pct: percent by which the true pendulum is longer than the sway data says.
        linear: |H(e^(pT))| of the filter alone, at the true sway pole p.
        machine: swing after a full press and after a full release, through the limits of the axis
            and a lagging valve, as a part of that without the filter; the worse of the two. The
            swing without the filter counts as at least ``STILL`` of its largest value. At least 1
            where the press ends below half of the maximum: its first steps are rounded to none.
    """

    length_pct: float
    linear: float
    machine: float


@dataclass(frozen=True, slots=True)
class Evaluation:
    """Measures of one setting.

    Attributes:
        first_jump: part of a step that the filter passes in the tick of the step.
        peak: largest output for a unit step.
        rise_s: time until the output stays above 95 % of the command (a first jump that dips
            again does not count).
        run_on_s: time until the output stays within 5 % of the command; after a release, the
            run-on of the crane.
        mean_delay_s: area between command and output: travel of the crane after a release, in
            seconds of full speed.
        dip: largest fall of the output, through the limits, while the joystick is held.
        residuals: residual sway at each length error.
    """

    first_jump: float
    peak: float
    rise_s: float
    run_on_s: float
    mean_delay_s: float
    dip: float
    residuals: tuple[Residual, ...]

    def worst(self, within_pct: float = 30.0) -> float:
        """Return the worst residual through the machine for lengths within +- ``within_pct``."""
        return max(r.machine for r in self.residuals if abs(r.length_pct) <= within_pct)


@dataclass(frozen=True, slots=True)
class Traces:
    """A full press through the machine, and its swing with and without the filter.

    ``sent`` has one value a tick; ``swing`` and ``swing_raw`` are in s, as ``SwayModel.angle``.
    """

    t_s: tuple[float, ...]
    sent: tuple[float, ...]
    swing: tuple[float, ...]
    swing_raw: tuple[float, ...]


def gff(poles_rad_s: tuple[float, float], third_pole_rad_s: float | None = None) -> ShaperFor:
    """Return a function that makes G_FF with these poles on a sway model."""
    return lambda sway: Gff(sway, poles_rad_s, third_pole_rad_s=third_pole_rad_s)


def shaper_of(chosen: Filter, tick_s: float, valve_rate_per_s: float) -> ShaperFor:
    """Return a function that makes the filter of a file on a sway model."""
    parameters = chosen.parameters()
    return lambda sway: build_shaper(
        chosen.kind, tick_s, sway, valve_rate_per_s=valve_rate_per_s, **parameters
    )


def evaluate(
    mode: SwayMode,
    tick_s: float,
    shaper_for: ShaperFor,
    machine: Machine | None = None,
    lengths_pct: Sequence[float] = LENGTHS_PCT,
) -> Evaluation:
    """Measure a setting.

    Args:
        mode: sway mode that the filter is made for.
        tick_s: period of the axis, s.
        shaper_for: makes the filter on a sway model, such as ``gff(poles)``.
        machine: limits and valve behind the filter.
        lengths_pct: length errors of the residuals, percent.

    Raises:
        ValueError: the filter does not suit the tick.
    """
    y = step_response(mode, tick_s, shaper_for)
    end = y[-1]
    below = [k for k, value in enumerate(y) if value < RISEN * end]
    outside = [k for k, value in enumerate(y) if abs(value - end) > SETTLED * abs(end)]
    run_on_s = (outside[-1] + 1) * tick_s if outside else 0.0
    machine = machine or Machine()
    hold_s = min(_LONGEST_S, max(_HELD_S, 2.0 * run_on_s + 1.0, machine.limits.tail_s + 1.0))
    shaped, raw = _moves(mode, tick_s, shaper_for, machine, hold_s)
    residuals, sent = [], shaped[0][1]
    for percent in lengths_pct:
        true = at_length(mode, 1.0 + percent / 100.0)
        worst = _worst(true, tick_s, machine, shaped, raw)
        residuals.append(Residual(percent, gain_at(true, tick_s, y), worst))
    return Evaluation(
        first_jump=y[0],
        peak=max(y),
        rise_s=(below[-1] + 1) * tick_s if below else 0.0,
        run_on_s=run_on_s,
        mean_delay_s=sum(1.0 - value / end for value in y) * tick_s,
        dip=max(top - value for top, value in zip(accumulate(sent, max), sent, strict=True)),
        residuals=tuple(residuals),
    )


def step_response(mode: SwayMode, tick_s: float, shaper_for: ShaperFor) -> list[float]:
    """Return the unlimited output for a unit step, one value a tick, until still or 120 s long."""
    sway = SwayModel(mode, tick_s)
    shaper = shaper_for(sway)
    y: list[float] = []
    still = 0
    still_s = max(_STILL_S, _STILL_PERIODS * mode.period_s)
    while still < still_s / tick_s and len(y) < _LONGEST_S / tick_s:
        command = shaper.step(1.0)
        sway.step(command)
        still = still + 1 if y and abs(command - y[-1]) < _AT_END * tick_s else 0
        y.append(command)
    return y


def press(
    mode: SwayMode, tick_s: float, shaper_for: ShaperFor, machine: Machine, duration_s: float
) -> Traces:
    """Return a full press from rest and the swing it makes, for a picture."""
    presses = [moves[0] for moves in _moves(mode, tick_s, shaper_for, machine, duration_s)]
    sent = presses[0][1]
    angles = [
        tuple(c.imag / mode.pole.imag for c in _modal(mode, tick_s, machine.lag_s, *press))
        for press in presses
    ]
    return Traces(tuple(k * tick_s for k in range(len(sent))), tuple(sent), *angles)


def _moves(
    mode: SwayMode, tick_s: float, shaper_for: ShaperFor, machine: Machine, hold_s: float
) -> tuple[Moves, Moves]:
    """Return press and release through the axis, with the filter and without."""
    shaped = _press_and_release(mode, tick_s, shaper_for, machine, hold_s)
    return shaped, _press_and_release(mode, tick_s, lambda _sway: Off(), machine, hold_s)


def _press_and_release(
    mode: SwayMode, tick_s: float, shaper_for: ShaperFor, machine: Machine, hold_s: float
) -> Moves:
    sway = SwayModel(mode, tick_s)
    axis = ShapedAxis(
        tick_s,
        machine.limits,
        sway=sway,
        shaper=shaper_for(sway),
        neutral_band=machine.neutral_band,
        stop_s=machine.stop_s,
        grid_steps=machine.grid_steps,
    )
    axis.tick(CommandInput(0.0))  # seen in neutral: ready
    count = round(hold_s / tick_s)
    moves = []
    for command in (1.0, 0.0):
        before, sent = axis.output.setpoint, []
        for _ in range(count):
            axis.tick(CommandInput(command))
            sent.append(axis.output.setpoint)
        moves.append((before, sent))
    return moves


def swing_left(
    mode: SwayMode,
    tick_s: float,
    shaper_for: ShaperFor,
    machine: Machine,
    trues: Sequence[SwayMode],
) -> list[float]:
    """Return ``Residual.machine`` for each true pendulum, of a press held for 4 s."""
    shaped, raw = _moves(mode, tick_s, shaper_for, machine, _HELD_S)
    return [_worst(true, tick_s, machine, shaped, raw) for true in trues]


def _worst(true: SwayMode, tick_s: float, machine: Machine, shaped: Moves, raw: Moves) -> float:
    """Return ``Residual.machine`` for one true pendulum."""
    worst = 0.0
    for (speed, sent), (raw_speed, raw_sent) in zip(shaped, raw, strict=True):
        count = max(_moving(sent), _moving(raw_sent))
        count += round(_LAGS * machine.lag_s / tick_s)
        swing = _modal(true, tick_s, machine.lag_s, speed, sent[:count])
        other = _modal(true, tick_s, machine.lag_s, raw_speed, raw_sent[:count])
        least = STILL * max(abs(c.imag) for c in other)
        worst = max(worst, abs(swing[-1]) / max(abs(other[-1]), least, 1e-12))
    if shaped[0][1][-1] < 0.5 * machine.limits.maximum:
        return max(worst, 1.0)  # no swing, because its first steps are rounded to none
    return worst


def _moving(sent: Sequence[float]) -> int:
    """Return the number of ticks until the output stands still."""
    count = len(sent)
    while count > 1 and sent[count - 1] == sent[count - 2]:
        count -= 1
    return count


def _modal(
    mode: SwayMode, tick_s: float, lag_s: float, speed: float, sent: Sequence[float]
) -> list[complex]:
    """Return c = x' - conj(p) x of x'' + 2 zeta w x' + w^2 x = v', lag v' + v = sent, exactly.

    c' = p c + v', and |c| is the amplitude of the free swing. ``sent`` is constant over a tick, so
    that v' decays with the lag.
    """
    free, slow = cmath.exp(mode.pole * tick_s), math.exp(-tick_s / lag_s)
    forced = (free - slow) / (mode.pole + 1.0 / lag_s) / lag_s
    c, result = 0j, []
    for held in sent:
        result.append(c)
        c = free * c + forced * (held - speed)
        speed = held + (speed - held) * slow
    return result
