"""The third pole of G_FF: a lag on the command that takes the first jump away."""

import math

import numpy as np
import pytest

from canshaper.shaping.shapers.gff import Gff
from canshaper.shaping.sway import SwayMode, SwayModel

TICKS_S = (0.005, 0.02, 0.05)
modes = pytest.mark.parametrize("mode", [SwayMode(2.86, 0.0), SwayMode(2.86, 0.05)], ids=str)
ticks = pytest.mark.parametrize("tick_s", TICKS_S)
# A triple pole p on an undamped swing: y = 1 - e^-x (1 + x + x^2/2) + (p/w)^2 e^-x (x - x^2/2)
# with x = |p| t stays below 1 while (p/w)^2 <= 2 + sqrt 5.
QUICKEST = math.sqrt(2.0 + math.sqrt(5.0))


def response(gff: Gff, sway: SwayModel, commands: list[float]) -> list[float]:
    out = []
    for command in commands:
        out.append(gff.step(command))
        sway.step(out[-1])
    return out


def transfer(
    mode: SwayMode, tick_s: float, poles: tuple[float, float, float], z: np.ndarray
) -> np.ndarray:
    """H(z) as the z transform of the response to one command of 1, long after it has died away."""
    sway = SwayModel(mode, tick_s)
    gff = Gff(sway, poles[:2], poles[2])
    impulse = [1.0, *[0.0] * round(14.0 / tick_s)]
    taps = np.array(response(gff, sway, impulse))
    return np.array([np.sum(taps * one ** -np.arange(len(taps))) for one in z])


def expected(
    mode: SwayMode, tick_s: float, poles: tuple[float, float, float], z: np.ndarray
) -> np.ndarray:
    """Zeros on the sampled swing, the three poles at exp(p T), gain one."""
    zero = np.exp(mode.pole * tick_s)
    top = [1.0, -2.0 * zero.real, abs(zero) ** 2, 0.0]  # the lag answers in the tick of the step
    bottom = np.poly(np.exp(np.array(poles) * tick_s))
    gain = np.polyval(bottom, 1.0) / np.polyval(top, 1.0)
    return gain * np.polyval(top, z) / np.polyval(bottom, z)


@modes
@ticks
@pytest.mark.parametrize("poles", [(-4.0, -4.0, -4.0), (-6.0, -3.0, -5.0), (-3.0, -3.0, -15.0)])
def test_zeros_on_the_swing_three_poles_and_gain_one(
    mode: SwayMode, tick_s: float, poles: tuple[float, float, float]
) -> None:
    circle = np.exp(1j * np.linspace(0.0, math.pi, 12))
    got, right = transfer(mode, tick_s, poles, circle), expected(mode, tick_s, poles, circle)
    assert np.max(np.abs(got - right)) < 1e-9
    assert got[0] == pytest.approx(1.0, abs=1e-9)
    zero = np.exp(np.array([mode.pole, mode.pole.conjugate()]) * tick_s)
    assert np.max(np.abs(transfer(mode, tick_s, poles, zero))) < 1e-8


@ticks
@pytest.mark.parametrize("times_omega", [0.7, 1.0, 1.4, 1.9])
@modes
def test_a_step_through_a_triple_pole_never_passes_the_command(
    mode: SwayMode, tick_s: float, times_omega: float
) -> None:
    assert times_omega < QUICKEST
    pole = -times_omega * mode.omega_rad_s
    sway = SwayModel(mode, tick_s)
    out = response(Gff(sway, (pole, pole), pole), sway, [1.0] * round(12.0 / tick_s))
    assert max(out) <= 1.0 + 1e-12
    assert min(out) >= 0.0
    assert out[-1] == pytest.approx(1.0, abs=1e-3)


@pytest.mark.parametrize("bad", [0.0, 0.1, -50.1, math.nan, -math.inf])
def test_a_third_pole_that_is_not_negative_or_too_fast_is_refused(bad: float) -> None:
    with pytest.raises(ValueError, match="expected -50 to below 0 rad/s"):
        Gff(SwayModel(SwayMode(2.86, 0.05), 0.02), (-3.0, -3.0), bad)
