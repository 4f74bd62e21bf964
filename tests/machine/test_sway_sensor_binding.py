"""Sway sensors of a deployment against its axes and the DBC."""

import math

import pytest

from canshaper.shaping.observer import Measured
from tests.rigs.files import Machine

ALONG = "bus: crane, message: GrappleSway, signal: SwayParallel, kind: angle, timeout_ms: 80"
ACROSS = ALONG.replace("SwayParallel", "SwayPerpendicular")
UNIT = 'SwayParallel : 16|16@1- (0.01,0) [-180|180] "deg"'
SLEW, NEAR_FAR = "    sway: { period_s: 2.356", "    sway: { length_m: 1.2"


def sensing(machine: Machine, text: str, before: str = NEAR_FAR) -> int:
    """Give an axis a sensor; return its line."""
    return machine.in_yaml(before, f"    sway_sensor: {{ {text} }}\n{before}")


def changed(old: str, new: str) -> str:
    assert old in ALONG
    return ALONG.replace(old, new)


def test_a_sensor_binds_to_its_message(machine: Machine) -> None:
    sensing(machine, f"{ALONG}, delay_ms: 40, invert: true, use: damp")
    bound = machine.load().axes["near_far"].sway_sensor
    assert bound is not None
    assert bound.message.key == ("crane", 0x400, False)
    assert (bound.signal.name, bound.cycle_s) == ("SwayParallel", 0.02)
    assert bound.factor == pytest.approx(-math.radians(1.0))
    timing = bound.timing(0.04)
    assert timing.measured is Measured.ANGLE
    assert (timing.period_s, timing.delay_s, timing.lag_s, timing.lost_s) == (0.04, 0.04, 0.1, 0.08)
    assert (bound.config.noise, bound.config.offset_max_deg) == (0.1, 3.0)


def test_axes_may_read_the_same_message(machine: Machine) -> None:
    sensing(machine, ALONG)
    sensing(machine, ACROSS, SLEW)
    deployment = machine.load()
    sensors = [deployment.axes[name].sway_sensor for name in ("slew", "near_far")]
    assert [s.signal.name for s in sensors if s] == ["SwayPerpendicular", "SwayParallel"]
    assert sum(bound.key == ("crane", 0x400, False) for bound in deployment.inputs()) == 1


@pytest.mark.parametrize(
    ("unit", "kind", "factor"),
    [
        ("rad", "angle", 1.0),
        ("mrad", "angle", 1e-3),
        ("deg/s", "rate", math.radians(1.0)),
        ("rad/s", "rate", 1.0),
    ],
)
def test_the_unit_is_that_of_the_dbc(machine: Machine, unit: str, kind: str, factor: float) -> None:
    machine.in_dbc(UNIT, UNIT.replace('"deg"', f'"{unit}"'))
    sensing(machine, changed("kind: angle", f"kind: {kind}"))
    bound = machine.load().axes["near_far"].sway_sensor
    assert bound is not None
    assert bound.factor == pytest.approx(factor)


SAYS = [
    (changed("bus: crane", "bus: rear"), ".bus: expected a bus, got 'rear'"),
    (changed("GrappleSway", "GrappleSwing"), ".message: "),
    (changed("SwayParallel", "Sway"), ".signal: "),
    (changed("kind: angle", "kind: force"), ".kind: "),
    (f"{ALONG}, delay_ms: 501", ".delay_ms: expected 0 to 500 ms, got 501"),
    (f"{ALONG}, noise_deg: 9", ".noise_deg: expected 0.01 to 5 deg, deg/s, got 9"),
    (changed("timeout_ms: 80", "timeout_ms: 30"), ".timeout_ms: "),
]


@pytest.mark.parametrize(("text", "says"), SAYS)
def test_what_is_wrong_is_told_at_its_line(machine: Machine, text: str, says: str) -> None:
    line = sensing(machine, text)
    (problem,) = machine.problems()
    assert problem.startswith(f"machine.yaml:{line}: axes.near_far.sway_sensor{says}")


def test_a_unit_that_is_no_angle(machine: Machine) -> None:
    machine.in_dbc(UNIT, UNIT.replace('"deg"', '"m"'))
    sensing(machine, ALONG)
    (problem,) = machine.problems()
    assert "SwayParallel has the unit 'm'; expected one of deg, °, rad, mrad" in problem


def test_a_rate_is_no_angle(machine: Machine) -> None:
    sensing(machine, changed("kind: angle", "kind: rate"))
    (problem,) = machine.problems()
    assert "SwayParallel has the unit 'deg'; expected one of deg/s, °/s, rad/s, mrad/s" in problem


def test_an_axis_without_sway(machine: Machine) -> None:
    machine.in_yaml(
        "    filter: { kind: off }",
        f"    sway_sensor: {{ {ALONG} }}\n    filter: {{ kind: off }}",
    )
    (problem,) = machine.problems()
    assert "axes.lift.sway_sensor: expected an axis with sway, got 'lift' without" in problem


def test_a_filter_that_feeds_nothing_back(machine: Machine) -> None:
    sensing(machine, f"{ALONG}, use: damp")
    machine.in_yaml(
        "filter: { kind: gff, a1: 0.708, a2: 0.12 } # near-far", "filter: { kind: zv } # near-far"
    )
    (problem,) = machine.problems()
    assert "use: expected watch with the filter zv: it does not feed the swing back" in problem


def test_too_few_messages_in_a_swing(machine: Machine) -> None:
    machine.in_dbc('"GenMsgCycleTime" BO_ 1024 20;', '"GenMsgCycleTime" BO_ 1024 400;')
    sensing(machine, changed("timeout_ms: 80", "timeout_ms: 900, delay_ms: 500"))
    (problem,) = machine.problems()
    assert "expected 6 messages or more in a swing of 2200 ms, got one in 400 ms" in problem


def test_a_delay_of_more_than_a_quarter_of_a_swing(machine: Machine) -> None:
    sensing(machine, f"{ALONG}, delay_ms: 450")
    machine.in_yaml("length_m: 1.2", "length_m: 0.6")
    (problem,) = machine.problems()
    assert "a quarter of a swing, got 450 ms" in problem


def test_another_timeout_for_the_same_message(machine: Machine) -> None:
    sensing(machine, ALONG.replace("timeout_ms: 80", "timeout_ms: 100"))
    sensing(machine, ACROSS, SLEW)
    (problem,) = machine.problems()
    assert "timeout_ms: expected the same as axes.slew.sway_sensor" in problem


def test_two_axes_on_one_signal(machine: Machine) -> None:
    sensing(machine, ALONG)
    sensing(machine, ALONG, SLEW)
    (problem,) = machine.problems()
    assert "which is the sway of slew already" in problem or "sway of slew" in problem
