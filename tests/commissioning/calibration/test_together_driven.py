"""Two axes driven together: by calibrate, on the simulated crane, and in the log of a driver."""

import math
import struct
from pathlib import Path
from typing import Any

import pytest

from canshaper.codec.frame import Frame
from canshaper.commissioning.calibration.drive import CalibrationDrive
from canshaper.commissioning.calibration.pump import Moment
from canshaper.commissioning.calibration.ramp import Ramp
from canshaper.commissioning.procedure.bench import log_simulated
from canshaper.errors import ConfigError
from canshaper.machine.binding import load_deployment
from canshaper.machine.deployment import Deployment
from canshaper_sim.operator import Script, Stroke
from canshaper_sim.parameters import changed_parameters
from tests.cli.invocation import invoke
from tests.commissioning.calibration.test_speed import sent_by
from tests.commissioning.calibration.test_together import (
    AXES,
    SPEEDS,
    TICK_S,
    drive,
    driven,
    starving,
)
from tests.rigs.files import ROOT

RAMP = Ramp(rate_per_s=1.0, top=0.2, rest_s=0.5)


def sent(deployment: Deployment, moved_s: float = math.inf) -> tuple[CalibrationDrive, list[Any]]:
    """Frames of slew, near-far and lift, tick by tick; near-far's joystick is moved at a time."""
    drive = CalibrationDrive(deployment, "slew", SPEEDS["slew"], RAMP, {AXES[1]: SPEEDS[AXES[1]]})
    last = round(drive.duration_s / TICK_S) + 60
    still = [Frame("crane", 0x402, False, bytes(6))]

    def moved(tick: int) -> dict[str, float]:
        return {"near_far": 0.5} if tick * TICK_S >= moved_s else {}

    ticks = sent_by(drive, deployment, still, range(last), moved)
    return drive, [[frames[can_id] for can_id in (0x200, 0x201, 0x202)] for frames in ticks]


def test_each_is_driven_alone_and_then_both() -> None:
    drive, ticks = sent(load_deployment(ROOT / "config/forwarder-robust.yaml"))
    assert drive.ended == "done"
    moves = [tuple(map(bool, tick)) for tick in ticks]
    order = [one for k, one in enumerate(moves) if any(one) and one != moves[k - 1]]
    assert (
        order == [(True, False, False)] * 2 + [(False, True, False)] * 2 + [(True, True, False)] * 2
    )
    assert not any(map(any, moves[-30:]))
    most = [max(moment[i] for moment in drive.moments) for i in (1, 3)]
    assert most == pytest.approx([(0.2 - 0.05) / 0.95] * 2, abs=0.01)  # of full speed


def test_a_joystick_that_is_moved_stops_both() -> None:
    at_s = 2.0 * RAMP.duration_s + 1.2
    drive, ticks = sent(load_deployment(ROOT / "config/forwarder-robust.yaml"), at_s)
    number = round(at_s / TICK_S)
    assert all(ticks[number - 10][:2])
    assert not any(map(any, ticks[number + 8 :]))
    assert drive.ended == "stopped: STOP_DONE"


def test_the_limits_of_both_axes_bound_the_ramp(file: Path) -> None:
    text = file.read_text().partition("  near_far:")
    slower = text[2].replace("deadband_pct: 5", "max_pct: 15, deadband_pct: 5", 1)
    file.write_text("".join((*text[:2], slower)))
    with pytest.raises(ConfigError, match=r"near_far\.limits\.max_pct: expected a ramp"):
        sent(load_deployment(file))


@pytest.mark.slow
def test_the_pump_of_the_simulated_crane_is_measured_and_written(file: Path) -> None:
    options = ("--together", "--top", "20", "--set", "pump_flow=0.2", "--write")
    shown = invoke("calibrate", str(file), *options)
    assert shown.exit_code == 0, shown.output
    config = load_deployment(file).config
    assert config.hydraulics
    assert config.hydraulics.flow == pytest.approx(0.195, abs=0.01)
    warned = invoke("check", str(file)).stdout
    assert "hydraulics.origin: measured on a simulated crane; measure it on the machine" in warned


@pytest.mark.slow
@pytest.mark.parametrize("name", ["forwarder-robust", "forwarder-pump"])
@pytest.mark.parametrize(
    ("changes", "says"),
    [
        (["pump_flow=1.2"], "flow: 1.18"),
        (["pump_flow=1.2", "pump.shares_flow=0", "slew.lag_s=0.2"], "slew starves"),
        (["pump_flow=1.5", "pump.lag_s=0.2"], "flow: 1.4"),
        (["pump_flow=3"], "enough oil for both"),
        (["pump_flow=0.8"], "hardly gets faster"),
        (["slew.flow_limit=0.7"], "slew alone hardly gets faster"),
    ],
)
def test_simulated_pumps_are_told_apart(name: str, changes: list[str], says: str) -> None:
    options = [word for change in changes for word in ("--set", change)]
    shown = invoke("calibrate", str(ROOT / f"config/{name}.yaml"), "--together", *options)
    assert says in shown.output
    assert shown.exit_code == ("hardly" in says)


