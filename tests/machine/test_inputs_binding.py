"""Protection of joysticks and emergency stop in a deployment: each problem with file and line."""

import pytest

from canshaper.checksums.kinds import CHECKSUMS, Checksum, ChecksumKind
from canshaper.codec.frame import FrameFault
from canshaper.codec.protection import UNPROTECTED, Protection
from canshaper.controller.controller import Controller
from tests.codec.checksum_reference import PLACES
from tests.rigs.files import Machine

COUNTER = "alive_counter: AliveCounter"
# Signals that the tests add to the left joystick, in bytes that it does not use.
SIGNALS = """ SG_ Check : 48|8@1+ (1,0) [0|255] "" SHAPER
 SG_ Half : 40|4@1+ (1,0) [0|15] "" SHAPER
 SG_ Count2 : 44|2@1+ (1,0) [0|3] "" SHAPER
 SG_ Count1 : 46|1@1+ (1,0) [0|1] "" SHAPER
"""
STOP_DBC = """BO_ 64 Stop: 8 JOYSTICKS
 SG_ Pressed : 0|2@1+ (1,0) [0|3] "" SHAPER
 SG_ Count : 8|4@1+ (1,0) [0|15] "" SHAPER
 SG_ Check : 16|8@1+ (1,0) [0|255] "" SHAPER
 SG_ Force : 32|32@1- (1,0) [0|1] "" SHAPER

"""
STOP = "emergency_stop: { bus: crane, message: Stop, signal: Pressed, timeout_ms: 100"


@pytest.fixture
def protected(machine: Machine) -> Machine:
    """The shipped machine with room for a checksum in the left joystick."""
    last = ' SG_ AliveCounter : 56|8@1+ (1,0) [0|255] "" SHAPER\n'
    machine.in_dbc(last, last + SIGNALS)
    return machine


@pytest.fixture
def stoppable(machine: Machine) -> Machine:
    """The shipped machine with the message of an emergency stop, not yet named."""
    machine.in_dbc("BO_ 512 SlewCommand", STOP_DBC + "BO_ 512 SlewCommand")
    cycle = 'BA_ "GenMsgCycleTime" BO_ 272 20;\n'
    machine.in_dbc(cycle, cycle + cycle.replace("272", "64"))
    machine.in_dbc("VAL_ 272 Slew 32766", "SIG_VALTYPE_ 64 Force : 1;\nVAL_ 272 Slew 32766")
    return machine


def joystick(machine: Machine, *lines: str) -> int:
    """Add lines to the left joystick; the number of the first of them."""
    return machine.in_yaml(COUNTER, "\n    ".join((COUNTER, *lines))) + 1


def stop(machine: Machine, text: str) -> int:
    """Name the emergency stop; its line."""
    last = "status: { bus: crane, message: ShaperStatus }"
    return machine.in_yaml(last, f"{text}\n{last}")


# -- joysticks ------------------------------------------------------------------------------------


def test_a_joystick_without_protection(machine: Machine) -> None:
    machine.in_yaml(COUNTER, "")
    bound = machine.load().joysticks["left"]
    assert bound.protection == UNPROTECTED
    config = bound.config
    assert (config.alive_max_step, config.qualify, config.stuck_s) == (None, 1, 20.0)


@pytest.mark.parametrize("kind", CHECKSUMS)
def test_a_joystick_with_everything(protected: Machine, kind: str) -> None:
    place = PLACES[CHECKSUMS[kind].bits]
    protected.in_dbc(SIGNALS, f' SG_ Check : {place} (1,0) [0|1] "" SHAPER\n')
    joystick(
        protected,
        f"checksum: {{ signal: Check, kind: {kind} }}",
        "alive_max_step: 128",
        "qualify: 20",
        "stuck_s: 3600",
    )
    deployment = protected.load()
    left, right = deployment.joysticks.values()
    byte = int(place.partition("|")[0]) // 8
    assert left.protection == Protection("AliveCounter", 256, Checksum(kind, byte))
    check = left.protection.check
    assert isinstance(check, Checksum)
    assert check.can_id == 0x110
    assert right.protection == Protection("AliveCounter", 256)
    Controller(deployment)


