"""``canshaper check``: what it shows of a deployment, and every problem with its line."""

import json
from pathlib import Path
from typing import Any

import pytest

from canshaper.machine.binding import load_deployment
from tests.cli.invocation import SHIPPED, invoke
from tests.rigs.files import ROOT, machine_file, text_of

NO_PUMP = (
    "where the pump lacks oil for slew and near_far at once, swing is left; measure flow (canshaper"
    f" calibrate {SHIPPED} --together), or write {{ flow: 3 }} where the oil is enough"
)
ROBUST = Path(__file__).parents[2] / "config" / "forwarder-robust.yaml"


def test_check_of_a_good_file_shows_what_it_does() -> None:
    result = invoke("check", str(SHIPPED))
    identity = load_deployment(SHIPPED).identity
    assert result.exit_code == 0
    assert result.stderr == ""
    before, _, _ = result.stdout.partition("\n  ".ljust(60))  # the table of stopping distances
    assert before.splitlines() == [
        f"{SHIPPED}: good",
        "  bus crane: socketcan vcan0, its 10 messages load 12% of 250 kbit/s",
        "  axis slew: JoystickLeft.Slew -> gff -> SlewCommand.Velocity every 20 ms",
        "    pendulum: 1.17 to 1.58 m, 14 and 8 % of the swing left",
        "  axis near_far: JoystickLeft.NearFar -> gff -> NearFarCommand.Velocity every 20 ms",
        "    pendulum: 1.02 to 1.38 m, 13 and 7 % of the swing left",
        "  axis lift: JoystickRight.Lift -> off -> LiftCommand.Velocity every 20 ms",
        "  worst filter: near_far, good: 4.9 % of the swing is left at the right length",
        "  slew is in no motion: together with another axis it leaves more swing;",
        "    a motion takes one axis that moves the tip in and out, which joints are not",
        "  JoystickLeft.Slew, JoystickLeft.NearFar, JoystickRight.Lift: "
        '32766 "Error": fault (JOYSTICK_ERROR); '
        '32767 "NotAvailable": fault (JOYSTICK_NOT_AVAILABLE)',
        "  JoystickLeft.Enable, JoystickRight.Enable: "
        '0 "Off", 2 "Error", 3 "NotAvailable": not on; 1 "On": on',
        "  JoystickLeft.Reset, JoystickRight.Reset: "
        '0 "Off", 2 "Error", 3 "NotAvailable": no reset; 1 "On": reset',
        "  JoystickLeft.AntiSwayOff, JoystickRight.AntiSwayOff: "
        '0 "Off", 2 "Error", 3 "NotAvailable": no anti_sway_off; 1 "On": anti_sway_off',
        f"  digest {identity.digest:#06x} of deployment, DBC files and program:",
        *(f"    {line}" for line in identity.lines()[1:]),
    ]


def test_check_shows_how_far_every_axis_travels_on() -> None:
    lines = invoke("check", str(SHIPPED)).stdout.splitlines()
    *lines, warning = lines[next(i for i, line in enumerate(lines) if "stops from" in line) :]
    assert max(map(len, lines)) <= 80
    rows = {line[:26].strip(): line[26:].split() for line in lines if line.startswith(" ")}
    # 0.5 rad/s at 9.6 m; lift has no speed
    assert rows["joystick released"] == ["3.63", "m", "22", "deg", "0.74", "m", "0.11", "s"]
    assert rows["joystick lost"] == ["4.11", "m", "25", "deg", "0.84", "m", "0.21", "s"]
    assert rows["in the old direction"] == ["0.18", "s", "0.18", "s", "0.18", "s"]
    assert rows["its filter needs"] == ["4.21", "m", "25", "deg", "0.87", "m", "0.23", "s"]
    assert rows["limits allow"] == ["4.70", "m", "28", "deg", "1.00", "m", "0.33", "s"]
    assert rows["stop_distance_m"] == ["4.7", "m", "1", "m", "-"]
    assert "WARNING" not in "".join(lines)
    assert warning.startswith(f"WARNING: {SHIPPED}:")
    assert warning.endswith(f": hydraulics: missing: {NO_PUMP}")
    assert "lift: in seconds of full speed" in "".join(lines)
    assert "slewing: of one that slews" not in "".join(lines)