@pytest.mark.parametrize(
    ("options", "says"),
    [
        (("--axis", "boom"), "expected an axis, got 'boom'; there are slew, near_far, lift"),
        (
            ("--axis", "slew", "--speed", "TipVelocity.Rate"),
            "expected a signal of TipVelocity, got",
        ),
        (
            ("--axis", "slew", "--speed", "Tip.Rate"),
            "expected a message of the DBC files, got 'Tip'",
        ),
        (("--axis", "slew", "--speed", "Rate"), "--speed: expected MESSAGE.SIGNAL, got Rate"),
        ((), "--axis: expected one, or two with --together, got none"),
        (("--axis", "slew", "--axis", "lift"), "or two with --together, got slew, lift"),
        (("--together", "--axis", "slew"), "--together: expected two axes, got slew; there are"),
        (("--together", "--axis", "slew", "--axis", "boom"), "got slew, boom; there are slew,"),
        (("--together", "--picture", "a.png"), "--picture: expected none with --together"),
        (("--together", *("--speed", "A.B") * 3), "--axis: expected an axis, got None"),
    ],
)
def test_wrong_options_are_reported(options: tuple[str, ...], says: str) -> None:
    shown = invoke("calibrate", str(ROOT / "config/forwarder-robust.yaml"), *options)
    assert shown.exit_code == 2
    assert says in shown.output


# --- a log ----------------------------------------------------------------------------------------


def logged(path: Path, moments: list[Moment], *, commands: bool = True) -> Path:
    """The drive in frames of valves and speeds, as the forwarder sends them."""
    rows = []
    for time_s, slew, slew_speed, near_far, near_far_speed in moments:
        at = f"({time_s:.6f}) vcan0"
        raws = [
            round(125 * math.copysign(0.05 + 0.95 * abs(v), v)) if v else 0
            for v in (slew, near_far)
        ]
        for can_id, raw in zip((0x200, 0x201), raws, strict=True):
            rows += [f"{at} {can_id:03X}#{raw & 0xFF:02X}00"] * commands
        data = struct.pack("<hhh", round(1e4 * slew_speed), round(1e3 * near_far_speed), 0)
        rows.append(f"{at} 402#{data.hex()}")
    path.write_text("\n".join(rows) + "\n")
    return path


def test_a_log_of_a_driver_shows_the_pump(tmp_path: Path, file: Path) -> None:
    alone, both = driven((-1.0, 0.0), (0.0, 1.0)), driven((-1.0, 1.0))
    logs = [
        str(logged(tmp_path / "alone.log", drive(alone, 1.2, starving))),
        str(logged(tmp_path / "both.log", drive(both, 1.2, starving))),
    ]
    shown = invoke("identify", *logs, "--file", str(file), "--together", "--write")
    assert shown.exit_code == 0, shown.output
    assert "slew - 20% ± 1%, near_far + 100% ± 1%: flow 1.20 ± 0.01 of 2.00" in shown.output
    assert "slew starves, near_far keeps its speed" in shown.output
    oil = load_deployment(file).config.hydraulics
    assert oil is not None
    assert oil.origin is not None
    assert (oil.flow, oil.origin.log) == (pytest.approx(1.18, abs=0.011), "alone.log, both.log")
    named = [f"--signal={axis}={'.'.join(SPEEDS[axis])}" for axis in reversed(AXES)]
    again = invoke("identify", *logs, "--file", str(file), "--together", *named)
    assert "near_far + 100% ± 1%, slew - 20% ± 1%" in again.output
    lacks = invoke("identify", logs[1], "--file", str(file), "--together")
    assert (lacks.exit_code, "expected near_far" in lacks.output) == (1, False)
    assert "expected slew alone, near_far alone and both at once" in lacks.output


def test_a_log_without_commands_and_without_a_file_says_so(tmp_path: Path, file: Path) -> None:
    log = str(logged(tmp_path / "a.log", drive(driven((1.0, 0.0)), 2.0), commands=False))
    shown = invoke("identify", log, "--file", str(file), "--together")
    assert shown.exit_code == 2
    assert "a.log: expected commands and speeds of slew" in shown.output
    for wrong in ([], ["--file", str(file), "--json"], ["--file", str(file), "--picture", "a.png"]):
        shown = invoke("identify", log, "--together", *wrong)
        assert "--together: expected --file, and neither --json nor --picture" in shown.output
        assert shown.exit_code == 2


@pytest.mark.slow
@pytest.mark.parametrize(
    ("changes", "says"),
    [
        (["pump_flow=1.2"], "both slow down alike"),
        (["pump_flow=1.2", "pump.shares_flow=0"], "slew starves, near_far keeps its speed"),
        (["pump_flow=3"], "enough oil for both"),
        (["pump_flow=0.9"], "flow at most 1.00"),
    ],
)
def test_a_drive_of_the_simulated_crane_shows_its_pump(
    tmp_path: Path, file: Path, changes: list[str], says: str
) -> None:
    strokes = [("near_far", 1.0, -0.8), ("slew", 6.0, 1.0), ("near_far", 11.0, 1.0)]
    strokes += [("near_far", 16.0, -1.0), ("slew", 21.0, 1.0), ("near_far", 21.0, 1.0)]
    script = Script("pump", tuple(Stroke(n, at, 2.5, v) for n, at, v in strokes), 26.0)
    log, crane = tmp_path / "drive.log", changed_parameters(changes)
    log_simulated(log, load_deployment(file), crane, script, bypass=True)
    shown = invoke("identify", str(log), "--file", str(file), "--together")
    assert says in shown.output
