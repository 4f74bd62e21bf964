"""Values that a deployment lets be changed, against its axes."""

import pytest

from tests.rigs.files import Machine

STATUS = "status: { bus: crane, message: ShaperStatus }\n"


def adjustable(machine: Machine, text: str) -> int:
    """Put in a control section; the line of its first entry."""
    return 3 + machine.in_yaml(STATUS, f"{STATUS}control:\n  adjustable:\n    {text}\n")


def test_numbers_of_sway_filter_and_limits_may_be_changed(machine: Machine) -> None:
    keys = "sway.period_s: [1.8, 3]", "filter.a2: [0.05, 0.2]", "limits.max_pct: [10, 100]"
    adjustable(machine, "\n    ".join(f"axes.slew.{key}" for key in keys))
    control = machine.load().config.control
    assert control is not None
    assert control.adjustable["axes.slew.sway.period_s"] == [1.8, 3.0]
    path = machine.load().path
    assert str(control.path(path)) == "/run/canshaper/machine/control.sock"


@pytest.mark.parametrize(
    ("text", "why"),
    [
        ("tick_ms: [1, 50]", "expected axes.AXIS.SECTION.NAME, got no key of an axis"),
        (
            "axes.boom.sway.period_s: [1, 2]",
            "expected an axis, got 'boom'; there are slew, near_far, lift",
        ),
        (
            "axes.slew.sway.length_m: [1, 2]",
            "expected a number in the axis' sway, filter or limits, got none of that name",
        ),
        (
            "axes.slew.valve.timeout_ms: [1, 2]",
            "expected a number in the axis' sway, filter or limits, got none of that name",
        ),
        (
            "axes.lift.sway.period_s: [1, 2]",
            "expected a number in the axis' sway, filter or limits, got none of that name",
        ),
        (
            "axes.slew.filter.kind: [1, 2]",
            "expected a number in the axis' sway, filter or limits, got none of that name",
        ),
        (
            "axes.slew.limits.allow_reverse: [0, 1]",
            "expected a number in the axis' sway, filter or limits, got none of that name",
        ),
        (
            "axes.slew.limits.tail_s: [0, 5]",
            "expected one of the limits max_pct, rise_per_s, fall_per_s, got tail_s",
        ),
        (
            "axes.slew.sway.period_s: [2.4, 3]",
            "expected a range around the number itself, 2.356, got 2.4 to 3",
        ),
        (
            "axes.slew.sway.period_s: [1, 26]",
            "expected both ends within the range of this key, got 26",
        ),
        (
            "axes.slew.limits.max_pct: [0, 100]",
            "expected both ends within the range of this key, got 0",
        ),
    ],
)
def test_what_cannot_be_changed_is_reported(machine: Machine, text: str, why: str) -> None:
    line = adjustable(machine, text)
    (problem,) = machine.problems()
    key = text.partition(":")[0]
    assert problem == f"machine.yaml:{line}: control.adjustable.{key}: {why}"


def test_a_filter_without_sway_data_stays(machine: Machine) -> None:
    machine.in_yaml(
        "filter: { kind: off } # lifting excites no sway",
        "filter: { kind: first_order, time_constant_s: 0.2 }",
    )
    adjustable(machine, "axes.lift.filter.time_constant_s: [0.1, 1]")
    assert "axis lift has no sway data; adjustable are its limits" in machine.problems()[0]


def test_an_axis_with_a_choice_of_filters_stays(machine: Machine) -> None:
    machine.in_yaml(
        STATUS,
        f"{STATUS}profile: {{ bus: crane, message: JoystickRight, timeout_ms: 100,\n"
        "  signal: Rotate, codes: { calm: 1 } }\n",
    )
    machine.in_yaml(
        "    filter: { kind: gff, a1: 0.708, a2: 0.12 }\n",
        "    filter: { kind: gff, a1: 0.708, a2: 0.12 }\n"
        "    profiles: { calm: { filter: { kind: gff, a1: 0.9, a2: 0.2 } } }\n",
    )
    adjustable(machine, "axes.slew.filter.a1: [0.6, 1]")
    assert any(
        "axis slew has a gain schedule or profiles" in problem for problem in machine.problems()
    )


