"""Identifiers of J1939, and what a deployment may say of them."""

import re
from pathlib import Path

import pytest
from hypothesis import example, given
from hypothesis import strategies as st

from canshaper.checksums.kinds import Checksum
from canshaper.codec.frame import id_of
from canshaper.codec.identifier import (
    CLAIMED,
    DM1,
    at_every_priority,
    claims_of,
    group_mask,
    group_of,
    has_destination,
    identifier,
    name_bytes,
    pgn_of,
    sent_by,
    with_source,
)
from canshaper.config.bus import J1939Name
from canshaper.errors import ConfigError
from canshaper.machine.binding import load_deployment
from canshaper.machine.deployment import Deployment
from tests.rigs.sent import command_frame

ROOT = Path(__file__).parents[2]
CONFIG = ROOT / "config" / "j1939-forwarder.yaml"
DBC = ROOT / "dbc" / "j1939-bjm-avc.dbc"
BJM1 = "2365445886"
OWN = 0x9C
BYTE = st.integers(0, 255)


class Machine:
    """The J1939 machine with changes, on disk."""

    def __init__(self, directory: Path) -> None:
        self.directory = directory
        self.yaml = CONFIG.read_text().replace("../dbc/j1939-bjm-avc.dbc", "machine.dbc")
        self.dbc = DBC.read_text(encoding="cp1252")

    def in_yaml(self, old: str, new: str) -> int:
        """Replace the first ``old``; its line."""
        assert old in self.yaml, old
        line = self.yaml[: self.yaml.index(old)].count("\n") + 1
        self.yaml = self.yaml.replace(old, new, 1)
        return line

    def in_dbc(self, old: str, new: str) -> int:
        assert old in self.dbc, old
        line = self.dbc[: self.dbc.index(old)].count("\n") + 1
        self.dbc = self.dbc.replace(old, new, 1)
        return line

    def load(self) -> Deployment:
        (self.directory / "machine.yaml").write_text(self.yaml)
        (self.directory / "machine.dbc").write_text(self.dbc, encoding="cp1252")
        return load_deployment(self.directory / "machine.yaml")

    def problems(self) -> list[str]:
        with pytest.raises(ConfigError) as caught:
            self.load()
        return [str(p).replace(f"{self.directory}/", "") for p in caught.value.problems]


@pytest.fixture
def machine(tmp_path: Path) -> Machine:
    return Machine(tmp_path)


# -- identifiers -----------------------------------------------------------------------------------


@given(st.integers(0, 7), st.integers(0, 3), BYTE, BYTE, BYTE)
@example(6, 0, 239, 0x33, 0)  # the last format with a destination
@example(6, 0, 240, 0x33, 0)
@example(6, 0, 241, 0x33, 0)
def test_a_group_is_known_from_any_source_at_any_priority(
    priority: int, pages: int, pf: int, ps: int, source: int
) -> None:
    can_id = priority << 26 | pages << 24 | pf << 16 | ps << 8 | source
    pgn = pages << 16 | pf << 8 | (ps if pf >= 240 else 0)
    assert pgn_of(can_id) == pgn
    assert has_destination(can_id) == (pf < 240)
    assert identifier(pgn, source, ps, priority) == can_id
    assert group_of(with_source(can_id, source ^ 0x5A)) == group_of(can_id)
    assert group_of(can_id) & ~group_mask(can_id) == 0


def test_identifiers_of_the_standards() -> None:
    assert identifier(CLAIMED, OWN) == 0x18EEFF9C
    assert identifier(DM1, OWN) == 0x18FECA9C
    assert claims_of(OWN) == [0x18EEFF9C, 0x18EEFFFE]
    assert pgn_of(0x0CFDD633) == 64982  # BJM1 from 0x33
    assert pgn_of(0x18EAFFFE) == 59904  # a request to all
    # the first format without a destination
    assert identifier(0xEF00, 1, destination=0x55) == 0x18EF5501
    assert identifier(0xF000, 1, destination=0x55) == 0x18F00001
    # an acknowledgement, faults, and both messages of the transport protocol at lowest priority
    assert sent_by(OWN) == [0x18E8FF9C, 0x18FECA9C, 0x1CECFF9C, 0x1CEBFF9C]
    assert at_every_priority(0x18FECA9C) == [
        *(0x00FECA9C, 0x04FECA9C, 0x08FECA9C, 0x0CFECA9C),
        *(0x10FECA9C, 0x14FECA9C, 0x18FECA9C, 0x1CFECA9C),
    ]


