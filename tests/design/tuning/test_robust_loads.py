"""``canshaper robust --loads`` and ``--lengths``: several loads, and a load that is not known."""

import json
import math
import re
from pathlib import Path

import pytest

from canshaper.config.filters import DesignedFor
from canshaper.config.section import expanded
from canshaper.machine.binding import load_deployment
from canshaper.machine.deployment import Deployment
from canshaper.shaping.sway import GRAVITY_M_S2
from tests.cli.invocation import invoke
from tests.rigs.files import machine_file
from tests.rigs.overhead import changed


@pytest.fixture
def file(tmp_path: Path) -> Path:
    return machine_file(tmp_path, "forwarder-load")


def taps(deployment: Deployment, axis: str) -> list[list[float]]:
    config = deployment.axes[axis].config
    filters = [config.filter, *(one.filter for one in config.gain_schedule)]
    return [one.parameters()["taps"] for one in filters]


def design(deployment: Deployment, axis: str) -> DesignedFor:
    chosen = deployment.axes[axis].config.filter.design()
    assert chosen
    return chosen


def words(*arguments: str, code: int = 0) -> str:
    done = invoke("robust", *arguments)
    assert done.exit_code == code, done.output
    return " ".join(done.output.split())


@pytest.mark.slow
@pytest.mark.parametrize("axis", ["slew", "near_far"])
def test_the_shipped_taps_are_those_of_the_commands_in_their_file(file: Path, axis: str) -> None:
    before = load_deployment(file)
    lengths = {"slew": "1.38:1.79", "near_far": "1.2:1.6"}[axis]
    text = file.read_text(encoding="utf-8").replace("0.0702883", "0.0701883")
    file.write_text(text.replace("0.0572831", "0.0571831"), encoding="utf-8")
    words(str(file), "--axis", axis, "--loads", "--duration", "1.8", "--write")
    words(str(file), "--axis", axis, "--lengths", lengths, "--duration", "2.4", "--write")
    after = load_deployment(file)
    assert taps(after, axis) == taps(before, axis)
    assert after.axes[axis].config.sway == before.axes[axis].config.sway
    warnings = [one for one in invoke("check", str(file)).output.split("\n") if "WARNING" in one]
    assert len(warnings) == 1 and "hydraulics: missing" in warnings[0]


def test_the_sets_begin_alike_and_the_longer_swing_has_more_time(file: Path) -> None:
    options = ("--axis", "slew", "--loads", "--duration", "1.6", "--json")
    printed = json.loads(invoke("robust", str(file), *options).stdout)
    empty, log = (one["filter"] for one in printed["loads"])
    assert empty["designed_for"]["duration_s"] == 1.6
    assert log["designed_for"]["duration_s"] == pytest.approx(1.6 * 2.686 / 2.356, abs=0.02)
    first, second = expanded(empty["taps"]), expanded(log["taps"])
    assert first[:25] == pytest.approx(second[:25], abs=2e-7)
    assert first[25:50] != pytest.approx(second[25:50], abs=1e-4)


def test_the_table_says_what_the_wrong_set_leaves(file: Path) -> None:
    text = words(str(file), "--axis", "near_far", "--loads", "--duration", "1.8")
    match = re.search(r"for 0 ([\d.]+) ([\d.]+) for 600 ([\d.]+) ([\d.]+) ", text)
    assert match
    empty, wrong, other_wrong, log = map(float, match.groups())
    assert max(empty, log) < 1.0
    assert min(wrong, other_wrong) > 10.0


def test_a_filter_of_another_kind_is_replaced_with_the_sets(file: Path) -> None:
    """A schedule has one kind of filter: none of its parts can be written alone."""
    text = file.read_text(encoding="utf-8")
    text = re.sub(r"kind: robust\n +tick_ms: 20\n +taps: .*\n +designed_for: .*", "kind: zv", text)
    file.write_text(text, encoding="utf-8")
    text = words(str(file), "--axis", "slew", "--loads", "--write")
    assert "NOTE: axes.slew.filter.kind: robust replaces zv" in text
    lengths = [len(one) for one in taps(load_deployment(file), "slew")]
    assert lengths[1] < lengths[0] < lengths[2]


def test_a_range_becomes_the_swing_of_the_file(file: Path) -> None:
    words(str(file), "--axis", "slew", "--lengths", "1.4:1.8", "--duration", "2.4", "--write")
    deployment = load_deployment(file)
    sway = deployment.axes["slew"].config.sway
    assert sway
    assert sway.mode().omega_rad_s == pytest.approx(math.sqrt(GRAVITY_M_S2 / 1.6), rel=1e-4)
    assert sway.damping_ratio == 0.038
    assert design(deployment, "slew").length_range_pct == 12.5
    assert design(deployment, "slew").duration_s == 2.4


