"""Model and filters that follow the length of a rope."""

import math

import pytest

from canshaper.shaping.registry import KINDS, build_shaper
from canshaper.shaping.shapers.kind import Following
from canshaper.shaping.shapers.limit_aware import TABLE_STEPS, LimitAware
from canshaper.shaping.sway import GRAVITY_M_S2, SwayMode, SwayModel

TICK_S = 0.02
RATIO = 0.005


def swing_of_rope(length_m: float, change_m_s: float, speed: float, seconds: float) -> float:
    """Angle of l theta'' + 2 l' theta' + g theta = a after a speed that jumps, in tiny steps."""
    steps = round(seconds / 1e-4)
    theta, rate = 0.0, speed / length_m
    for k in range(steps):
        length = length_m + change_m_s * k * 1e-4
        rate += -1e-4 * (2.0 * change_m_s * rate + GRAVITY_M_S2 * theta) / length
        theta += 1e-4 * rate
    return theta


@pytest.mark.parametrize("change_m_s", [-0.5, 0.0, 0.5])
def test_the_model_swings_as_a_load_that_is_hoisted(change_m_s: float) -> None:
    length_m = 6.0
    model = SwayModel(SwayMode.from_length(length_m, 0.0), TICK_S)
    for k in range(250):
        now = length_m + change_m_s * (k + 0.5) * TICK_S
        model.follow(SwayMode.from_length(now, 0.0))
        model.step(1.0)
    model.follow(SwayMode.from_length(length_m + change_m_s * 250 * TICK_S, 0.0))
    want = swing_of_rope(length_m, change_m_s, 1.0, 250 * TICK_S)
    assert model.sway_rad(1.0) == pytest.approx(want, abs=0.004 * 0.13)


def parameters(kind: str, mode: SwayMode) -> dict[str, object]:
    """Return the parameters of a filter for a mode."""
    if kind == "gff":
        return {
            "a1": 2.1 / mode.omega_rad_s,
            "a2": 1.0 / mode.omega_rad_s**2,
            "third_pole_rad_s": -9.0,
        }
    return KINDS[kind].settings(mode, TICK_S)["limit-aware ZV"]


@pytest.mark.parametrize("kind", [name for name, kind in KINDS.items() if kind.follows])
@pytest.mark.parametrize("row", [16, 32, 48])  # of the table of taps
def test_a_filter_that_has_followed_is_the_one_of_that_length(kind: str, row: int) -> None:
    factor = 0.5 + row * 1.5 / TABLE_STEPS
    first, then = SwayMode.from_length(4.0, RATIO), SwayMode.from_length(4.0 * factor**2, RATIO)
    followed, fresh = SwayModel(first, TICK_S), SwayModel(then, TICK_S)
    own = parameters(kind, first)
    one = build_shaper(kind, TICK_S, followed, valve_rate_per_s=5.0, **own)
    follows = KINDS[kind].follows
    assert follows is not None
    other = build_shaper(kind, TICK_S, fresh, valve_rate_per_s=5.0, **follows(own, factor))
    assert isinstance(one, Following)
    one.prepare(0.5, 2.0)
    followed.follow(then)
    one.follow(factor)
    for tick in range(400):
        command = 1.0 if tick < 150 else 0.0
        got, want = one.step(command), other.step(command)
        assert got == pytest.approx(want, abs=1e-6)
        followed.step(0.9 * got)
        fresh.step(0.9 * want)


def test_poles_follow_the_period() -> None:
    follows = KINDS["gff"].follows
    assert follows is not None
    poles = {"poles_rad_s": [-4.0, -2.0], "third_pole_rad_s": -8.0}
    assert follows(poles, 2.0) == {"poles_rad_s": [-2.0, -1.0], "third_pole_rad_s": -4.0}


@pytest.mark.parametrize("kind", ["gff", "robust"])
@pytest.mark.parametrize("change_m_s", [-0.5, 0.5])
def test_hoisting_in_motion_makes_no_step_and_leaves_no_swing(kind: str, change_m_s: float) -> None:
    length_m = 6.0
    mode = SwayMode.from_length(length_m, RATIO)
    sway = SwayModel(mode, TICK_S)
    shaper = build_shaper(kind, TICK_S, sway, valve_rate_per_s=5.0, **parameters(kind, mode))
    assert isinstance(shaper, Following)
    shaper.prepare(0.3, 2.0)
    before, steps = 0.0, []
    for tick in range(900):
        if 60 <= tick < 400:
            length_m += change_m_s * TICK_S
            now = SwayMode.from_length(length_m, RATIO)
            sway.follow(now)
            shaper.follow(now.period_s / mode.period_s)
        asked = min(max(shaper.step(1.0 if 10 <= tick < 300 else 0.0), 0.0), 1.0)
        if kind == "gff":
            steps.append(abs(asked - before) if tick % 290 > 40 else 0.0)
        before = asked
        sway.step(asked)
    assert math.degrees(abs(sway.sway_rad(1.0))) < 0.15
    assert math.degrees(abs(sway.rate) / math.sqrt(length_m * GRAVITY_M_S2)) < 0.15
    assert max(steps, default=0.0) < 0.1


def test_the_twin_of_a_rope_has_the_swing_of_its_length() -> None:
    """After half a stroke, as if the rope had always been so long."""
    first, then = SwayMode.from_length(4.0, RATIO), SwayMode.from_length(5.0, RATIO)
    ways = []
    for change_after in (0, 40):
        sway = SwayModel(first, TICK_S)
        shaper = build_shaper(
            "robust", TICK_S, sway, valve_rate_per_s=5.0, **parameters("robust", first)
        )
        assert isinstance(shaper, LimitAware)
        shaper.prepare(0.5, 2.0)
        for tick in range(80):
            if tick == change_after:
                sway.follow(then)
                shaper.follow(then.period_s / first.period_s)
            sway.step(shaper.step(1.0))
        ways.append(shaper._twin.angle)
    assert ways[0] == pytest.approx(ways[1], abs=2e-4)  # between two rows of the table
    assert abs(ways[0]) > 0.01
