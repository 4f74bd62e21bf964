"""A sway sensor on frames: what the controller makes of it, says of it, and sends."""

import math
import pickle
import re
from pathlib import Path

import pytest

from canshaper.codec.frame import Frame, FrameFault
from canshaper.controller.controller import Controller
from canshaper.controller.events import SwingLengthEvent
from canshaper.controller.status_messages import SensorReport
from canshaper.design.lockstep import LockStep, drive
from canshaper.machine.binding import load_deployment
from canshaper.machine.deployment import Deployment
from canshaper.shaping.states import Trust
from canshaper.shaping.sway import SwayMode
from canshaper.shaping.swing_length import SwingLength
from canshaper.shaping.transfer import Off
from canshaper_sim.crane import CraneParameters
from canshaper_sim.grapple import Grapple
from canshaper_sim.joysticks import JoystickNode
from canshaper_sim.operator import SCRIPTS
from canshaper_sim.plant import PlantNode
from canshaper_sim.recording import Recording
from canshaper_sim.strokes import Script, Stroke
from canshaper_sim.sway_sensor import SwaySensorParameters
from tests.rigs.files import ROOT, text_of

FILE = ROOT / "config" / "forwarder-sensor.yaml"
PULSE = SCRIPTS["pulse-near_far"]


def changed(tmp_path: Path, *changes: tuple[str, str]) -> Deployment:
    """The shipped deployment, changed."""
    text = text_of(FILE)
    for old, new in changes:
        assert re.search(old, text), old
        text = re.sub(old, new, text)
    path = tmp_path / "machine.yaml"
    path.write_text(text, encoding="utf-8")
    return load_deployment(path)


class Run:
    """Controller and crane in lock-step, with what was reported and sent."""

    def __init__(self, deployment: Deployment, script: Script, crane: CraneParameters) -> None:
        self.controller = Controller(deployment)
        self.frames: list[Frame] = []
        self.events: list[str] = []
        node = PlantNode(deployment, crane)
        hands = [JoystickNode(deployment, script)]
        lock_step = LockStep(deployment, self.controller, node, hands, self._seen)
        while lock_step.time_ms < 1000.0 * script.duration_s:
            lock_step.step()
            self.events += [event.text for event in self.controller.events]
            self.controller.events.clear()

    def _seen(self, frame: Frame, time_s: float) -> None:
        self.frames.append(frame)

    def trust(self, axis: str) -> list[str]:
        """Reported state of a sensor."""
        start = f"axis={axis} sway_sensor="
        return [event.removeprefix(start) for event in self.events if event.startswith(start)]


def crane(**sensor: float) -> CraneParameters:
    return CraneParameters(sway_sensor=SwaySensorParameters(**sensor))


def test_it_is_reported_when_it_is_trusted() -> None:
    run = Run(load_deployment(FILE), PULSE, crane())
    assert run.trust("near_far") == ["UNPROVED", "TRUSTED"]
    assert run.trust("slew") == ["UNPROVED"]
    assert run.trust("lift") == []


def test_the_status_message_says_it() -> None:
    deployment = load_deployment(FILE)
    run = Run(deployment, PULSE, crane())
    status = deployment.axes["near_far"].status
    assert status is not None
    key = status.message.key
    values = [status.decode(frame.data) for frame in run.frames if frame[:3] == key]
    trusts = [value["SwaySensor"] for value in values if value]
    assert trusts[-1] is Trust.TRUSTED
    assert Trust.UNPROVED in trusts


