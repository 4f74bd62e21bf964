"""Whose speed a measurement listens to: one bus, one sender, numbers that are speeds."""

import struct
from collections.abc import Callable
from pathlib import Path

import pytest
from typer.testing import CliRunner

from canshaper.cli.app import app
from canshaper.codec.frame import Frame
from canshaper.commissioning.calibration.drive import CalibrationDrive
from canshaper.commissioning.calibration.ramp import (
    RATE_PER_S,
    TOP,
    EndStopDetector,
    Ramp,
    speed_signal,
)
from canshaper.commissioning.calibration.run import run_simulated
from canshaper.errors import CalibrationError, ConfigError
from canshaper.machine.binding import load_deployment
from canshaper.machine.deployment import Deployment
from canshaper_sim.hand import Hand, Held
from canshaper_sim.parameters import changed_parameters
from tests.rigs.files import ROOT, Machine

RAMP = Ramp(rate_per_s=0.04, top=0.3, rest_s=1.0)
TICK_NS = 20_000_000
MESSAGES = """
BO_ 1000 Floating: 8 PLANT
 SG_ Speed : 0|32@1- (1,0) [0|0] "" SHAPER

BO_ 1001 Chosen: 8 PLANT
 SG_ Which M : 0|8@1+ (1,0) [0|255] "" SHAPER
 SG_ Speed m0 : 8|16@1- (1,0) [0|0] "" SHAPER

BO_ 1002 Long: 20 PLANT
 SG_ Speed : 0|32@1- (1,0) [0|0] "" SHAPER

BO_ 1003 Ranged: 8 PLANT
 SG_ Speed : 0|16@1- (1,0) [-100|100] "" SHAPER

"""


def with_messages(folder: Path, long: int = 20, fd: str = "") -> Deployment:
    machine, messages = Machine(folder), MESSAGES.lstrip().replace("Long: 20", f"Long: {long}")
    machine.in_dbc("BO_ ", f"{messages}BO_ ")
    machine.dbc += "\nSIG_VALTYPE_ 1000 Speed : 1;\n"
    machine.in_yaml("bitrate: 250000", f"bitrate: 250000{fd}")
    return machine.load()


def drive_on(
    deployment: Deployment,
    axis: str,
    speed: tuple[str, str],
    feedback: list[Frame],
    ticks: int = 400,
) -> CalibrationDrive:
    """Joysticks held in neutral with their enable; the speed is ``feedback``, the last for ever."""
    drive = CalibrationDrive(deployment, axis, speed, RAMP)
    sent_by(drive, deployment, feedback, range(ticks))
    return drive


def sent_by(
    drive: CalibrationDrive,
    deployment: Deployment,
    feedback: list[Frame],
    ticks: range,
    moved: Callable[[int], dict[str, float]] = lambda _tick: {},
) -> list[dict[int, int]]:
    """First byte of the valve frames of each tick, by id; joysticks moved by number of the tick."""
    hand, sent = Hand(deployment), []
    for tick in ticks:
        now_ns = tick * TICK_NS
        for frame in hand.frames(tick * 20, Held(moved(tick), enable=True)):
            drive.receive(frame, now_ns)
        sent.append({frame.can_id: frame.data[0] for frame in drive.tick(now_ns)})
        drive.receive(feedback[min(tick, len(feedback) - 1)], now_ns)
    return sent


@pytest.mark.parametrize(("bus", "begins"), [("front", True), ("rear", False)])
def test_the_speed_of_another_bus_is_that_of_another_crane(bus: str, begins: bool) -> None:
    deployment = load_deployment(ROOT / "config" / "two-cranes.yaml")
    speed = Frame(bus, 0x402, False, bytes(6))
    drive = drive_on(deployment, "front_slew", ("TipVelocity", "SlewRate"), [speed])
    assert (drive.waiting_for == "") is begins
    assert begins or drive.waiting_for == "feedback"


def test_another_valve_that_speaks_does_not_stand_for_one_that_fell_silent() -> None:
    deployment = load_deployment(ROOT / "config" / "j1939-forwarder.yaml")
    own, other = (
        Frame("crane", 0x0CFE1000 | source, True, b"\x7d\x7d" + b"\xff" * 6)
        for source in (0x80, 0x55)
    )
    feedback = [own] * 200 + [other]
    drive = drive_on(deployment, "slew", ("AVEF0", "ExtendFlow"), feedback)
    assert drive.ended == "stopped: the feedback fell silent, or reports an error"
    assert 0.0 < drive.progress < 1.0