def test_the_name_is_made_of_its_fields() -> None:
    name = J1939Name(
        identity_number=0x1ABCDE & 0x1FFFFF,
        manufacturer_code=0x5A5,
        ecu_instance=5,
        function_instance=19,
        function=129,
        vehicle_system=0x55,
        vehicle_system_instance=9,
        industry_group=2,
    )
    assert len(name_bytes(name)) == 8
    number = int.from_bytes(name_bytes(name), "little")
    widths = (21, 11, 3, 5, 8, 1, 7, 4, 3, 1)
    fields, at = [], 0
    for width in widths:
        fields.append(number >> at & (1 << width) - 1)
        at += width
    assert at == 64
    assert fields == [0x1ABCDE & 0x1FFFFF, 0x5A5, 5, 19, 129, 0, 0x55, 9, 2, 0]


def test_the_id_in_a_word_of_the_kernel() -> None:
    """What another program has set beyond an id of 11 bits does not reach a bus."""
    assert id_of(0x123) == id_of(0x1FFF_F923) == (0x123, False)
    assert id_of(0x9234_5678) == (0x1234_5678, True)
    assert id_of(0x9FFF_FFFF) == (0x1FFF_FFFF, True)


# -- binding ---------------------------------------------------------------------------------------


def test_what_is_sent_goes_out_under_our_address(machine: Machine) -> None:
    deployment = machine.load()
    ids = deployment.routing.buses["crane"]
    assert {i & 0xFF for i, _ in ids.sent} == {OWN}
    assert {pgn_of(i) for i, _ in ids.valves} == {0xFE30, 0xFE31, 0xFE32}
    assert ids.j1939
    assert {group >> 8 for group in ids.received_groups} >= {0xFDD6, 0xFDD8, 0xEE00, 0xEA00}


def test_a_valve_on_a_bus_without_our_address(machine: Machine) -> None:
    start = machine.yaml.index("    j1939:")
    machine.yaml = machine.yaml[:start] + machine.yaml[machine.yaml.index("\ndbc:") :]
    valve = machine.yaml.index("    valve:\n      bus: crane")
    line = machine.yaml[:valve].count("\n") + 2
    text = "AVC0, a message of J1939: expected a bus with a section j1939, got crane without"
    assert f"machine.yaml:{line}: axes.slew.valve.bus: {text}" in machine.problems()


@pytest.mark.parametrize("number", [int(BJM1) - 0x80000000, 272])
def test_a_dbc_id_of_29_bits_without_bit_31(machine: Machine, number: int) -> None:
    line = machine.in_dbc(f"BO_ {BJM1} BJM1", f"BO_ {number} BJM1")
    machine.dbc = machine.dbc.replace(BJM1, str(number))
    (problem,) = machine.problems()
    assert problem.startswith(f"machine.dbc:{line}: ")
    assert "BJM1" in problem
    assert "an id of 29 bits stands in a DBC file with bit 31 set: 0x80000000 more" in problem


def test_signals_that_overlap(machine: Machine) -> None:
    machine.in_dbc("State : 16|4@1+", "State : 7|4@1+")
    line = machine.dbc[: machine.dbc.index("BO_ 2365468926")].count("\n") + 1
    (problem,) = machine.problems()
    assert problem.startswith(f"machine.dbc:{line}: ")
    assert "are overlapping in message AVC0" in problem


def test_a_factor_with_which_full_flow_cannot_be_reached(machine: Machine) -> None:
    machine.in_dbc("PortFlow : 0|8@1+ (0.4,0)", "PortFlow : 0|8@1+ (0.2,0)")
    line = machine.dbc[: machine.dbc.index("BO_ 2365468926")].count("\n") + 1
    (problem,) = machine.problems()
    text = "PortFlow cannot reach its range [0|100] with 8 bits at 0.2 per bit"
    assert problem == f"machine.dbc:{line}: AVC0: {text}"


def test_our_address_is_no_joysticks(machine: Machine) -> None:
    machine.in_yaml("    message: BJM1\n", "    message: BJM1\n    source: 0x9C\n")
    line = machine.yaml[: machine.yaml.index("source: 0x9C")].count("\n") + 1
    text = "BJM1 comes from address 156, which is ours on bus crane"
    assert machine.problems() == [f"machine.yaml:{line}: joysticks.left.source: {text}"]


def second_bus(machine: Machine, name: str) -> int:
    """A second bus of J1939; the line of its NAME."""
    node = f"j1939: {{ address: 0x9D, name: {name} }}"
    bus = f"  other:\n    interface: socketcan\n    channel: vcan1\n    {node}\n"
    return machine.in_yaml("\ndbc:", f"{bus}\ndbc:") + 3


def test_one_name_on_two_buses(machine: Machine) -> None:
    line = second_bus(machine, "{ identity_number: 1, manufacturer_code: 2047 }")
    (problem,) = machine.problems()
    assert problem == (
        f"machine.yaml:{line}: buses.other.j1939.name: is the NAME of bus crane; each node needs"
        " one of its own: another ecu_instance will do"
    )


def test_two_names_on_two_buses(machine: Machine) -> None:
    second_bus(machine, "{ identity_number: 1, manufacturer_code: 2047, ecu_instance: 1 }")
    assert set(machine.load().config.buses) == {"crane", "other"}


