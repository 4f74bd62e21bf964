"""The record of a machine, number by number: what its file says, in the units of the gate."""

import math
from dataclasses import replace
from types import SimpleNamespace
from typing import Any

import pytest

from canshaper.config.schema import Command, Valve
from canshaper.gate.build import _forwarded, _group, record_of
from canshaper.gate.checks import Checksum
from canshaper.gate.fields import Field
from canshaper.gate.signals import Scale, bits_of, command_of, field_of, rest_of
from canshaper.machine.deployment import Deployment
from tests.faults import shipped
from tests.gate.bench import limited, load
from tests.gate.test_decoder import message
from tests.rigs.files import Machine, read


def changed(deployment: Deployment, axis: str, **config: Any) -> Deployment:
    """The deployment with other sections of an axis."""
    bound = deployment.axes[axis]
    other = replace(bound, config=bound.config.model_copy(update=config))
    return replace(deployment, axes={**deployment.axes, axis: other})


def test_a_group_has_a_destination_below_pf_240() -> None:
    assert [_group(can_id) for can_id in (0x0CEF2180, 0x18F02180)] == [0x03FF0000, 0x03FFFF00]


def test_messages() -> None:
    deployment = load("ecu-forwarder")
    messages = record_of(deployment).messages
    assert (messages["left"].page, messages["left"].alone) == ((Field(32, 15), 1), False)
    assert {one.own for one in messages.values()} == {-1}
    left = deployment.joysticks["left"]
    assert left.chosen is not None
    alone = replace(left, chosen=left.chosen._replace(alone=True))
    joysticks = {**deployment.joysticks, "left": alone}
    assert record_of(replace(deployment, joysticks=joysticks)).messages["left"].alone
    remote = record_of(load("remote-forwarder")).messages
    assert [*remote] == [one.name for one in remote.values()]
    assert {(len(one.ids), one.own) for one in remote.values()} == {(8, 156)}


@pytest.mark.parametrize(("bits", "most"), [(2, 2), (8, 3)])
def test_a_short_counter_jumps_by_less(machine: Machine, bits: int, most: int) -> None:
    machine.in_dbc("AliveCounter : 56|8@1+", f"AliveCounter : 56|{bits}@1+")
    assert record_of(machine.load()).messages["left"].most_step == most


def test_switches() -> None:
    joysticks = record_of(load("ecu-forwarder")).joysticks
    for name, one in joysticks.items():
        assert one.pressed.message == "left"
        assert one.pressed.only_zero is (name == "left")  # in its own frame an error stops shaped
        assert [(other.on, other.only_zero) for other in one.others] == [(1, False), (3, False)]
        assert one.stuck_ns == 20_000_000_000


def test_speeds_and_ways() -> None:
    deployment = load("forwarder-sensor")
    sway = deployment.axes["near_far"].config.sway
    assert sway is not None
    sway = sway.model_copy(update={"full_speed_m_s": 2.0})
    one = record_of(changed(deployment, "near_far", sway=sway)).axes
    speeds = {name: (axis.full_m_s, axis.tip_m_s) for name, axis in one.items()}
    assert speeds == {"slew": (1.5, 4.8), "near_far": (2.0, 0.0), "lift": (1.0, 0.0)}
    assert (one["near_far"].path_m, one["near_far"].path) == (0.6, 0.3)  # it damps: as far again
    assert (one["slew"].path, one["lift"].run_on) == (0.0, math.inf)
    short = limited(deployment, "lift", stop_s=0.005)
    assert record_of(short).axes["lift"].stop == 1


def test_numbers_that_may_be_set() -> None:
    ranges = record_of(read(shipped.shipped("forwarder").adjustable)).axes["slew"].ranges
    assert ranges.keys() == {"limits.rise_per_s", "filter.a1", "filter.a2"}
    assert ranges["limits.rise_per_s"] == (2.0, 5.0)


def test_bits_of_a_valve(machine: Machine) -> None:
    machine.in_dbc("BO_ 512 SlewCommand: 2", "BO_ 512 SlewCommand: 4")
    machine.in_dbc("Velocity : 0|8@1-", "Velocity : 16|8@1-")
    machine.in_dbc("AliveCounter : 8|8@1+", "Check : 24|8@1+")
    machine.in_yaml(
        "alive_counter: AliveCounter }\n    status: { bus: crane, message: SlewStatus",
        "checksum: { signal: Check, kind: sum_id } }\n"
        "    status: { bus: crane, message: SlewStatus",
    )
    valve = record_of(machine.load()).valves["crane", 512, False]
    assert (valve.ours, valve.fixed, valve.fixed_value) == (0xFFFF0000, 0xFFFF, 0)
    assert (valve.group, valve.protection.check) == (0, Checksum("sum", 3, plus=2))


