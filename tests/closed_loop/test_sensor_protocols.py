"""Sway sensors of J1939 and CANopen: trusted, and damping as much, in lock-step."""

from collections.abc import Callable, Iterator
from dataclasses import dataclass, replace
from pathlib import Path

import pytest

from canshaper.codec.frame import Frame
from canshaper.controller.controller import Controller
from canshaper.design.lockstep import LockStep
from canshaper.machine.binding import load_deployment
from canshaper.machine.deployment import Deployment
from canshaper_sim.crane import CraneParameters
from canshaper_sim.joysticks import JoystickNode
from canshaper_sim.plant import PlantNode
from canshaper_sim.strokes import Script, Stroke
from canshaper_sim.sway_sensor import SwaySensorParameters
from tests.rigs.files import ROOT, machine_file

J1939, CANOPEN = "j1939-sensor.yaml", "canopen-sensor.yaml"
TOOL = 0x30
START_S = 2.0  # an address is claimed, nodes are started, and valves brought up
REVERSAL = Script(
    "reversal",
    (Stroke("near_far", START_S, 1.5, 1.0, 0.1), Stroke("near_far", START_S + 1.5, 1.5, -1.0, 0.1)),
    START_S + 8.0,
)
Change = tuple[str, str]
SSI = (("message: SSI2", "message: SSI"),)
ANGULAR_RATE = (
    ("message: SSI2", "message: ARI"),
    ("signal: PitchAngle", "signal: PitchRate"),
    ("signal: RollAngle", "signal: RollRate"),
    ("kind: inclination", "kind: rate"),
    ("      merit: RollMerit # 0 good; all else measures nothing\n", ""),  # ARI has none
    ("      merit: PitchMerit\n", ""),
    ("      fusion_s: 5\n", ""),
    ("      fusion_s: 5 # time constant with which it corrects its gyro, of its data sheet\n", ""),
)


def changed(tmp_path: Path, file: str, *changes: Change) -> Deployment:
    return load_deployment(machine_file(tmp_path, file, *changes))


def nothing(_time_s: float) -> Iterator[Frame]:
    yield from ()


@dataclass(frozen=True)
class Left:
    """Swing along the boom that a drive left, degrees, and trust in its sensor."""

    swing_deg: float
    trust: list[str]


def drive(
    deployment: Deployment,
    length_pct: float = 0.0,
    others: Callable[[float], Iterator[Frame]] = nothing,
    **sensor: float,
) -> Left:
    parameters = CraneParameters(sway_sensor=SwaySensorParameters(**sensor))
    parameters = replace(parameters, grapple=parameters.grapple.longer(length_pct))
    controller, plant = Controller(deployment), PlantNode(deployment, parameters)
    hands = [JoystickNode(deployment, REVERSAL)]
    lock_step = LockStep(deployment, controller, plant, hands)
    trust, swing = [], [0.0]
    while lock_step.time_ms < 1000.0 * REVERSAL.duration_s:
        time_s = lock_step.time_ms / 1000.0
        for frame in others(time_s):
            controller.receive(frame, lock_step.time_ms * 1_000_000)
        lock_step.step()
        texts = [event.text for event in controller.events]
        controller.events.clear()
        assert not any("TRIPPED" in text for text in texts)
        start = "axis=near_far sway_sensor="
        trust += [text.removeprefix(start) for text in texts if text.startswith(start)]
        if time_s > START_S + 5.5:
            swing.append(abs(plant.crane.state.theta6_rad) * 57.29578)
    return Left(max(swing), trust)