def test_numbers_of_faults_that_do_not_end_in_the_range(machine: Machine) -> None:
    line = machine.in_yaml("      address: 0x9C", "      first_spn: 524286\n      address: 0x9C")
    (problem,) = machine.problems()
    assert problem == (
        f"machine.yaml:{line}: buses.crane.j1939.first_spn: expected the last SPN up to 524287, got"
        " 524291 from 524286 on"
    )


def test_a_source_for_a_message_that_is_none_of_j1939(machine: Machine) -> None:
    machine.in_dbc(f'BA_ "VFrameFormat" BO_ {BJM1} 3;\n', "")
    machine.in_yaml("    message: BJM1\n", "    message: BJM1\n    source: 0x33\n")
    text = "BJM1 is no message of J1939 (VFrameFormat in the DBC)"
    assert any(p.endswith(f"joysticks.left.source: {text}") for p in machine.problems())


def test_a_message_to_one_node_needs_its_sender(machine: Machine) -> None:
    # proprietary A, PGN 61184, to us
    machine.dbc = machine.dbc.replace(BJM1, str(0x98EF9CFE))
    (problem,) = machine.problems()
    says = "expected the address of the sender of BJM1, got none: it is sent"
    assert f"joysticks.left.source: {says}" in problem
    machine.in_yaml("    message: BJM1\n", "    message: BJM1\n    source: 0x33\n")
    assert (0x18EF9C33, True) in machine.load().routing.buses["crane"].received


@pytest.mark.parametrize("source", ["", "source: 0x80, "])
def test_what_commands_a_valve_is_no_input(machine: Machine, source: str) -> None:
    """From another address it has to count as a second controller."""
    given = "feedback: { bus: crane, message: AVEF0, signal: ExtendFlow,"
    line = machine.in_yaml(
        given, f"feedback: {{ bus: crane, message: AVC0, {source}signal: PortFlow,"
    )
    (problem, *_) = [p for p in machine.problems() if "commands no valve" in p]
    assert problem == (
        f"machine.yaml:{line}: axes.slew.feedback.message: AVC0: expected a group that commands no"
        " valve, got that of axes.slew.valve"
    )


def test_an_emergency_stop_needs_its_sender(machine: Machine) -> None:
    stop = "emergency_stop: { bus: crane, message: BJM3, signal: Button1, timeout_ms: 200 }\n"
    machine.yaml += stop
    line = machine.yaml.count("\n")
    (problem,) = machine.problems()
    assert problem.startswith(f"machine.yaml:{line}: emergency_stop.source: missing: in the DBC")
    machine.yaml = machine.yaml.replace("message: BJM3,", "message: BJM3, source: 0x40,")
    assert machine.load().emergency_stop is not None


def test_a_checksum_over_the_id_needs_a_known_source(machine: Machine) -> None:
    """Its address is in the id: that of the joystick, and ours in what we send."""
    joystick = ' SG_ Check : 56|8@1+ (1,0) [0|255] "" SHAPER\n\nBO_ 2365446398'
    for name in ("Button9", "Button10", "Button11", "Button12"):
        machine.dbc = re.sub(rf" SG_ {name} : .*\n", "", machine.dbc, count=1)
        machine.dbc = re.sub(rf"VAL_ {BJM1} {name} .*\n", "", machine.dbc)
    machine.in_dbc("\nBO_ 2365446398", joystick)
    flow = ' SG_ ExtendedFlow : 24|16@1+ (0.0015625,0) [0|100] "%" VALVES\n'
    machine.in_dbc(flow, flow + ' SG_ Check : 40|8@1+ (1,0) [0|255] "" VALVES\n')
    check = "checksum: { signal: Check, kind: sum_id }"
    line = machine.in_yaml("    message: BJM1\n", f"    message: BJM1\n    {check}\n") + 1
    machine.in_yaml("      message: AVC0\n", f"      message: AVC0\n      {check}\n")
    assert machine.problems() == [
        f"machine.yaml:{line}: joysticks.left.checksum.kind: expected a known source with 'sum_id',"
        " which depends on the id, got BJM1 from any"
    ]
    machine.in_yaml("    message: BJM1\n", "    message: BJM1\n    source: 0x21\n")
    deployment = machine.load()
    protections = {
        "joystick": (deployment.joysticks["left"].protection, (int(BJM1) & 0x1FFFFF00) | 0x21),
        "valve": (deployment.axes["slew"].valve.message.protection, 0x0CFE3000 | OWN),
    }
    for protection, can_id in protections.values():
        assert isinstance(protection.check, Checksum)
        assert protection.check.can_id == can_id
    frame = command_frame(deployment.axes["slew"].valve)
    assert frame.can_id == protections["valve"][1]
    assert (
        frame.data[5] == sum(frame.can_id.to_bytes(4, "big") + frame.data[:5] + b"\xff\xff") % 256
    )
