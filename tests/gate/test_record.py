"""The record of machines that no shipped file has."""

from dataclasses import replace
from pathlib import Path
from types import SimpleNamespace

import pytest

from canshaper.gate.build import _valve_key, record_of
from canshaper.gate.fields import word_of
from canshaper.gate.signals import field_of, start_of
from canshaper.machine.binding import load_deployment
from tests.gate.bench import load
from tests.gate.test_decoder import message
from tests.rigs.files import Machine, machine_file


def test_a_motion_of_slew_alone_moves_nothing_else(tmp_path: Path) -> None:
    motion = "motion: { crane: { slew: slew } }\n"
    axes = record_of(load_deployment(machine_file(tmp_path, "forwarder", more=motion))).axes
    assert axes["slew"].added == 0.25
    assert axes["near_far"].added == 0.0
    assert {axis.partner for axis in axes.values()} == {""}


def test_who_is_not_the_master_starts_no_node() -> None:
    deployment = load("canopen-forwarder")
    (name,) = deployment.config.buses
    bus = deployment.config.buses[name]
    assert bus.canopen is not None
    canopen = bus.canopen.model_copy(update={"master": False})
    buses = {name: bus.model_copy(update={"canopen": canopen})}
    config = deployment.config.model_copy(update={"buses": buses})
    assert (name, 0, False) in record_of(deployment).others
    assert (name, 0, False) not in record_of(replace(deployment, config=config)).others


def test_what_a_signal_carries_that_no_one_sets() -> None:
    one = message("Real : 0|32@1- (1,0) [0|0]", floats="Real")
    (real,) = one.signals
    assert start_of(real, j1939=True) == 0.0
    real.raw_initial = 100.1
    carried = field_of(one, "Real").raw(word_of(one.encode({"Real": 100.1})))
    assert start_of(real, j1939=True) == carried != 100.1  # as its bits hold it
    signed, plain = message("A : 0|8@1- (1,0) [0|0]", "B : 8|8@1+ (1,0) [0|0]").signals
    assert [start_of(s, j1939=True) for s in (signed, plain)] == [-1, 255]
    assert [start_of(s, j1939=False) for s in (signed, plain)] == [0, 0]
    for start, expected in ((7, 7), (300, 255), (-1, 0)):
        plain.raw_initial = start
        assert start_of(plain, j1939=True) == expected


@pytest.mark.parametrize(("source", "can_id"), [(None, 0x0CFDD633), (0x44, 0x0CFDD644)])
def test_a_joystick_of_j1939_keeps_its_address_in_a_gateway(
    source: int | None, can_id: int
) -> None:
    joystick = SimpleNamespace(bus="a", message="BJM1", source=source)
    axis = SimpleNamespace(
        command=SimpleNamespace(joystick="left"), valve=SimpleNamespace(bus="b", message="BJM1")
    )
    of = SimpleNamespace(frame_id=0x0CFDD633, protocol="j1939", is_extended_frame=True)
    buses = {"b": SimpleNamespace(j1939=None)}
    gateway = SimpleNamespace(other={"b": "a"}.get)
    deployment = SimpleNamespace(
        config=SimpleNamespace(joysticks={"left": joystick}, buses=buses, gateway=gateway),
        joysticks={"left": SimpleNamespace(config=joystick)},
    )
    bound = SimpleNamespace(config=axis, valve_message=of)
    assert _valve_key(bound, deployment) == ("b", can_id, True)


def test_the_header_of_e2e_is_no_start_value(machine: Machine) -> None:
    machine.in_dbc("BO_ 512 SlewCommand: 2", "BO_ 512 SlewCommand: 4")
    machine.in_dbc("Velocity : 0|8@1-", "Velocity : 24|8@1-")
    machine.in_dbc(
        'AliveCounter : 8|8@1+ (1,0) [0|255] "" VALVES', 'Crc : 0|8@1+ (1,0) [0|255] "" V'
    )
    machine.in_yaml(
        "alive_counter: AliveCounter }\n    status: { bus: crane, message: SlewStatus",
        "e2e: { profile: p22, data_ids: [1, 2, 3, 4, 5, 6, 7, 8, 9, 10, 11, 12, 13, 14, 15, 16] } }"
        "\n    status: { bus: crane, message: SlewStatus",
    )
    valve = record_of(machine.load()).valves["crane", 512, False]
    assert valve.protection.counts == 16
    assert valve.ours == 0xFF00FFFF
    assert valve.fixed == 0x00FF0000
