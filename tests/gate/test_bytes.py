"""Rules 8 to 10: every bit of a frame that is not ours, its turn, and what may leave besides."""

from typing import Any

import pytest

from canshaper.codec.frame import Frame
from canshaper.codec.rewrite import RewritingSender
from canshaper.controller.controller import Controller
from canshaper.gate.build import WORDS, record_of
from canshaper.gate.fields import word_of
from canshaper.gate.gate import Gate
from canshaper.gate.record import Key
from canshaper.gate.rules import OTHERS
from canshaper_sim.hand import Hand, Held
from tests.faults import shipped
from tests.gate.bench import Bench, bench, load


@pytest.mark.parametrize("length", range(9))
def test_a_frame_of_another_length(length: int) -> None:
    one = bench()
    one.rests()
    one.gate.tick(one.now_ns, 0)
    why = one.gate.leaving(one.key, one.frame(0).ljust(8, b"\0")[:length])
    assert (why == "") is (length == 2), why
    assert "limit=length" in why or length == 2


def sound(name: str) -> tuple[Gate, list[tuple[Key, bytes]]]:
    """A deployment at rest, and frames of its valves that leave in the last tick."""
    deployment = load(name)
    controller, gate = Controller(deployment), Gate(record_of(deployment))
    hand, tick_ms = Hand(deployment), deployment.config.tick_ms
    last = 1000 // tick_ms - 1
    last -= (last + 1) % max(axis.period_ticks for axis in deployment.axes.values())
    for number in range(last + 1):
        now_ns = number * tick_ms * 1_000_000
        for frame in hand.frames(number * tick_ms, Held(enable=True)):
            gate.receive(frame[:3], frame[3], now_ns)
            controller.receive(frame, now_ns)
        gate.tick(now_ns, 0)
        frames = [(f[:3], f[3]) for f in controller.tick(now_ns)]
        for key, data in frames if number < last else ():
            assert not gate.leaving(key, data)
    return gate, [one for one in frames if one[0] in gate.valves]


@pytest.mark.parametrize("name", [n for n in shipped.NAMES if "gateway" not in n])
def test_every_bit_of_a_frame_at_rest(name: str) -> None:
    """One bit is another: it does not leave, but for the free ones of a counter or checksum."""
    gate, left = sound(name)
    assert left
    for key, data in left:
        valve, _ = gate.valves[key]
        for bit in range(8 * len(data)):
            word = int.from_bytes(data, "little") ^ 1 << bit
            changed = word.to_bytes(len(data), "little")
            words = {field.raw(word_of(changed)) for field, _ in valve.words}
            if words and words <= WORDS - {field.raw(word_of(data)) for field, _ in valve.words}:
                continue  # another control word that a valve may be sent
            why = gate.leaving(key, changed)
            assert why, (key, bit)
            if valve.fixed >> bit & 1:
                assert "limit=bits" in why
        assert not gate.leaving(key, data)


def test_a_counter_that_stands_or_jumps_and_a_second_frame_of_a_tick() -> None:
    one = bench()
    one.rests()
    one.gate.tick(one.now_ns, 0)
    last = one.gate.counts[one.key]
    for count in (last, last + 2, last - 1):
        assert "limit=counter" in one.gate.leaving(one.key, bytes([0, count & 0xFF]))
    assert not one.gate.leaving(one.key, one.frame(0))
    assert one.gate.leaving(one.key, one.frame(0)) == "limit=one frame a tick"


def test_what_was_withheld_leaves_no_gap() -> None:
    one = bench()
    one.gate.tick(0, 0)
    assert not one.gate.leaving(one.key, b"\0\7")
    one.gate.withheld(one.key)
    assert one.key not in one.gate.counts
    for number in (8, 9):
        one.gate.tick(number, 0)
        assert not one.gate.leaving(one.key, bytes([0, number]))
    one.gate.withheld(one.key)
    one.gate.tick(10, 0)
    assert not one.gate.leaving(one.key, b"\0\x09")


def test_a_valve_that_is_not_due_gets_nothing() -> None:
    from tests.faults import variants

    one = Bench(variants.machine("slow-valves")[1], "near_far")
    one.rests(1)
    one.gate.tick(one.now_ns, 0)
    assert one.gate.leaving(one.key, one.frame(0)) == "limit=one frame a tick"


def test_a_control_word_that_no_valve_is_sent() -> None:
    gate, left = sound("canopen-forwarder")
    key, data = left[0]
    for word in (0, 1, 7, 0x1F, 0xFF):
        assert gate.leaving(key, bytes([word]) + data[1:])


@pytest.mark.parametrize(
    ("key", "data"),
    [
        (("crane", 0x110, False), bytes(8)),  # a joystick's
        (("crane", 0x200, True), bytes(2)),  # the twin of 29 bits
        (("other", 0x200, False), bytes(2)),
        (("crane", 0x000, False), b"\1\0"),  # NMT
        (("crane", 0x601, False), bytes(8)),  # SDO
        (("crane", 0x18EAFF00, True), bytes(3)),  # a request of J1939
    ],
)
def test_an_identifier_that_is_not_one_of_ours(key: Any, data: bytes) -> None:
    assert bench().gate.leaving(key, data) == "limit=identifier"