@pytest.mark.parametrize(
    ("message", "data"),
    [
        ("Floating", struct.pack("<f", float("nan")) + bytes(4)),
        ("Floating", struct.pack("<f", float("inf")) + bytes(4)),
        ("Ranged", struct.pack("<h", 101) + bytes(6)),
    ],
)
def test_what_is_no_speed_counts_as_silence(tmp_path: Path, message: str, data: bytes) -> None:
    deployment = with_messages(tmp_path)
    can_id = deployment.messages.find(message)[1].frame_id  # type: ignore[union-attr]
    good, bad = Frame("crane", can_id, False, bytes(8)), Frame("crane", can_id, False, data)
    drive = drive_on(deployment, "slew", (message, "Speed"), [bad])
    assert drive.waiting_for == "feedback"
    drive = drive_on(deployment, "slew", (message, "Speed"), [good] * 200 + [bad])
    assert drive.ended == "stopped: the feedback fell silent, or reports an error"


@pytest.mark.parametrize(
    ("message", "why"),
    [
        ("Chosen", " is multiplexed"),
        ("Long", ": expected the length of a frame, 8 bytes at most, got 20"),
    ],
)
def test_messages_that_cannot_be_measured_with(tmp_path: Path, message: str, why: str) -> None:
    with pytest.raises(ConfigError, match=f"--speed: {message}{why}"):
        CalibrationDrive(with_messages(tmp_path), "slew", (message, "Speed"), RAMP)


def test_the_joystick_of_another_axis_ends_it_and_moves_nothing() -> None:
    deployment = load_deployment(ROOT / "config" / "forwarder.yaml")
    drive = CalibrationDrive(deployment, "slew", ("TipVelocity", "SlewRate"), RAMP)
    still = [Frame("crane", 0x402, False, bytes(6))]
    sent = sent_by(drive, deployment, still, range(300), lambda n: {"near_far": float(n > 200)})
    assert drive.ended == "stopped: the joystick of near_far was moved"
    assert any(tick[0x200] for tick in sent)
    assert not any(tick[0x201] for tick in sent)
    assert not any(tick[0x200] for tick in sent[-20:])


def test_it_waits_for_every_joystick() -> None:
    deployment = load_deployment(ROOT / "config" / "forwarder.yaml")
    drive = CalibrationDrive(deployment, "slew", ("TipVelocity", "SlewRate"), RAMP)
    still = [Frame("crane", 0x402, False, bytes(6))]
    sent = sent_by(drive, deployment, still, range(100), lambda _tick: {"near_far": 1.0})
    assert not any(tick[0x200] or tick[0x201] for tick in sent)
    assert drive.waiting_for == "the joystick of near_far"


@pytest.mark.slow
def test_in_a_gateway_the_frames_of_the_joystick_move_the_crane() -> None:
    deployment = load_deployment(ROOT / "config" / "gateway-forwarder.yaml")
    drive = CalibrationDrive(deployment, "slew", ("TipVelocity", "SlewRate"), RAMP)
    run_simulated(drive, deployment, None, lambda _: None)
    assert drive.result().positive.opens == pytest.approx(0.05, abs=0.008)
    assert drive.neutral_frames() == []  # the last frame of the joystick was


def test_the_end_in_a_gateway_can_be_reported_more_than_once() -> None:
    deployment = load_deployment(ROOT / "config" / "gateway-forwarder.yaml")
    feedback = [Frame("machine", 0x402, False, bytes(6))]
    drive = drive_on(deployment, "slew", ("TipVelocity", "SlewRate"), feedback, 150)
    assert drive.waiting_for == ""
    reported = [drive.neutral_frames() for _ in range(3)]
    assert [[frame.data[:2] for frame in frames] for frames in reported] == [[bytes(2)]] * 3