@pytest.mark.parametrize(
    ("text", "why"),
    [
        (
            "axes.slew.sway.period_s: [3, 1.8]",
            "axes.slew.sway.period_s: expected the lower end first, got 3 to 1.8",
        ),
        ("axes.slew.sway.period_s: [3]", "expected 2 or more entries, got [3]"),
    ],
)
def test_a_range_is_two_numbers_in_order(machine: Machine, text: str, why: str) -> None:
    adjustable(machine, text)
    assert why in machine.problems()[0]


def test_the_mode_is_octal_and_in_quotes(machine: Machine) -> None:
    for mode, good in (('"0660"', True), ("0660", False), ('"rw"', False), ('"0999"', False)):
        text = f"control: {{ mode: {mode}, adjustable: {{ axes.slew.sway.period_s: [2, 3] }} }}\n"
        machine.in_yaml(STATUS, STATUS + text)
        if good:
            assert machine.load().config.control
        else:
            assert "control.mode: " in machine.problems()[0]
        machine.in_yaml(text, "")


def test_the_filter_scaled_to_each_end_has_to_run(machine: Machine) -> None:
    machine.in_yaml("kind: gff, a1: 0.708, a2: 0.12", "kind: robust, tick_ms: 20, taps: [0.5, 0.5]")
    line = adjustable(machine, "axes.slew.sway.period_s: [0.16, 3]")
    (problem,) = machine.problems()
    assert problem.startswith(
        f"machine.yaml:{line}: control.adjustable.axes.slew.sway.period_s: at 0.16: natural"
        " frequency: expected up to 35.7143 rad/s for this filter at a tick of 0.02 s, got 39.2"
    )
    machine.in_yaml("[0.16, 3]", "[0.2, 3]")
    machine.load()


def test_a_number_of_the_swing_that_goes_with_another_one_only_may_be_adjustable(
    machine: Machine,
) -> None:
    """So light a grapple does not swing with this damping, but with less of it, set with it."""
    adjustable(
        machine,
        "axes.near_far.sway.mass_kg: [10, 300]\n    axes.near_far.sway.damping_nms: [5, 120]",
    )
    control = machine.load().config.control
    assert control is not None
    assert len(control.adjustable) == 2


def rehearsing(machine: Machine, rows: str = "", limits: str = "max_pct: 40, ") -> None:
    """Allow faults to be rehearsed, at such a speed."""
    machine.in_yaml(STATUS, f"{STATUS}control:\n  rehearse_faults: true\n{rows}")
    machine.yaml = machine.yaml.replace("rise_per_s: 5,", f"{limits}rise_per_s: 5,")


def test_faults_are_rehearsed_at_reduced_speed_without_a_number_to_change(machine: Machine) -> None:
    rehearsing(machine)
    control = machine.load().config.control
    assert control is not None
    assert control.rehearse_faults
    assert not control.adjustable


def test_faults_are_rehearsed_at_no_higher_speed(machine: Machine) -> None:
    rehearsing(machine, limits="max_pct: 41, ")
    for axis in ("slew", "near_far", "lift"):
        text = f"axes.{axis}.limits.max_pct: expected up to 40 with control.rehearse_faults, got 41"
        assert any(text in problem for problem in machine.problems())


def test_no_number_may_be_set_to_a_higher_speed_meanwhile(machine: Machine) -> None:
    rehearsing(machine, "  adjustable:\n    axes.slew.limits.max_pct: [20, 60]\n")
    (problem,) = machine.problems()
    assert problem.endswith("expected up to 40 with rehearse_faults, got 60")


def test_a_control_section_allows_something(machine: Machine) -> None:
    machine.in_yaml(STATUS, f"{STATUS}control: {{ socket: /run/c.sock }}\n")
    assert "expected a number to change, or rehearse_faults" in machine.problems()[0]
