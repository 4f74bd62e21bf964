"""A joystick's message on its way through a gateway, judged by plain cantools."""

from typing import Any

import cantools
from hypothesis import example, given
from hypothesis import strategies as st

from canshaper.checksums.kinds import Checksum
from canshaper.codec.message import UNPROTECTED, Protection
from canshaper.codec.rewrite import RewritingSender, RewrittenMessage

# Two velocities that are ours, one of Motorola; one of each kind that is not.
DBC = """VERSION ""

BU_: A

BO_ 273 Stick: 16 A
 SG_ Slew : 0|8@1- (1,0) [-100|100] "%" A
 SG_ Lift : 15|12@0+ (0.1,-100) [-100|100] "%" A
 SG_ Offset : 24|8@1+ (1,-125) [-125|125] "%" A
 SG_ Falling : 32|8@1+ (-0.5,50) [-50|50] "%" A
 SG_ Ratio : 40|32@1- (2,0.5) [-1|1] "" A
 SG_ Missing : 72|8@1+ (1,-125) [-125|125] "%" A
 SG_ OneSided : 80|8@1+ (1,5) [0|100] "%" A
 SG_ NoRange : 88|8@1+ (1,0) [0|0] "" A
 SG_ Back : 112|8@1+ (1,-100) [-100|0] "%" A
 SG_ Buttons : 96|8@1+ (1,0) [0|255] "" A
 SG_ Enable : 104|2@1+ (1,0) [0|3] "" A
 SG_ Count : 108|4@1+ (1,0) [0|15] "" A
 SG_ Check : 120|8@1+ (1,0) [0|255] "" A

BA_DEF_ BO_ "VFrameFormat" ENUM "StandardCAN","ExtendedCAN","StandardCAN_FD";
BA_DEF_DEF_ "VFrameFormat" "StandardCAN";
BA_DEF_ SG_ "GenSigStartValue" FLOAT -100000 100000;
BA_DEF_DEF_ "GenSigStartValue" 0;
BA_ "VFrameFormat" BO_ 273 2;
BA_ "GenSigStartValue" SG_ 273 Offset 7;
BA_ "GenSigStartValue" SG_ 273 Ratio 0.5;
BA_ "GenSigStartValue" SG_ 273 Missing 255;
BA_ "GenSigStartValue" SG_ 273 OneSided 9;
BA_ "GenSigStartValue" SG_ 273 NoRange 8;
BA_ "GenSigStartValue" SG_ 273 Back 90;
BA_ "GenSigStartValue" SG_ 273 Buttons 170;
BA_ "GenSigStartValue" SG_ 273 Enable 2;
VAL_ 273 Missing 254 "Error" 255 "NotAvailable" ;
SIG_VALTYPE_ 273 Ratio : 1;
"""
(STICK,) = cantools.database.load_string(DBC, "dbc").messages
OURS = frozenset(("Slew", "Lift"))
CHECK = Checksum("xor", 15)
PROTECTED = Protection("Count", 16, CHECK)
FRAMES = st.binary(min_size=16, max_size=16)
# What a frame of our own says: no speed, and else the start value.
REST = {
    "Slew": 0,
    "Lift": 1000,
    "Offset": 125,
    "Falling": 100,
    "Ratio": -0.25,
    "Missing": 255,
    "OneSided": 9,
    "NoRange": 8,
    "Back": 90,
    "Buttons": 170,
    "Enable": 2,
}


def bound(protection: Protection = PROTECTED) -> RewrittenMessage:
    return RewrittenMessage("b", STICK, None, protection, enable="Enable", ours=OURS)


def made(protection: Protection = PROTECTED) -> RewritingSender:
    return bound(protection).sender()


def decoded(data: bytes) -> dict[str, Any]:
    raw: Any = STICK.decode(data, decode_choices=False, scaling=False)
    return raw


def others(data: bytes, *names: str) -> dict[str, str]:
    """Every signal but these; a NaN is one."""
    return {name: repr(value) for name, value in decoded(data).items() if name not in names}


def test_a_message_at_rest() -> None:
    assert {name: made().raw[name] for name in REST} == REST


@given(FRAMES, st.integers(-100, 100), st.integers(0, 2000))
@example(bytes((0xFF,) * 16), 0, 0)
@example(bytes(16), -1, 0xFFF)
def test_only_ours_are_changed(data: bytes, slew: int, lift: int) -> None:
    message = made()
    message.raw.update(Slew=slew, Lift=lift)
    frame = message.onto(data)
    assert (frame.bus, frame.can_id, frame.extended) == ("b", 273, False)
    after = decoded(frame.data)
    assert (after["Slew"], after["Lift"], after["Count"]) == (slew, lift, 1)
    changed = "Slew", "Lift", "Count", "Check"
    assert others(frame.data, *changed) == others(data, *changed)
    assert CHECK.verify(frame.data)


@given(FRAMES)
def test_without_protection_count_and_check_are_its_own(data: bytes) -> None:
    assert others(made(UNPROTECTED).onto(data).data, *OURS) == others(data, *OURS)
    lift = RewrittenMessage(
        "b", STICK, None, UNPROTECTED, enable="Enable", ours=frozenset(("Lift",))
    ).sender()
    assert others(lift.onto(data).data, "Lift") == others(data, "Lift")
    assert others(made(Protection("Count", 16)).onto(data).data, "Count", *OURS) == others(
        data, "Count", *OURS
    )


def test_the_bits_of_ours() -> None:
    """Byte 0 is the lowest; 12 bits of Motorola from the highest of byte 1."""
    message = bound()
    assert message.ours_mask == 0xF0FFFF
    message.start["Slew"] = -1
    # 1000 is 0x3E8, in bytes 1 and 2
    assert message.neutral_bits() == 0x803EFF


def test_the_bits_of_ours_where_those_of_no_signal_are_1() -> None:
    (stick,) = cantools.database.load_string(DBC, "dbc").messages
    stick.protocol = "j1939"
    rewritten = RewrittenMessage("b", stick, None, UNPROTECTED, enable="Enable", ours=OURS)
    assert rewritten.ours_mask == 0xF0FFFF


@given(FRAMES)
def test_what_takes_the_place_of_a_frame_has_its_count(data: bytes) -> None:
    message = made()
    first = message.onto(data)
    message.raw["Slew"] = 50
    second = message.instead(first)
    assert decoded(second.data)["Slew"] == 50
    assert others(second.data, "Slew", "Check") == others(first.data, "Slew", "Check")
    assert CHECK.verify(second.data)
    assert decoded(message.onto(data).data)["Count"] == 2


def test_a_frame_of_our_own() -> None:
    message = made()
    message.raw["Slew"] = 50
    for enabled, count in ((True, 1), (False, 2)):
        frame = message.own(enabled=enabled)
        expected = {**REST, "Slew": 50, "Enable": 1 if enabled else 2, "Count": count}
        assert others(frame.data, "Check") == {name: repr(v) for name, v in expected.items()}
        assert CHECK.verify(frame.data)
