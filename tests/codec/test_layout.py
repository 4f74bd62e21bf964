"""Bits of random messages, judged by cantools both ways."""

import inspect
import runpy
import sys
from typing import Any

import bitstruct
import cantools
import pytest
from cantools.database.can import Message, Signal
from cantools.database.conversion import BaseConversion
from hypothesis import given
from hypothesis import strategies as st

from canshaper.codec.layout import Layout, frame_length, is_fd, layout_fault
from canshaper.codec.message import SentMessage
from canshaper.codec.signals import raw_limits
from tests.rigs.files import Machine

Bits = list[tuple[int, int]]  # (byte, bit)


def walk(order: str, free: set[tuple[int, int]], at: tuple[int, int]) -> Bits:
    """The free bits that a signal from this start can have, as DBC files number them."""
    bits = []
    byte, bit = at
    while (byte, bit) in free:
        bits.append((byte, bit))
        if order == "little_endian":
            byte, bit = (byte, bit + 1) if bit < 7 else (byte + 1, 0)
        else:
            byte, bit = (byte, bit - 1) if bit > 0 else (byte + 1, 7)
    return bits


@st.composite
def messages(draw: st.DrawFn) -> Message:
    """A message of 1 to 8 bytes with up to 8 signals of every kind, in any places."""
    length = draw(st.integers(1, 8))
    free = {(byte, bit) for byte in range(length) for bit in range(8)}
    signals: list[Signal] = []
    for i in range(draw(st.integers(1, 8))):
        if not free:
            break
        order = draw(st.sampled_from(["little_endian", "big_endian"]))
        room = walk(order, free, draw(st.sampled_from(sorted(free))))
        floats = [n for n in (16, 32, 64) if n <= len(room)]
        is_float = bool(floats) and draw(st.integers(0, 3)) == 0
        bits = draw(st.sampled_from(floats) if is_float else st.integers(1, len(room)))
        free -= set(room[:bits])
        signals.append(
            Signal(
                f"S{i}",
                room[0][0] * 8 + room[0][1],
                bits,
                byte_order=order,  # type: ignore[arg-type]
                is_signed=draw(st.booleans()),
                raw_initial=draw(st.integers(-1000, 1000)),
                conversion=BaseConversion.factory(is_float=is_float),
            )
        )
    return Message(1, "M", length, signals, strict=True)


def values_of(signal: Signal) -> st.SearchStrategy[Any]:
    if signal.is_float:
        return st.floats(width=signal.length)  # type: ignore[arg-type]  # 32 or 64
    low, high = raw_limits(signal)
    return st.one_of(st.integers(low, high), st.sampled_from(sorted({low, 0, high})))


def raw_values(data: st.DataObject, message: Message) -> dict[str, Any]:
    return {s.name: data.draw(values_of(s), s.name) for s in message.signals}


def judge_encode(message: Message, raw: dict[str, Any]) -> bytes:
    return message.encode(raw, scaling=False, strict=False)


def judge_decode(message: Message, data: bytes) -> Any:
    return message.decode(data, decode_choices=False, scaling=False)


def shown(values: dict[str, Any]) -> dict[str, str]:
    """Values with their kind: 1 is not 1.0, and a NaN is one."""
    return {name: repr(value) for name, value in values.items()}


@given(message=messages(), data=st.binary(min_size=8, max_size=8))
def test_every_frame_decodes_as_by_cantools(message: Message, data: bytes) -> None:
    data = data[: message.length]
    assert shown(Layout(message).decode(data)) == shown(judge_decode(message, data))


@given(message=messages(), data=st.data())
def test_every_set_of_values_encodes_as_by_cantools(message: Message, data: st.DataObject) -> None:
    raw = raw_values(data, message)
    frame = Layout(message).encode(raw)
    assert frame == judge_encode(message, raw)
    assert shown(Layout(message).decode(frame)) == shown(raw)


@given(message=messages(), data=st.data())
def test_a_value_beyond_its_bits_is_refused(message: Message, data: st.DataObject) -> None:
    """Never wrapped: the largest command would become the opposite one."""
    whole = [s for s in message.signals if not s.is_float]
    raw = {s.name: 0 for s in message.signals}
    for signal in whole:
        low, high = raw_limits(signal)
        beyond = data.draw(st.integers(1, 1 << 70))
        for value in (low - 1, high + 1, low - beyond, high + beyond):
            with pytest.raises(OverflowError):
                Layout(message).encode({**raw, signal.name: value})


@given(message=messages(), data=st.data())
def test_what_is_not_set_keeps_its_start_value(message: Message, data: st.DataObject) -> None:
    raw = raw_values(data, message)
    unset = data.draw(st.sets(st.sampled_from(sorted(raw)))) if raw else set()
    start: dict[str, Any] = {}
    for signal in message.signals:
        low, high = raw_limits(signal)
        initial = int(signal.raw_initial or 0)
        start[signal.name] = initial if signal.is_float else min(max(initial, low), high)
    some = {name: value for name, value in raw.items() if name not in unset}
    sender = SentMessage("b", message).sender()
    assert sender.frame(some).data == judge_encode(message, {**start, **some})


@given(message=messages(), data=st.data())
def test_in_j1939_the_bits_of_no_signal_are_1(message: Message, data: st.DataObject) -> None:
    raw = raw_values(data, message)
    every = {(byte, bit) for byte in range(message.length) for bit in range(8)}
    free = set(every)
    for s in message.signals:
        free -= set(walk(s.byte_order, every, divmod(s.start, 8))[: s.length])
    ones = sum(1 << 8 * byte + bit for byte, bit in free)
    frame = int.from_bytes(judge_encode(message, raw), "little") | ones
    message.protocol = "j1939"
    assert Layout(message).encode(raw) == frame.to_bytes(message.length, "little")


