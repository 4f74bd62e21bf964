"""Corrections of the DBC in the file: scaling, cycle, value of the multiplexor."""

from collections.abc import Sequence

import pytest

from canshaper.controller.controller import Controller
from canshaper.gate.build import record_of
from canshaper.gate.fields import word_of
from canshaper.shaping.states import Reason
from tests.rigs.files import Machine
from tests.rigs.sent import command_frame

SLEW = "Slew : 0|16@1- (0.1,0) [-100|100]"
VALVE = "Velocity : 0|8@1- (0.8,0) [-100|100]"
COMMAND = "command: { joystick: left, signal: Slew,"
OUT_OF_RANGE = Reason.JOYSTICK_OUT_OF_RANGE


def commands(machine: Machine, raws: Sequence[int]) -> list[float | Reason]:
    """Read the demand of slew from raw values of a joystick; the gate reads the same."""
    deployment = machine.load()
    joystick = deployment.joysticks["left"]
    stick = record_of(deployment).axes["slew"].stick
    result = []
    for raw in raws:
        data = (raw & 0xFFFF).to_bytes(2, "little") + bytes(6)
        command = joystick.decode(data)[1]["Slew"]
        demand = None if isinstance(command, Reason) else pytest.approx(command, abs=1e-12)
        assert stick.demand(word_of(data)) == demand
        result.append(command)
    return result


@pytest.mark.parametrize(
    ("dbc", "yaml", "raws", "expected"),
    [
        # The DBC has no range, or one that is wrong.
        ("Slew : 0|16@1- (0.1,0) [0|0]", "full: 100,", (1000, -500), (1.0, -0.5)),
        ("Slew : 0|16@1- (1,0) [-9|7]", "full: 200,", (200, -100, 201), (1.0, -0.5, OUT_OF_RANGE)),
        # Unsigned with offset: 11 bits around 1024, or as the DBC has its range.
        (
            "Slew : 0|11@1+ (1,0) [0|0]",
            "full: 1023, zero: 1024,",
            (1024, 2047, 1, 0, 1536),
            (0.0, 1.0, -1.0, -1.0, 512 / 1023),
        ),
        ("Slew : 0|8@1+ (1,0) [0|250]", "zero: 125,", (125, 250, 0, 251), (0, 1, -1, OUT_OF_RANGE)),
        ("Slew : 0|8@1+ (0.5,-5) [0|0]", "full: 50, zero: 45,", (100, 0, 200), (0, -1, 1)),
        # The other way round, zero and full in the unit of the DBC as before.
        (SLEW, "invert: true,", (1000, -500, 0), (-1.0, 0.5, 0.0)),
        (
            "Slew : 0|8@1+ (1,0) [0|250]",
            "full: 100, zero: 125, invert: true,",
            (225, 100, 125),
            (-1.0, 0.25, 0.0),
        ),
        # Two's complement in the DBC: its farther end is full too.
        ("Slew : 0|8@1- (1,0) [-128|127]", "", (127, -127, -128, 0), (1.0, -1.0, -1.0, 0.0)),
        ("Slew : 0|8@1+ (1,-127) [-127|128]", "", (255, 254, 0, 127), (1.0, 1.0, -1.0, 0.0)),
        (
            "Slew : 0|16@1- (1,0) [-128|127]",
            "",
            (-128, -129, 128),
            (-1.0, OUT_OF_RANGE, OUT_OF_RANGE),
        ),
    ],
)
def test_a_joystick(
    machine: Machine, dbc: str, yaml: str, raws: list[int], expected: list[float | Reason]
) -> None:
    machine.in_dbc(SLEW, dbc)
    machine.in_yaml(COMMAND, f"{COMMAND} {yaml}")
    assert (
        commands(machine, raws) == pytest.approx(list(expected))
        if not any(isinstance(one, Reason) for one in expected)
        else commands(machine, raws) == list(expected)
    )


@pytest.mark.parametrize(
    ("dbc", "yaml", "steps", "raws"),
    [
        ("Velocity : 0|8@1- (1,0) [0|0]", "full: 100,", 100, {100: 100, -100: 0x9C, 0: 0}),
        (
            "Velocity : 0|8@1+ (1,0) [0|0]",
            "full: 100, zero: 128,",
            100,
            {100: 228, -100: 28, 0: 128},
        ),
        ("Velocity : 0|8@1- (0.8,0) [-100|100]", "invert: true,", 125, {125: 0x83, -125: 125}),
        ("Velocity : 0|8@1- (1,0) [-128|127]", "", 127, {127: 127, -127: 0x81}),
    ],
)
def test_a_valve(machine: Machine, dbc: str, yaml: str, steps: int, raws: dict[int, int]) -> None:
    machine.in_dbc(VALVE, dbc)
    machine.in_yaml("message: SlewCommand,", f"message: SlewCommand, {yaml}")
    deployment = machine.load()
    valve = deployment.axes["slew"].valve
    assert valve.steps == steps
    command = record_of(deployment).axes["slew"].command
    assert command.size.full == steps
    for step, raw in raws.items():
        data = command_frame(valve, step).data
        assert data[0] == raw
        assert command.steps(word_of(data)) == step


@pytest.mark.parametrize("low", ["-0.1", "-1"])
def test_a_range_that_ends_at_zero_is_none(machine: Machine, low: str) -> None:
    """One step of two's complement more, and nothing on the other side: full speed would be 0."""
    machine.in_dbc(SLEW, f"Slew : 0|16@1- ({low[1:]},0) [{low}|0]")
    assert f"Slew: expected a symmetrical range, got [{low}|0]" in machine.problems()[0]