@pytest.mark.parametrize(
    ("signal", "byte"),
    [("48|8@1+", 6), ("55|8@0+", 6), ("40|8@1+", 5), ("47|8@0+", 5)],
)
def test_a_checksum_in_either_byte_order(protected: Machine, signal: str, byte: int) -> None:
    protected.in_dbc(SIGNALS, f' SG_ Check : {signal} (1,0) [0|255] "" SHAPER\n')
    joystick(protected, "checksum: { signal: Check, kind: xor }")
    assert protected.load().joysticks["left"].protection.check == Checksum("xor", byte)


@pytest.mark.parametrize(
    "signal",
    ["44|8@1+", "43|8@0+", "48|7@1+", "49|7@1+", "40|16@1+", "48|8@1-"],
)
def test_a_checksum_that_fills_no_byte(protected: Machine, signal: str) -> None:
    protected.in_dbc(SIGNALS, f' SG_ Check : {signal} (1,0) [0|1] "" SHAPER\n')
    line = joystick(protected, "checksum: { signal: Check, kind: xor }")
    assert protected.problems() == [
        f"machine.yaml:{line}: joysticks.left.checksum.signal: Check: expected an unsigned byte of"
        " its"
        " own, got another signal"
    ]


@pytest.mark.parametrize(
    ("signal", "place"),
    [
        ("40|4@1+", Checksum("sum4", 5)),
        ("43|4@0+", Checksum("sum4", 5)),
        ("44|4@1+", Checksum("sum4", 5, 4)),
        ("47|4@0+", Checksum("sum4", 5, 4)),
        ("40|16@1+", Checksum("crc16_arc", 5)),
        ("47|16@0+", Checksum("crc16_arc", 5, 0, "big")),
    ],
)
def test_a_checksum_of_another_width(protected: Machine, signal: str, place: Checksum) -> None:
    protected.in_dbc(SIGNALS, f' SG_ Check : {signal} (1,0) [0|1] "" SHAPER\n')
    joystick(protected, f"checksum: {{ signal: Check, kind: {place.kind} }}")
    assert protected.load().joysticks["left"].protection.check == place


@pytest.mark.parametrize(
    ("kind", "signal", "part"),
    [
        ("sum4", "42|4@1+", "half of a byte"),
        ("sum4", "46|4@0+", "half of a byte"),
        ("sum4", "48|8@1+", "half of a byte"),
        ("sum4", "48|4@1-", "half of a byte"),
        ("crc16_arc", "48|8@1+", "pair of bytes"),
        ("crc16_arc", "44|12@1+", "pair of bytes"),
        ("crc16_arc", "39|16@1+", "pair of bytes"),
        ("crc16_arc", "47|12@0+", "pair of bytes"),
        ("crc16_arc", "40|16@1-", "pair of bytes"),
    ],
)
def test_a_checksum_that_fills_no_such_part(
    protected: Machine, kind: str, signal: str, part: str
) -> None:
    protected.in_dbc(SIGNALS, f' SG_ Check : {signal} (1,0) [0|1] "" SHAPER\n')
    line = joystick(protected, f"checksum: {{ signal: Check, kind: {kind} }}")
    assert protected.problems() == [
        f"machine.yaml:{line}: joysticks.left.checksum.signal: Check: expected an unsigned {part}"
        " of"
        " its own, got another signal"
    ]


def test_an_algorithm_that_fails_is_a_problem_of_the_file(
    protected: Machine, monkeypatch: pytest.MonkeyPatch
) -> None:
    """Not of the first tick."""
    row = ChecksumKind("", 8, lambda _id, _place, data: data[99])
    monkeypatch.setitem(CHECKSUMS, "fails", row)
    line = joystick(protected, "checksum: { signal: Check, kind: fails }")
    assert protected.problems() == [
        f"machine.yaml:{line}: joysticks.left.checksum.kind: 'fails' fails on JoystickLeft:"
        " IndexError: index out of range"
    ]