@pytest.mark.slow
def test_check_says_for_which_pendulums_the_filters_of_each_load_hold(tmp_path: Path) -> None:
    """Those that a filter was designed for, else those that a campaign draws."""
    load = ROBUST.with_name("forwarder-load.yaml")
    assert [row for row in invoke("check", str(load)).stdout.splitlines() if "pendulum" in row] == [
        "    pendulum: at 0 1.17 to 1.58 m, 9 and 9 %; at 600 1.52 to 2.06 m, 8 and 8 %;"
        " load not known 1.38 to 1.79 m, 2 and 2 % of the swing left",
        "    pendulum: at 0 1.02 to 1.38 m, 8 and 8 %; at 600 1.36 to 1.84 m, 7 and 7 %;"
        " load not known 1.20 to 1.60 m, 1 and 1 % of the swing left",
    ]
    file = machine_file(tmp_path, SHIPPED, more="\nuncertainty: { length_pct: [-60, 100] }\n")
    assert "pendulum: 0.48 to 2.40 m, 53 and 33 % of" in invoke("check", str(file)).stdout


@pytest.mark.slow
def test_check_says_which_axis_moves_without_its_joystick() -> None:
    note = (
        "  NOTE: while slew moves, near_far moves too without its joystick: by up to 0.25 m/s,"
        " 0.3 m in or out, 6 s"
    )
    assert note in invoke("check", "forwarder-robust.yaml").stdout.splitlines()
    assert "without its joystick" not in invoke("check", str(SHIPPED)).stdout


@pytest.mark.slow
@pytest.mark.parametrize("name", ["forwarder-sensor", "j1939-sensor", "canopen-sensor"])
def test_check_counts_what_a_sway_sensor_moves_it_besides(tmp_path: Path, name: str) -> None:
    way = " m/s, 0.6 m in or out (0.3 for slewing, as much to damp by its sway sensor), 6 s"
    note = "near_far moves too without its joystick"
    shipped = ROOT / "config" / f"{name}.yaml"
    [row] = [row for row in invoke("check", str(shipped)).stdout.splitlines() if note in row]
    assert row.endswith(way)
    watched = machine_file(tmp_path, shipped, ("use: damp", "use: watch"))
    [row] = [row for row in invoke("check", str(watched)).stdout.splitlines() if note in row]
    assert row.endswith(" m/s, 0.3 m in or out, 6 s")


@pytest.mark.slow
def test_check_says_where_a_filter_no_longer_fits(tmp_path: Path) -> None:
    assert "designed" not in invoke("check", str(ROBUST)).stdout
    file = machine_file(
        tmp_path,
        ROBUST,
        ("sway: { period_s: 2.356", "sway: { period_s: 2.6"),
        ("mass_kg: 300", "mass_kg: 120"),
        ("fall_per_s: 5", "fall_per_s: 4"),
    )
    text = file.read_text()
    result = invoke("check", str(file))
    assert result.exit_code == 0
    slew, near_far = (
        number for number, row in enumerate(text.splitlines(), 1) if "designed_for" in row
    )
    again = "; design it again: canshaper robust"
    slew_for, near_for = "axes.slew.filter.designed_for", "axes.near_far.filter.designed_for"
    valve = "valve_rate_per_s: expected a valve of 5 full speeds per s or more, got 4"
    assert [row for row in result.stdout.splitlines() if "designed_for" in row] == [
        f"WARNING: {file}:{slew}: {slew_for}.period_s:"
        f" expected a swing of 2.17 to 2.53 s, got 2.60 s{again}",
        f"WARNING: {file}:{slew}: {slew_for}.{valve}{again}",
        f"WARNING: {file}:{near_far}: {near_for}.damping_ratio:"
        f" expected a damping ratio of 0.019 to 0.079, got 0.121{again}",
        f"WARNING: {file}:{near_far}: {near_for}.{valve}{again}",
    ]


def unstated(tmp_path: Path) -> Path:
    """The shipped machine, whose slew does not state how far it may travel on."""
    changes = (", stop_distance_m: 4.7", ""), ("    slewing:", "    #")
    return machine_file(tmp_path, SHIPPED, *changes)


LONG_WAY = (
    "axes.slew.limits.stop_distance_m: missing: to stop, the limits allow 3.2 m, which is more"
    " than 2 m; write how far the tip may travel when it stops"
)


def test_check_warns_of_a_long_way_that_is_not_stated(tmp_path: Path) -> None:
    file = unstated(tmp_path)
    result = invoke("check", str(file))
    assert result.exit_code == 0
    line = file.read_text().splitlines().index("  near_far:") - 1
    assert result.stdout.splitlines()[-1] == f"WARNING: {file}:{line}: {LONG_WAY}"
    assert "slewing: of one that slews" in " ".join(result.stdout.split())