def test_grapple_data_stays_grapple_data(file: Path) -> None:
    words(str(file), "--axis", "near_far", "--lengths", "1.2:1.8", "--write")
    sway = load_deployment(file).axes["near_far"].config.sway
    assert sway
    assert (sway.length_m, sway.mass_kg, sway.period_s) == (1.5, 300.0, None)


def test_a_range_leaves_less_than_the_same_time_for_more_than_the_range() -> None:
    """ZVD of the middle leaves 2.3 %, ±30 % 4.5 % through the limits of the axis."""
    text = words("forwarder-load.yaml", "--axis", "near_far", "--lengths", "1.2:1.6")
    match = re.search("1.20 m .* 1.60 m .*? through the machine (.*) shaper alone", text)
    assert match
    assert max(map(float, match[1].split())) < 1.5


@pytest.mark.slow
def test_of_a_range_with_a_residual_the_shortest_is_taken(file: Path) -> None:
    text = words(str(file), "--axis", "near_far", "--lengths", "1.2:1.6", "--residual", "5")
    assert re.search("at most 5.0 % of the swing at pendulums of 1.2 to 1.6 m", text)


@pytest.mark.parametrize(
    ("lengths", "expected"),
    [
        ("1.6:1.2", "expected LOW of 0.05 to 1.2 m, up to HIGH, got 1.6:1.2"),
        ("1.2:151", "expected LOW of 0.05 to 150 m, up to HIGH, got 1.2:151"),
        ("1.2", "expected LOW:HIGH in m, such as 1.2:1.6, got 1.2"),
        ("nan:1", "expected LOW of 0.05 to 1 m, up to HIGH, got nan:1"),
    ],
)
def test_a_range_that_is_none_is_refused_in_one_line(lengths: str, expected: str) -> None:
    text = words("forwarder.yaml", "--axis", "slew", "--lengths", lengths, code=2)
    assert text == f"--lengths: {expected}"


@pytest.mark.parametrize(
    ("options", "expected"),
    [
        (["--loads"], "--loads: expected a gain_schedule with the swing of each load at slew"),
        (["--loads", "--lengths", "1:2"], "expected one of --lengths and --loads, got both"),
        (["--lengths", "0.5:3"], "axis slew: range of length: expected 0 to 60 %, got 71.4 %"),
    ],
)
def test_what_cannot_be_designed_is_refused_in_one_line(options: list[str], expected: str) -> None:
    assert words("forwarder.yaml", "--axis", "slew", *options, code=2) == expected


@pytest.mark.parametrize(
    ("verb", "cure"),
    [
        (
            "robust",
            "--loads writes all of them, --lengths LOW:HIGH that while the load is not known",
        ),
        ("tune", "robust --loads --write designs one for each"),
    ],
)
def test_one_filter_beside_those_of_a_schedule_is_not_written(
    file: Path, verb: str, cure: str
) -> None:
    before = file.read_bytes()
    done = invoke(verb, str(file), "--axis", "slew", "--write")
    says = "--write: expected an axis without gain_schedule, got slew with 0, 600, whose filters"
    assert done.exit_code == 2
    assert " ".join(done.output.split()) == f"{says} would stay: {cure}"
    assert file.read_bytes() == before


@pytest.mark.slow
def test_lengths_of_an_axis_that_follows_its_rope_are_those_of_the_rope(tmp_path: Path) -> None:
    file = changed(tmp_path, ("tail_s: 10, stop_s: 10", "tail_s: 7, stop_s: 12"), ("30 }", "20 }"))
    options = ["--axis", "trolley", "--lengths", "2:25", "--range", "5"]
    assert "sway: { length_m: 2.0, length: { lowest_m: 2.0, highest_m: 25.0 } }" in words(
        str(file), *options
    )
    words(str(file), *options, "--write")
    trolley = load_deployment(file).axes["trolley"].config
    assert trolley.sway and trolley.sway.length
    ends = trolley.sway.length_m, trolley.sway.length.lowest_m, trolley.sway.length.highest_m
    assert ends == (2.0, 2.0, 25.0)
    design = trolley.filter.design()
    assert design
    assert design.period_s == pytest.approx(2.0 * math.pi * math.sqrt(2.0 / 9.81), rel=1e-3)
    assert design.duration_s
    # What a filter drawn out to the longest rope takes.
    assert trolley.limits.tail_s == pytest.approx(design.duration_s * math.sqrt(12.5), abs=0.2)