def test_it_is_reported_and_shown_how_long_the_pendulum_seems() -> None:
    deployment = load_deployment(FILE)
    press = Script("press", (Stroke("near_far", 0.5, 1.0, 1.0),), 5.0)
    run = Run(deployment, press, CraneParameters(grapple=Grapple(l2_m=1.56)))
    (event,) = [one for one in run.events if "swings_like" in one]
    match = re.fullmatch(
        r"axis=near_far swings_like_length_m=(1\.\d\d) sd_pct=\d damping_ratio=0\.0\d file=1\.20"
        r" set=axes\.near_far\.sway\.length_m=\1",
        event,
    )
    assert match
    assert float(match[1]) == pytest.approx(1.56, rel=0.07)
    status = deployment.axes["near_far"].status
    assert status is not None
    frames = [frame for frame in run.frames if frame[:3] == status.message.key]
    shown = [(status.decode(frame.data) or {})["SwingLength"] for frame in frames]
    assert shown[0] == 0.0
    assert shown[-1] == pytest.approx(1.56, rel=0.05)


def test_of_a_period_it_is_reported_as_one() -> None:
    slew = Script("slew", (Stroke("slew", 0.5, 2.5, 1.0, 0.1),), 5.0)
    run = Run(load_deployment(FILE), slew, CraneParameters(grapple=Grapple(l2_m=1.56)))
    (event,) = [one for one in run.events if "swings_like" in one]
    match = re.match(
        r"axis=slew swings_like_period_s=(\d\.\d\d) .* file=2\.36 set=axes\.slew\.", event
    )
    assert match
    real_s = 2.0 * math.pi / Grapple(l2_m=1.56).mode5.omega_rad_s
    assert float(match[1]) == pytest.approx(real_s, rel=0.04)


def test_the_length_of_a_breakpoint_is_no_other_one_than_that_of_the_file() -> None:
    """A load that hangs deeper: to set the key of the empty grapple to it would be wrong."""
    control = Controller(load_deployment(FILE)).axes["near_far"]
    report = SensorReport("near_far", control)
    axis, loaded_length = control.axis, SwingLength(2.0, 0.04, 3.0)
    assert axis.sensed is not None
    assert axis.sway is not None
    of_file, loaded = axis.sway.mode, SwayMode.from_grapple(2.0, 120.0, 900.0)
    axis.retune(loaded, lambda _sway: Off())
    axis.sensed.length.result = loaded_length
    assert not list(report.events())
    axis.retune(of_file, lambda _sway: Off())
    assert not list(report.events())  # measured with the other load
    axis.sensed.length.result = empty_length = SwingLength(2.0, 0.04, 3.0)
    (event,) = report.events()
    assert isinstance(event, SwingLengthEvent)
    assert event.seen is empty_length


def test_the_length_of_the_file_is_no_news_and_its_return_is() -> None:
    assert not any(
        "swings_like" in one for one in Run(load_deployment(FILE), PULSE, crane()).events
    )


@pytest.mark.parametrize(
    ("fault", "reported"),
    [
        ({"lost_s": 2.0}, ["UNPROVED", "TRUSTED", "LOST"]),
        ({"jump_s": 2.0}, ["UNPROVED", "TRUSTED", "JUMP"]),
        ({"gain": -1.0}, ["UNPROVED", "WRONG_SIGN"]),
    ],
)
def test_a_fault_is_named_and_never_trips(fault: dict[str, float], reported: list[str]) -> None:
    stroke = Script("stroke", (Stroke("near_far", 0.5, 2.5, 1.0, 0.1),), 5.0)
    run = Run(load_deployment(FILE), stroke, crane(**fault))
    assert run.trust("near_far") == reported
    assert not any("TRIPPED" in event for event in run.events)


def commands(recording: Recording) -> list[float]:
    return list(recording.axes["near_far"].sent)


def test_watched_only_it_changes_no_command(tmp_path: Path) -> None:
    watched = changed(tmp_path, ("use: damp", "use: watch"))
    without = changed(tmp_path, (r"    sway_sensor:.*\n", ""))
    long = CraneParameters(grapple=crane().grapple.__class__(l2_m=1.5))
    assert commands(drive(watched, PULSE, parameters=long)) == commands(
        drive(without, PULSE, parameters=long)
    )
    assert commands(drive(load_deployment(FILE), PULSE, parameters=long)) != commands(
        drive(without, PULSE, parameters=long)
    )