@pytest.mark.parametrize(
    ("file", "changes"),
    [(J1939, ()), (J1939, SSI), (J1939, ANGULAR_RATE), (CANOPEN, ())],
    ids=["SSI2", "SSI", "ARI", "CiA 410"],
)
@pytest.mark.parametrize("length_pct", [-30.0, pytest.param(30.0, marks=pytest.mark.slow)])
def test_it_is_trusted_and_damps_with_a_length_that_is_30_percent_wrong(
    tmp_path: Path, file: str, changes: tuple[Change, ...], length_pct: float
) -> None:
    damped = drive(changed(tmp_path, file, *changes), length_pct)
    watch = (("use: damp", "use: watch"),)
    watched = drive(changed(tmp_path, file, *changes, *watch), length_pct)
    print(f"{damped.swing_deg:.2f} degrees left, only watched {watched.swing_deg:.2f}")
    assert damped.trust == ["UNPROVED", "TRUSTED"]
    assert damped.swing_deg < 0.3 * watched.swing_deg
    assert damped.swing_deg < 2.2  # of a reversal that is cut short


@pytest.mark.slow
@pytest.mark.parametrize("length_pct", [0.0, 30.0])
def test_the_shortest_fusion_that_check_takes_damps_and_a_short_one_would_not(
    tmp_path: Path, length_pct: float
) -> None:
    deployment = load_deployment(ROOT / "config" / CANOPEN)
    watched = changed(tmp_path, CANOPEN, ("use: damp", "use: watch"))
    plain = drive(watched, length_pct).swing_deg
    least, short = (drive(deployment, length_pct, fusion_s=s).swing_deg for s in (3.3, 0.5))
    print(f"{least:.2f} degrees left, {short:.2f} with 0.5 s, {plain:.2f} without a sensor")
    assert least < max(0.5 * plain, 1.0)  # of a reversal that is cut short
    assert short > max(plain, 3.0)


def test_an_inclinometer_without_a_gyro_is_never_trusted() -> None:
    """What ``check`` refuses to be configured: it shows nothing of the swing."""
    deployment = load_deployment(ROOT / "config" / CANOPEN)
    assert "TRUSTED" not in drive(deployment, fusion_s=0.0).trust


def emergency(time_s: float) -> Iterator[Frame]:
    """The node of the sensor reports an error in the first stroke."""
    if abs(time_s - START_S - 1.0) < 1e-6:
        yield Frame("crane", 0x80 + TOOL, False, bytes((0x00, 0x50, 0x01, 0, 0, 0, 0, 0)))


def pre_operational(time_s: float) -> Iterator[Frame]:
    """It says again and again that it is not operational."""
    if time_s > START_S + 1.0:
        yield Frame("crane", 0x700 + TOOL, False, bytes((0x7F,)))


@pytest.mark.parametrize("others", [emergency, pre_operational])
def test_a_node_that_does_not_work_measures_nothing_and_stops_nothing(
    others: Callable[[float], Iterator[Frame]],
) -> None:
    deployment = load_deployment(ROOT / "config" / CANOPEN)
    assert drive(deployment, others=others).trust[:3] == ["UNPROVED", "TRUSTED", "LOST"]


def test_another_address_is_no_sensor(tmp_path: Path) -> None:
    elsewhere = changed(tmp_path, J1939, ("source: 0x19", "source: 0x1A"))
    plant = PlantNode(load_deployment(ROOT / "config" / J1939))
    plant.advance(0.02)
    controller = Controller(elsewhere)
    for frame in plant.feedback():
        controller.receive(frame, 0)
    assert list(controller.tick(0))
    assert controller.axes["near_far"].trust.name == "NO_DATA"


@pytest.mark.parametrize(("raw", "trust"), [(0xFE00, "NO_DATA"), (0xFAFF, "UNPROVED")])
def test_an_error_code_of_j1939_is_no_measurement(tmp_path: Path, raw: int, trust: str) -> None:
    deployment = changed(tmp_path, J1939, *SSI)
    sensor = deployment.axes["near_far"].sway_sensor
    assert sensor is not None
    controller = Controller(deployment)
    data = raw.to_bytes(2, "little") + bytes((0, 0x7D)) + bytes(4)
    controller.receive(Frame(*sensor.message.key, data), 0)
    assert list(controller.tick(0))
    assert controller.axes["near_far"].trust.name == trust
