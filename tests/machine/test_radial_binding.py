"""Radial compensation of a deployment against its other axes and the DBC; the radius on CAN."""

import math
import struct
from typing import Any

import pytest

from canshaper.codec.frame import FrameFault
from canshaper.inputs.radius import RadiusInput
from tests.rigs.files import Machine

SWAY = "    sway: { period_s: 2.356, damping_ratio: 0.038, full_speed_m_s: 1.5 }\n"
NEAR_SWAY = "    sway: { length_m: 1.2, damping_nms: 120, mass_kg: 300, full_speed_m_s: 1.0 }\n"
NEAR_FILTER = "    filter: { kind: gff, a1: 0.708, a2: 0.12 } # near-far tuning of the paper\n"
FIXED = "axis: near_far, full_speed_rad_s: 0.5, radius_m: 3"
TIP = "bus: crane, message: TipPosition, signal: Radius, timeout_ms: 100"
MEASURED = f"axis: near_far, full_speed_rad_s: 0.5, radius: {{ {TIP} }}"
RADIUS = 'Radius : 16|16@1+ (0.001,0) [0|60] "m"'
MS = 1_000_000


def compensated(machine: Machine, text: str, after: str = SWAY) -> int:
    """Give an axis a radial compensation; return the line."""
    return 1 + machine.in_yaml(after, f"{after}    radial_compensation: {{ {text} }}\n")


def test_a_fixed_radius_binds(machine: Machine) -> None:
    compensated(machine, FIXED)
    deployment = machine.load()
    radial = deployment.axes["slew"].radial
    assert radial is not None
    assert (radial.key, radial.config.radius_m, radial.config.max_pct) == (None, 3.0, 25.0)
    assert deployment.axes["near_far"].radial is None


def test_a_measured_radius_binds_to_its_message(machine: Machine) -> None:
    compensated(machine, MEASURED)
    radial = machine.load().axes["slew"].radial
    assert radial is not None
    assert radial.key == ("crane", 0x401, False)


def measured(**changes: str) -> str:
    text = MEASURED
    for old, new in changes.items():
        place = text.index(f" {old}: ") + 1
        end = min(i for i in (text.find(",", place), text.find(" }", place)) if i > 0)
        text = f"{text[:place]}{old}: {new}{text[end:]}"
    return text


@pytest.mark.parametrize(
    ("text", "says"),
    [
        (FIXED.replace("near_far", "telescope"), ".axis: found 'telescope', other axes are near_"),
        (FIXED.replace("near_far", "slew"), ".axis: found 'slew', other axes are near_far, lift"),
        (FIXED.replace("near_far", "lift"), ".axis: found 'lift', which has no sway data"),
        (f"{FIXED}, radius: {{ {TIP} }}", ": found both; allowed is one of radius_m and radius"),
        (FIXED.replace(", radius_m: 3", ""), ": found neither; allowed is one of radius_m and"),
        (FIXED.replace("radius_m: 3", "radius_m: 0.4"), "found 0.4, allowed is 0.5 to 30 m"),
        (FIXED.replace("speed_rad_s: 0.5", "speed_rad_s: 5"), "found 5, allowed is 0.05 to 3 rad"),
        (f"{FIXED}, max_pct: 51", ".max_pct: found 51, allowed is 1 to 50 % of full near-far"),
        (f"{FIXED}, speed: 1", ".speed: unknown key; allowed are axis, full_speed_rad_s, radius"),
        (measured(signal="Reach"), ".radius.signal: found 'Reach', signals of TipPosition are"),
        (measured(message="Tip"), ".radius.message: found 'Tip', messages of the DBC files are"),
        (measured(bus="boom"), ".radius.bus: found 'boom', buses are crane"),
        (
            measured(message="JoystickLeft", signal="Slew"),
            "which is used already by joysticks.left",
        ),
        (measured(timeout_ms="30"), ".radius.timeout_ms: found 30, allowed is 40 ms or more"),
        (measured(timeout_ms="5"), ".radius.timeout_ms: found 5, allowed is a whole number, 10 to"),
    ],
)
def test_what_does_not_fit_is_told_with_its_line(machine: Machine, text: str, says: str) -> None:
    line = compensated(machine, text)
    found = machine.problems()
    assert says in found[0]
    assert found[0].startswith(f"machine.yaml:{line}: axes.slew.radial_compensation")
    # the signal of a joystick is no radius either
    assert len(found) == (2 if "JoystickLeft" in text else 1)


def test_an_axis_without_sway_data_of_its_own_cannot_compensate(machine: Machine) -> None:
    lift = "    filter: { kind: off } # lifting excites no sway\n"
    line = compensated(machine, FIXED, lift)
    assert machine.problems() == [
        f"machine.yaml:{line}: axes.lift.radial_compensation:"
        " needs the sway data of its own axis; found no sway"
    ]


def test_valves_of_different_cycles_do_not_work_together(machine: Machine) -> None:
    line = compensated(machine, FIXED)
    machine.in_dbc('BA_ "GenMsgCycleTime" BO_ 513 20;', 'BA_ "GenMsgCycleTime" BO_ 513 40;')
    assert machine.problems() == [
        f"machine.yaml:{line}: axes.slew.radial_compensation.axis:"
        " found 'near_far', whose valve has another cycle"
    ]


def test_an_axis_that_compensates_cannot_be_asked_itself(machine: Machine) -> None:
    """Each would overwrite what the other asks."""
    line = compensated(machine, FIXED)
    other = compensated(machine, FIXED.replace("near_far", "slew"), NEAR_SWAY)
    place = "radial_compensation.axis"
    assert machine.problems() == [
        f"machine.yaml:{line}: axes.slew.{place}:"
        " found 'near_far', which has a radial compensation itself",
        f"machine.yaml:{other}: axes.near_far.{place}:"
        " found 'slew', which has a radial compensation itself",
    ]


