"""Identifiers of J1939, and what a deployment may say of them."""

import re

import pytest
from hypothesis import example, given
from hypothesis import strategies as st

from canshaper.checksums.kinds import Checksum
from canshaper.codec.frame import (
    CLAIMED,
    DM1,
    at_every_priority,
    claims_of,
    group_mask,
    group_of,
    has_destination,
    id_of,
    identifier,
    name_bytes,
    pgn_of,
    sent_by,
    with_source,
)
from canshaper.config.bus import J1939Name
from tests.rigs.files import Machine
from tests.rigs.sent import command_frame

BJM1 = "2365445886"
OWN = 0x9C
BYTE = st.integers(0, 255)


@pytest.fixture
def machine(machine: Machine) -> Machine:
    machine.become("j1939-forwarder.yaml", "j1939-bjm-avc.dbc")
    return machine


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


def test_a_source_for_a_message_that_is_none_of_j1939(machine: Machine) -> None:
    machine.in_dbc(f'BA_ "VFrameFormat" BO_ {BJM1} 3;\n', "")
    machine.in_yaml("    message: BJM1\n", "    message: BJM1\n    source: 0x33\n")
    text = "BJM1 is no message of J1939 (VFrameFormat in the DBC)"
    assert any(p.endswith(f"joysticks.left.source: {text}") for p in machine.problems())


def test_a_message_to_one_node_needs_its_sender(machine: Machine) -> None:
    # proprietary A, PGN 61184, to us
    machine.dbc = machine.dbc.replace(BJM1, str(0x98EF9CFE))
    (problem,) = machine.problems()
    assert problem.endswith(
        "joysticks.left.source: expected the address of the sender of BJM1, got none: it is sent"
        " from one node to another"
    )
    machine.in_yaml("    message: BJM1\n", "    message: BJM1\n    source: 0x33\n")
    assert (0x18EF9C33, True) in machine.load().routing.buses["crane"].received


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