def test_bits_that_no_signal_of_j1939_has(machine: Machine) -> None:
    machine.become("j1939-forwarder.yaml", "j1939-bjm-avc.dbc")
    machine.in_dbc("PortFlow : 0|8@1+", "PortFlow : 56|8@1+")
    (valve, *_) = record_of(machine.load()).valves.values()
    assert valve.fixed_value & 0xFFFF == 0xFFFF


def test_bits_of_a_gateway() -> None:
    deployment = load("gateway-forwarder")
    left, right = record_of(deployment).valves.values()
    assert (left.fixed, left.group, left.ours) == (0, 0, 0xFF000000FFFFFFFF)
    assert {field.shift: {*values} for field, values in right.own} == {
        16: {0, 32767}, 32: {0, 1}, 34: {0}, 36: {0}
    }  # fmt: skip
    rotate = dict.fromkeys(("neutral", "negative", "positive"), "Rotate")
    for keys in ({"flags": rotate}, {"negative": "Rotate"}):
        command = Command(joystick="right", signal="Lift", **keys)  # type: ignore[arg-type]
        other = record_of(changed(deployment, "lift", command=command))
        assert other.valves["machine", 273, False].ours == 0xFF000000FFFFFFFF
        assert other.axes["lift"].command.codes or other.axes["lift"].command.back
    bound = deployment.axes["lift"].config
    elsewhere = SimpleNamespace(
        command=bound.command, valve=SimpleNamespace(bus="machine", message="LiftCommand")
    )
    assert [_forwarded(one, deployment) for one in (bound, elsewhere)] == [True, False]


def test_what_may_leave_beside_a_status_of_11_bits_where_we_are_a_node_of_j1939() -> None:
    deployment = load("forwarder")
    bus = deployment.config.buses["crane"]
    bus = bus.model_copy(update={"j1939": SimpleNamespace(address=0x9C), "canopen": None})
    config = deployment.config.model_copy(update={"buses": {"crane": bus}})
    others = record_of(replace(deployment, config=config)).others
    ours = {0x18EEFF9C, 0x18EEFFFE, 0x18E8FF9C, 0x18FECA9C, 0x1CECFF9C, 0x1CEBFF9C}
    longest = {(can_id, extended): max(one) for (_, can_id, extended), (one, _) in others.items()}
    assert longest == {
        **{(can_id, False): 64 for can_id in (0x300, 0x301, 0x302, 0x310, 0x311)},
        **{(can_id, True): 8 for can_id in ours},
        (0x18EAFFFE, True): 3,
    }


@pytest.mark.parametrize(
    ("signal", "rest"),
    [
        ("8@1- (1,0) [-100|100]", {0}),
        ("8@1+ (0.3,-1) [-1|10]", {3}),
        ("8@1+ (1,0) [0|100]", set()),
        ("8@1- (1,0) [-100|0]", set()),
        ("32@1- (0.5,0.25) [-1|1]", {-0.5}),
    ],
)
def test_where_a_velocity_rests(signal: str, rest: set[float]) -> None:
    one = message(f"Signal : 0|{signal}", floats="Signal" if signal.startswith("32") else "")
    assert rest_of(one.signals[0]) == rest


def test_bits_of_both_byte_orders() -> None:
    one = message("Intel : 4|12@1+ (1,0) [0|0]", "Motorola : 39|16@0+ (1,0) [0|0]")
    intel, motorola = (field_of(one, name) for name in ("Intel", "Motorola"))
    assert [bits_of(intel, 8), bits_of(intel, 8, 1)] == [0xFFF0, 0x10]
    assert [bits_of(motorola, 8), bits_of(motorola, 8, 1)] == [0xFFFF << 32, 1 << 40]


def test_a_command_that_the_file_corrects() -> None:
    one = message("Speed : 0|8@1+ (1,-100) [-100|100]", "Side : 8|8@1+ (1,0) [0|255]")
    of = Scale(one.signals[0], Command(joystick="a", signal="Speed", invert=True), magnitude=False)
    assert (of.scale, of.offset) == (-1, 100)
    keys: dict[str, Any] = {"bus": "crane", "message": "Message", "timeout_ms": 100}
    sides = {"signal": "Side", "neutral": 3, "positive": 5, "negative": 7}
    command = command_of(one, Valve(**keys, signal="Speed", direction=sides), None, one)
    assert command.signs == {(3,): 0, (5,): 1, (7,): -1}
    rocker = Command(joystick="a", signal="Speed", negative="Side", full=50)
    back = command_of(one, Valve(**keys, signal="Speed"), rocker, one).back
    assert back is not None
    assert back.full == 50
