"""Sway sensors of a deployment against its axes and the DBC."""

import math
from pathlib import Path

import pytest

from canshaper.machine.sway_sensor import sensor_timing
from canshaper.shaping.sway import Measured, SensorLimits, SensorTiming
from tests.rigs.files import Machine, faults, machine_file

ALONG = "bus: crane, message: GrappleSway, signal: SwayParallel, kind: angle, timeout_ms: 80"
ACROSS = ALONG.replace("SwayParallel", "SwayPerpendicular")
UNIT = 'SwayParallel : 16|16@1- (0.01,0) [-180|180] "deg"'
INCLINED = ALONG.replace("kind: angle", "kind: inclination")
OTHER = "TipPosition, signal: SlewAngle"
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
    assert bound.timing == SensorTiming(Measured.ANGLE, 0.02, 0.04, 0.1, 0.08)
    slow = sensor_timing(bound.config, bound.cycle_s, 0.04)
    assert slow == SensorTiming(Measured.ANGLE, 0.04, 0.04, 0.1, 0.08)
    assert sensor_timing(bound.config, bound.cycle_s, 0.01).period_s == 0.02
    assert bound.limits == SensorLimits(math.radians(0.1), math.radians(3.0), 0.6, None)
    assert bound.message.signals == (bound.signal,)
    assert bound.message.merits == {}


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
        (
            "Merits",
            "expected a signal of GrappleSway, got 'Merits'; there are SwayPerpendicular,"
            " SwayParallel, Float",
        ),
        (
            "SwayParallel",
            "expected a free signal, got 'SwayParallel', which is the sway of near_far already",
        ),
        ("Float", "expected a signal of whole numbers, got 'Float'"),
    ],
)
def test_a_figure_of_merit_that_is_none(machine: Machine, merit: str, fault: str) -> None:
    with_merits(machine, MERIT.splitlines()[1] + "\n")
    machine.dbc += "SIG_VALTYPE_ 1024 Float : 1;\n"
    line = sensing(machine, f"{ALONG}, merit: {merit}")
    (problem,) = machine.problems()
    assert problem == f"machine.yaml:{line}: axes.near_far.sway_sensor.merit: {fault}"


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
        ("°", "angle", math.radians(1.0)),
        (" deg ", "angle", math.radians(1.0)),
        ("rad", "angle", 1.0),
        ("mrad", "angle", 1e-3),
        ("deg/s", "rate", math.radians(1.0)),
        ("°/s", "rate", math.radians(1.0)),
        ("rad/s", "rate", 1.0),
        ("mrad/s", "rate", 1e-3),
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
    assert bound.timing.measured is Measured.ANGLE
    assert bound.config.noise == 0.1


def test_a_second_swing(machine: Machine) -> None:
    sensing(machine, f"{ALONG}, second_period_s: 0.7")
    bound = machine.load().axes["near_far"].sway_sensor
    assert bound is not None
    second = bound.limits.second
    assert second is not None
    assert (second.period_s, second.damping_ratio) == (pytest.approx(0.7), 0.04)


SAYS = [
    (
        changed("SwayParallel", "Sway"),
        ".signal: expected a signal of GrappleSway, got 'Sway'; there are SwayPerpendicular,"
        " SwayParallel",
    ),
    (f"{ALONG}, node: tool", ".node: expected a node of bus crane, got 'tool'; there are none"),
    (
        f"{ALONG}, fusion_s: 5",
        ".fusion_s: expected it with the kind inclination only, got it with angle",
    ),
    (
        f"{ALONG}, fusion_s: 0",
        ".fusion_s: expected it with the kind inclination only, got it with angle",
    ),
    (f"{INCLINED}", ".fusion_s: expected 3.3 s or more, 1.5 swings, got none"),
    (f"{INCLINED}, fusion_s: 2", ".fusion_s: expected 3.3 s or more, 1.5 swings, got 2 s"),
    (
        f"{INCLINED}, fusion_s: 0",
        ".fusion_s: expected 3.3 s or more, 1.5 swings, got 0: without a gyro an inclinometer shows"
        " nothing on a free pendulum",
    ),
    (
        changed("timeout_ms: 80", "timeout_ms: 30"),
        ".timeout_ms: expected 40 ms or more, twice the cycle of GrappleSway, got 30",
    ),
    (
        f"{ALONG}, second_period_s: 1.2",
        ".second_period_s: expected up to 1.10 s, half of the first swing, got 1.2 s",
    ),
]