@pytest.mark.parametrize("name", shipped.NAMES)
def test_what_leaves_besides_is_as_the_file_has_it(name: str) -> None:
    gate = Gate(record_of(load(name)))
    for key, (lengths, contents) in gate.record.others.items():
        for length in range(9):
            gate.tick(length, 0)
            data = bytes(length)
            right = length in lengths and (not contents or data in contents)
            assert (gate.leaving(key, data) == "") is right
        for data in contents:
            assert not gate.leaving(key, data)


def test_a_message_besides_leaves_some_times_in_a_tick() -> None:
    """Status and answers, not a flood that keeps a valve's frames back."""
    gate = Gate(record_of(load("forwarder")))
    gate.tick(0, 0)
    key, (lengths, _) = next(iter(gate.record.others.items()))
    left = [gate.leaving(key, bytes(min(lengths))) for _ in range(20)]
    assert left == [""] * OTHERS + ["limit=rate"] * (20 - OTHERS)
    gate.tick(20_000_000, 0)
    assert not gate.leaving(key, bytes(min(lengths)))
    nmt = Gate(record_of(load("canopen-forwarder")))
    starts = nmt.record.others["crane", 0, False][1]
    assert not any(nmt.leaving(("crane", 0, False), one) for one in starts for _ in range(2))


def test_nmt_but_start_and_a_heartbeat_but_ours() -> None:
    gate = Gate(record_of(load("canopen-forwarder")))
    ids = {key[1]: one for key, one in gate.record.others.items() if one[1]}
    assert all(data[0] == 1 for data in ids.pop(0)[1])
    assert [one[1] for one in ids.values()] == [frozenset((b"\0", b"\5"))]


def test_the_last_frame_is_neutral_and_right() -> None:
    one = bench()
    one.rests()
    assert "limit=neutral" in one.gate.last(one.key, one.frame(5))
    assert "limit=length" in one.gate.last(one.key, one.frame(0) + b"\0")
    data = one.frame(0)
    assert not one.gate.last(one.key, data)
    assert one.gate.counts[one.key] == data[1]


class Gateway:
    """The left joystick of gateway-forwarder, and what its frames leave as."""

    def __init__(self) -> None:
        self.deployment = load("gateway-forwarder")
        self.gate, self.hand = Gate(record_of(self.deployment)), Hand(self.deployment)
        self.number = 0
        sender = self.deployment.axes["slew"].valve.message.sender()
        assert isinstance(sender, RewritingSender)
        self.message, self.key = sender, sender.key

    def receives(self, **held: Any) -> Frame:
        """A frame of the joystick, in a tick of its own."""
        now_ns = self.number * 20_000_000
        frames = self.hand.frames(self.number * 20, Held({}, **({"enable": True} | held)))
        self.number += 1
        mine = next(f for f in frames if f[1] == self.key[1])
        for frame in frames:
            self.gate.receive(frame[:3], frame[3], now_ns)
        return mine

    def ticks(self) -> None:
        self.gate.tick(self.number * 20_000_000, 0)


def test_every_bit_of_a_gateway_that_is_not_ours() -> None:
    one = Gateway()
    valve, _ = one.gate.valves[one.key]
    for _ in range(3):
        mine = one.receives(enable=False)
        assert not one.gate.leaving(one.key, one.message.onto(mine.data).data, mine.data)
        one.ticks()
    mine = one.receives(enable=False)
    passed = one.message.onto(mine.data).data
    for bit in range(64):
        changed = (int.from_bytes(passed, "little") ^ 1 << bit).to_bytes(8, "little")
        why = one.gate.leaving(one.key, changed, mine.data)
        assert why, bit
        assert ("limit=bits" in why) is not bool(valve.ours >> bit & 1)
    assert one.gate.leaving(one.key, passed, mine.data + b"\0").startswith("limit=bits")
    assert not one.gate.leaving(one.key, passed, mine.data)
    one.message.protector.take_back()
    again = one.message.onto(mine.data).data
    assert one.gate.leaving(one.key, again, mine.data) == "limit=one frame a tick"


def test_a_frame_of_our_own_asks_for_nothing() -> None:
    one = Gateway()
    one.receives()
    one.ticks()
    for enabled in (True, False):
        data = one.message.own(enabled=enabled).data
        assert not one.gate.leaving(one.key, data)
        one.ticks()
    valve, _ = one.gate.valves[one.key]
    data = one.message.own(enabled=False).data
    free = [bit for bit in range(64) if not valve.ours >> bit & 1]
    refused = 0
    for bit in free:
        changed = (int.from_bytes(data, "little") ^ 1 << bit).to_bytes(8, "little")
        refused += "limit=bits of an own frame" in one.gate.leaving(one.key, changed)
    assert refused
    one.receives(enable=False)
    one.ticks()
    one.message.protector.take_back()
    data = one.message.own(enabled=True).data
    assert one.gate.leaving(one.key, data) == "limit=bits of an own frame"
