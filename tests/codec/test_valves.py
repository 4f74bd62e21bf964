"""Valve messages: direction by codes, the same in two resolutions, axes that share a message."""

from typing import Any

import cantools
import pytest
from hypothesis import given
from hypothesis import strategies as st

from canshaper.checksums.kinds import Checksum
from canshaper.codec.codecs import Sender
from canshaper.codec.frame import Frame
from canshaper.codec.protection import Protection
from canshaper.codec.valve import DirectionCodec, ValveCodec, ValveMessage
from canshaper.controller.controller import Controller
from tests.rigs.files import Machine

# ISO 11783-7 auxiliary valve command 0; the reserved bits and bytes 6 to 8 have no signals.
DBC = """VERSION ""

BU_: SHAPER VALVE

BO_ 2365468926 AVC0: 8 SHAPER
 SG_ PortFlow : 0|8@1+ (0.4,0) [0|100] "%" VALVE
 SG_ ResolutionMode : 8|2@1+ (1,0) [0|3] "" VALVE
 SG_ State : 16|4@1+ (1,0) [0|15] "" VALVE
 SG_ FailSafe : 22|2@1+ (1,0) [0|3] "" VALVE
 SG_ ExtFlow : 24|16@1+ (0.0015625,0) [0|100] "%" VALVE

BO_ 1280 Block: 8 SHAPER
 SG_ First : 0|8@1- (0.8,0) [-100|100] "%" VALVE
 SG_ Second : 15|8@0- (0.8,0) [-100|100] "%" VALVE
 SG_ Third : 16|8@1+ (0.4,0) [0|100] "%" VALVE
 SG_ ThirdState : 24|2@1+ (1,0) [0|3] "" VALVE
 SG_ Falling : 32|8@1- (-1,2) [-100|100] "%" VALVE
 SG_ Count : 60|4@1+ (1,0) [0|15] "" VALVE

BA_DEF_ BO_ "GenMsgCycleTime" INT 0 65535;
BA_DEF_DEF_ "GenMsgCycleTime" 0;
BA_DEF_ SG_ "GenSigStartValue" FLOAT -100000 100000;
BA_DEF_DEF_ "GenSigStartValue" 0;
BA_DEF_ BO_ "VFrameFormat" ENUM "StandardCAN","ExtendedCAN","reserved","J1939PG";
BA_DEF_DEF_ "VFrameFormat" "StandardCAN";
BA_ "GenMsgCycleTime" BO_ 2365468926 20;
BA_ "GenMsgCycleTime" BO_ 1280 20;
BA_ "VFrameFormat" BO_ 2365468926 3;
BA_ "GenSigStartValue" SG_ 2365468926 FailSafe 0;
VAL_ 2365468926 State 0 "Block" 1 "Extend" 2 "Retract" 3 "Float" 15 "DontCare" ;
"""
network: Any = cantools.database.load_string(DBC, "dbc")
STATE = DirectionCodec("State", (0, 1, 2))


def avc(signal: str, *also: str) -> ValveCodec:
    message = network.get_message_by_name("AVC0")
    signals = {s.name: s for s in message.signals}
    shared = ValveMessage(Sender("b", message))
    return ValveCodec(shared, signals[signal], STATE, [signals[name] for name in also])


def test_the_example_of_a_maker() -> None:
    """60 % out of port B: 96 00 01 in the fields that matter, all unused bits 1."""
    codec = avc("PortFlow")
    codec.put(150)
    frame = codec.message.frame()
    assert frame.data.hex() == "96ff31ffffffffff"
    assert (frame.can_id, frame.extended) == (0x0CFE30FE, True)


@pytest.mark.parametrize(
    ("steps", "data"),
    [(0, "00ff300000ffffff"), (64_000, "faff3100faffffff"), (-6_400, "19ff320019ffffff")],
)
def test_both_resolutions_report_the_same(steps: int, data: str) -> None:
    codec = avc("ExtFlow", "PortFlow")
    assert codec.steps == 64_000
    codec.put(steps)
    assert codec.message.frame().data.hex() == data


def test_both_resolutions_of_a_signal_with_a_sign() -> None:
    message = network.get_message_by_name("Block")
    first, second = (message.get_signal_by_name(name) for name in ("First", "Second"))
    codec = ValveCodec(ValveMessage(Sender("b", message)), first, also=[second])
    codec.put(-25)
    assert codec.message.frame().data[:2] == bytes((256 - 25, 256 - 25))


def test_the_same_in_a_signal_that_falls() -> None:
    message = network.get_message_by_name("Block")
    first, falling = (message.get_signal_by_name(name) for name in ("First", "Falling"))
    codec = ValveCodec(ValveMessage(Sender("b", message)), first, also=[falling])
    for steps in (-125, -1, 0, 25, 125):
        codec.put(steps)
        values: Any = message.decode(codec.message.frame().data)
        assert values["First"] == pytest.approx(0.8 * steps)
        assert values["Falling"] == pytest.approx(0.8 * steps, abs=0.5)