# -- by hand, not by cantools ----------------------------------------------------------------------


DBC = """VERSION ""

BU_: A

BO_ 1 M: 8 A
 SG_ Intel : 4|12@1- (1,0) [0|0] "" A
 SG_ Motorola : 21|10@0+ (1,0) [0|0] "" A
 SG_ Ratio : 32|32@1- (1,0) [0|0] "" A

SIG_VALTYPE_ 1 Ratio : 1;
"""


def test_bits_of_a_frame_by_hand() -> None:
    (message,) = cantools.database.load_string(DBC, "dbc").messages
    frame = bytes.fromhex("f0 ff 2a c0 00 00 c0 3f")
    # the ten Motorola bits are 6 of byte 2 (101010) and 4 of byte 3 (1100)
    raw = {"Intel": -1, "Motorola": 0b101010_1100, "Ratio": 1.5}
    assert Layout(message).decode(frame) == raw
    assert Layout(message).encode(raw) == frame


# -- without the compiled part of bitstruct --------------------------------------------------------


@pytest.mark.parametrize(
    ("length", "fd", "protocol", "sent_in"),
    [
        (8, False, None, None),
        (8, True, None, 8),
        (9, False, None, 12),  # no classical frame is as long
        (12, True, None, 12),
        (33, True, None, 48),
        (64, True, None, 64),
        (65, False, None, 65),  # in no frame; refused elsewhere
        (20, False, "j1939", None),
        (20, True, "j1939", 20),
    ],
)
def test_lengths_of_can_fd(length: int, fd: bool, protocol: str | None, sent_in: int) -> None:
    message = Message(1, "M", length, [], is_fd=fd, protocol=protocol)
    assert is_fd(message) is (sent_in is not None)
    assert frame_length(message) == (sent_in or length)


def test_what_has_no_layout() -> None:
    (message,) = cantools.database.load_string(DBC, "dbc").messages
    assert layout_fault(message) is None
    (message,) = cantools.database.load_string(DBC.replace("32|32@1-", "32|24@1-"), "dbc").messages
    assert layout_fault(message) == "Ratio: expected a float of 32 or 64 bits, got 24"
    wide = DBC.replace("32|32@1-", "0|64@1-").replace("4|12@1-", "0|12@1-")
    (message,) = cantools.database.load_string(wide, "dbc", strict=False).messages
    assert layout_fault(message) is None


@pytest.mark.parametrize("value", ["1e999", "-1e999"])
def test_a_start_value_that_is_no_number(value: str) -> None:
    starts = f'{DBC}BA_DEF_ SG_ "GenSigStartValue" FLOAT -1 1;\nBA_DEF_DEF_ "GenSigStartValue" 0;\n'
    (message,) = cantools.database.load_string(DBC, "dbc").messages
    start = f'BA_ "GenSigStartValue" SG_ {message.frame_id} Ratio {value};\n'
    (message,) = cantools.database.load_string(starts + start, "dbc").messages
    number = value.replace("1e999", "inf")
    assert layout_fault(message) == f"GenSigStartValue of Ratio: expected a number, got {number}"


def test_without_the_compiled_part_it_is_the_same(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setitem(sys.modules, "bitstruct.c", None)
    slow = runpy.run_path(str(inspect.getsourcefile(Layout)))["Layout"]
    (message,) = cantools.database.load_string(DBC, "dbc").messages
    data = bytes(range(7, 7 + message.length))
    raw = Layout(message).decode(data)
    assert slow(message).decode(data) == raw
    assert slow(message).encode(raw) == Layout(message).encode(raw)
    with pytest.raises(bitstruct.Error):
        slow(message).encode({**raw, "Intel": 2048})


def float_of_9_bits(machine: Machine, number: int, message: str, name: str) -> str:
    """Make one; cantools loads it, and fails with the first frame. Returns what is to be said."""
    line = machine.in_dbc(f"BO_ {number} {message}", f"BO_ {number} {message}")
    machine.in_dbc(f"{name} : 16|16@1-", f"{name} : 16|9@1-")
    machine.dbc += f"SIG_VALTYPE_ {number} {name} : 1;\n"
    fault = f"{name}: expected a float of 32 or 64 bits, got 9"
    return f"machine.dbc:{line}: {message}: {fault}"


def test_a_file_with_such_a_message_is_refused(machine: Machine) -> None:
    says = float_of_9_bits(machine, 272, "JoystickLeft", "NearFar")
    assert machine.problems() == [says]


def test_such_a_message_that_is_not_used_cannot_be_read(machine: Machine) -> None:
    says = float_of_9_bits(machine, 1024, "GrappleSway", "SwayParallel")
    assert machine.load().messages.find("GrappleSway") == f"{machine.directory}/{says}"


def test_values_of_a_multiplexor_that_is_none(machine: Machine) -> None:
    """Two signals in the same bits: only a multiplexor says which of them a frame has."""
    line = machine.in_dbc("BO_ 272 JoystickLeft: 8", "BO_ 272 JoystickLeft: 8")
    rows = ' SG_ Page m : 40|2@1+ (1,0) [0|3] "" SHAPER\n'
    for i in (0, 1):
        rows += f' SG_ P{i} m{i} : 42|6@1+ (1,0) [0|63] "" SHAPER\n'
        machine.dbc += f"SG_MUL_VAL_ 272 P{i} Page {i}-{i};\n"
    machine.in_dbc(" SG_ Enable : 32|2", f"{rows} SG_ Enable : 32|2")
    says = "P0: expected a multiplexor (M) in its message, got none for it"
    assert machine.problems() == [f"machine.dbc:{line}: JoystickLeft: {says}"]