def test_without_frames_it_is_the_machine_without_a_sensor(tmp_path: Path) -> None:
    without = changed(tmp_path, (r"    sway_sensor:.*\n", ""))
    silent = crane(lost_s=0.0)
    assert commands(drive(load_deployment(FILE), PULSE, parameters=silent)) == commands(
        drive(without, PULSE, parameters=silent)
    )


def test_axes_whose_sensors_have_messages_of_their_own_read_their_own(tmp_path: Path) -> None:
    """Slew an angle, near-far a gyro."""
    along = "message: SwayAngle, signal: Along, kind: angle"
    mixed = changed(tmp_path, (along, "message: SwayRate, signal: Along, kind: rate"))
    run = Run(mixed, PULSE, crane(noise_deg=0.3))
    assert run.trust("near_far") == ["UNPROVED", "TRUSTED"]
    assert run.trust("slew") == ["UNPROVED"]


def test_an_error_code_is_no_measurement(tmp_path: Path) -> None:
    deployment = load_deployment(FILE)
    controller = Controller(deployment)
    message = deployment.messages.find("SwayAngle")
    assert not isinstance(message, str)
    beyond = message[1].encode({"Across": 0, "Along": 20000}, scaling=False, strict=False)
    controller.receive(Frame("crane", 1040, False, beyond), 0)
    assert list(controller.tick(0))
    assert controller.counters.last_fault is FrameFault.INVALID_SIGNAL
    assert controller.axes["near_far"].trust is Trust.NO_DATA
    assert controller.axes["slew"].trust is Trust.UNPROVED


def test_after_a_standstill_what_has_waited_is_no_measurement() -> None:
    deployment = load_deployment(FILE)
    controller = Controller(deployment)
    message = deployment.messages.find("SwayAngle")
    assert not isinstance(message, str)
    data = message[1].encode({"Across": 0, "Along": 0}, scaling=False)
    controller.stalled()
    controller.receive(Frame("crane", 1040, False, data), 0)
    assert list(controller.tick(0))
    assert controller.axes["near_far"].trust is Trust.NO_DATA


def test_who_only_listens_judges_no_sensor() -> None:
    listening = load_deployment(FILE).listening()
    assert all(axis.sway_sensor is None for axis in listening.axes.values())


HEARTBEAT, EMERGENCY = (
    Frame("crane", 0x730, False, bytes((5,))),
    Frame("crane", 0xB0, False, bytes((0, 0x50, 1, 0, 0, 0, 0, 0))),
)


@pytest.mark.parametrize(
    ("said", "trust"),
    [
        ((), Trust.NO_DATA),
        ((HEARTBEAT,), Trust.UNPROVED),
        ((HEARTBEAT, EMERGENCY), Trust.NO_DATA),
        ((HEARTBEAT, HEARTBEAT._replace(data=bytes((0x7F,)))), Trust.NO_DATA),
    ],
)
def test_it_measures_while_its_node_works(said: tuple[Frame, ...], trust: Trust) -> None:
    deployment = load_deployment(ROOT / "config" / "canopen-sensor.yaml")
    controller = Controller(deployment)
    for frame in (*said, Frame("crane", 0x1B0, False, bytes(4))):
        controller.receive(frame, 0)
    assert list(controller.tick(0))
    assert [controller.axes[name].trust for name in ("slew", "near_far")] == [trust, trust]


def test_no_loop_waits_for_the_gains_of_an_observer(monkeypatch: pytest.MonkeyPatch) -> None:
    handed_over = pickle.loads(pickle.dumps(load_deployment(FILE)))
    monkeypatch.delattr("canshaper.shaping.free_swing.kalman_gains")
    assert Controller(handed_over).axes["near_far"].axis.sensed is not None