@given(st.integers(-64_000, 64_000))
def test_what_is_put_is_read_by_cantools(steps: int) -> None:
    codec = avc("ExtFlow", "PortFlow")
    codec.put(steps)
    raw: Any = network.decode_message(
        "AVC0", codec.message.frame().data, decode_choices=False, scaling=False
    )
    assert codec.read(raw) == steps
    flow = 250 * abs(steps) / 64_000
    assert abs(raw["PortFlow"] - flow) <= 0.5
    assert raw["State"] == (1 if steps > 0 else 2 if steps < 0 else 0)


def test_neutral_is_what_it_holds_before_anything_is_put() -> None:
    assert avc("ExtFlow", "PortFlow").message.frame().data.hex() == "00ff300000ffffff"


def test_the_smallest_commands_have_a_direction() -> None:
    codec = avc("PortFlow")
    for steps, state in ((1, 1), (-1, 2), (0, 0)):
        codec.put(steps)
        assert codec.message.raw["State"] == state


def test_in_neutral_no_flow_is_a_command() -> None:
    assert avc("PortFlow").read({"PortFlow": 10, "State": 0}) == 0


def test_what_takes_the_place_of_a_frame_has_its_count() -> None:
    block = network.get_message_by_name("Block")
    for protection in (Protection("Count", 16), Protection("Count", 16, Checksum("xor", 6))):
        message = ValveMessage(Sender("b", block, protection=protection))
        first = message.frame()
        message.raw["First"] = 5
        second = message.instead(first)
        assert first.data[7] >> 4 == second.data[7] >> 4 == 1
        assert second.data[0] == 5
        assert message.frame().data[7] >> 4 == 2
        # two frames of one count differ in the command, and in a checksum where there is one
        assert (first.data[6] == second.data[6]) is (protection.check is None)


@pytest.mark.parametrize("state", [3, 4, 14, 15])
def test_other_states_are_no_command(state: int) -> None:
    assert avc("PortFlow").read({"PortFlow": 10, "State": state}) is None


def test_beyond_full_flow_is_no_command() -> None:
    codec = avc("PortFlow")
    assert codec.read({"PortFlow": 251, "State": 1}) is None
    with pytest.raises(ValueError, match=r"expected up to \+-250 steps, got -251"):
        codec.put(-251)


# -- bound to a deployment -------------------------------------------------------------------------

SLEW = "{ bus: crane, message: SlewCommand, signal: Velocity, timeout_ms: 200,"
AVC = "{ bus: crane, message: AVC0, signal: PortFlow, timeout_ms: 200, "
CODES = "direction: { signal: State, neutral: 0, positive: 1, negative: 2 }"
ALIVE = " alive_counter: AliveCounter"
NODE = "j1939: { address: 0x9C, name: { identity_number: 1, manufacturer_code: 1 } }"


def with_valves(machine: Machine, *valves: tuple[str, str]) -> Machine:
    """The shipped machine with a second DBC file and other valves of some axes."""
    (machine.directory / "valves.dbc").write_text(DBC, encoding="cp1252")
    machine.in_yaml("[machine.dbc]", "[machine.dbc, valves.dbc]")
    for axis, valve in valves:
        machine.in_yaml(f"message: {axis}Command, signal: Velocity, timeout_ms: 200,{ALIVE}", valve)
    if "AVC0" in machine.yaml:
        machine.in_yaml("bitrate: 250000", f"bitrate: 250000, {NODE}")
    return machine


def test_a_valve_with_a_direction_is_bound(machine: Machine) -> None:
    valve = f"message: AVC0, signal: ExtFlow, also: [PortFlow], timeout_ms: 200, {CODES}"
    axis = with_valves(machine, ("Slew", valve)).load().axes["slew"]
    assert axis.valve.steps == 64_000
    assert axis.valve.message.sender.key == ("crane", 0x0CFE309C, True)


