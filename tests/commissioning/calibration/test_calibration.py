"""A valve whose dead band, gain and asymmetry are known is measured, in lock-step."""

from pathlib import Path
from typing import Any

import pytest
from typer.testing import CliRunner

from canshaper.cli.app import app
from canshaper.codec.frame import Frame
from canshaper.codec.velocity import ValveCodec
from canshaper.commissioning.calibration.drive import CalibrationDrive
from canshaper.commissioning.calibration.fit import Calibration, Direction, Sample, fit
from canshaper.commissioning.calibration.ramp import Ramp, speed_signal
from canshaper.commissioning.calibration.run import run_simulated
from canshaper.config.section import Origin
from canshaper.edit.edit import written_by
from canshaper.errors import CalibrationError, ConfigError
from canshaper.machine.binding import load_deployment
from canshaper.machine.deployment import Deployment
from canshaper.shaping.limits import ValveCurve
from canshaper_sim.joysticks import JoystickNode
from canshaper_sim.operator import Script, Stroke
from canshaper_sim.parameters import changed_parameters
from tests.rigs.files import ROOT, machine_file, text_of

FILE = ROOT / "config" / "forwarder.yaml"
RAMP = Ramp(rate_per_s=0.04, top=0.3, rest_s=1.0)
SPEED = ("TipVelocity", "SlewRate")
TICK_NS = 20_000_000
SPEED_0 = Frame("crane", 0x402, False, bytes(6))


@pytest.fixture
def deployment() -> Deployment:
    return load_deployment(FILE)


def measured(deployment: Deployment, *changes: str, ramp: Ramp = RAMP) -> Calibration:
    drive = CalibrationDrive(deployment, "slew", SPEED, ramp)
    run_simulated(drive, deployment, changed_parameters(list(changes)), lambda _drive: None)
    assert drive.ended == "done"
    return drive.result()


@pytest.mark.slow
@pytest.mark.parametrize(
    ("deadband", "more", "gain", "dead_time"),
    [
        (0.05, 0.0, 1.0, 0.0),
        (0.08, -0.04, 0.8, 0.15),
        (0.03, 0.06, 0.6, 0.05),
        (0.0, 0.0, 1.0, 0.1),
    ],
)
def test_a_known_valve_is_found(
    deployment: Deployment, deadband: float, more: float, gain: float, dead_time: float
) -> None:
    valve = measured(
        deployment,
        f"slew.deadband={deadband}",
        f"slew.negative_more_deadband={more}",
        f"slew.negative_gain={gain}",
        f"slew.dead_time_s={dead_time}",
    )
    # A step of the frame is 0.8 % of the command.
    assert valve.positive.opens == pytest.approx(deadband, abs=0.008)
    assert valve.negative.opens == pytest.approx(deadband + more, abs=0.008)
    assert valve.positive.full == pytest.approx(0.5, rel=0.04)
    assert valve.negative.full / valve.positive.full == pytest.approx(gain, rel=0.04)
    # A longer dead time is a later opening on the way up, and no other curve.
    assert valve.positive.delay == pytest.approx(2 * RAMP.rate_per_s * (0.1 + dead_time), abs=0.01)


@pytest.mark.parametrize(("rate_per_s", "top"), [(0.1, 0.15), (0.1, 0.4), (0.05, 0.15)])
def test_a_quick_or_low_ramp_finds_the_same_valve(
    deployment: Deployment, rate_per_s: float, top: float
) -> None:
    ramp = Ramp(rate_per_s=rate_per_s, top=top, rest_s=1.0)
    valve = measured(deployment, "slew.deadband=0.08", ramp=ramp)
    for direction in (valve.positive, valve.negative):
        assert direction.opens == pytest.approx(0.08, abs=0.008)
        assert direction.full == pytest.approx(0.5, rel=0.1)
        assert direction.delay == pytest.approx(2 * rate_per_s * 0.1, abs=0.01)


def test_the_curve_goes_into_the_deployment(tmp_path: Path) -> None:
    file = machine_file(tmp_path, FILE)
    options = ["calibrate", str(file), "--axis", "slew", "--top", "25", "--rate", "5", "--write"]
    reported = CliRunner().invoke(app, [*options, "--set", "slew.negative_more_deadband=0.05"])
    assert reported.exit_code == 0, reported.output
    assert "negative: opens at" in reported.output
    assert "above 25 % of the command this is a straight line, not measured" in reported.output
    limits = load_deployment(file).axes["slew"].config.limits
    curve = limits.curve()
    assert curve is not None
    assert limits.deadband_pct == 0.0
    assert limits.curve_origin == Origin(**written_by("calibrate", simulated=True))
    assert curve.velocity(0.04) == 0.0 == curve.velocity(-0.09)
    assert curve.velocity(0.06) > 0.0 > curve.velocity(-0.115)