@pytest.mark.parametrize("verb", [["calibrate"], ["robust"], ["set"], ["tune"]])
def test_a_shipped_deployment_is_not_written(
    verb: list[str], tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.chdir(tmp_path)
    before = (ROOT / "config" / "forwarder.yaml").read_text()
    axis = [] if verb == ["set"] else ["--axis", "slew"]
    reported = CliRunner().invoke(app, [*verb, "forwarder.yaml", *axis, "--write"])
    assert reported.exit_code == 2, reported.output
    assert "shipped with the package; copy it, then write to the copy" in reported.output
    assert (ROOT / "config" / "forwarder.yaml").read_text() == before


@pytest.mark.parametrize(("length", "good"), [(20, True), (21, False)])
def test_a_speed_may_be_in_a_frame_of_can_fd(tmp_path: Path, length: int, good: bool) -> None:
    """There is none of 21 bytes."""
    deployment = with_messages(tmp_path, length, fd=", fd: true")
    if good:
        data = struct.pack("<h", 50).ljust(length, b"\0")
        can_id = deployment.messages.find("Long")[1].frame_id  # type: ignore[union-attr]
        drive = drive_on(
            deployment, "slew", ("Long", "Speed"), [Frame("crane", can_id, False, data)]
        )
        assert drive.waiting_for == ""
        return
    text = "expected the length of a frame, 64 bytes at most, got 21"
    with pytest.raises(ConfigError, match=f"--speed: Long: {text}"):
        CalibrationDrive(deployment, "slew", ("Long", "Speed"), RAMP)


JOINTS = ROOT / "config" / "forwarder-joints.yaml"


def of_joint(axis: str, ramp: Ramp) -> CalibrationDrive:
    deployment = load_deployment(JOINTS)
    drive = CalibrationDrive(deployment, axis, speed_signal(deployment, axis, None), ramp)
    run_simulated(
        drive, deployment, changed_parameters([f"joints.{axis}.deadband=0.08"]), lambda _: None
    )
    return drive


@pytest.mark.slow
@pytest.mark.parametrize("axis", ["lift_cylinder", "knuckle", "extension"])
def test_a_joint_has_room_for_the_ramp_that_is_proposed(axis: str) -> None:
    """The lift cylinder begins at its upper end, and is brought back first."""
    valve = of_joint(axis, Ramp(RATE_PER_S, TOP)).result()
    for direction in (valve.positive, valve.negative):
        assert direction.opens == pytest.approx(0.08, abs=0.004)
        assert direction.full == pytest.approx(valve.positive.full, rel=0.02)


@pytest.mark.slow
@pytest.mark.parametrize("axis", ["knuckle", "extension"])
def test_a_ramp_that_reaches_the_end_of_a_joint_is_no_measurement(axis: str) -> None:
    """On the way up or down: what is left of the ramp would make a wrong curve."""
    drive = of_joint(axis, Ramp(0.03, 0.4))
    with pytest.raises(CalibrationError, match=r"its end\? give it room for 5\.7 s"):
        drive.result()
    assert drive.progress < 0.5  # no need to push against it for the rest of a minute


def watched(*samples: tuple[str, float, float], tremble: float = 0.0) -> bool:
    """Samples of (part, command, speed), a tenth of a second apart; whether one is the end."""
    watch, rest = EndStopDetector(), [("rest", 0.0, sign * tremble) for sign in (1, -1)]
    steps = [*rest, *samples]
    reached = [watch.reached(part, 0.1 * n, c, s) for n, (part, c, s) in enumerate(steps)]
    return any(reached)


def test_what_is_no_end() -> None:
    ramp = [0.01 * n for n in range(41)]
    speed = [max(0.0, c - 0.2) for c in ramp]  # a wide dead band: it stands for half of the way
    up = [("up+", c, s) for c, s in zip(ramp, speed, strict=True)]
    down = [("down+", c, s) for _, c, s in reversed(up)]
    assert not watched(*up, *down)
    assert not watched(*up, *down, ("settling", 0.0, 0.0), *(("up-", -c, 0.0) for c in ramp[:20]))
    trembling = [("up+", c, 0.01 * (-1) ** n) for n, c in enumerate(ramp)]
    assert not watched(*trembling, tremble=0.01)
    stands = [("down+", c, 0.0) for c in reversed(ramp)]
    assert watched(*up, *stands)
    assert watched(*up, *(("held+", 0.4, 0.0) for _ in range(7)))
