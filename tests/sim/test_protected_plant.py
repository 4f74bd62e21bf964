"""The simulated machine under protection: what valves refuse, what joysticks and radius send."""

import struct
from pathlib import Path

import pytest
from crccheck.crc import Crc8Autosar, Crc8SaeJ1850

from canshaper.codec.frame import Frame
from canshaper.controller.controller import Controller
from canshaper.machine.deployment import Deployment
from canshaper.shaping.states import State
from canshaper_sim.joysticks import JoystickNode
from canshaper_sim.operator import random_script
from canshaper_sim.plant import PlantNode
from tests.machine import protected_machine
from tests.rigs.files import Machine

IDS = list(range(1, 17))
SLEW = (
    "BO_ 512 SlewCommand: 2 SHAPER\n"
    ' SG_ Velocity : 0|8@1- (0.8,0) [-100|100] "%" VALVES\n'
    ' SG_ AliveCounter : 8|8@1+ (1,0) [0|255] "" VALVES\n'
)
PROTECTED_SLEW = (
    "BO_ 512 SlewCommand: 4 SHAPER\n"
    ' SG_ Velocity : 16|8@1- (0.8,0) [-100|100] "%" VALVES\n'
    ' SG_ AliveCounter : 24|8@1+ (1,0) [0|255] "" VALVES\n'
)
VALVE = "message: SlewCommand, signal: Velocity, timeout_ms: 200, alive_counter: AliveCounter"
STEP_S = 0.02


@pytest.fixture
def protected(machine: Machine) -> Deployment:
    """The shipped machine with its slew valve under profile 2."""
    e2e = f"e2e: {{ profile: p02, data_ids: {IDS} }}"
    machine.in_yaml(VALVE, VALVE.replace("alive_counter: AliveCounter", e2e))
    machine.in_dbc(SLEW, PROTECTED_SLEW)
    return machine.load()


def frame(count: int, steps: int = 100) -> Frame:
    """A slew command; its header by the library."""
    rest = struct.pack("<BbB", count % 16, steps, 0)
    crc = Crc8Autosar.calc(rest + bytes([IDS[count % 16]]))
    return Frame("crane", 512, False, bytes([crc]) + rest)


def drive(plant: PlantNode, frames: list[Frame | None]) -> list[float]:
    """Slew rates while these frames come, one every 20 ms."""
    rates = []
    for one in frames:
        if one is not None:
            plant.receive(one)
        plant.advance(STEP_S)
        rates.append(plant.crane.state.theta1_rate_rad_s)
    return rates


def test_a_valve_follows_right_frames(protected: Deployment) -> None:
    rates = drive(PlantNode(protected), [frame(n) for n in range(100)])
    assert rates[-1] > 0.1


@pytest.mark.parametrize("bit", [0, 9, 13, 20, 31])
def test_a_valve_closes_when_only_wrong_frames_come(protected: Deployment, bit: int) -> None:
    plant = PlantNode(protected)
    moving = drive(plant, [frame(n) for n in range(100)])[-1]
    wrong: list[Frame | None] = []
    for n in range(100, 200):
        data = bytearray(frame(n).data)
        data[bit // 8] ^= 1 << bit % 8
        wrong.append(frame(n)._replace(data=bytes(data)))
    rates = drive(plant, wrong)
    assert rates[5] > 0.9 * moving  # not before its timeout
    assert abs(rates[-1]) < 0.01 * moving
    assert drive(plant, [frame(n) for n in range(200, 300)])[-1] > 0.9 * moving


def test_a_valve_closes_when_the_same_frame_comes_again_and_again(protected: Deployment) -> None:
    """What a controller sends that hangs with its bus still at work."""
    plant = PlantNode(protected)
    moving = drive(plant, [frame(n) for n in range(100)])[-1]
    assert abs(drive(plant, [frame(99)] * 100)[-1]) < 0.01 * moving


def test_a_controller_that_starts_again_is_followed_again(protected: Deployment) -> None:
    plant = PlantNode(protected)
    moving = drive(plant, [frame(n) for n in range(100)])[-1]
    still = drive(plant, [None] * 100)[-1]
    assert abs(still) < 0.01 * moving
    # The first frame counts, whatever its counter: 99 was the last.
    assert drive(plant, [frame(109), *[None] * 8])[-1] > 0.1 * moving
    rates = drive(plant, [frame(n) for n in range(110, 200)])
    assert rates[-1] > 0.9 * moving


def test_the_controller_is_followed(protected: Deployment) -> None:
    plant, controller = PlantNode(protected), Controller(protected)
    joysticks = JoystickNode(protected, random_script(1))
    fastest = 0.0
    for time_ms in range(0, 10_000, 20):
        for sent in joysticks.frames(time_ms):
            controller.receive(sent, time_ms * 1_000_000)
        for sent in controller.tick(time_ms * 1_000_000):
            plant.receive(sent)
        plant.advance(STEP_S)
        fastest = max(fastest, abs(plant.crane.state.theta1_rate_rad_s))
    assert fastest > 0.1


def test_the_joysticks_of_a_machine_with_headers_are_received(tmp_path: Path) -> None:
    deployment = protected_machine.load(tmp_path)
    controller = Controller(deployment)
    joysticks = JoystickNode(deployment, random_script(1))
    states, counts = set(), []
    for time_ms in range(0, 6_000, 20):
        for sent in joysticks.frames(time_ms):
            controller.receive(sent, time_ms * 1_000_000)
            if sent.can_id == 272:
                counts.append(sent.data[1] & 0x0F)
                crc = Crc8SaeJ1850.calc(b"\x23\x01" + sent.data[1:], initvalue=0) ^ 0xFF
                assert sent.data[0] == crc
        list(controller.tick(time_ms * 1_000_000))
        states |= {control.axis.state for control in controller.axes.values()}
    assert counts == [(n + 1) % 15 for n in range(len(counts))]
    assert State.ACTIVE in states
    assert controller.counters.last_fault == 0


def test_a_measured_radius_is_sent_as_the_deployment_asks(machine: Machine) -> None:
    radius = "bus: crane, message: TipPosition, signal: Radius, timeout_ms: 100"
    e2e = "e2e: { profile: p01, data_id: 0x123, data_id_mode: both }"
    motion = f"slew: slew, near_far: near_far, radius: {{ {radius}, {e2e} }}"
    machine.yaml += f"motion: {{ crane: {{ {motion} }} }}\n"
    for old, new in (
        ("TipPosition: 6", "TipPosition: 8"),
        ("Height : 32|16@1-", "Height : 48|16@1-"),
        ("Radius : 16|16@1+", "Radius : 32|16@1+"),
        ("SlewAngle : 0|16@1- (0.01,0) [-327|327]", "SlewAngle : 16|16@1- (0.01,0) [-327|327]"),
    ):
        machine.in_dbc(old, new)
    deployment = machine.load()
    controller, plant = Controller(deployment), PlantNode(deployment)
    for n in range(20):
        (sent,) = (f for f in plant.feedback() if f.can_id == 1025)
        assert sent.data[1] & 0x0F == (n + 1) % 15
        controller.receive(sent, n * 20_000_000)
        assert controller.counters.last_fault == 0