@pytest.mark.parametrize(
    ("of_slew", "of_near_far", "key"),
    [
        ("invert: true,", "", "invert"),
        ("", "invert: true,", "invert"),
        ("full: 100,", "full: 50,", "full"),
        ("zero: 1, full: 100,", "full: 100,", "zero"),
    ],
)
def test_a_signal_means_the_same_to_every_axis(
    machine: Machine, of_slew: str, of_near_far: str, key: str
) -> None:
    """Else that of the axis named last would move both."""
    machine.in_yaml(COMMAND, f"{COMMAND} {of_slew}")
    machine.in_yaml(
        "joystick: left, signal: NearFar,", f"joystick: left, signal: Slew, {of_near_far}"
    )
    (problem,) = machine.problems()
    assert problem.endswith(
        f"axes.near_far.command.{key}: expected the same as axes.slew.command, which reads Slew"
        " too, got another"
    )


def test_axes_that_agree_share_a_signal(machine: Machine) -> None:
    machine.in_yaml(COMMAND, f"{COMMAND} invert: true,")
    machine.in_yaml("signal: NearFar,", "signal: Slew, invert: true,")
    assert machine.load().joysticks["left"].decode(b"\xf4\1" + bytes(6))[1] == {"Slew": -0.5}


def test_neutral_of_a_valve_is_its_zero(machine: Machine) -> None:
    machine.in_dbc(VALVE, "Velocity : 0|8@1+ (1,0) [0|0]")
    machine.in_yaml("message: SlewCommand,", "message: SlewCommand, full: 100, zero: 128,")
    (frame,) = (f for f in Controller(machine.load()).neutral_frames() if f.can_id == 512)
    assert frame.data[0] == 128


def test_a_cycle(machine: Machine) -> None:
    machine.in_dbc('BA_ "GenMsgCycleTime" BO_ 272 20;', "")
    machine.in_dbc('BA_ "GenMsgCycleTime" BO_ 512 20;', 'BA_ "GenMsgCycleTime" BO_ 512 7;')
    machine.in_yaml("message: JoystickLeft", "message: JoystickLeft\n    cycle_ms: 30")
    machine.in_yaml("message: SlewCommand,", "message: SlewCommand, cycle_ms: 40,")
    deployment = machine.load()
    assert deployment.joysticks["left"].message.cycle_time == 30
    assert deployment.axes["slew"].period_ticks == 2
    machine.in_yaml("timeout_ms: 100", "timeout_ms: 50")
    assert "expected 60 ms or more, twice the cycle" in machine.problems()[0]


@pytest.mark.parametrize(
    ("yaml", "says"),
    [
        ("full: 101,", "Velocity cannot reach its range [-101.12|101] with 8 bits at 0.79"),
        ("full: 4,", "Velocity has fewer than 10 steps to full command"),
        ("zero: 0.8,", "expected a symmetrical range, got [-100.8|99.2]"),
        ("full: 0,", "full: expected"),
        ("invert: 1,", "invert: expected"),
        ("invert: true, also: [AliveCounter],", "invert: expected none with also"),
        (
            "multiplexor: 1,",
            "multiplexor: expected a message with one multiplexor, got SlewCommand",
        ),
    ],
)
def test_what_cannot_be(machine: Machine, yaml: str, says: str) -> None:
    if "101" in yaml:
        machine.in_dbc(VALVE, "Velocity : 0|8@1- (0.79,0) [0|0]")
    machine.in_yaml("message: SlewCommand,", f"message: SlewCommand, {yaml}")
    assert any(says in problem for problem in machine.problems()), machine.problems()


def test_a_valve_command_in_a_multiplexed_message(machine: Machine) -> None:
    machine.in_dbc("SlewCommand: 2", "SlewCommand: 3")
    machine.in_dbc(
        f" SG_ {VALVE}",
        ' SG_ Kind M : 16|8@1+ (1,0) [0|0] "" VALVES\n'
        ' SG_ Other m1 : 0|8@1+ (1,0) [0|0] "" VALVES\n'
        f" SG_ {VALVE.replace(' :', ' m7 :')}",
    )
    machine.in_yaml("message: SlewCommand,", "message: SlewCommand, multiplexor: 7,")
    valve = machine.load().axes["slew"].valve
    assert command_frame(valve, 100).data == bytes((100, 1, 7))


@pytest.mark.parametrize("key", ["multiplexor", "cycle_ms"])
def test_axes_of_one_message_say_the_same_of_it(machine: Machine, key: str) -> None:
    """Else what the second one says would count for nothing."""
    machine.in_dbc("SlewCommand: 2", "SlewCommand: 4")
    machine.in_dbc(
        f" SG_ {VALVE}",
        ' SG_ Kind M : 16|8@1+ (1,0) [0|0] "" VALVES\n'
        ' SG_ Other m1 : 0|8@1+ (1,0) [0|0] "" VALVES\n'
        ' SG_ Tip : 24|8@1- (0.8,0) [-100|100] "" VALVES\n'
        f" SG_ {VALVE.replace(' :', ' m7 :')}",
    )
    of_tip = {"multiplexor": "multiplexor: 1", "cycle_ms": "multiplexor: 7, cycle_ms: 40"}[key]
    machine.in_yaml("message: SlewCommand,", "message: SlewCommand, multiplexor: 7,")
    machine.in_yaml(
        "message: NearFarCommand, signal: Velocity,",
        f"message: SlewCommand, {of_tip}, signal: Tip,",
    )
    text = f"axes.near_far.valve.{key}: expected the same as the other axes of SlewCommand"
    assert any(text in problem for problem in machine.problems()), machine.problems()
