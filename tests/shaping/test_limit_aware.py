"""A shaper that knows of the limits: itself while none acts, and far less swing where one does."""

import math
import random

import pytest

from canshaper.shaping.axis import ShapedAxis
from canshaper.shaping.limits import OutputLimits
from canshaper.shaping.registry import KINDS
from canshaper.shaping.shapers.fir import Fir, zv_taps
from canshaper.shaping.shapers.gff import Gff
from canshaper.shaping.shapers.kind import Shaper
from canshaper.shaping.shapers.limit_aware import POLE_PER_OMEGA, LimitAware
from canshaper.shaping.states import CommandInput, State
from canshaper.shaping.sway import SwayMode, SwayModel
from canshaper.shaping.transfer import Off

TICK_S = 0.02
MODES = [SwayMode.from_period(2.356, zeta) for zeta in (0.0, 0.05)]
modes = pytest.mark.parametrize("mode", MODES, ids=lambda m: f"zeta {m.damping_ratio}")


def restless(seed: int, ticks: int) -> list[float]:
    """A joystick that goes anywhere, turns round, and rests."""
    source = random.Random(seed)
    commands: list[float] = []
    while len(commands) < ticks:
        level = source.choice([0.0, 1.0, -1.0, source.uniform(-1.0, 1.0)])
        commands += [level] * source.randint(1, 80)
    return commands[:ticks]


@modes
def test_without_a_limit_it_is_the_shaper_itself(mode: SwayMode) -> None:
    sway, taps = SwayModel(mode, TICK_S), zv_taps(mode, TICK_S)
    bare, aware = Fir(taps), LimitAware(sway, Fir(taps))
    for command in restless(1, 20_000):
        out = aware.step(command)
        assert out == pytest.approx(bare.step(command), abs=1e-12)
        sway.step(out)


@modes
def test_a_swing_that_a_sensor_shows_is_damped_as_one_that_a_limit_made(mode: SwayMode) -> None:
    made, shown = SwayModel(mode, TICK_S), SwayModel(mode, TICK_S)
    one, other = (LimitAware(sway, Fir(zv_taps(mode, TICK_S))) for sway in (made, shown))
    for sway, aware in ((made, one), (shown, other)):
        sway.step(aware.step(0.5))
    made.angle, made.rate = made.angle + 0.03, made.rate - 0.2
    shown.free_angle, shown.free_rate = 0.03, -0.2
    assert one.step(0.5) == pytest.approx(other.step(0.5), abs=1e-12)
    assert abs(one.step(0.5) - Fir([1.0]).step(0.5)) > 0.01


def test_it_is_stretched_with_all_its_taps_at_the_same_period() -> None:
    kind = KINDS["robust"]
    assert kind.stretched
    assert kind.stretched({"tick_ms": 20, "taps": [0.2, 0.3, 0.5]}, 2.0) == {
        "tick_ms": 20,
        "taps": pytest.approx([0.1, 0.1, 0.15, 0.15, 0.25, 0.25]),
    }


# Half a second to full speed. A valve far slower than the swing leaves the feedback no room.
RATE = OutputLimits(rise_per_s=2.0, fall_per_s=2.0, tail_s=3.0)
CLIP = OutputLimits(rise_per_s=100.0, fall_per_s=100.0, maximum=0.6, tail_s=3.0)
FREE = OutputLimits(rise_per_s=100.0, fall_per_s=100.0, tail_s=3.0)
# Held against the swing in the middle of its run: the output may not go against the joystick.
REVERSAL = [1.0] * 100 + [-0.3] * 30 + [0.8] * 60 + [0.0] * 600


@modes
@pytest.mark.parametrize(
    ("limits", "commands", "most_of_bare"),
    [(RATE, REVERSAL, 0.02), (CLIP, REVERSAL, 0.02), (FREE, REVERSAL, 0.02)],
    ids=["rate", "clip", "joystick"],
)
def test_residual_swing_where_a_limit_acts(
    mode: SwayMode, limits: OutputLimits, commands: list[float], most_of_bare: float
) -> None:
    """Amplitude after the axis has come to rest, in parts of what no shaping leaves."""

    def residual(kind: str) -> float:
        sway = SwayModel(mode, TICK_S)
        fir = Fir(zv_taps(mode, TICK_S))
        shapers: dict[str, Shaper] = {"bare": fir, "aware": LimitAware(sway, fir), "off": Off()}
        # A grid far finer than any valve's: the limits alone are judged.
        axis = ShapedAxis(TICK_S, limits, sway=sway, shaper=shapers[kind], grid_steps=100_000)
        for command in [0.0, *commands]:
            axis.tick(CommandInput(command))
        assert axis.state is State.READY
        return math.hypot(mode.omega_rad_s * sway.angle, sway.rate + axis.output.setpoint)

    bare, aware, off = (residual(kind) for kind in ("bare", "aware", "off"))
    print(f"residual: off {off:.3f}, bare ZV {bare:.4f}, limit-aware {aware:.5f}")
    assert bare > 0.02  # the limit acts
    assert aware < most_of_bare * bare


@modes
@pytest.mark.parametrize("rate", [0.7, 1.0, 1.5, 2.0, 5.0])
def test_a_slow_valve_gets_feedback_that_it_can_follow(mode: SwayMode, rate: float) -> None:
    """Poles too quick for the valve would add swing: worse than no feedback at 1/s and below."""
    limits = OutputLimits(rise_per_s=rate, fall_per_s=max(1.0, rate), tail_s=3.0)

    def residual(*, aware: bool) -> float:
        sway = SwayModel(mode, TICK_S)
        fir = Fir(zv_taps(mode, TICK_S))
        shaper: Shaper = LimitAware(sway, fir, rate) if aware else fir
        axis = ShapedAxis(TICK_S, limits, sway=sway, shaper=shaper, grid_steps=100_000)
        for command in [0.0, *REVERSAL]:
            axis.tick(CommandInput(command))
        return math.hypot(mode.omega_rad_s * sway.angle, sway.rate + axis.output.setpoint)

    assert residual(aware=True) < 0.8 * residual(aware=False)


def test_the_quickest_swing_for_a_tick_is_allowed() -> None:
    tick_s = 0.04
    sway = SwayModel(SwayMode(-1.0 / (POLE_PER_OMEGA * tick_s), 0.0), tick_s)
    LimitAware(sway, Fir([1.0]))
    with pytest.raises(ValueError, match="natural frequency: expected"):
        LimitAware(
            SwayModel(SwayMode(math.nextafter(sway.mode.omega_rad_s, 99.0), 0.0), tick_s),
            Fir([1.0]),
        )


@modes
@pytest.mark.parametrize(("rate", "times_omega"), [(math.inf, 1.4), (5.0, 1.4), (2.0, 1.126)])
def test_made_in_full_swing_it_damps_from_the_first_tick(
    mode: SwayMode, rate: float, times_omega: float
) -> None:
    """A filter changed in motion: nothing was asked by it yet, so all of the swing is to go."""
    sway = SwayModel(mode, TICK_S)
    sway.angle, sway.rate = 0.3, -0.2
    pole = -times_omega * mode.omega_rad_s
    gff = Gff(sway, (pole, pole))
    aware = LimitAware(sway, Fir([1.0]), rate)
    assert aware.step(0.0) == pytest.approx(-gff.k1 * 0.3 + gff.k2 * 0.2, rel=2e-3)