def hands(deployment: Deployment, **stroke: float) -> JoystickNode:
    strokes = tuple(Stroke("slew", 3.0, 1.0, v, ramp_s=0.0) for v in stroke.values())
    return JoystickNode(deployment, Script("hand", strokes, 60.0))


def run(
    drive: CalibrationDrive, hands: JoystickNode, ticks: range, *, spoil: str = "", blind: int = 999
) -> list[Frame]:
    """The daemon's side alone: feedback stands at zero, and is silent from a tick on."""
    sent: list[Frame] = []
    for tick in ticks:
        now_ns = tick * TICK_NS
        for frame in hands.frames(tick * 20):
            if spoil == "silent" and tick > 150:
                continue
            if spoil == "enable" and tick > 150:
                data = frame.data[:4] + bytes((frame.data[4] & ~0x3,)) + frame.data[5:]
                frame = frame._replace(data=data)  # noqa: PLW2901
            drive.receive(frame, now_ns)
        if tick < blind:
            drive.receive(SPEED_0, now_ns)
        sent += drive.tick(now_ns)
    assert not any(f.data[0] for f in sent if f.can_id in (0x201, 0x202)), "another valve moved"
    return [f for f in sent if f.can_id == 0x200]


@pytest.mark.parametrize(
    ("spoil", "moved", "why"),
    [
        ({"spoil": "silent"}, {}, "stopped: STOP_DONE"),
        ({"spoil": "enable"}, {}, "stopped: ENABLE_LOST"),
        ({"blind": 201}, {}, "stopped: the feedback fell silent, or reports an error"),
        ({}, {"hand": 0.3}, "stopped: STOP_DONE"),
    ],
)
def test_what_stops_the_daemon_ends_it_in_neutral(
    deployment: Deployment, spoil: dict[str, Any], moved: dict[str, float], why: str
) -> None:
    drive = CalibrationDrive(deployment, "slew", SPEED, RAMP)
    sent = run(drive, hands(deployment, **moved), range(300), **spoil)
    assert any(frame.data[0] for frame in sent)
    assert drive.ended == why
    assert [frame.data[0] for frame in sent[-30:]] == [0] * 30
    with pytest.raises(CalibrationError, match=f"not taken to its end: {why}"):
        drive.result()


def test_a_joystick_that_is_moved_before_the_start_is_waited_for(deployment: Deployment) -> None:
    """Also one that was in neutral before: READY ends without a trip, and comes back."""
    drive, joysticks = (
        CalibrationDrive(deployment, "slew", SPEED, RAMP),
        hands(deployment, hand=0.3),
    )
    sent = run(drive, joysticks, range(190), blind=0)
    assert drive.waiting_for == "JOYSTICK_NOT_NEUTRAL"
    sent += run(drive, joysticks, range(190, 300), blind=0)
    assert (drive.waiting_for, drive.ended) == ("feedback", "")
    assert not any(frame.data[0] for frame in sent)


def test_it_does_not_begin_with_feedback_of_long_ago(deployment: Deployment) -> None:
    drive = CalibrationDrive(deployment, "slew", SPEED, RAMP)
    drive.receive(SPEED_0, 0)
    sent = run(drive, hands(deployment), range(50, 150), blind=0)
    assert not any(frame.data[0] for frame in sent)
    assert (drive.waiting_for, drive.ended) == ("feedback", "")


@pytest.mark.slow
def test_a_signal_that_is_none_of_the_axis_is_reported(deployment: Deployment) -> None:
    drive = CalibrationDrive(deployment, "slew", ("TipVelocity", "VerticalSpeed"), RAMP)
    run_simulated(drive, deployment, None, lambda _drive: None)
    with pytest.raises(CalibrationError, match="positive commands: the axis did not move"):
        drive.result()


AT_ITS_END = [Sample(c / 1000, min(max(0.0, c / 1000 - 0.05), 0.1)) for c in range(400)]
NOISE = [Sample(c / 1000, 0.01 * ((c * 7919) % 13 - 6) / 6) for c in range(400)]
TOO_QUICK = [Sample(0.04 * n, max(0.0, 0.04 * n - 0.1)) for n in range(11)]


@pytest.mark.parametrize(
    ("up", "rest", "noise", "says"),
    [
        (AT_ITS_END, AT_ITS_END[-20:], 0.0, "does not rise with the command"),
        (NOISE, NOISE[-20:], 0.006, "did not move up to 40%"),
        (TOO_QUICK, TOO_QUICK[-1:] * 20, 0.0, "too few samples of the feedback on the ramp"),
    ],
)
def test_a_ramp_that_shows_no_curve_is_refused(
    up: list[Sample], rest: list[Sample], noise: float, says: str
) -> None:
    with pytest.raises(CalibrationError, match=says):
        fit(up, rest, up[::-1], noise)


