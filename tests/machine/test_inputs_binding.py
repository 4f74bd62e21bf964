"""Protection of joysticks in a deployment: each problem with file and line."""

import pytest

from canshaper.checksums.kinds import CHECKSUMS, Checksum, ChecksumKind
from canshaper.codec.message import UNPROTECTED, Protection
from canshaper.controller.controller import Controller
from tests.codec.checksum_reference import PLACES
from tests.machine.protected_joystick import COUNTER, SIGNALS, joystick
from tests.rigs.files import Machine


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
        *(
            ("xor", signal, "byte")
            for signal in ("44|8@1+", "43|8@0+", "48|7@1+", "49|7@1+", "40|16@1+", "48|8@1-")
        ),
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
    ],
)
def test_what_a_joystick_may_not_say(protected: Machine, text: str, says: str) -> None:
    line = joystick(protected, text)
    (problem,) = protected.problems()
    assert problem.startswith(f"machine.yaml:{line}: {says}")