@pytest.mark.parametrize(
    ("text", "says"),
    [
        (
            "checksum: { signal: Crc, kind: xor }",
            "joysticks.left.checksum.signal: expected a signal of JoystickLeft, got 'Crc'; there"
            " are Slew,"
            " NearFar, Enable, AntiSwayOff, Reset, Half, Count2, Count1, Check, AliveCounter",
        ),
        (
            "checksum: { signal: Check, kind: crc8 }",
            "joysticks.left.checksum.kind: expected one of"
            f" {', '.join(map(repr, [*CHECKSUMS][:-1]))} or {[*CHECKSUMS][-1]!r}, got 'crc8'",
        ),
        (
            "checksum: { signal: Check }",
            "joysticks.left.checksum: expected one of kind and polynomial, got neither",
        ),
        (
            "checksum: { signal: Check, kind: xor, polynomial: 7 }",
            "joysticks.left.checksum: expected one of kind and polynomial, got both",
        ),
        (
            "checksum: { signal: Check, kind: xor, start: 1 }",
            "joysticks.left.checksum: start, end and reflected: expected with polynomial, got kind",
        ),
        (
            "checksum: { signal: Check, polynomial: 0x107 }",
            "joysticks.left.checksum.signal: Check: expected 8 or 16 bits, as many as the"
            " polynomial has, got 8",
        ),
        (
            "checksum: { signal: Half, polynomial: 3 }",
            "joysticks.left.checksum.signal: Half: expected 8 or 16 bits, as many as the"
            " polynomial has, got 4",
        ),
        ("checksum: { kind: xor }", "joysticks.left.checksum.signal: "),
        ("checksum: { signal: Check, kind: xor, byte: 6 }", "joysticks.left.checksum.byte: "),
        (
            "checksum: { signal: AliveCounter, kind: xor }",
            "joysticks.left.checksum.signal: expected a free signal, got 'AliveCounter', which is"
            " alive_counter already",
        ),
        (
            "alive_max_step: 129",
            "joysticks.left.alive_max_step: expected up to 128 with a counter of 256 values, got"
            " 129",
        ),
        (
            "alive_max_step: 0",
            "joysticks.left.alive_max_step: expected a whole number, 1 to 255, got 0",
        ),
        (
            "alive_max_step: 256",
            "joysticks.left.alive_max_step: expected a whole number, 1 to 255, got 256",
        ),
        (
            "alive_max_step: 1.5",
            "joysticks.left.alive_max_step: expected a whole number, 1 to 255, got 1.5",
        ),
        (
            "qualify: 0",
            "joysticks.left.qualify: expected a whole number, 1 to 20 messages, got 0",
        ),
        (
            "qualify: 21",
            "joysticks.left.qualify: expected a whole number, 1 to 20 messages, got 21",
        ),
        ("stuck_s: 0.9", "joysticks.left.stuck_s: expected 1 to 3600 s, got 0.9"),
        ("stuck_s: 3601", "joysticks.left.stuck_s: expected 1 to 3600 s, got 3601"),
        ("alive_step: 3", "joysticks.left.alive_step: "),
    ],
)
def test_what_a_joystick_may_not_say(protected: Machine, text: str, says: str) -> None:
    line = joystick(protected, text)
    (problem,) = protected.problems()
    assert problem.startswith(f"machine.yaml:{line}: {says}")


@pytest.mark.parametrize(
    ("counter", "usual"), [("Count1", 1), ("Count2", 2), ("Half", 3), ("AliveCounter", 3)]
)
def test_the_usual_step_suits_every_counter(protected: Machine, counter: str, usual: int) -> None:
    protected.in_yaml(COUNTER, f"alive_counter: {counter}")
    bound = protected.load().joysticks["left"]
    for step in range(1, bound.protection.counts):
        checker = bound.sequence_checker()
        assert checker.check(b"", 0) is FrameFault.NONE
        expected = FrameFault.NONE if step <= usual else FrameFault.COUNTER_JUMP
        assert checker.check(b"", step) is expected


@pytest.mark.parametrize(
    ("counter", "most"), [("Count1", 1), ("Count2", 2), ("Half", 8), ("AliveCounter", 128)]
)
def test_a_step_is_at_most_half_of_the_counters_range(
    protected: Machine, counter: str, most: int
) -> None:
    """A step back must not look like one forward."""
    protected.in_yaml(COUNTER, f"alive_counter: {counter}\n    alive_max_step: {most}")
    assert protected.load().joysticks["left"].config.alive_max_step == most
    protected.in_yaml(f"alive_max_step: {most}", f"alive_max_step: {most + 1}")
    (problem,) = protected.problems()
    values = {1: 2, 2: 4, 8: 16, 128: 256}[most]
    expected = f"expected up to {most} with a counter of {values} values, got {most + 1}"
    assert expected in problem


