"""Frames of rehearsed faults: what is altered, and that nothing else is."""

import random
from pathlib import Path
from types import SimpleNamespace
from typing import Any

import cantools
import pytest

from canshaper.codec.frame import Frame
from canshaper.codec.velocity import VelocitySignal
from canshaper.daemon.rehearsal.fault import Editor
from canshaper.daemon.rehearsal.faults import rehearsed_faults
from canshaper.daemon.rehearsal.joystick import fault_codes
from canshaper.machine.binding import load_deployment
from canshaper.machine.deployment import Deployment
from canshaper.shaping.states import Reason
from tests.machine import protected_machine
from tests.rigs.files import CONFIG, Machine, machine_file, read

FLOAT = """
BO_ 16 Joystick: 4 J
 SG_ X : 0|32@1- (1,0) [-1|1] "" C
SIG_VALTYPE_ 16 X : 1;
"""


def frames(deployment: Deployment, joystick: str) -> tuple[Editor, Frame]:
    """A frame of a joystick with any bits, as its sender protects it."""
    editor = Editor(deployment.joysticks[joystick])
    data = random.Random(1).randbytes(editor.bound.message.length)
    return editor, editor.changed(Frame(*editor.bound.key, data), {})


@pytest.mark.parametrize("name", ["forwarder", "canfd-forwarder", "j1939-forwarder"])
def test_one_signal_changes_and_its_check_is_right(name: str) -> None:
    editor, frame = frames(read(CONFIG / f"{name}.yaml"), "left")
    for signal in editor.bound.message.signals:
        raw, check = editor.raw(frame), editor.bound.protection.check
        altered = editor.changed(frame, {signal.name: 0})
        now = editor.raw(altered)
        assert check is None or check.verify(altered.data)
        assert now[signal.name] == 0 or signal.name == "Check"
        others = [k for k in raw if k not in (signal.name, "Check")]
        assert {k: now[k] for k in others} == {k: raw[k] for k in others}


@pytest.fixture(params=["canfd-forwarder", "profile 1"])
def protected(request: pytest.FixtureRequest, tmp_path: Path) -> Deployment:
    """A machine whose joystick has a checksum, or a profile of E2E."""
    if request.param == "canfd-forwarder":
        return read(CONFIG / "canfd-forwarder.yaml")
    return protected_machine.load(tmp_path)


def test_a_check_is_spoiled_and_no_signal(protected: Deployment) -> None:
    editor, frame = frames(protected, next(iter(protected.joysticks)))
    spoiled, check = editor.spoiled(frame), editor.bound.protection.check
    assert check is not None
    assert check.verify(frame.data)
    assert not check.verify(spoiled.data)
    raw = editor.raw(spoiled)
    moved = [one.name for one in protected.joysticks[editor.bound.name].velocities]
    assert {k: raw[k] for k in moved} == {k: editor.raw(frame)[k] for k in moved}


def test_a_count_is_another_and_its_check_is_right(protected: Deployment) -> None:
    editor, frame = frames(protected, next(iter(protected.joysticks)))
    check, counts = editor.bound.protection.check, editor.bound.protection.counts
    seen: list[int] = []
    other = editor.counted(frame, lambda count: seen.append(count) or count + 3)
    editor.counted(other, lambda count: seen.append(count) or count)
    assert check is not None
    assert seen[1] == (seen[0] + 3) % counts
    assert check.verify(other.data)


def test_a_float_joystick_is_no_number() -> None:
    (message,) = cantools.database.load_string(FLOAT, "dbc").messages
    velocity = VelocitySignal.of(message.signals[0])
    joystick: Any = SimpleNamespace(message=message, velocities=[velocity])
    for reason in (Reason.JOYSTICK_NOT_A_NUMBER, Reason.JOYSTICK_OUT_OF_RANGE):
        assert velocity.read(fault_codes(joystick)[reason]["X"]) is reason


def test_a_joystick_that_may_stand_for_long_is_not_frozen(machine: Machine) -> None:
    machine.in_yaml("    timeout_ms: 100", "    stuck_s: 60\n    timeout_ms: 100")
    faults = rehearsed_faults(machine.load())
    assert [name for name in faults if name.startswith("frozen:")] == ["frozen:right"]


def test_the_switch_that_is_pressed_is_the_enable(tmp_path: Path) -> None:
    other = ("[Enable, seat, crane_mode]", "[seat, Enable, crane_mode]")
    path = machine_file(tmp_path, "ecu-forwarder", other)
    claims = {name: one.claim for name, one in rehearsed_faults(load_deployment(path)).items()}
    assert claims["switch_off:seat"] == "ENABLE_LOST"
    assert claims["switch_off:crane_mode"] == "R2"
