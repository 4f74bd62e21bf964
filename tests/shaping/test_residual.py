"""Swing left behind a real valve: limit-aware G_FF against its ordinary realisation.

The claim of the limit-aware form, on the linear pendulum behind a slow valve, under a busy hand.
"""

import cmath
import math
import random

import numpy as np
import pytest
from scipy import signal

from canshaper.shaping.axis import ShapedAxis
from canshaper.shaping.limits import OutputLimits
from canshaper.shaping.shapers.gff import Gff, poles_from_denominator
from canshaper.shaping.shapers.kind import Shaper
from canshaper.shaping.states import CommandInput, State
from canshaper.shaping.sway import GRAVITY_M_S2, SwayMode, SwayModel
from canshaper.shaping.transfer import Off

TICK_S = 0.01
DAMPING = 0.02
VALVE_LAG_S = 0.1
LIMITS = OutputLimits(rise_per_s=4.0, fall_per_s=4.0, tail_s=2.0)
PAPER_SLEW = poles_from_denominator(0.42, 0.043)
DRIVE_S = 30.0
DWELL_S = 2.5  # residual: what still swings later than this after the release
SEEDS = range(24)


class OrdinaryGff:
    """The peer: the same sampled filter as a biquad that never learns what was really sent."""

    def __init__(self, mode: SwayMode, poles: tuple[float, float]) -> None:
        zero = cmath.exp(mode.pole * TICK_S)
        p, q = (math.exp(pole * TICK_S) for pole in poles)
        numerator = [1.0, -2.0 * zero.real, abs(zero) ** 2]
        self._a = [1.0, -(p + q), p * q]
        gain = sum(self._a) / sum(numerator)
        self._b = [gain * b for b in numerator]
        self._past = [(0.0, 0.0), (0.0, 0.0)]

    def step(self, command: float) -> float:
        (u1, y1), (u2, y2) = self._past
        b, a = self._b, self._a
        output = b[0] * command + b[1] * u1 + b[2] * u2 - a[1] * y1 - a[2] * y2
        self._past = [(command, output), self._past[0]]
        return output


def busy_hand(seed: int) -> tuple[list[float], int]:
    """Quick strokes, half of them reversals, a quick release, and rest; index of the release."""
    rng = random.Random(seed)
    commands: list[float] = []
    level = 0.0

    def ramp(target: float, duration_s: float) -> None:
        ticks, start = max(1, int(duration_s / TICK_S)), level
        commands.extend(start + (target - start) * (i + 1) / ticks for i in range(ticks))

    while len(commands) < DRIVE_S / TICK_S:
        if level and rng.random() < 0.5:
            target = -level * rng.uniform(0.6, 1.0)
        elif rng.random() < 0.3:
            target = 0.0
        else:
            target = rng.choice([-1.0, 1.0]) * rng.uniform(0.6, 1.0)
        ramp(target, rng.uniform(0.1, 0.2))
        level = target
        commands += [level] * int(rng.uniform(0.3, 2.0) / TICK_S)
    if level == 0.0:
        level = 0.8
        commands += [level] * round(1.0 / TICK_S)
    ramp(0.0, 0.1)
    return [0.0] * 2 + commands + [0.0] * round(8.0 / TICK_S), 2 + len(commands)


def sent_by(axis: ShapedAxis, commands: list[float]) -> list[float]:
    sent = []
    for command in commands:
        axis.tick(CommandInput(command))
        sent.append(axis.output.setpoint)
    assert axis.state is State.READY
    return sent


def swing(sent: list[float], mode: SwayMode) -> np.ndarray:
    """Angle of the pendulum behind the valve's lag, exactly sampled (unit: as the model's)."""
    w, z = mode.omega_rad_s, mode.damping_ratio
    pendulum = np.polymul([VALVE_LAG_S, 1.0], [1.0, 2.0 * z * w, w * w])
    numerator, denominator, _ = signal.cont2discrete(([1.0, 0.0], pendulum), TICK_S, "zoh")
    return signal.lfilter(numerator.ravel(), denominator, sent)


def axis_with(shaper: Shaper, sway: SwayModel | None) -> ShapedAxis:
    return ShapedAxis(TICK_S, LIMITS, sway=sway, shaper=shaper, grid_steps=125)


@pytest.mark.slow
@pytest.mark.parametrize("length_m", [0.6, 1.0, 1.5])
def test_residual_swing_behind_a_real_valve(length_m: float) -> None:
    mode = SwayMode(math.sqrt(GRAVITY_M_S2 / length_m), DAMPING)
    residual = {"raw": 0.0, "aware": 0.0, "ordinary": 0.0}
    for seed in SEEDS:
        commands, released = busy_hand(seed)
        model = SwayModel(mode, TICK_S)
        axes = {
            "raw": axis_with(Off(), None),
            "aware": axis_with(Gff(model, PAPER_SLEW), model),
            "ordinary": axis_with(OrdinaryGff(mode, PAPER_SLEW), None),
        }
        for name, axis in axes.items():
            angle = swing(sent_by(axis, commands), mode)
            residual[name] += float(np.max(np.abs(angle[released + round(DWELL_S / TICK_S) :])))
    aware, ordinary = (1.0 - residual[name] / residual["raw"] for name in ("aware", "ordinary"))
    print(f"l = {length_m} m: residual reduced by {aware:.1%}, ordinary {ordinary:.1%}")
    assert aware >= 0.92
    assert ordinary < 0.80


@pytest.mark.parametrize("length_m", [0.6, 1.0, 1.5])
def test_without_limits_both_realisations_are_one_filter(length_m: float) -> None:
    """The peer is a fair one: it differs by nothing but its input."""
    mode = SwayMode(math.sqrt(GRAVITY_M_S2 / length_m), DAMPING)
    model = SwayModel(mode, TICK_S)
    aware, ordinary = Gff(model, PAPER_SLEW), OrdinaryGff(mode, PAPER_SLEW)
    for command in busy_hand(1)[0]:
        output = aware.step(command)
        model.step(output)
        assert ordinary.step(command) == pytest.approx(output, abs=1e-8)
