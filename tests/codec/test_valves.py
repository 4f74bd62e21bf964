"""Valve messages: direction by codes, the same in two resolutions."""

from typing import Any

import pytest
from hypothesis import given
from hypothesis import strategies as st

from canshaper.checksums.kinds import Checksum
from canshaper.codec.message import Protection, SentMessage
from canshaper.codec.velocity import DirectionCodec, ValveCodec
from tests.codec.valve_machine import CODES, DBC, network, with_valves
from tests.rigs.files import Machine
from tests.rigs.sent import command_frame, command_raw

STATE = DirectionCodec("State", (0, 1, 2))


def avc(signal: str, *also: str) -> ValveCodec:
    message = network.get_message_by_name("AVC0")
    signals = {s.name: s for s in message.signals}
    shared = SentMessage("b", message)
    return ValveCodec(shared, signals[signal], STATE, [signals[name] for name in also])


def test_the_example_of_a_maker() -> None:
    """60 % out of port B: 96 00 01 in the fields that matter, all unused bits 1."""
    codec = avc("PortFlow")
    frame = command_frame(codec, 150)
    assert frame.data.hex() == "96ff31ffffffffff"
    assert (frame.can_id, frame.extended) == (0x0CFE30FE, True)


@pytest.mark.parametrize(
    ("steps", "data"),
    [(0, "00ff300000ffffff"), (64_000, "faff3100faffffff"), (-6_400, "19ff320019ffffff")],
)
def test_both_resolutions_report_the_same(steps: int, data: str) -> None:
    codec = avc("ExtFlow", "PortFlow")
    assert codec.steps == 64_000
    assert command_frame(codec, steps).data.hex() == data


def test_both_resolutions_of_a_signal_with_a_sign() -> None:
    message = network.get_message_by_name("Block")
    first, second = (message.get_signal_by_name(name) for name in ("First", "Second"))
    codec = ValveCodec(SentMessage("b", message), first, also=[second])
    assert command_frame(codec, -25).data[:2] == bytes((256 - 25, 256 - 25))


def test_the_same_in_a_signal_that_falls() -> None:
    message = network.get_message_by_name("Block")
    first, falling = (message.get_signal_by_name(name) for name in ("First", "Falling"))
    codec = ValveCodec(SentMessage("b", message), first, also=[falling])
    for steps in (-125, -1, 0, 25, 125):
        values: Any = message.decode(command_frame(codec, steps).data)
        assert values["First"] == pytest.approx(0.8 * steps)
        assert values["Falling"] == pytest.approx(0.8 * steps, abs=0.5)


@given(st.integers(-64_000, 64_000))
def test_what_is_put_is_read_by_cantools(steps: int) -> None:
    codec = avc("ExtFlow", "PortFlow")
    data = command_frame(codec, steps).data
    raw: Any = network.decode_message("AVC0", data, decode_choices=False, scaling=False)
    assert codec.read(raw) == steps
    flow = 250 * abs(steps) / 64_000
    assert abs(raw["PortFlow"] - flow) <= 0.5
    assert raw["State"] == (1 if steps > 0 else 2 if steps < 0 else 0)


def test_neutral_is_what_it_holds_before_anything_is_put() -> None:
    assert avc("ExtFlow", "PortFlow").message.sender().frame().data.hex() == "00ff300000ffffff"


def test_the_smallest_commands_have_a_direction() -> None:
    codec = avc("PortFlow")
    for steps, state in ((1, 1), (-1, 2), (0, 0)):
        assert command_raw(codec, steps)["State"] == state


def test_in_neutral_no_flow_is_a_command() -> None:
    assert avc("PortFlow").read({"PortFlow": 10, "State": 0}) == 0


def test_what_takes_the_place_of_a_frame_has_its_count() -> None:
    block = network.get_message_by_name("Block")
    for protection in (Protection("Count", 16), Protection("Count", 16, Checksum("xor", 6))):
        message = SentMessage("b", block, protection=protection).sender()
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
        command_raw(codec, -251)


# -- bound to a deployment -------------------------------------------------------------------------


def test_a_valve_with_a_direction_is_bound(machine: Machine) -> None:
    valve = f"message: AVC0, signal: ExtFlow, also: [PortFlow], timeout_ms: 200, {CODES}"
    axis = with_valves(machine, ("Slew", valve)).load().axes["slew"]
    assert axis.valve.steps == 64_000
    assert axis.valve.message.key == ("crane", 0x0CFE309C, True)


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
            f"signal: PortFlow, {CODES.replace('neutral: 0', 'neutral: 16')}",
            "axes.slew.valve.direction.neutral: expected up to 15, of 4 bits of State, got 16",
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


def problem_of(machine: Machine, old: str, new: str) -> str:
    """The one problem where a piece of the DBC file of the valves is another one."""
    broken = with_valves(
        machine, ("Slew", f"message: AVC0, signal: PortFlow, timeout_ms: 200, {CODES}")
    )
    (machine.directory / "valves.dbc").write_text(DBC.replace(old, new), encoding="cp1252")
    (problem,) = broken.problems()
    return problem


def test_the_largest_code_of_the_bits_is_a_direction(machine: Machine) -> None:
    codes = CODES.replace("negative: 2", "negative: 15")
    valve = f"message: AVC0, signal: PortFlow, timeout_ms: 200, {codes}"
    with_valves(machine, ("Slew", valve))
    named = DBC.replace('15 "DontCare"', '14 "DontCare"')
    (machine.directory / "valves.dbc").write_text(named, encoding="cp1252")
    codec = machine.load().axes["slew"].valve
    assert command_raw(codec, -10)["State"] == 15


def test_a_direction_with_a_sign_is_reported(machine: Machine) -> None:
    problem = problem_of(machine, "State : 16|4@1+", "State : 16|4@1-")
    assert problem.partition(": ")[2] == (
        "axes.slew.valve.direction.signal: State: expected an unsigned integer signal, got a signed"
        " one"
    )
