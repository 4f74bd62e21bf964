"""Two cranes in one deployment: a fault of one does not stop the other; and a rotator's rocker."""

import shutil
from dataclasses import replace
from pathlib import Path
from typing import Any

import cantools
import pytest

from canshaper.codec.frame import Frame, FrameFault
from canshaper.controller.controller import Controller
from canshaper.machine.binding import load_deployment
from tests.controller.reloaded import reload
from tests.rigs.files import ROOT

TICK_NS = 20_000_000
MESSAGES = {
    "JoystickLeft": {"Slew": 0, "NearFar": 0, "AntiSwayOff": 0},
    "JoystickRight": {"Lift": 0, "Rotate": 0, "AntiSwayOff": 0},
    "RotatorRocker": {"RotateLeft": 0, "RotateRight": 0},
}
CRANES = ("front", "rear")


class Rig:
    """Both cranes; ``silent`` and ``released`` name buses whose joysticks are so."""

    def __init__(self, file: Path = ROOT / "config" / "two-cranes.yaml") -> None:
        self.deployment = load_deployment(file)
        self.controller = Controller(self.deployment)
        self.dbc: Any = cantools.database.Database()
        for name in ("forwarder", "rotator"):
            self.dbc.add_dbc_file(ROOT / "dbc" / f"{name}.dbc")
        self.now_ns = self.count = 0
        self.silent: set[str] = set()
        self.released: set[str] = set()

    def run(self, ticks: int, **raw: int) -> dict[tuple[str, str], int]:
        """So many ticks with these joysticks on both cranes; the velocities sent last."""
        sent = {}
        for _ in range(ticks):
            self.count = (self.count + 1) % 256
            for bus in (bus for bus in CRANES if bus not in self.silent):
                for name, joysticks in MESSAGES.items():
                    message = self.dbc.get_message_by_name(name)
                    on = {"Enable": int(bus not in self.released), "Reset": 0}
                    moved = {k: v for k, v in raw.items() if k in joysticks}
                    data = message.encode(
                        {**joysticks, **on, "AliveCounter": self.count, **moved}, scaling=False
                    )
                    frame = Frame(bus, message.frame_id, False, data)
                    self.controller.receive(frame, self.now_ns)
            for frame in self.controller.tick(self.now_ns):
                message = self.dbc.get_message_by_frame_id(frame.can_id)
                if "Command" in message.name:
                    values = message.decode(frame.data, scaling=False)
                    sent[frame.bus, message.name] = int(values["Velocity"])
            self.now_ns += TICK_NS
        return sent

    def states(self, crane: str) -> set[str]:
        return {
            control.axis.state.name
            for name, control in self.controller.axes.items()
            if name.startswith(crane)
        }


@pytest.fixture
def rig() -> Rig:
    rig = Rig()
    rig.run(3)
    return rig


MOVING = {"Slew": 1000, "NearFar": 1000, "Lift": 1000, "RotateRight": 250}


def test_both_move_each_by_its_own_joysticks(rig: Rig) -> None:
    rig.silent = {"rear"}
    sent = rig.run(60, **MOVING)
    assert sent["front", "SlewCommand"] > 50
    assert sent["front", "RotatorCommand"] < -100  # to the right is negative
    assert [v for (bus, _), v in sent.items() if bus == "rear"] == [0, 0, 0, 0]


@pytest.mark.parametrize("what", ["silent", "released"])
def test_a_fault_of_one_crane_does_not_stop_the_other(rig: Rig, what: str) -> None:
    rig.run(60, **MOVING)
    getattr(rig, what).add("front")
    sent = rig.run(150, **MOVING)
    assert {v for (bus, _), v in sent.items() if bus == "front"} == {0}
    assert rig.states("front") <= {"TRIPPED", "NEUTRAL_WAIT"}
    assert min(abs(v) for (bus, _), v in sent.items() if bus == "rear") > 100
    assert rig.states("rear") == {"ACTIVE"}


def test_of_the_bus_that_is_opened_again_alone_counters_may_jump(rig: Rig, tmp_path: Path) -> None:
    shutil.copy(rig.deployment.path, tmp_path)
    rig.deployment = replace(rig.deployment, path=tmp_path / rig.deployment.path.name)
    reload(rig, ("channel: vcan1, bitrate: 250000", "channel: vcan1, bitrate: 500000"))
    rig.count += 5
    rig.run(1)
    assert rig.controller.counters.last_fault is FrameFault.COUNTER_JUMP
    assert rig.states("front") == {"NEUTRAL_WAIT"}
    assert rig.states("rear") == {"READY"}


def test_a_second_sender_trips_its_own_valve_only(rig: Rig) -> None:
    rig.run(60, **MOVING)
    rig.controller.receive(Frame("rear", 0x200, False, bytes(2)), rig.now_ns)
    rig.run(5, **MOVING)
    tripped = [n for n, r in rig.controller.axes.items() if r.axis.state.name == "TRIPPED"]
    assert tripped == ["rear_slew"]


def test_a_rocker_pressed_both_ways_stops_its_axis(rig: Rig) -> None:
    assert rig.run(60, RotateLeft=250)["front", "RotatorCommand"] > 100
    assert rig.run(60, RotateLeft=250, RotateRight=250)["front", "RotatorCommand"] == 0
    axis = rig.controller.axes["front_rotator"].axis
    assert (axis.state.name, axis.reason.name) == ("NEUTRAL_WAIT", "JOYSTICK_CONTRADICTORY")


def test_each_crane_is_a_motion_of_its_own(tmp_path: Path) -> None:
    file = tmp_path / "machine.yaml"
    motions = "".join(
        f"  {crane}: {{ slew: {crane}_slew, near_far: {crane}_near_far, radius_m: 3 }}\n"
        for crane in CRANES
    )
    text = (ROOT / "config" / "two-cranes.yaml").read_text(encoding="utf-8")
    file.write_text(f"{text.replace('../dbc', str(ROOT / 'dbc'))}motion:\n{motions}")
    rig = Rig(file)
    rig.run(5)
    rig.silent = {"rear"}
    rig.run(10)  # its stop is over: nothing was moving
    moved = [rig.run(1, Slew=1000) for _ in range(60)]
    assert any(sent["front", "NearFarCommand"] for sent in moved)
    assert not any(sent["rear", "NearFarCommand"] for sent in moved)
    rig.silent = set()
    rig.released = {"front"}
    rig.run(10)  # a trip of the front crane is none of the rear one
    moved = [rig.run(1, Slew=1000) for _ in range(60)]
    assert not any(sent["front", "NearFarCommand"] for sent in moved)
    assert any(sent["rear", "NearFarCommand"] for sent in moved)
