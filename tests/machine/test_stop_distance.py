"""Stopping distances of a file: speed of the tip, stated bound, and what has to be stated."""

import pytest

from canshaper.config.schema import AxisSection
from canshaper.machine.stop_distance import (
    FullSpeed,
    allowed_m,
    full_speed,
    output_limits,
    stated_fault,
    stop_fault,
    unstated,
    unstated_fault,
)
from tests.rigs.files import Machine

SLEWING = "    slewing: { full_speed_rad_s: 0.5, largest_radius_m: 9.6 }\n"
STATED = ", stop_distance_m: 200"  # as the machine of these tests has it, slew first


def slew(machine: Machine) -> AxisSection:
    return machine.load().axes["slew"].config


def stopping(axis: AxisSection, stated: float | None) -> AxisSection:
    """The axis with another stated distance, or none."""
    limits = axis.limits.model_copy(update={"stop_distance_m": stated})
    return axis.model_copy(update={"limits": limits})


def test_an_axis_that_slews_has_its_speed_at_the_largest_radius(machine: Machine) -> None:
    assert full_speed(slew(machine)) == FullSpeed(0.5 * 9.6, 0.5)


def test_else_the_speed_is_that_of_the_sway(machine: Machine) -> None:
    machine.in_yaml(SLEWING, "")
    axes = machine.load().axes
    assert full_speed(axes["slew"].config) == FullSpeed(1.5, None)
    assert full_speed(axes["lift"].config) == FullSpeed(None, None)
    assert allowed_m(axes["lift"].config, timeout_ms=100, period_s=0.02) is None


def test_allowed_is_the_speed_times_what_the_limits_allow(machine: Machine) -> None:
    # 20 ms until it is seen, tail_s of 2 s and half a tick of rounding, 0.1 s to fall
    assert allowed_m(slew(machine), timeout_ms=100, period_s=0.02) == pytest.approx(4.8 * 2.13)


def test_the_timeout_of_the_joystick_lengthens_what_is_allowed(machine: Machine) -> None:
    # 0.2 s until it counts as lost, 20 ms until it is seen, tail_s of 2 s and half a tick
    assert allowed_m(slew(machine), timeout_ms=200, period_s=0.02) == pytest.approx(4.8 * 2.23)


def test_a_distance_that_the_limits_just_reach_is_good(
    machine: Machine, monkeypatch: pytest.MonkeyPatch
) -> None:
    axis = slew(machine)
    allowed = allowed_m(axis, timeout_ms=100, period_s=0.02)
    assert allowed is not None
    assert stated_fault(stopping(axis, allowed), timeout_ms=100, period_s=0.02) is None
    monkeypatch.setattr("canshaper.machine.stop_distance.MOST_UNSTATED_M", allowed)
    assert unstated_fault(stopping(axis, None), timeout_ms=100, period_s=0.02) is None


@pytest.mark.parametrize(
    ("stated", "good"), [("1.15", False), ("1.16", True), ("11", True)], ids=str
)
def test_a_stated_distance_holds_the_fall(machine: Machine, stated: str, good: bool) -> None:
    line = machine.in_yaml(STATED, f", stop_distance_m: {stated}")
    if good:
        assert machine.load().axes["slew"].config.limits.stop_distance_m == float(stated)
        return
    assert machine.problems() == [
        f"machine.yaml:{line}: axes.slew.limits.stop_distance_m: expected 1.16 m or more, what it"
        " travels without any run-on by max_pct, fall_per_s, timeout_ms and the speed of the tip,"
        " got 1.15 m"
    ]


@pytest.mark.parametrize(
    ("old", "new"),
    [
        ("fall_per_s: 5", "fall_per_s: 3"),
        ("largest_radius_m: 9.6", "largest_radius_m: 10"),
        ("full_speed_rad_s: 0.5", "full_speed_rad_s: 0.6"),
        ("timeout_ms: 100", "timeout_ms: 180"),
    ],
)
def test_everything_that_lengthens_a_stop_is_seen(machine: Machine, old: str, new: str) -> None:
    machine.in_yaml(STATED, ", stop_distance_m: 1.16")
    machine.load()
    machine.in_yaml(old, new)
    (problem,) = machine.problems()
    assert "axes.slew.limits.stop_distance_m: expected" in problem
    assert problem.endswith(", got 1.16 m")


def test_a_distance_of_an_axis_without_a_speed_says_nothing(machine: Machine) -> None:
    line = machine.in_yaml("stop_s: 0.2", "stop_s: 0.2, stop_distance_m: 2")
    assert machine.problems() == [
        f"machine.yaml:{line}: axes.lift.limits.stop_distance_m: expected the section sway or"
        " slewing with it, got 2 m without"
    ]


def test_a_long_way_has_to_be_stated(machine: Machine) -> None:
    machine.in_yaml(STATED, "")
    axes = list(unstated(machine.load()))
    assert axes == [
        (
            ("axes", "slew", "limits", "stop_distance_m"),
            "missing: to stop, the limits allow 10.23 m, which is more than 2 m; write how far the"
            " tip may travel when it stops",
        )
    ]


def test_a_short_way_need_not_be_stated(machine: Machine) -> None:
    machine.in_yaml(STATED, "")
    machine.in_yaml(STATED, "")
    machine.in_yaml("largest_radius_m: 9.6", "largest_radius_m: 1.8")  # 1.92 m
    assert [place[1] for place, _ in unstated(machine.load())] == ["near_far"]  # 2.13 m
    machine.in_yaml("full_speed_m_s: 1.0", "full_speed_m_s: 0.93")
    assert list(unstated(machine.load())) == []


def test_a_distance_in_whole_centimetres_is_not_rounded_up(machine: Machine) -> None:
    machine.in_yaml(STATED, "")
    machine.in_yaml("largest_radius_m: 9.6", "largest_radius_m: 10")
    (fault,) = (fault for _, fault in unstated(machine.load()))
    assert fault == (
        "missing: to stop, the limits allow 10.65 m, which is more than 2 m; write how far the tip"
        " may travel when it stops"
    )


def test_an_axis_may_not_move_over_a_stated_or_an_unstated_way(machine: Machine) -> None:
    """The shortest way is 1.20004 m: a hair beyond a whole centimetre."""
    machine.in_yaml("largest_radius_m: 9.6", "largest_radius_m: 10.00034")
    deployment = machine.load()
    axis = deployment.axes["slew"].config
    assert stop_fault(deployment, "slew", stopping(axis, 1.21)) is None
    assert stop_fault(deployment, "slew", stopping(axis, 1.2)) == (
        "expected 1.21 m or more, what it travels without any run-on by max_pct, fall_per_s,"
        " timeout_ms and the speed of the tip, got 1.2 m"
    )
    assert stop_fault(deployment, "slew", stopping(axis, None)) == (
        "missing: to stop, the limits allow 10.66 m, which is more than 2 m; write how far the tip"
        " may travel when it stops"
    )


@pytest.mark.parametrize("timeout_ms", [100, 300])
def test_what_is_stated_bounds_what_the_limits_allow(machine: Machine, timeout_ms: int) -> None:
    """A lost joystick, a command that waits, and the tick of the fall are within it."""
    axis = stopping(slew(machine), 4.7)
    times = {"timeout_ms": timeout_ms, "period_s": 0.02}
    limits = output_limits(axis, **times)
    assert limits.run_on == pytest.approx(4.7 / 4.8 - timeout_ms / 1000.0 - 0.04)
    assert allowed_m(axis, **times) == pytest.approx(4.7)
    assert output_limits(stopping(axis, None), **times) == axis.limits.output_limits()
