"""Every filter by its name: the one that is built is the one that was asked for."""

import math
from collections.abc import Callable
from importlib.metadata import EntryPoint
from typing import Any

import pytest

from canshaper.shaping.registry import (
    BUILT_IN,
    FAULTS,
    GROUP,
    KINDS,
    build_shaper,
    with_entry_points,
)
from canshaper.shaping.shapers.fir import Fir, convolved, ei_taps, zv_taps
from canshaper.shaping.shapers.gff import Gff, poles_from_denominator
from canshaper.shaping.shapers.kind import Parameter, Shaper, ShaperKind
from canshaper.shaping.shapers.limit_aware import LimitAware
from canshaper.shaping.shapers.smoothing import FirstOrder, SCurve
from canshaper.shaping.sway import SwayMode, SwayModel
from canshaper.shaping.transfer import Off

TICK_S = 0.02
MODE = SwayMode.from_period(2.2, 0.05)
OF_SWAY = [kind.name for kind in KINDS.values() if kind.needs_sway]
TAPS = [0.5, 0.2, 0.3]
COMMANDS = [1.0] * 40 + [-0.4] * 40 + [0.0] * 40


def answer(shaper: Shaper, sway: SwayModel, rate_per_tick: float = math.inf) -> list[float]:
    """Output of a filter, and of a valve of limited rate that the model knows of."""
    out, sent = [], 0.0
    for command in COMMANDS:
        out.append(shaper.step(command))
        sent += min(max(out[-1] - sent, -rate_per_tick), rate_per_tick)
        sway.step(sent)
    return out


def model() -> SwayModel:
    return SwayModel(MODE, TICK_S)


def parameters(kind: str) -> dict[str, Any]:
    return {**next(iter(KINDS[kind].settings(MODE, TICK_S).values()))}


GFF, SECOND = parameters("gff"), SwayMode.from_period(0.4 * MODE.period_s, 0.02)
ZV = zv_taps(MODE, TICK_S)
DIRECT: dict[str, Callable[[SwayModel], Shaper]] = {
    "off": lambda _: Off(),
    "first_order": lambda _: FirstOrder(TICK_S, 0.3 * MODE.period_s),
    "s_curve": lambda _: SCurve(TICK_S, 2.2 / MODE.period_s, 16.0 / MODE.period_s),
    "gff": lambda sway: Gff(sway, poles_from_denominator(GFF["a1"], GFF["a2"])),
    "zv": lambda _: Fir(ZV),
    "zvd": lambda _: Fir(convolved(ZV, ZV)),
    "ei": lambda _: Fir(ei_taps(MODE, TICK_S, 0.05)),
    "two_mode": lambda _: Fir(convolved(ZV, zv_taps(SECOND, TICK_S))),
    "robust": lambda sway: LimitAware(sway, Fir(ZV), 1.5),
}


@pytest.mark.parametrize("kind", DIRECT)
def test_a_filter_by_name_is_the_filter(kind: str) -> None:
    sway, other = model(), model()
    built = build_shaper(kind, TICK_S, sway, valve_rate_per_s=1.5, **parameters(kind))
    right = DIRECT[kind](other)
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
    for one in given:
        sway = model()
        built = build_shaper("gff", TICK_S, sway, **one, third_pole_rad_s=third)
        assert answer(built, sway) == pytest.approx(expected, abs=1e-9)


@pytest.mark.parametrize("given", [{}, {"a1": 0.42}, {"a2": 0.043}])
def test_half_a_denominator_is_refused(given: dict[str, object]) -> None:
    with pytest.raises(ValueError, match=r"^expected a1 and a2, or poles_rad_s, got neither$"):
        build_shaper("gff", TICK_S, model(), **given)


@pytest.mark.parametrize("kind", OF_SWAY)
def test_a_filter_of_the_swing_needs_sway_data(kind: str) -> None:
    says = f"^expected sway data for filter {kind}, got none$"
    with pytest.raises(ValueError, match=says):
        build_shaper(kind, TICK_S, None, **parameters(kind))


@pytest.mark.parametrize("kind", [k for k in KINDS if k not in OF_SWAY])
def test_the_others_do_without(kind: str) -> None:
    assert any(answer(build_shaper(kind, TICK_S, None, **parameters(kind)), model()))


def test_a_second_mode_that_is_none_is_named() -> None:
    with pytest.raises(ValueError, match=r"^second mode: period: expected 0\.15 to 25 s, got 26 s"):
        build_shaper("two_mode", TICK_S, model(), period_s=26.0, damping_ratio=0.0)
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


WHICH = "expected a1 and a2, or poles_rad_s, got"


@pytest.mark.parametrize(
    ("kind", "given", "says"),
    [
        ("gff", {}, f"{WHICH} neither"),
        ("gff", {"third_pole_rad_s": -4.0}, f"{WHICH} neither"),
        ("gff", {"a2": 0.1}, f"{WHICH} a2"),
        ("gff", {"poles_rad_s": [-4.0, -4.0], "a1": 1.0}, f"{WHICH} a1, poles_rad_s"),
        ("gff", {"a1": 1.0, "a2": 1.0}, r"a1: expected 2 or more for a2 = 1 .*, got 1"),
        ("robust", {"taps": [0.5, 0.4], "tick_ms": 20}, r"sum of the taps: expected 1, got 0\.9"),
    ],
)
def test_parameters_that_do_not_go_together_are_refused_without_sway_data(
    kind: str, given: dict[str, object], says: str
) -> None:
    check = KINDS[kind].check
    assert check is not None
    with pytest.raises(ValueError, match=f"^{says}$"):
        check(**given)