@pytest.mark.parametrize("key", ["checksum", "alive_counter"])
def test_a_joystick_that_is_protection_too(protected: Machine, key: str) -> None:
    """A joystick that counts up with every frame would move the axis by itself."""
    protected.in_dbc(SIGNALS, ' SG_ Check : 48|8@1- (1,0) [-100|100] "" SHAPER\n')
    use = {"checksum": "checksum: { signal: Check, kind: sum }", "alive_counter": "qualify: 1"}
    joystick(protected, use[key])
    if key == "alive_counter":
        protected.in_yaml(COUNTER, "alive_counter: Check")
    line = protected.in_yaml("signal: Slew,", "signal: Check,")
    problems = protected.problems()
    expected = (
        f"axes.slew.command.signal: expected a free signal, got 'Check', which is {key} already"
    )
    assert f"machine.yaml:{line}: {expected}" in problems


@pytest.mark.parametrize("key", ["enable", "reset", "anti_sway_off"])
def test_a_switch_that_is_protection_too(protected: Machine, key: str) -> None:
    signal = {"enable": "Enable", "reset": "Reset", "anti_sway_off": "AntiSwayOff"}[key]
    line = protected.in_yaml(COUNTER, f"alive_counter: {signal}\n    alive_max_step: 2")
    assert protected.problems() == [
        f"machine.yaml:{line}: joysticks.left.alive_counter: expected a free signal, got"
        f" '{signal}', which is {key} already"
    ]
    protected.in_yaml(f"alive_counter: {signal}", f"checksum: {{ signal: {signal}, kind: xor }}")
    expected = f"expected a free signal, got '{signal}', which is {key} already"
    assert (
        f"machine.yaml:{line}: joysticks.left.checksum.signal: {expected}" in protected.problems()
    )


@pytest.mark.parametrize(
    ("signal", "says"),
    [("56|8@1-", "got a signed one"), ("32|32@1-", "got a float")],
)
def test_a_counter_that_cannot_count(machine: Machine, signal: str, says: str) -> None:
    kept = machine.dbc.index(" SG_ Enable : 32|2@1+")
    end = machine.dbc.index(" SG_ AliveCounter : 56|8@1+")
    if "float" in says:  # it takes the place of the switches
        machine.dbc = machine.dbc[:kept] + machine.dbc[end:]
        machine.in_dbc("VAL_ 272 Slew", "SIG_VALTYPE_ 272 AliveCounter : 1;\nVAL_ 272 Slew")
        for switch in ("Enable", "AntiSwayOff", "Reset"):
            machine.dbc = "".join(
                row
                for row in machine.dbc.splitlines(keepends=True)
                if not row.startswith(f"VAL_ 272 {switch}")
            )
    machine.in_dbc("AliveCounter : 56|8@1+", f"AliveCounter : {signal}")
    line = joystick(machine) - 1
    assert (
        f"machine.yaml:{line}: joysticks.left.alive_counter: AliveCounter: expected an unsigned"
        f" integer signal, {says}" in ("\n".join(machine.problems()))
    )


# -- the emergency stop ----------------------------------------------------------------------------


def test_a_machine_without_emergency_stop(machine: Machine) -> None:
    assert machine.load().emergency_stop is None


def test_an_emergency_stop(stoppable: Machine) -> None:
    stop(
        stoppable,
        f"{STOP}, alive_counter: Count, alive_max_step: 8, qualify: 3,"
        " checksum: { signal: Check, kind: crc8_autosar } }",
    )
    deployment = stoppable.load()
    bound = deployment.emergency_stop
    assert bound is not None
    assert bound.key == ("crane", 0x40, False)
    assert bound.protection == Protection("Count", 16, Checksum("crc8_autosar", 2))
    assert (0x40, False) in deployment.routing.buses["crane"].received
    Controller(deployment)