def test_run_moves_nothing_over_a_long_way_that_is_not_stated(
    tmp_path: Path, opened: list[dict[str, Any]]
) -> None:
    file = unstated(tmp_path)
    result = invoke("run", str(file))
    assert result.exit_code == 2
    assert LONG_WAY in result.stderr
    assert opened == []
    assert invoke("run", str(file), "--listen-only").exit_code == 3  # as it moves nothing


def test_check_of_a_broken_file_reports_every_problem(broken: Path) -> None:
    result = invoke("check", str(broken))
    assert result.exit_code == 2
    assert result.stdout == ""
    line = (
        SHIPPED.read_text(encoding="utf-8")
        .splitlines()
        .index("tick_ms: 20 # period of the control loop")
    )
    first, second, count = result.stderr.splitlines()
    assert first == f"{broken}:{line + 1}: tick_ms: expected a whole number, 1 to 50 ms, got 0"
    assert "axes.lift.filter.kind: expected one of 'off', 'gff', " in second
    assert second.endswith(", got 'x'")
    assert count == "2 problems"


def test_check_of_no_file() -> None:
    result = invoke("check", "nowhere/none.yaml")
    assert result.exit_code == 2
    assert result.stderr.splitlines() == [
        "nowhere/none.yaml: No such file or directory",
        "1 problem",
    ]


@pytest.mark.slow
def test_a_shipped_file_goes_by_its_name(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.chdir(tmp_path)
    for name in ("forwarder.yaml", "config/forwarder.yaml"):
        assert invoke("check", name).exit_code == 0
    assert invoke("check", "other/forwarder.yaml").exit_code == 2
    Path("forwarder.yaml").write_text("tick_ms: 0\n", encoding="utf-8")  # one that is there wins
    assert invoke("check", "forwarder.yaml").exit_code == 2


@pytest.mark.slow
@pytest.mark.parametrize(
    ("file", "slews"),
    [
        ("forwarder.yaml", ["slew"]),
        ("forwarder-joints.yaml", ["slew"]),
        ("two-cranes.yaml", ["front_slew", "rear_slew"]),
        ("forwarder-robust.yaml", []),
    ],
)
def test_check_names_an_axis_that_slews_in_no_motion(file: str, slews: list[str]) -> None:
    lines = invoke("check", file).stdout.splitlines()
    named = [line.split()[0] for line in lines if "is in no motion" in line]
    assert named == slews
    assert sum("which joints are not" in line for line in lines) == len(slews)


PUMP = "hydraulics: { flow: 3 }"


@pytest.mark.parametrize("more", [PUMP, "    filter: { kind: off }"])
def test_a_pump_that_is_stated_and_one_filter_alone_are_no_warning(
    tmp_path: Path, more: str
) -> None:
    text = text_of(SHIPPED)
    if more != PUMP:
        before, _, after = text.partition("  near_far:")
        filters = [row for row in after.splitlines() if row.lstrip().startswith("filter:")]
        text = f"{before}  near_far:{after.replace(filters[0], more, 1)}"
    (file := tmp_path / "machine.yaml").write_text(text + f"{more}\n" * (more == PUMP))
    shown = invoke("check", str(file))
    assert shown.exit_code == 0, shown.output
    assert "hydraulics" not in shown.stdout


def test_check_shows_pump_and_end_stops(tmp_path: Path) -> None:
    pump = ROOT / "config" / "forwarder-pump.yaml"
    lines = invoke("check", str(pump)).stdout.splitlines()
    near_far = next(k for k, line in enumerate(lines) if line.startswith("  axis near_far"))
    of_pump = "    takes 1 of 1.2 full axis flows of the pump, others 0"
    ends = "    end stops TipPosition.Radius 1.8 to 8, margin 0.05"
    assert lines[near_far + 1 : near_far + 3] == [ends, of_pump]
    assert lines.count(of_pump) == 3
    found = json.loads(invoke("check", str(pump), "--json").stdout)
    assert found["hydraulics"]["flow"] == 1.2
    assert found["axes"]["near_far"]["ends"]["highest"] == 8.0
    assert found["axes"]["slew"]["ends"] is None
    others = "{ bus: crane, message: TipPosition, signal: Radius, timeout_ms: 200, full: 9 }"
    measured = ("{ flow: 1.2 }", f"{{ flow: 1.2, others_measured: {others} }}")
    file = machine_file(tmp_path, pump, measured)
    assert f"{of_pump[:-1]}measured" in invoke("check", str(file)).stdout
    plain = json.loads(invoke("check", str(SHIPPED), "--json").stdout)
    assert plain["hydraulics"] is None
