"""Filters with gain schedules, profiles and adjustable numbers: each problem with its line."""

from dataclasses import replace
from typing import Any

import pytest

from canshaper.errors import ConfigError
from canshaper.machine.filters import filter_fault, unfit
from canshaper.shaping.registry import KINDS
from canshaper.shaping.shapers.kind import Shaper
from canshaper.shaping.transfer import Off
from tests.rigs.files import Machine

STATUS = "status: { bus: crane, message: ShaperStatus }\n"
LOAD_STATE = "load_state: { bus: crane, message: TipVelocity, signal: SlewRate, timeout_ms: 100 }\n"
CODES = (
    "profile: { bus: crane, message: GrappleSway, signal: SwayParallel, timeout_ms: 100,"
    " codes: { calm: 1, fast: 2 } }\n"
)
BUTTON = ("    anti_sway_off: AntiSwayOff\n", "    next_profile: AntiSwayOff\n")
OWN = "kind: gff, a1: 0.708, a2: 0.12"
SLEW = f"    filter: {{ {OWN} }}\n"
GFF = "kind: gff, a1: 0.9, a2: 0.2"
TOO_FAST = "kind: gff, poles_rad_s: [-60, -3]"
SWAY = "sway: { period_s: 2.3, damping_ratio: 0.04, full_speed_m_s: 1.5 }"
POLE = "filter: pole: expected -50 to below 0 rad/s at a tick of 0.02 s, got -60 rad/s"
# The sum of taps may miss 1 by a thousandth; between these two it misses it by more.
TAPS = "kind: robust, tick_ms: 20, taps: [0.056, 0.87, 0.075]"
OTHER_TAPS = "kind: robust, tick_ms: 20, taps: [0.57, 0.2, 0.231]"
BETWEEN = "at 0.0625, between two breakpoints: sum of the taps: expected 1, got 1.001"
DESIGNED = "kind: robust, tick_ms: 20, taps: [0.5, 0.5], designed_for: {"


def schedule(first: str, second: str, indent: str = "    ") -> str:
    """A gain schedule of two filters."""
    entries = (
        f"{indent}  - {{ breakpoint: {at}, {SWAY}, filter: {{ {one} }} }}\n"
        for at, one in ((0, first), (2, second))
    )
    return f"{indent}gain_schedule:\n{''.join(entries)}"


def profile(name: str, chosen: str, first: str = "", second: str = "") -> str:
    """A profile, with a gain schedule where two filters are named."""
    sets = schedule(first, second, " " * 8) if first else ""
    return f"    profiles:\n      {name}:\n        filter: {{ {chosen} }}\n{sets}"


def problems(machine: Machine) -> list[str]:
    """Problems without file and line; none where it loads."""
    try:
        machine.load()
    except ConfigError as error:
        return [str(one).partition(": ")[2] for one in error.problems]
    return []


@pytest.mark.parametrize(
    ("slew", "top", "says"),
    [
        (SLEW + schedule(GFF, GFF), LOAD_STATE, []),
        (SLEW + profile("calm", GFF, GFF, GFF), LOAD_STATE + CODES, []),
        (
            SLEW + schedule(GFF, GFF),
            "",
            ["gain_schedule: expected load_state, which chooses them, got none"],
        ),
        (
            SLEW + profile("calm", GFF, GFF, GFF),
            CODES,
            ["profiles.calm.gain_schedule: expected load_state, which chooses them, got none"],
        ),
        (
            SLEW + schedule(GFF, TOO_FAST),
            LOAD_STATE,
            [f"gain_schedule.1.{POLE}"],
        ),
        (SLEW + profile("calm", TOO_FAST), CODES, [f"profiles.calm.{POLE}"]),
        (
            SLEW + profile("calm", GFF, TOO_FAST, GFF),
            LOAD_STATE + CODES,
            [f"profiles.calm.gain_schedule.0.{POLE}"],
        ),
        (
            SLEW.replace(OWN, TAPS) + schedule(TAPS, OTHER_TAPS),
            LOAD_STATE,
            [f"gain_schedule: {BETWEEN}"],
        ),
        (
            SLEW.replace(OWN, TAPS) + profile("calm", TAPS, TAPS, OTHER_TAPS),
            LOAD_STATE + CODES,
            [f"profiles.calm.gain_schedule: {BETWEEN}"],
        ),
        (
            SLEW.replace(OWN, TAPS.replace("20", "40")) + schedule(TAPS, OTHER_TAPS),
            LOAD_STATE,
            ["filter: tick_ms of the taps: expected the period of the valve, 20 ms, got 40 ms"],
        ),
    ],
)
def test_every_filter_that_the_load_or_the_operator_chooses_has_to_run(
    machine: Machine, slew: str, top: str, says: list[str]
) -> None:
    machine.in_yaml(SLEW, slew)
    machine.in_yaml(STATUS, STATUS + top)
    assert problems(machine) == [f"axes.slew.{text}" for text in says]