def test_what_goes_together_passes_the_check() -> None:
    for kind in KINDS.values():
        for given in kind.settings(MODE, TICK_S).values():
            if kind.check is not None:
                kind.check(**given)


def test_taps_run_at_their_own_period() -> None:
    says = r"^tick_ms of the taps: expected the period of the valve, 20 ms, got 40 ms$"
    with pytest.raises(ValueError, match=says):
        build_shaper("robust", TICK_S, model(), taps=TAPS, tick_ms=40)
    build_shaper("robust", TICK_S, model(), taps=TAPS, tick_ms=20)


def test_settings_are_those_of_the_comparison_in_its_order() -> None:
    """With these names and numbers the tables in docs/comparison.md were made."""
    mode = SwayMode.from_period(8.0, 0.0)
    omega = math.pi / 4.0
    rows = {name: row for kind in BUILT_IN for name, row in kind.settings(mode, 0.6).items()}
    expected = [
        ("off", {}),
        ("G_FF slew poles", {"a1": 0.42, "a2": 0.043}),
        ("G_FF near-far poles", {"a1": 0.708, "a2": 0.12}),
        ("G_FF no jump over 1", {"a1": pytest.approx(2.0000001 / omega), "a2": 1.0 / omega**2}),
        ("G_FF third pole -4", {"poles_rad_s": [-4.0, -4.0], "third_pole_rad_s": -4.0}),
        ("G_FF third pole -5", {"poles_rad_s": [-5.0, -5.0], "third_pole_rad_s": -5.0}),
        ("first order", {"time_constant_s": pytest.approx(2.4)}),
        ("S-curve", {"rate_per_s": pytest.approx(0.275), "jerk_per_s2": pytest.approx(2.0)}),
        ("ZV", {}),
        ("ZVD", {}),
        ("EI 5 %", {"residual_pct": 5.0}),
        ("two-mode", {"period_s": pytest.approx(3.2), "damping_ratio": 0.02}),
        ("limit-aware ZV", {"tick_ms": 600, "taps": zv_taps(mode, 0.6)}),
    ]
    names = [name for name, _ in expected]
    assert [(name, row) for name, row in rows.items() if name in names] == expected


# -- declarations, and those of other packages -----------------------------------------------------


def kind_of(name: str = "notch", *parameters: Parameter) -> ShaperKind:
    off, settings = (lambda _tick_s: Off()), (lambda _m, _t: {name: {}})
    return ShaperKind(name, "", off, settings, parameters, runs_ahead=False)


def number(name: str = "width_s", low: float = 1, **more: Any) -> Parameter:
    return Parameter(name, low, 2, "s", "width", **more)


@pytest.mark.parametrize("name", ["", "Notch", "2d", "notch ", "kind", "sway", "tick_s"])
def test_a_name_that_cannot_be_one_is_refused(name: str) -> None:
    with pytest.raises(ValueError, match=f"^filter {name}: the name '{name}' is not allowed here$"):
        kind_of(name)
    with pytest.raises(ValueError, match=f"^filter notch: the name '{name}' is not allowed here$"):
        kind_of("notch", number(name))
    kind_of("notch_2", number("width_2_s"))


def test_a_parameter_stands_once_and_has_a_range_with_its_default() -> None:
    with pytest.raises(ValueError, match=r"^filter notch: the name 'width_s' is not allowed here$"):
        kind_of("notch", number(), number())
    for default in (0.9, 2.1, math.nan):
        with pytest.raises(ValueError, match=r"^parameter width_s: default .*, range 1 to 2$"):
            number(default=default)
    with pytest.raises(ValueError, match=r"^parameter width_s: default 3, range 3 to 2$"):
        number(low=3)
    assert (number(default=1.0).default, number(default=2.0).default) == (1.0, 2.0)


class Dist:
    name = "crane-extras"


def point(name: str, loaded: object) -> EntryPoint:
    """An entry point of an installed package that gives this, or raises it."""

    class Loaded(EntryPoint):
        dist = Dist()  # type: ignore[assignment]

        def load(self) -> object:
            if isinstance(loaded, Exception):
                raise loaded
            return loaded

    return Loaded(name, f"extras:{name}", GROUP)


def test_entry_points_add_kinds_after_the_others_in_the_order_of_their_names() -> None:
    assert not FAULTS
    two, one = kind_of("two"), kind_of("one")
    points = [point("b", two), point("a", one)]
    kinds, added, faults = with_entry_points(BUILT_IN, points)
    assert list(kinds.values()) == [*BUILT_IN, one, two]
    assert (added, faults) == ({"two": points[0], "one": points[1]}, [])


@pytest.mark.parametrize(
    ("loaded", "says"),
    [
        (ImportError("No module\nnamed x"), "ImportError: No module named x"),
        (kind_of("zv"), "ValueError: the kind 'zv' is there already"),
        (7, "ValueError: expected a ShaperKind, got a value of type int"),
    ],
)
def test_a_package_that_gives_no_kind_is_named_and_the_next_one_counts(
    loaded: object, says: str
) -> None:
    kinds, added, faults = with_entry_points(BUILT_IN, [point("x", loaded), point("y", kind_of())])
    assert list(added) == ["notch"]
    assert list(kinds) == [*(kind.name for kind in BUILT_IN), "notch"]
    assert kinds["zv"] in BUILT_IN
    assert faults == [("package crane-extras", f"entry point x of canshaper.shapers: {says}")]


def test_an_entry_point_of_no_package_goes_by_what_it_names() -> None:
    *_, faults = with_entry_points((), [EntryPoint("x", "no_such_module:KIND", GROUP)])
    (((package, text)),) = faults
    assert package == "package no_such_module:KIND"
    assert text.endswith("ModuleNotFoundError: No module named 'no_such_module'")
