"""Every filter by its name: the one that is built is the one that was asked for."""

import math

import pytest

from canshaper.shaping.fir import Fir, convolved, ei_taps, zv_taps
from canshaper.shaping.gff import Gff, poles_from_denominator
from canshaper.shaping.limit_aware import LimitAware
from canshaper.shaping.registry import KINDS, KINDS_OF_SWAY, Off, Shaper, build_shaper
from canshaper.shaping.smoothing import FirstOrder, SCurve
from canshaper.shaping.sway import SwayMode, SwayModel

TICK_S = 0.02
MODE = SwayMode.from_period(2.2, 0.05)
SECOND = SwayMode.from_period(0.9, 0.01)
TAPS = [0.5, 0.2, 0.3]
COMMANDS = [1.0] * 40 + [-0.4] * 40 + [0.0] * 40


def answer(shaper: Shaper, sway: SwayModel, rate_per_tick: float = math.inf) -> list[float]:
    """What a filter asks for, and a valve of limited rate that the model is told of."""
    out, sent = [], 0.0
    for command in COMMANDS:
        out.append(shaper.wanted(command))
        sent += min(max(out[-1] - sent, -rate_per_tick), rate_per_tick)
        sway.step(sent)
    return out


def model() -> SwayModel:
    return SwayModel(MODE, TICK_S)


def direct(kind: str, sway: SwayModel) -> Shaper:
    zv = zv_taps(MODE, TICK_S)
    return {
        "off": Off,
        "first_order": lambda: FirstOrder(TICK_S, 0.7),
        "s_curve": lambda: SCurve(TICK_S, 1.0, 7.0),
        "gff": lambda: Gff(sway, poles_from_denominator(0.42, 0.043)),
        "zv": lambda: Fir(zv),
        "zvd": lambda: Fir(convolved(zv, zv)),
        "ei": lambda: Fir(ei_taps(MODE, TICK_S, 0.08)),
        "two_mode": lambda: Fir(convolved(zv, zv_taps(SECOND, TICK_S))),
        "robust": lambda: LimitAware(sway, Fir(TAPS), 1.5),
    }[kind]()


PARAMETERS: dict[str, dict[str, object]] = {
    "off": {},
    "first_order": {"time_constant_s": 0.7},
    "s_curve": {"rate_per_s": 1.0, "jerk_per_s2": 7.0},
    "gff": {"a1": 0.42, "a2": 0.043},
    "zv": {},
    "zvd": {},
    "ei": {"residual_pct": 8.0},
    "two_mode": {"period_s": 0.9, "damping_ratio": 0.01},
    "robust": {"taps": TAPS},
}


def test_every_kind_is_here() -> None:
    assert set(PARAMETERS) == set(KINDS)


@pytest.mark.parametrize("kind", KINDS)
def test_a_filter_by_name_is_the_filter(kind: str) -> None:
    sway, other = model(), model()
    built = build_shaper(kind, TICK_S, sway, valve_rate_per_s=1.5, **PARAMETERS[kind])
    right = direct(kind, other)
    assert type(built) is type(right)
    got, expected = answer(built, sway, 0.03), answer(right, other, 0.03)
    assert got == expected
    assert any(got)


@pytest.mark.parametrize("third", [None, -4.0])
@pytest.mark.parametrize("poles", [(-5.0, -3.5), poles_from_denominator(0.42, 0.043)])
def test_gff_by_poles_or_by_denominator_with_and_without_a_third_pole(
    poles: tuple[float, float], third: float | None
) -> None:
    expected_sway = model()
    expected = answer(Gff(expected_sway, poles, third), expected_sway)
    p, q = poles
    given = (
        {"poles_rad_s": list(poles)},
        {"a1": -(1.0 / p + 1.0 / q), "a2": 1.0 / (p * q)},
    )
    for parameters in given:
        sway = model()
        built = build_shaper("gff", TICK_S, sway, **parameters, third_pole_rad_s=third)
        assert answer(built, sway) == pytest.approx(expected, abs=1e-9)


@pytest.mark.parametrize("parameters", [{}, {"a1": 0.42}, {"a2": 0.043}])
def test_half_a_denominator_is_refused(parameters: dict[str, object]) -> None:
    with pytest.raises(ValueError, match=r"^allowed are a1 and a2, or poles_rad_s$"):
        build_shaper("gff", TICK_S, model(), **parameters)


@pytest.mark.parametrize("kind", sorted(KINDS_OF_SWAY))
def test_a_filter_of_the_swing_needs_sway_data(kind: str) -> None:
    says = f"^filter {kind} needs the sway data of the axis; found no sway$"
    with pytest.raises(ValueError, match=says):
        build_shaper(kind, TICK_S, None, **PARAMETERS[kind])


@pytest.mark.parametrize("kind", sorted(set(KINDS) - KINDS_OF_SWAY))
def test_the_others_do_without(kind: str) -> None:
    built = build_shaper(kind, TICK_S, None, valve_rate_per_s=1.5, **PARAMETERS[kind])
    assert answer(built, model()) == answer(direct(kind, model()), model())


def test_a_second_mode_that_is_none_is_named() -> None:
    with pytest.raises(ValueError, match=r"^second mode: period is 13 s, allowed is 0\.15 to 12"):
        build_shaper("two_mode", TICK_S, model(), period_s=13.0, damping_ratio=0.0)
    # six samples to a swing are needed, also of the second mode
    with pytest.raises(ValueError, match=r"^second mode: natural frequency at a tick of 0\.15 s"):
        slow = SwayModel(MODE, 0.15)
        build_shaper("two_mode", 0.15, slow, period_s=0.8, damping_ratio=0.0)


def test_without_a_valve_rate_the_robust_shaper_takes_the_valve_for_quick() -> None:
    sway, other = model(), model()
    built = build_shaper("robust", TICK_S, sway, taps=TAPS)
    got = answer(built, sway, 0.03)
    assert got == answer(LimitAware(other, Fir(TAPS)), other, 0.03)
    slow = model()
    assert answer(LimitAware(slow, Fir(TAPS), 1.5), slow, 0.03) != got