def test_profiles_of_an_axis_need_its_sway_data(machine: Machine) -> None:
    lift = "    filter: { kind: off } # lifting excites no sway\n"
    machine.in_yaml(lift, lift + profile("calm", "kind: off"))
    machine.in_yaml(STATUS, STATUS + CODES)
    assert problems(machine) == [
        "axes.lift: expected sway data of its own with profiles or a gain schedule, got none"
    ]


@pytest.mark.parametrize(
    ("top", "says"),
    [
        (CODES, "expected a profile, got 'soft'; there are calm, fast"),
        (
            "",
            "expected a profile, got 'soft'; there are none: there is no profile at the top level",
        ),
    ],
)
def test_a_profile_that_nothing_chooses_is_reported(machine: Machine, top: str, says: str) -> None:
    machine.in_yaml(SLEW, SLEW + profile("soft", GFF))
    machine.in_yaml(STATUS, STATUS + top)
    assert problems(machine) == [f"axes.slew.profiles.soft: {says}"]


@pytest.mark.parametrize(
    ("slew", "top", "says"),
    [
        (SLEW + profile("calm", GFF), "", []),
        (SLEW, "", ["expected an axis with profiles, got none"]),
        (
            SLEW + profile("calm", GFF),
            CODES,
            ["expected one of profile and next_profile, got both"],
        ),
    ],
)
def test_a_button_for_the_next_profile_is_the_only_choice_of_profiles(
    machine: Machine, slew: str, top: str, says: list[str]
) -> None:
    machine.in_yaml(*BUTTON)
    machine.in_yaml(SLEW, slew)
    machine.in_yaml(STATUS, STATUS + top)
    assert problems(machine) == [f"joysticks.left.next_profile: {text}" for text in says]


def test_a_filter_that_cannot_be_drawn_out_to_an_end_is_reported(machine: Machine) -> None:
    second = "second: { period_s: 0.6, damping_ratio: 0.1, length_range_pct: 20 }"
    machine.in_yaml(OWN, f"{DESIGNED} period_s: 2.356, damping_ratio: 0.038, {second} }}")
    entries = "axes.near_far.limits.max_pct: [10, 100]", "axes.slew.sway.period_s: [1.5, 2.4]"
    adjustable = "".join(f"    {entry}\n" for entry in entries)
    machine.in_yaml(STATUS, f"{STATUS}control:\n  adjustable:\n{adjustable}")
    assert problems(machine) == [
        "control.adjustable.axes.slew.sway.period_s: at 1.5: filter.designed_for.second.period_s:"
        " expected 0.34 to 0.42 s for the second mode that the filter would cover then, got 0.6 s;"
        " design it again"
    ]


def test_a_filter_of_another_swing_says_how_to_cure_it(machine: Machine) -> None:
    machine.in_yaml(OWN, f"{DESIGNED} period_s: 3, damping_ratio: 0.038, duration_s: 2.5 }}")
    place = "axes", "slew", "filter", "designed_for"
    assert list(unfit(machine.load().config)) == [
        (
            (*place, "period_s"),
            "expected a swing of 2.92 to 3.07 s, got 2.36 s; design it again: canshaper robust",
        ),
        (
            (*place, "duration_s"),
            "expected limits.tail_s of 2.5 s or more, got 2 s; lengthen it",
        ),
    ]


@pytest.mark.parametrize(
    ("limits", "needs"),
    [
        ("", True),
        ("reversal: brake_shaped, reversal_s: 2.1, ", True),
        ("reversal: brake_shaped, reversal_s: 2.2, ", False),
        ("allow_reverse: true, ", False),
    ],
)
def test_a_second_mode_asks_for_a_reversal_that_lets_the_response_end(
    machine: Machine, limits: str, needs: bool
) -> None:
    """2 s of response, and full speed falls by 5 a second."""
    second = "second: { period_s: 0.6, damping_ratio: 0.1, length_range_pct: 20 }"
    designed = f"{DESIGNED} period_s: 2.356, damping_ratio: 0.038, duration_s: 2, {second} }}"
    machine.in_yaml(OWN, designed)
    machine.in_yaml("limits: { ", f"limits: {{ {limits}")
    text = "a reversal cuts the response off and makes this mode swing; write in limits"
    says = f"{text} reversal: brake_shaped, reversal_s: 2.2"
    place = "axes", "slew", "filter", "designed_for", "second"
    assert list(unfit(machine.load().config)) == [(place, says)] * needs


def test_a_filter_gets_the_rate_of_its_valve(
    machine: Machine, monkeypatch: pytest.MonkeyPatch
) -> None:
    def build(_sway: Any, *, valve_rate_per_s: float, **_parameters: Any) -> Shaper:
        if valve_rate_per_s < 6.0:
            raise ValueError(f"valve: expected 6 full speeds per s, got {valve_rate_per_s:g}")
        return Off()

    slew = machine.load().axes["slew"].config
    monkeypatch.setitem(KINDS, "gff", replace(KINDS["gff"], build=build, needs_valve_rate=True))
    assert filter_fault(slew.filter, slew.sway, 0.02, 6.0) is None
    assert filter_fault(slew.filter, slew.sway, 0.02, 5.0) == (
        "valve: expected 6 full speeds per s, got 5"
    )