@pytest.mark.parametrize(("text", "says"), SAYS)
def test_what_is_wrong_is_reported_at_its_line(machine: Machine, text: str, says: str) -> None:
    line = sensing(machine, text)
    (problem,) = machine.problems()
    assert problem == f"machine.yaml:{line}: axes.near_far.sway_sensor{says}"


def test_a_message_that_there_is_not(machine: Machine) -> None:
    line = sensing(machine, changed("GrappleSway", "GrappleSwing"))
    (problem,) = machine.problems()
    assert problem.startswith(f"machine.yaml:{line}: axes.near_far.sway_sensor.message: ")


@pytest.mark.parametrize(
    ("unit", "kind", "units", "got"),
    [
        ('"m"', "angle", "deg, °, rad, mrad", "'m'"),
        ('""', "angle", "deg, °, rad, mrad", "None"),
        ('"deg"', "rate", "deg/s, °/s, rad/s, mrad/s", "'deg'"),
    ],
)
def test_a_unit_of_another_kind(
    machine: Machine, unit: str, kind: str, units: str, got: str
) -> None:
    machine.in_dbc(UNIT, UNIT.replace('"deg"', unit))
    line = sensing(machine, changed("kind: angle", f"kind: {kind}"))
    (problem,) = machine.problems()
    expected = f"expected one in {units} for the kind {kind}, got 'SwayParallel' in {got}"
    assert problem == f"machine.yaml:{line}: axes.near_far.sway_sensor.signal: {expected}"


def test_another_timeout_for_the_same_message(machine: Machine) -> None:
    sensing(machine, ALONG.replace("timeout_ms: 80", "timeout_ms: 100"))
    sensing(machine, ACROSS, SLEW)
    line = machine.in_yaml(NEAR_FAR, NEAR_FAR) - 1
    assert machine.problems() == [
        f"machine.yaml:{line}: axes.near_far.sway_sensor.timeout_ms: expected the same as"
        " axes.slew.sway_sensor, which reads the message too"
    ]


def test_two_axes_on_one_signal(machine: Machine) -> None:
    sensing(machine, ALONG)
    sensing(machine, ALONG, SLEW)
    line = machine.in_yaml(NEAR_FAR, NEAR_FAR) - 1
    assert machine.problems() == [
        f"machine.yaml:{line}: axes.near_far.sway_sensor.signal: expected a free signal, got"
        " 'SwayParallel', which is the sway of slew already"
    ]


def test_axes_may_read_messages_of_their_own(machine: Machine) -> None:
    sensing(machine, ALONG)
    sensing(machine, ALONG.replace("GrappleSway, signal: SwayParallel", OTHER), SLEW)
    axes = machine.load().axes
    names = {name: axis.sway_sensor.name for name, axis in axes.items() if axis.sway_sensor}
    assert names == {"slew": "TipPosition.SlewAngle", "near_far": "GrappleSway.SwayParallel"}


def test_a_sensor_of_j1939_needs_a_known_source(tmp_path: Path) -> None:
    source = "      source: 0x19 # its address\n"
    reported = faults(machine_file(tmp_path, "j1939-sensor", (source, "")))
    missing = "missing: in the DBC SSI2 may come from any source address"
    says = f"axes.slew.sway_sensor.source: {missing}; a sway sensor needs a known one"
    assert [one for one in reported if "missing" in one] == [says]
