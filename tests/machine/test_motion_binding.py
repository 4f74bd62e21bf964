"""Two-axis motion of a deployment against its axes and the DBC; the radius on CAN."""

import math
import struct
from typing import Any

import pytest

from canshaper.codec.frame import FrameFault
from tests.rigs.files import Machine
from tests.rigs.radius import RadiusInput

FIXED = "slew: slew, near_far: near_far, radius_m: 3"
TIP = "bus: crane, message: TipPosition, signal: Radius, timeout_ms: 100"
MEASURED = f"slew: slew, near_far: near_far, radius: {{ {TIP} }}"
RADIUS = 'Radius : 16|16@1+ (0.001,0) [0|60] "m"'
MS = 1_000_000


def moving(machine: Machine, text: str) -> int:
    """Let axes move as one; return the line."""
    return machine.in_yaml("axes:\n", f"motion: {{ crane: {{ {text} }} }}\naxes:\n")


def test_a_fixed_radius_binds(machine: Machine) -> None:
    moving(machine, FIXED)
    motion = machine.load().motions["crane"]
    assert motion.radius is None
    config = motion.config
    assert (config.slew, config.near_far, config.radius_m) == ("slew", "near_far", 3.0)
    assert (config.max_pct, config.max_path_m, config.max_s) == (25.0, 0.3, 6.0)


def test_a_measured_radius_binds_to_its_message(machine: Machine) -> None:
    moving(machine, MEASURED)
    radius = machine.load().motions["crane"].radius
    assert radius is not None
    assert radius.key == ("crane", 0x401, False)


@pytest.mark.parametrize("text", ["slew: slew", "slew: slew, near_far: near_far"])
def test_radius_and_near_far_may_be_missing(machine: Machine, text: str) -> None:
    moving(machine, text)
    assert machine.load().motions["crane"].radius is None


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
        (
            FIXED.replace("near_far: near_far", "near_far: telescope"),
            ".near_far: expected an axis, got 'telescope'; there are slew, near_far, lift",
        ),
        (
            FIXED.replace("near_far: near_far", "near_far: slew"),
            ".near_far: expected an axis that is in no other motion, got 'slew' of motion.crane.sl",
        ),
        (
            FIXED.replace("near_far: near_far", "near_far: lift"),
            ".near_far: expected an axis with sway, got 'lift' without",
        ),
        (
            FIXED.replace("slew: slew, near_far: near_far", "slew: near_far, near_far: slew"),
            ".slew: expected an axis with slewing, got 'near_far' without",
        ),
        (f"{FIXED}, radius: {{ {TIP} }}", ": expected one of radius and radius_m, got both"),
        ("slew: slew, radius_m: 3", ": expected near_far with a radius or an aim, got none"),
        (f"{FIXED}, luffing: lift", ": expected luffing, luffing_rad_s and a radius together, got"),
        (f"{FIXED}, luffing: lift, luffing_rad_s: 0.1", "expected an axis with sway, got 'lift'"),
        (
            measured(signal="Reach"),
            ".radius.signal: expected a signal of TipPosition, got 'Reach'; there are",
        ),
        (
            measured(message="Tip"),
            ".radius.message: expected a message of the DBC files, got 'Tip'; there are",
        ),
        (
            measured(timeout_ms="30"),
            ".radius.timeout_ms: expected 40 ms or more, twice the cycle of TipPosition, got 30",
        ),
    ],
)
def test_what_does_not_fit_is_reported_with_its_line(
    machine: Machine, text: str, says: str
) -> None:
    line = moving(machine, text)
    (problem,) = machine.problems()
    assert says in problem
    assert problem.startswith(f"machine.yaml:{line}: motion.crane")


def test_an_axis_is_in_one_motion_only(machine: Machine) -> None:
    both = f"{{ a: {{ {FIXED} }}, b: {{ {FIXED} }} }}"
    line = machine.in_yaml("axes:\n", f"motion: {both}\naxes:\n")
    text = "expected an axis that is in no other motion, got"
    assert machine.problems() == [
        f"machine.yaml:{line}: motion.b.slew: {text} 'slew' of motion.a.slew",
        f"machine.yaml:{line}: motion.b.near_far: {text} 'near_far' of motion.a.near_far",
    ]