def test_the_ramp_is_as_quick_up_as_down_and_ends_at_zero() -> None:
    tops = [RAMP.command(t + RAMP.rest_s + RAMP.up_s + 0.5) for t in (0.0, RAMP.half_s)]
    assert tops == pytest.approx([0.3, -0.3])
    assert RAMP.command(0.5) == 0.0 == RAMP.command(RAMP.half_s + 0.5)
    assert RAMP.command(RAMP.duration_s) == 0.0 == RAMP.command(1e6)
    times = [i * 0.02 for i in range(round(RAMP.duration_s / 0.02))]
    steps = [abs(RAMP.command(t + 0.02) - RAMP.command(t)) for t in times]
    assert max(steps) <= 0.04 * 0.02 + 1e-9


@pytest.mark.parametrize(("what", "reason"), [("send", "SEND_FAILED"), ("stall", "LOOP_STALLED")])
def test_a_frame_not_sent_and_a_loop_that_stood_still_end_it(
    deployment: Deployment, what: str, reason: str
) -> None:
    drive = CalibrationDrive(deployment, "slew", SPEED, RAMP)
    joysticks = hands(deployment)
    (*_, moving) = run(drive, joysticks, range(200))
    assert moving.data[0]
    if what == "send":
        drive.send_failed(moving)
    else:
        drive.stalled()
    assert [f.data[0] for f in run(drive, joysticks, range(200, 203))] == [0] * 3
    assert drive.ended == f"stopped: {reason}"


def with_limits(tmp_path: Path, limits: str) -> Path:
    """The machine with these limits of slew; ``canshaper set`` may change its speed."""
    text = text_of(FILE).replace("limits: { deadband_pct: 5,", f"limits: {{ {limits},", 1)
    text += "control: { adjustable: { axes.slew.limits.max_pct: [20, 100] } }\n"
    (file := tmp_path / "machine.yaml").write_text(text, encoding="utf-8")
    return file


def test_the_speed_of_the_file_bounds_the_ramp(tmp_path: Path) -> None:
    file = with_limits(tmp_path, "max_pct: 30, deadband_pct: 5")
    line = file.read_text(encoding="utf-8").split("max_pct: 30")[0].count("\n") + 1
    shown = CliRunner().invoke(app, ["calibrate", str(file), "--axis", "slew", "--top", "80"])
    expected = (
        f"{file}:{line}: axes.slew.limits.max_pct: expected a ramp (--top) up to 30 % of full"
    )
    assert shown.exit_code == 2
    assert f"{expected} speed, got 80 %" in shown.output.replace("\n", "")
    usual = CliRunner().invoke(app, ["calibrate", str(file), "--axis", "slew"])
    assert (usual.exit_code, "above 30 % of the command" in usual.output) == (0, True), usual.output


def test_a_curve_in_the_file_says_how_fast_a_ramp_is(tmp_path: Path) -> None:
    commands, speeds = "[-100, -40, -5, 5, 40, 100]", "[-100, -60, 0, 0, 50, 100]"
    curve = f"curve_command_pct: {commands}, curve_speed_pct: {speeds}"
    file = with_limits(tmp_path, f"max_pct: 55, {curve}")
    with pytest.raises(ConfigError, match=r"up to 55 % of full speed, got 60 %"):
        CalibrationDrive(load_deployment(file), "slew", SPEED, Ramp(0.1, 0.4))
    assert measured(load_deployment(file), ramp=Ramp(0.1, 0.35)).positive.opens < 0.1


def test_the_guard_stops_a_command_that_is_beyond_the_ramp(
    deployment: Deployment, monkeypatch: pytest.MonkeyPatch
) -> None:
    put = ValveCodec.put
    monkeypatch.setattr(ValveCodec, "put", lambda valve, raw, steps: put(valve, raw, 2 * steps))
    drive = CalibrationDrive(deployment, "slew", SPEED, RAMP)
    sent = run(drive, hands(deployment), range(300))
    assert drive.ended == "stopped: OUTPUT_REFUSED"
    assert max(frame.data[0] for frame in sent) < 0.1 * 125


def test_a_drive_without_a_deadband_has_a_curve_all_the_same() -> None:
    one = Direction(0.0, ((0.1, 0.1), (0.4, 0.4)), 0.0, 1.0)
    commands, speeds = Calibration(one, one).curve()
    assert commands == [-100.0, -40.0, -10.0, 0.0, 0.01, 10.0, 40.0, 100.0]
    curve = ValveCurve([v / 100.0 for v in commands], [v / 100.0 for v in speeds])
    assert curve.command(0.4) == pytest.approx(0.4)


@pytest.mark.parametrize(("axis", "signal"), [("bridge", "BridgeSpeed"), ("hoist", "HoistSpeed")])
def test_the_speed_of_an_axis_is_that_of_what_it_moves(axis: str, signal: str) -> None:
    bridge = load_deployment(ROOT / "config/bridge-crane.yaml")
    assert speed_signal(bridge, axis, None) == ("CraneVelocity", signal)