@pytest.mark.parametrize(
    ("valve", "says"),
    [
        ("signal: PortFlow", "AVC0: PortFlow: expected a symmetrical range, got [0|100]"),
        ("signal: PortFlow", "got [0|100]; with a direction it is right"),
        (
            f"signal: PortFlow, {CODES.replace('positive: 1', 'positive: 2')}",
            "expected three different codes, got 0, 2, 2",
        ),
        (
            f"signal: PortFlow, {CODES.replace('positive: 1', 'positive: 3')}",
            "axes.slew.valve.direction.positive: expected no code of floating, which drops the"
            " load, got 3, in the DBC Float",
        ),
        (
            f"signal: PortFlow, {CODES.replace('negative: 2', 'negative: 16')}",
            "axes.slew.valve.direction.negative: expected up to 15, of 4 bits of State, got 16",
        ),
        (
            f"signal: PortFlow, {CODES.replace('State', 'Stat')}",
            "axes.slew.valve.direction.signal: expected a signal of AVC0, got 'Stat'; there are"
            " PortFlow",
        ),
        (
            f"signal: PortFlow, {CODES.replace('State', 'PortFlow')}",
            "direction.signal: expected a free signal, got 'PortFlow', which is"
            " axes.slew.valve.signal already",
        ),
        (
            f"signal: PortFlow, also: [PortFlow], {CODES}",
            "valve.also.0: expected a free signal, got 'PortFlow'",
        ),
        (
            f"signal: PortFlow, also: [Flow], {CODES}",
            "also.0: expected a signal of AVC0, got 'Flow'; there are",
        ),
    ],
)
def test_what_does_not_fit_is_reported(machine: Machine, valve: str, says: str) -> None:
    problems = with_valves(machine, ("Slew", f"message: AVC0, timeout_ms: 200, {valve}")).problems()
    assert any(says in problem for problem in problems), problems


def test_a_flow_that_its_bits_do_not_reach_is_reported_with_its_line(machine: Machine) -> None:
    broken = with_valves(
        machine, ("Slew", f"message: AVC0, signal: PortFlow, timeout_ms: 200, {CODES}")
    )
    text = DBC.replace("0|8@1+ (0.4,0)", "0|8@1+ (0.1,0)")
    (machine.directory / "valves.dbc").write_text(text, encoding="cp1252")
    (problem,) = broken.problems()
    assert problem == (
        "valves.dbc:5: AVC0: PortFlow cannot reach its range [0|100] with 8 bits at 0.1 per bit"
    )


# -- axes that share a message ---------------------------------------------------------------------

BLOCK = "message: Block, timeout_ms: 200, alive_counter: Count"
THREE = (
    ("Slew", f"{BLOCK}, signal: First"),
    ("NearFar", f"{BLOCK}, signal: Second"),
    (
        "Lift",
        f"{BLOCK}, signal: Third,"
        " direction: { signal: ThirdState, neutral: 0, positive: 1, negative: 2 }",
    ),
)


def test_three_axes_in_one_message(machine: Machine) -> None:
    """One frame a tick with the commands of all; its counter counts frames, not axes."""
    deployment = with_valves(machine, *THREE).load()
    controller = Controller(deployment)
    joystick: Any = {m.name: m for m in deployment.messages.all()}
    moved: list[Any] = []
    for n in range(60):
        for side, command in (
            ("Left", {"Slew": 900, "NearFar": -400}),
            ("Right", {"Lift": -600}),
        ):
            message = joystick[f"Joystick{side}"]
            raw = dict.fromkeys((s.name for s in message.signals), 0)
            raw |= {"Enable": 1, "AliveCounter": n % 256, **(command if n > 4 else {})}
            data = message.encode(raw, scaling=False)
            controller.receive(Frame("crane", message.frame_id, False, data), n * 20_000_000)
        sent = [f for f in controller.tick(n * 20_000_000) if f.can_id == 0x500]
        assert len(sent) == 1
        moved.append(network.decode_message("Block", sent[0].data, scaling=False))
    assert [m["Count"] for m in moved] == [(n + 1) % 16 for n in range(60)]
    last = moved[-1]
    assert last["First"] > 40
    assert last["Second"] < -20
    assert (last["Third"], last["ThirdState"]) == (155, 2)  # 60 %, and 5 % for the deadband
    (neutral,) = controller.neutral_frames()
    raw = network.decode_message("Block", neutral.data, scaling=False)
    assert [raw[s] for s in ("First", "Second", "Third", "ThirdState")] == [0, 0, 0, 0]


def test_a_frame_that_is_not_sent_trips_all_of_its_axes(machine: Machine) -> None:
    deployment = with_valves(machine, *THREE).load()
    controller = Controller(deployment)
    (frame,) = (f for f in controller.tick(0) if f.can_id == 0x500)
    controller.receive(frame, 0)
    list(controller.tick(20_000_000))
    assert {r.axis.reason.name for r in controller.axes.values()} == {"SECOND_SENDER"}


@pytest.mark.parametrize(
    ("old", "new", "says"),
    [
        (
            "signal: Second",
            "signal: First",
            "expected a free signal, got 'First', which is axes.slew.valve.signal already",
        ),
        (
            "signal: ThirdState",
            "signal: Count",
            "expected a free signal, got 'Count', which is alive_counter already",
        ),
        (
            "signal: Second",
            "signal: Second, alive_counter: null",
            "",
        ),
    ],
)
def test_no_signal_serves_two(machine: Machine, old: str, new: str, says: str) -> None:
    with_valves(machine, *THREE)
    if not says:
        machine.in_yaml(f"alive_counter: Count, {old}", old)
        says = "alive_counter: expected the same as the other axes of Block, got another"
    else:
        machine.in_yaml(old, new)
    problems = machine.problems()
    assert any(says in problem for problem in problems), problems