def test_a_slewing_axis_acts_first(machine: Machine) -> None:
    """Where it trips, nothing of it is in the other one's output of the same tick."""
    text = machine.yaml
    slew, near_far, lift = (
        text.index("  slew:\n"),
        text.index("  near_far:\n"),
        text.index("  lift:"),
    )
    machine.yaml = text[:slew] + text[near_far:lift] + text[slew:near_far] + text[lift:]
    assert [*machine.load().axes] == ["near_far", "slew", "lift"]
    moving(machine, FIXED)
    assert [*machine.load().axes] == ["slew", "near_far", "lift"]


@pytest.mark.parametrize(
    ("limits", "says"),
    [
        ("[0|0]", "Radius has no range in the DBC; what lies outside is no radius"),
        ("[-1|60]", "Radius: expected a range from 0 m or more, got [-1|60]"),
    ],
)
def test_a_radius_needs_a_range(machine: Machine, limits: str, says: str) -> None:
    moving(machine, MEASURED)
    machine.in_dbc(RADIUS, RADIUS.replace("[0|60]", limits))
    (problem,) = machine.problems()
    assert problem.startswith("machine.dbc:")
    assert says in problem


# -- the radius as it arrives ----------------------------------------------------------------------


def radius_of(machine: Machine) -> RadiusInput:
    moving(machine, MEASURED)
    radius = machine.load().motions["crane"].radius
    assert radius is not None
    return RadiusInput(radius)


def tip(raw: int) -> bytes:
    return struct.pack("<hHh", 0, raw, 0)


@pytest.mark.parametrize("value", [math.nan, math.inf, -math.inf, -0.1, 60.1])
def test_a_float_that_is_no_radius(machine: Machine, value: Any) -> None:
    machine.in_dbc(RADIUS, 'Radius : 16|32@1- (1,0) [0|60] "m"')
    machine.in_dbc(' SG_ Height : 32|16@1- (0.001,0) [-30|30] "m" SHAPER\n', "")
    machine.in_dbc("VAL_ 272 Slew", "SIG_VALTYPE_ 1025 Radius : 1;\nVAL_ 272 Slew")
    radius = radius_of(machine)
    assert radius.receive(struct.pack("<hf", 0, value), 0) is FrameFault.INVALID_SIGNAL
    assert radius.fresh(0) is None
    assert radius.receive(struct.pack("<hf", 0, 3.5), 0) is FrameFault.NONE
    assert radius.fresh(0) == pytest.approx(3.5)


# -- what is no motion of a crane ------------------------------------------------------------------


def test_axes_of_two_cranes_are_no_motion(machine: Machine) -> None:
    for name in ("slew", "near_far"):
        machine.in_yaml(f"  {name}:\n", f"  front_{name}:\n")
    line = moving(machine, FIXED.replace("slew: slew", "slew: front_slew"))
    machine.in_yaml("near_far: near_far", "near_far: front_near_far")
    machine.load()
    machine.yaml = machine.yaml.replace("front_near_far", "rear_near_far")
    assert machine.problems() == [
        f"machine.yaml:{line}: motion.crane.near_far: expected an axis of the same crane as"
        " 'front_slew', got 'rear_near_far'"
    ]


def test_axes_with_names_of_their_own_may_be_of_one_crane(machine: Machine) -> None:
    machine.in_yaml("  near_far:\n", "  reach:\n")
    moving(machine, FIXED.replace("near_far: near_far", "near_far: reach"))
    assert machine.load().motions["crane"].config.near_far == "reach"


@pytest.mark.parametrize("unit", ["deg", "mm", "%"])
def test_a_radius_that_is_no_length_is_refused(machine: Machine, unit: str) -> None:
    moving(machine, MEASURED)
    line = machine.in_dbc(RADIUS, RADIUS.replace('"m"', f'"{unit}"'))
    (problem,) = machine.problems()
    assert problem.startswith("machine.dbc:")
    assert f"Radius: expected a radius in m, got a signal in {unit}" in problem
    assert line > 0


@pytest.mark.parametrize("axis", ["slew", "near_far"])
def test_an_axis_without_sway_data_is_refused(machine: Machine, axis: str) -> None:
    line = moving(machine, FIXED)
    section = machine.yaml.index(f"  {axis}:\n")
    begin = machine.yaml.index("    sway:", section)
    end = machine.yaml.index("\n", machine.yaml.index("    filter:", section))
    machine.yaml = machine.yaml[:begin] + "    filter: { kind: off }" + machine.yaml[end:]
    says = f"machine.yaml:{line}: motion.crane.{axis}: expected an axis with sway, got '{axis}'"
    assert f"{says} without" in machine.problems()
