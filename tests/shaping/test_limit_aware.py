"""A shaper that knows of the limits: itself while none acts, and far less swing where one does."""

import math
import random

import pytest

from canshaper.shaping.axis import ShapedAxis
from canshaper.shaping.limits import OutputLimits
from canshaper.shaping.registry import KINDS, build_shaper
from canshaper.shaping.shapers.fir import Fir, zv_taps
from canshaper.shaping.shapers.gff import Gff
from canshaper.shaping.shapers.kind import Shaper
from canshaper.shaping.shapers.limit_aware import POLE_PER_OMEGA, LimitAware
from canshaper.shaping.shapers.off import Off
from canshaper.shaping.states import CommandInput, Reason, State
from canshaper.shaping.sway import SwayMode, SwayModel

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
RELEASE = [1.0] * 100 + [0.0] * 600
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
        return math.hypot(mode.omega_rad_s * sway.angle, sway.rate + axis.sent)

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
        return math.hypot(mode.omega_rad_s * sway.angle, sway.rate + axis.sent)

    assert residual(aware=True) < 0.8 * residual(aware=False)


@pytest.mark.slow
@modes
def test_a_million_restless_ticks_stay_bounded(mode: SwayMode) -> None:
    sway = SwayModel(mode, TICK_S)
    aware = LimitAware(sway, Fir(zv_taps(mode, TICK_S)))
    source = random.Random(3)
    command = sent = 0.0
    for i in range(1_000_000):
        if i % 37 == 0:
            command = source.uniform(-1.0, 1.0)
        unlimited = aware.step(command)
        step = min(max(unlimited - sent, -0.05), 0.05)
        sent = round(125.0 * min(max(sent + step, -0.7), 0.7)) / 125.0
        sway.step(sent)
        # A command that the valve cannot follow may ask for several times full speed, not more.
        assert abs(unlimited) < 6.0
    for _ in range(3000):
        sent = aware.step(0.0)
        sway.step(sent)
    assert abs(sent) < 1e-9
    assert math.hypot(mode.omega_rad_s * sway.angle, sway.rate + sent) < 1e-9


class Broken:
    """A shaper that fails on demand."""

    def __init__(self, shaper: Fir) -> None:
        self.shaper = shaper
        self.broken = False

    def step(self, command: float) -> float:
        unlimited = self.shaper.step(command)
        return math.nan if self.broken else unlimited


def test_after_output_invalid_it_starts_again() -> None:
    mode = MODES[1]
    sway = SwayModel(mode, TICK_S)
    broken = Broken(Fir(zv_taps(mode, TICK_S)))
    axis = ShapedAxis(TICK_S, RATE, sway=sway, shaper=LimitAware(sway, broken))
    for command in [0.0, *[1.0] * 70]:
        axis.tick(CommandInput(command))
    assert axis.sent > 0.5
    broken.broken = True
    axis.tick(CommandInput(1.0))
    assert (axis.state, axis.reason, axis.raw) == (State.TRIPPED, Reason.OUTPUT_INVALID, 0)
    broken.broken = False
    axis.tick(CommandInput(enabled=False))
    for _ in range(80):  # longer than the impulse response
        axis.tick(CommandInput())
    assert axis.state is State.READY
    # From here on it does what a fresh one does.
    fresh_sway = SwayModel(mode, TICK_S)
    fresh = ShapedAxis(
        TICK_S, RATE, sway=fresh_sway, shaper=LimitAware(fresh_sway, Fir(zv_taps(mode, TICK_S)))
    )
    fresh.tick(CommandInput())
    for command in RELEASE:
        axis.tick(CommandInput(command))
        fresh.tick(CommandInput(command))
        assert axis.raw == fresh.raw
    assert fresh.raw == 0


@modes
def test_missed_ticks_leave_no_swing(mode: SwayMode) -> None:
    """The output is held while the loop is late: the pendulum swings on, and is calmed again."""

    def residual(*, known: bool) -> float:
        sway = SwayModel(mode, TICK_S)
        fir = Fir(zv_taps(mode, TICK_S))
        limits = OutputLimits(rise_per_s=100.0, fall_per_s=100.0, tail_s=4.0)
        shaper = LimitAware(sway, fir) if known else fir
        axis = ShapedAxis(TICK_S, limits, sway=sway, shaper=shaper, grid_steps=100_000)
        for i, command in enumerate([0.0, *RELEASE]):
            if i in (20, 45, 130):
                axis.hold(12)
            axis.tick(CommandInput(command))
        return math.hypot(mode.omega_rad_s * sway.angle, sway.rate + axis.sent)

    bare = residual(known=False)
    assert bare > 0.02
    assert residual(known=True) < 0.05 * bare


def test_a_swing_too_quick_for_the_tick_is_refused_in_the_words_of_the_user() -> None:
    says = r"natural frequency: expected up to 17\.8571 rad/s .* tick of 0\.04 s, got 20 rad/s"
    with pytest.raises(ValueError, match=says):
        build_shaper("robust", 0.04, SwayModel(SwayMode(20.0, 0.0), 0.04), taps=[1.0])
    build_shaper("robust", 0.04, SwayModel(SwayMode(17.8, 0.0), 0.04), taps=[1.0])


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
