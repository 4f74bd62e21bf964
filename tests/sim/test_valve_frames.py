"""The simulated valves read their frames by themselves, and so see a fault of the controller's."""

import random
from pathlib import Path

import pytest

from canshaper.codec.layout import Layout
from canshaper.codec.velocity import ValveCodec
from canshaper.controller.controller import Controller
from canshaper.machine.deployment import Deployment
from canshaper_sim.joysticks import JoystickNode
from canshaper_sim.plant import PlantNode
from canshaper_sim.strokes import Script, Stroke
from canshaper_sim.valve_frames import CommandReader
from tests.codec.test_flags_binding import FLAGGED, FLAGS, SIGNED
from tests.codec.test_shared_valves import THREE
from tests.codec.valve_machine import CODES, with_valves
from tests.rigs.files import CONFIG, Machine, read
from tests.rigs.gateway import GatewayRig

SHIPPED = sorted(path.name for path in CONFIG.glob("*.yaml"))
JOYSTICK = "signal: Slew, neutral_pct: 2"
ROCKER = """ SG_ Slew : 0|8@1+ (0.4,0) [0|100] "%" SHAPER
 SG_ SlewBack : 8|8@1+ (0.4,0) [0|100] "%" SHAPER
"""


def says(deployment: Deployment, axis: str, data: str) -> float:
    return CommandReader(deployment, axis).command(bytes.fromhex(data))


@pytest.mark.parametrize("name", SHIPPED)
def test_it_reads_what_the_codec_reads(name: str) -> None:
    """Two readings that share no line."""
    chance = random.Random(name)
    for axis, bound in read(CONFIG / name).axes.items():
        reader, layout = CommandReader(read(CONFIG / name), axis), Layout(bound.valve_message)
        counter = bound.valve.message.protection.counter
        for _ in range(100):
            data = chance.randbytes(layout.length)
            raw = layout.decode(data)
            assert reader.command(data) == (bound.valve.read(raw) or 0) / bound.valve.steps
            assert reader.count(data) == (raw[counter] if counter else 0)


def test_intel_motorola_and_a_direction(machine: Machine) -> None:
    deployment = with_valves(machine, *THREE).load()
    assert says(deployment, "slew", "83 00 00 00 00 00 00 00") == -1.0
    assert says(deployment, "near_far", "00 19 00 00 00 00 00 00") == 0.2
    assert says(deployment, "lift", "00 00 7d 01 00 00 00 00") == 0.5
    assert says(deployment, "lift", "00 00 7d 02 00 00 00 00") == -0.5
    assert says(deployment, "lift", "00 00 7d 03 00 00 00 00") == 0.0
    assert CommandReader(deployment, "lift").count(bytes.fromhex("00000000000000d0")) == 13


def test_a_code_that_is_no_direction(machine: Machine) -> None:
    valve = f"message: AVC0, signal: PortFlow, timeout_ms: 200, {CODES}"
    deployment = with_valves(machine, ("Slew", valve)).load()
    assert says(deployment, "slew", "96ff31ffffffffff") == 0.6
    assert says(deployment, "slew", "96ff3fffffffffff") == 0.0
    assert says(deployment, "slew", "fbff31ffffffffff") == 0.0  # beyond full


def test_full_zero_and_invert_of_the_file(machine: Machine) -> None:
    machine.in_yaml(
        "message: SlewCommand, signal: Velocity,",
        "message: SlewCommand, signal: Velocity, full: 80, zero: 8, invert: true,",
    )
    deployment = machine.load()
    assert says(deployment, "slew", "0a 00") == 0.0
    assert says(deployment, "slew", "6e 00") == -1.0
    assert says(deployment, "slew", "d8 00") == 0.5


def test_flags_through_the_gateway(tmp_path: Path) -> None:
    rig = GatewayRig(tmp_path, ((JOYSTICK, f"signal: Slew, flags: {FLAGS}"),), ((SIGNED, FLAGGED),))
    assert says(rig.deployment, "slew", "04 7d 00 00 01 00 00 00") == -0.5
    assert says(rig.deployment, "slew", "10 7d 00 00 01 00 00 00") == 0.5
    assert says(rig.deployment, "slew", "14 7d 00 00 01 00 00 00") == 0.0  # both


def test_a_rocker_through_the_gateway(tmp_path: Path) -> None:
    rig = GatewayRig(
        tmp_path, ((JOYSTICK, "signal: Slew, negative: SlewBack"),), ((SIGNED, ROCKER),)
    )
    assert says(rig.deployment, "slew", "7d 00 00 00 01 00 00 00") == 0.5
    assert says(rig.deployment, "slew", "00 7d 00 00 01 00 00 00") == -0.5
    assert says(rig.deployment, "slew", "7d 7d 00 00 01 00 00 00") == 0.0  # both


def test_a_codec_that_turns_the_direction_drives_the_crane_the_wrong_way(
    machine: Machine, monkeypatch: pytest.MonkeyPatch
) -> None:
    """Although it reads back what it wrote; without the gate, which would stop it."""
    assert slewed_rad(machine.load()) > 0.2
    put, get = ValveCodec.put, ValveCodec.read
    monkeypatch.setattr(ValveCodec, "put", lambda self, raw, steps: put(self, raw, -steps))
    monkeypatch.setattr(ValveCodec, "read", lambda self, raw: -(get(self, raw) or 0))
    assert slewed_rad(machine.load()) < -0.2


def slewed_rad(deployment: Deployment) -> float:
    """How far the controller slews the crane in two seconds to the left."""
    plant, controller = PlantNode(deployment), Controller(deployment)
    joysticks = JoystickNode(deployment, Script("press", (Stroke("slew", 0.5, 2.0, 1.0),), 4.0))
    for time_ms in range(0, 4000, 20):
        for frame in joysticks.frames(time_ms):
            controller.receive(frame, time_ms * 1_000_000)
        for frame in controller.tick(time_ms * 1_000_000):
            plant.receive(frame)
        plant.advance(0.02)
    return plant.crane.state.theta1_rad