def test_two_axes_cannot_ask_one(machine: Machine) -> None:
    line = compensated(machine, FIXED)
    lift = "    filter: { kind: off } # lifting excites no sway\n"
    machine.in_yaml(lift, SWAY + lift)
    other = compensated(machine, FIXED, lift)
    assert machine.problems() == [
        f"machine.yaml:{line}: axes.slew.radial_compensation.axis:"
        " found 'near_far', which axis lift uses already",
        f"machine.yaml:{other}: axes.lift.radial_compensation.axis:"
        " found 'near_far', which axis slew uses already",
    ]


@pytest.mark.parametrize(
    ("limits", "says"),
    [
        ("[0|0]", "Radius has no range in the DBC; what lies outside is no radius"),
        ("[-1|60]", "Radius has the range [-1|60]; allowed is one from 0 m or more"),
    ],
)
def test_a_radius_needs_a_range(machine: Machine, limits: str, says: str) -> None:
    compensated(machine, MEASURED)
    machine.in_dbc(RADIUS, RADIUS.replace("[0|60]", limits))
    (found,) = machine.problems()
    assert found.startswith("machine.dbc:")
    assert says in found


# -- the radius as it arrives ----------------------------------------------------------------------


def radius_of(machine: Machine) -> RadiusInput:
    compensated(machine, MEASURED)
    radial = machine.load().axes["slew"].radial
    assert radial is not None
    return RadiusInput(radial)


def tip(raw: int) -> bytes:
    return struct.pack("<hHh", 0, raw, 0)


def test_a_fixed_radius_is_that_of_the_grapple_a_measured_one_that_of_the_tip(
    machine: Machine,
) -> None:
    radius = radius_of(machine)
    assert radius.circle_m(0, 0.9) is None  # nothing heard yet
    assert radius.receive(tip(4500), 0) is FrameFault.NONE
    assert radius.circle_m(0, 0.9) == pytest.approx(5.0)
    machine.in_yaml(MEASURED, FIXED)
    fixed = machine.load().axes["slew"].radial
    assert fixed is not None
    assert RadiusInput(fixed).circle_m(10**15, 0.9) == 3.0


def test_it_counts_as_long_as_it_is_fresh(machine: Machine) -> None:
    radius = radius_of(machine)
    radius.receive(tip(3000), 5 * MS)
    assert radius.circle_m(105 * MS, 1.0) == pytest.approx(3.0)
    assert radius.circle_m(105 * MS + 1, 1.0) is None
    radius.receive(tip(3100), 200 * MS)
    assert radius.circle_m(200 * MS, 1.0) == pytest.approx(3.1)
    radius.invalidate()
    assert radius.circle_m(200 * MS, 1.0) is None


@pytest.mark.parametrize(
    ("data", "fault"),
    [
        (b"", FrameFault.WRONG_LENGTH),
        (tip(3000)[:5], FrameFault.WRONG_LENGTH),
        (tip(3000) + b"\0", FrameFault.WRONG_LENGTH),
        (tip(60_001), FrameFault.INVALID_SIGNAL),
        (tip(0xFFFF), FrameFault.INVALID_SIGNAL),
    ],
)
def test_a_frame_that_is_no_radius_neither_counts_nor_refreshes(
    machine: Machine, data: bytes, fault: FrameFault
) -> None:
    radius = radius_of(machine)
    assert radius.receive(data, 0) is fault
    assert radius.circle_m(0, 1.0) is None
    radius.receive(tip(3000), 0)
    assert radius.receive(data, 90 * MS) is fault
    assert radius.circle_m(100 * MS, 1.0) == pytest.approx(3.0)
    assert radius.circle_m(101 * MS, 1.0) is None


def test_an_error_code_within_the_range_is_no_radius(machine: Machine) -> None:
    machine.in_dbc(RADIUS, RADIUS.replace("[0|60]", "[0|65.535]"))
    machine.in_dbc(
        "VAL_ 272 Slew", 'VAL_ 1025 Radius 65534 "Error" 65535 "NotAvailable" ;\nVAL_ 272 Slew'
    )
    radius = radius_of(machine)
    for raw in (65534, 65535):
        assert radius.receive(tip(raw), 0) is FrameFault.INVALID_SIGNAL
    assert radius.circle_m(0, 1.0) is None
    assert radius.receive(tip(65533), 0) is FrameFault.NONE


@pytest.mark.parametrize("value", [math.nan, math.inf, -math.inf, -0.1, 60.1])
def test_a_float_that_is_no_radius(machine: Machine, value: Any) -> None:
    machine.in_dbc(RADIUS, 'Radius : 16|32@1- (1,0) [0|60] "m"')
    machine.in_dbc(' SG_ Height : 32|16@1- (0.001,0) [-30|30] "m" SHAPER\n', "")
    machine.in_dbc("VAL_ 272 Slew", "SIG_VALTYPE_ 1025 Radius : 1;\nVAL_ 272 Slew")
    radius = radius_of(machine)
    assert radius.receive(struct.pack("<hf", 0, value), 0) is FrameFault.INVALID_SIGNAL
    assert radius.circle_m(0, 1.0) is None
    assert radius.receive(struct.pack("<hf", 0, 3.5), 0) is FrameFault.NONE
    assert radius.circle_m(0, 1.0) == pytest.approx(3.5)
