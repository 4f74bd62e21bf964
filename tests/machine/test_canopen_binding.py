"""CANopen in a deployment: what does not fit is one problem, with file and line."""

from pathlib import Path

import pytest

from canshaper.machine.binding import load_deployment
from tests.rigs.canopen import DBC_FILE, write_variant
from tests.rigs.files import ROOT, machine_file, problems

LAST_NODE = "lift: { id: 0x22, heartbeat_ms: 500 }"


@pytest.mark.parametrize(
    ("old", "new", "says"),
    [
        (
            LAST_NODE, LAST_NODE.replace("0x22", "0x21"),
            "expected a node id of its own, got 33, that of",
        ),
        (
            LAST_NODE, LAST_NODE.replace("0x22", "0x7E"),
            "buses.crane.canopen.nodes.lift.id: expected a node id of its own, got 126, that of"
            " node",
        ),
        (
            "node: lift\n", "node: lifft\n",
            "expected a node of bus crane, got 'lifft'; there are left, right",
        ),
        ("control: ControlWord\n        status: { bus: crane, message: Lift", "control: Nothing\n"
         "        status: { bus: crane, message:"
         " Lift", "expected a signal of LiftCommand, got 'Nothing'; there are ControlWord"),
        ("control: ControlWord\n        status: { bus: crane, message: Lift", "control: SetPoint\n"
         "        status: { bus: crane, message:"
         " Lift", "expected a free signal, got 'SetPoint', which is"),
        ("message: LiftValve, signal: StatusWord, timeout_ms: 300",
         "message: LiftValve, signal: StatusWord, timeout_ms: 150", "expected 200 ms or more, "),
        ("message: LiftValve, signal", "message: SlewValve,  signal",
         "SlewValve has the id 0x1a0 on bus crane"),
    ],
)  # fmt: skip
def test_problems_of_the_deployment_have_their_line(
    tmp_path: Path, old: str, new: str, says: str
) -> None:
    file = write_variant(tmp_path, (old, new))
    line = file.read_text()[: file.read_text().index(new)].count("\n") + 1
    reports = problems(file)
    assert any(says in one for one in reports), reports
    (reported,) = (one for one in reports if says in one)
    number = int(reported.split("machine.yaml:")[1].split(":")[0])
    assert line <= number <= line + new.count("\n")


def test_a_valve_with_cia408_has_its_node_there(tmp_path: Path) -> None:
    file = write_variant(tmp_path, ("SlewCommand\n", "SlewCommand\n      node: slew\n"))
    (problem,) = problems(file)
    assert "axes.slew.valve: node: expected none with cia408, which has a key of that" in problem


def test_the_node_of_a_drive_is_one_of_its_bus(tmp_path: Path) -> None:
    slow = ("200, node: slew", "200, node: slow")
    (problem,) = problems(machine_file(tmp_path, "cia402-forwarder", slow))
    assert "axes.slew.valve.node: expected a node of bus crane, got 'slow'; there are" in problem


@pytest.mark.parametrize(
    ("old", "new", "says"),
    [
        ("SG_ SetPoint : 16|16@1- (0.006103515625,0) [-100|100]",
         "SG_ SetPoint : 16|16@1- (0.0030518509475997192,0) [-100|100]",
         "SetPoint has 32767 steps to full command; a set point of CiA 408 has 16384"),
        ("SG_ SetPoint : 16|16@1- (0.006103515625,0) [-100|100]",
         "SG_ SetPoint : 16|16@1- (0.006103515625,0.006103515625) [-100|100]",
         "SetPoint has the offset"),
        (
            "SG_ ControlWord : 0|16@1+", "SG_ ControlWord : 0|3@1+",
            "ControlWord: expected 4 bits or more, got 3",
        ),
        (
            "SG_ ControlWord : 0|16@1+", "SG_ ControlWord : 0|16@1-",
            " axes.slew.valve.cia408.control: ControlWord: expected an unsigned integer signal,"
            " got a signed one",
        ),
        (
            "SG_ StatusWord : 0|16@1+", "SG_ StatusWord : 0|3@1+",
            " axes.slew.valve.cia408.status.signal: StatusWord: expected 4 bits or more, got 3",
        ),
        ("BO_ 400 JoystickLeft", "BO_ 1809 JoystickLeft", "which is one of heartbeat in CANopen"),
    ],
)  # fmt: skip
def test_problems_of_the_dbc(tmp_path: Path, old: str, new: str, says: str) -> None:
    dbc = (ROOT / "dbc" / DBC_FILE).read_text()
    assert old in dbc
    number, other = old.split()[1], new.split()[1]
    dbc = dbc.replace(old, new)
    if old.startswith("BO_"):
        dbc = dbc.replace(f"BO_ {number} ", f"BO_ {other} ").replace(
            f"VAL_ {number} ", f"VAL_ {other} "
        )
    (tmp_path / "machine.dbc").write_text(dbc)
    file = write_variant(tmp_path, (str(ROOT / "dbc" / DBC_FILE), "machine.dbc"))
    assert any(says in one for one in problems(file)), problems(file)


def test_a_word_of_as_many_bits_as_the_state_has_is_enough(tmp_path: Path) -> None:
    dbc = (ROOT / "dbc" / DBC_FILE).read_text()
    for name in ("ControlWord", "StatusWord"):
        old = f"SG_ {name} : 0|16@1+ (1,0) [0|65535]"
        assert old in dbc
        dbc = dbc.replace(old, f"SG_ {name} : 0|4@1+ (1,0) [0|15]")
    (tmp_path / "machine.dbc").write_text(dbc)
    file = write_variant(tmp_path, (str(ROOT / "dbc" / DBC_FILE), "machine.dbc"))
    assert load_deployment(file).axes["slew"].valve is not None