@pytest.mark.parametrize(
    ("text", "says"),
    [
        (
            STOP.replace("crane", "boom"),
            "emergency_stop.bus: expected a bus, got 'boom'; there are crane",
        ),
        (
            STOP.replace("Stop", "Halt"),
            "emergency_stop.message: expected a message of the DBC files, got 'Halt'",
        ),
        (
            STOP.replace("Pressed", "Button"),
            "emergency_stop.signal: expected a signal of Stop, got 'Button'; there are Pressed,"
            " Count, Check,",
        ),
        (
            STOP.replace("Pressed", "Force"),
            "emergency_stop.signal: Force: expected an integer signal, got a float",
        ),
        (
            STOP.replace("100", "39"),
            "emergency_stop.timeout_ms: expected 40 ms or more, twice the cycle of Stop, got 39",
        ),
        (
            STOP.replace("100", "1001"),
            "emergency_stop.timeout_ms: expected a whole number, 10 to 1000 ms, got 1001",
        ),
        (
            f"{STOP}, alive_counter: Pressed, alive_max_step: 2",
            "emergency_stop.alive_counter: expected a free signal, got 'Pressed', which is signal"
            " already",
        ),
        (
            f"{STOP}, alive_counter: Force",
            "emergency_stop.alive_counter: Force: expected an unsigned integer signal, got a float",
        ),
        (
            f"{STOP}, alive_counter: Count, alive_max_step: 9",
            "emergency_stop.alive_max_step: expected up to 8 with a counter of 16 values, got 9",
        ),
        (
            f"{STOP}, checksum: {{ signal: Count, kind: xor }}",
            "emergency_stop.checksum.signal: Count: expected an unsigned byte of its own",
        ),
        (
            f"{STOP}, alive_counter: Check, checksum: {{ signal: Check, kind: xor }}",
            "emergency_stop.checksum.signal: expected a free signal, got 'Check', which is"
            " alive_counter already",
        ),
        (f"{STOP}, stuck_s: 5", "emergency_stop.stuck_s: "),
        (f"{STOP}, enable: Pressed", "emergency_stop.enable: "),
        (
            STOP.replace("Stop", "SlewCommand").replace("Pressed", "Velocity"),
            "emergency_stop.message: SlewCommand has the id 0x200 on bus crane, which is used"
            " already by axes.slew.valve",
        ),
        (
            STOP.replace("Stop", "JoystickLeft").replace("Pressed", "Reset"),
            "emergency_stop.message: JoystickLeft has the id 0x110 on bus crane, which is used"
            " already by joysticks.left",
        ),
    ],
)
def test_what_an_emergency_stop_may_not_say(stoppable: Machine, text: str, says: str) -> None:
    line = stop(stoppable, text + " }")
    (problem,) = stoppable.problems()
    assert problem.startswith(f"machine.yaml:{line}: {says}")


@pytest.mark.parametrize("key", ["bus: crane", "message: Stop", "signal: Pressed"])
def test_what_an_emergency_stop_must_say(stoppable: Machine, key: str) -> None:
    line = stop(stoppable, STOP.replace(f"{key}, ", "") + " }")
    (problem,) = stoppable.problems()
    assert problem.startswith(f"machine.yaml:{line}: emergency_stop.{key.partition(':')[0]}: ")


def test_an_emergency_stop_without_a_cycle_is_a_problem_of_the_dbc(stoppable: Machine) -> None:
    stoppable.in_dbc('BA_ "GenMsgCycleTime" BO_ 64 20;\n', "")
    line = stoppable.in_dbc("BO_ 64 Stop", "BO_ 64 Stop")
    stop(stoppable, STOP + " }")
    assert stoppable.problems() == [
        f"machine.dbc:{line}: Stop: has no GenMsgCycleTime; cycle_ms may say it"
    ]


def test_problems_of_joysticks_and_stop_are_reported_together(stoppable: Machine) -> None:
    stoppable.in_yaml("enable: Enable", "enable: On")
    stop(stoppable, STOP.replace("Pressed", "Button").replace("100", "20") + " }")
    places = [p.split(": ")[1] for p in stoppable.problems()]
    assert places == ["joysticks.left.enable", "emergency_stop.timeout_ms", "emergency_stop.signal"]
