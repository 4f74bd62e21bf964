"""Rules 8 to 10: every bit of a frame that is not ours, its turn, and what may leave besides."""

from typing import Any

import pytest

from canshaper.codec.frame import Frame
from canshaper.codec.rewrite import RewritingSender
from canshaper.gate.build import record_of
from canshaper.gate.gate import Gate
from canshaper.gate.rules import OTHERS
from canshaper_sim.hand import Hand, Held
from tests.faults import shipped
from tests.gate.bench import Bench, bench, load
from tests.rigs.files import Machine


def test_what_was_withheld_leaves_no_gap() -> None:
    one = bench()
    one.gate.tick(0, 0)
    assert not one.gate.leaving(one.key, b"\0\7")
    one.gate.withheld(one.key)
    assert one.gate.valves[one.key].count is None
    for number in (8, 9):
        one.gate.tick(number, 0)
        assert not one.gate.leaving(one.key, bytes([0, number]))
    one.gate.withheld(one.key)
    one.gate.tick(10, 0)
    assert one.gate.leaving(one.key, b"\0\x0a") == "limit=counter value=10"
    assert not one.gate.leaving(one.key, b"\0\x09")


def test_a_valve_that_is_not_due_gets_nothing() -> None:
    from tests.faults import variants

    one = Bench(variants.machine("slow-valves")[1], "near_far")
    one.rests(1)
    one.gate.tick(one.now_ns, 0)
    assert one.gate.leaving(one.key, one.frame(0)) == "limit=one frame a tick"


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


def test_the_log_names_what_is_wrong() -> None:
    one = bench()
    data = one.frame(0)
    assert one.gate.leaving(one.key, data) == "limit=one frame a tick"  # before the first one
    one.gate.tick(0, 0)
    assert one.gate.leaving(one.key, data + b"\0") == "limit=length length=3 expected=2"
    assert not one.gate.leaving(one.key, data)
    assert one.gate.leaving(one.key, one.frame(0)) == "limit=one frame a tick"
    assert one.gate.leaving(("crane", 0x601, False), data) == "limit=identifier"
    (key, _), *_ = one.gate.record.others.items()
    assert one.gate.leaving(key, b"") == "limit=content"
    for name, change, why in (
        ("canopen-forwarder", 0, "limit=word"),  # none of CiA 408
        ("canfd-forwarder", 1, "limit=checksum"),
        ("j1939-forwarder", 1 << 63, "limit=bits wrong=8000000000000000"),
    ):
        one = Bench(load(name), "near_far")
        one.gate.tick(0, 0)
        data = one.frame(0)
        word = int.from_bytes(data, "little") ^ change
        assert one.gate.leaving(one.key, word.to_bytes(len(data), "little")) == why


@pytest.mark.parametrize("start", [1.5, 100.1, 0.0])
@pytest.mark.parametrize("place", ["32|32@1-", "39|32@0-"])
def test_a_float_that_no_axis_uses_leaves_as_it_starts(
    machine: Machine, place: str, start: float
) -> None:
    machine.in_dbc(
        "BO_ 512 SlewCommand: 2 SHAPER\n",
        f'BO_ 512 SlewCommand: 8 SHAPER\n SG_ Gain : {place} (1,0) [0|100] "" VALVES\n',
    )
    machine.dbc += f'BA_ "GenSigStartValue" SG_ 512 Gain {start};\nSIG_VALTYPE_ 512 Gain : 1;\n'
    one = Bench(machine.load(), "slew")
    one.gate.tick(0, 0)
    data = one.frame(0)
    assert one.gate.leaving(one.key, data) == ""
    one.gate.tick(1, 0)
    wrong = data[:-1] + bytes([data[-1] ^ 1])
    assert "limit=" in one.gate.leaving(one.key, wrong)


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


def test_only_a_frame_that_counts_is_passed_on() -> None:
    one = Gateway()
    data = one.receives().data
    one.gate = Gate(record_of(one.deployment))
    assert one.gate.leaving(one.key, data, data) == "limit=one frame a tick"


def test_a_frame_is_made_from_one_of_its_length() -> None:
    one = Gateway()
    data = one.receives().data
    one.ticks()
    assert "limit=bits" in one.gate.leaving(one.key, data, data[:-1])
    assert not one.gate.leaving(one.key, data, data)


def test_a_frame_of_our_own_asks_for_nothing() -> None:
    one = Gateway()
    one.ticks()  # no joystick was seen: nothing may move, and so nothing is enabled
    data = one.message.own(enabled=True).data
    assert one.gate.leaving(one.key, data) == "limit=bits of an own frame"
    one.message.take_back()
    one.receives()
    one.ticks()
    for enabled in (True, False):
        data = one.message.own(enabled=enabled).data
        assert not one.gate.leaving(one.key, data)
        one.ticks()
    valve = one.gate.valves[one.key].of
    data = one.message.own(enabled=False).data
    free = [bit for bit in range(64) if not valve.ours >> bit & 1]
    refused = 0
    for bit in free:
        changed = (int.from_bytes(data, "little") ^ 1 << bit).to_bytes(8, "little")
        refused += "limit=bits of an own frame" in one.gate.leaving(one.key, changed)
    assert refused
    one.receives(enable=False)
    one.ticks()
    one.message.take_back()
    data = one.message.own(enabled=True).data
    assert one.gate.leaving(one.key, data) == "limit=bits of an own frame"
