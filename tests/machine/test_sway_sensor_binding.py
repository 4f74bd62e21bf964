"""Sway sensors of a deployment against its axes and the DBC."""

import math

import pytest

from canshaper.shaping.sway_sensor import Measured
from tests.rigs.files import Machine

ALONG = "bus: crane, message: GrappleSway, signal: SwayParallel, kind: angle, timeout_ms: 80"
ACROSS = ALONG.replace("SwayParallel", "SwayPerpendicular")
UNIT = 'SwayParallel : 16|16@1- (0.01,0) [-180|180] "deg"'
INCLINED = ALONG.replace("kind: angle", "kind: inclination")
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


MERIT = """ SG_ Merit : 62|2@1+ (1,0) [0|3] "" SHAPER
 SG_ Float : 32|32@1- (1,0) [0|3] "" SHAPER
"""


def with_merits(machine: Machine, merit: str = MERIT) -> None:
    machine.in_dbc("GrappleSway: 4 PLANT\n", f"GrappleSway: 8 PLANT\n{merit}")


def test_axes_may_share_a_figure_of_merit(machine: Machine) -> None:
    with_merits(machine, MERIT.splitlines()[0] + "\n")
    sensing(machine, f"{ALONG}, merit: Merit")
    sensing(machine, f"{ACROSS}, merit: Merit", SLEW)
    bound = machine.load().axes["near_far"].sway_sensor
    assert bound is not None
    assert bound.message.merits == {"SwayPerpendicular": "Merit", "SwayParallel": "Merit"}


@pytest.mark.parametrize(
    ("merit", "fault"),
    [
        ("Merits", "expected a signal of GrappleSway, got 'Merits'"),
        ("SwayParallel", "expected a free signal, got 'SwayParallel', which is"),
        ("Float", "expected a signal of whole numbers, got 'Float'"),
    ],
)
def test_a_figure_of_merit_that_is_none(machine: Machine, merit: str, fault: str) -> None:
    with_merits(machine, MERIT.splitlines()[1] + "\n")
    machine.dbc += "SIG_VALTYPE_ 1024 Float : 1;\n"
    line = sensing(machine, f"{ALONG}, merit: {merit}")
    (problem,) = machine.problems()
    assert problem.startswith(f"machine.yaml:{line}: axes.near_far.sway_sensor.merit: {fault}")


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


def test_an_inclination_is_an_angle(machine: Machine) -> None:
    sensing(machine, f"{INCLINED}, fusion_s: 3.4")
    bound = machine.load().axes["near_far"].sway_sensor
    assert bound is not None
    assert bound.timing(0.02).measured is Measured.ANGLE
    assert bound.config.noise == 0.1


def test_a_second_swing(machine: Machine) -> None:
    sensing(machine, f"{ALONG}, second_period_s: 0.7")
    bound = machine.load().axes["near_far"].sway_sensor
    assert bound is not None
    second = bound.limits.second
    assert second is not None
    assert (second.period_s, second.damping_ratio) == (pytest.approx(0.7), 0.04)


SAYS = [
    (changed("bus: crane", "bus: rear"), ".bus: expected a bus, got 'rear'"),
    (changed("GrappleSway", "GrappleSwing"), ".message: "),
    (changed("SwayParallel", "Sway"), ".signal: "),
    (changed("kind: angle", "kind: force"), ".kind: "),
    (f"{ALONG}, delay_ms: 501", ".delay_ms: expected 0 to 500 ms, got 501"),
    (f"{ALONG}, noise_deg: 9", ".noise_deg: expected 0.01 to 5 deg, deg/s, got 9"),
    (f"{ALONG}, offset_max_deg: 21", ".offset_max_deg: expected 0.1 to 20 deg, deg/s, got 21"),
    (f"{ALONG}, node: tool", ".node: expected a node of bus crane, got 'tool'; there are none"),
    (f"{ALONG}, fusion_s: 5", ".fusion_s: expected it with the kind inclination only, got it with"),
    (f"{INCLINED}", ".fusion_s: expected 3.3 s or more, 1.5 swings, got none"),
    (f"{INCLINED}, fusion_s: 2", ".fusion_s: expected 3.3 s or more, 1.5 swings, got 2 s"),
    (f"{INCLINED}, fusion_s: 0", ".fusion_s: expected 3.3 s or more, 1.5 swings, got 0: without"),
    (changed("timeout_ms: 80", "timeout_ms: 30"), ".timeout_ms: "),
    (f"{ALONG}, second_period_s: 3.1", ".second_period_s: expected 0.15 to 3 s, got 3.1"),
    (f"{ALONG}, second_period_s: 1.2", ".second_period_s: expected up to 1.10 s, half of the"),
]


@pytest.mark.parametrize(("text", "says"), SAYS)
def test_what_is_wrong_is_reported_at_its_line(machine: Machine, text: str, says: str) -> None:
    line = sensing(machine, text)
    (problem,) = machine.problems()
    assert problem.startswith(f"machine.yaml:{line}: axes.near_far.sway_sensor{says}")


def test_a_unit_that_is_no_angle(machine: Machine) -> None:
    machine.in_dbc(UNIT, UNIT.replace('"deg"', '"m"'))
    line = sensing(machine, ALONG)
    (problem,) = machine.problems()
    expected = "expected one in deg, °, rad, mrad for the kind angle, got 'SwayParallel' in 'm'"
    assert problem == f"machine.yaml:{line}: axes.near_far.sway_sensor.signal: {expected}"


def test_a_rate_is_no_angle(machine: Machine) -> None:
    sensing(machine, changed("kind: angle", "kind: rate"))
    (problem,) = machine.problems()
    assert ".signal: expected one in deg/s, °/s, rad/s, mrad/s for the kind rate, got" in problem


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


def test_too_few_messages_in_a_second_swing(machine: Machine) -> None:
    machine.in_dbc('"GenMsgCycleTime" BO_ 1024 20;', '"GenMsgCycleTime" BO_ 1024 200;')
    sensing(machine, changed("timeout_ms: 80", "timeout_ms: 900, second_period_s: 0.7"))
    (problem,) = machine.problems()
    assert "expected 6 messages or more in a swing of 700 ms, got one in 200 ms" in problem


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
