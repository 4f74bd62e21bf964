"""The gate judges a message: its sequence and its sender."""

import math
from dataclasses import replace

import pytest

from canshaper.codec.e2e import Profile5
from canshaper.codec.frame import Frame
from canshaper.gate.build import record_of
from canshaper.gate.checks import E2e
from canshaper.gate.gate import Gate
from canshaper.gate.received import Received
from canshaper.gate.record import Protection
from canshaper.inputs.stops import EmergencyStopInput
from canshaper.machine.deployment import Deployment
from tests.faults import variants
from tests.gate.bench import Bench, bench, load
from tests.rigs.j1939 import OWN, bjm

MS = 1_000_000


class Alike:
    """The gate's and the controller's opinion of one message, frame by frame."""

    def __init__(self, deployment: Deployment, name: str) -> None:
        bound = deployment.joysticks[name]
        self.message = Received(record_of(deployment).messages[name])
        self.input = EmergencyStopInput(bound, bound.enable or "")  # any input has this part
        self.sender, self.bound = bound.protection, bound

    def take(self, data: bytes, now_ms: int) -> bool:
        """Whether it counts; both have to agree."""
        word = int.from_bytes(data, "little"), int.from_bytes(data, "big")
        _, counts = self.message.take(data, word, now_ms * MS)
        self.input.receive(data, now_ms * MS)
        assert self.message.good_ns == self.input.received_ns
        return counts


def counted(count: int) -> bytes:
    return bytes([0, 0, 0, 0, 1, 0, 0, count & 0xFF])


def test_a_sequence_is_judged_as_the_controller_judges_it() -> None:
    one = Alike(load("forwarder"), "left")
    steps = [(0, True), (1, True), (1, False), (2, True), (5, True), (9, False), (10, True)]
    for number, (count, counts) in enumerate(steps):
        assert one.take(counted(count), 20 * number) is counts, count
    assert not one.take(counted(30), 140)
    assert not one.take(counted(60), 240)
    assert one.take(counted(77), 240 + 101)  # after silence any counter but the last
    assert not one.take(counted(77), 500)
    assert not one.take(counted(78)[:7], 510)


@pytest.mark.parametrize("seed", range(6))
def test_with_checksum_and_qualification_too(seed: int) -> None:
    import random

    deployment = variants.machine("protected")[1]
    rng = random.Random(seed)
    bound = deployment.joysticks["left"]
    config = bound.config.model_copy(update={"qualify": 1 + seed % 3})
    joysticks = {**deployment.joysticks, "left": replace(bound, config=config)}
    one = Alike(replace(deployment, joysticks=joysticks), "left")
    field = record_of(deployment).messages["left"].protection.counter
    assert field is not None
    assert bound.protection.check is not None
    count = now_ms = 0
    counting = []
    for _ in range(400):
        count += rng.choice((0, 1, 1, 1, 1, 2, 4))
        now_ms += rng.choice((20, 20, 20, 20, 101))
        word = (count & field.mask) << field.shift
        data = word.to_bytes(one.message.of.length, "big" if field.order else "little")
        data = bound.protection.check.protect(data, 0)
        if rng.random() < 0.1:
            data = bytes([data[0] ^ 1]) + data[1:]
        counting.append(one.take(data, now_ms))
    assert {*counting} == {True, False}


def test_frames_with_another_multiplexor_say_nothing() -> None:
    message = record_of(load("forwarder")).messages["left"]
    field = replace(message.protection.counter, shift=40, mask=0xF)  # type: ignore[type-var]
    for alone in (False, True):
        one = Received(replace(message, page=(field, 3), alone=alone))

        def take(kind: int, count: int, one: Received = one) -> tuple[bool, bool]:
            data = bytes([0, 0, 0, 0, 1, kind, 0, count])
            word = int.from_bytes(data, "little"), int.from_bytes(data, "big")
            return one.take(data, word, count * MS)

        assert take(3, 1) == (True, True)
        assert take(5, 2) == (False, False)
        assert (one.intact_ns == 2 * MS) is not alone
        assert take(3, 3) == (True, True)


def test_the_counter_of_e2e_is_in_its_header() -> None:
    message = record_of(load("forwarder")).messages["left"]
    header = replace(message, protection=Protection(E2e("p05", 256, 7), counts=256))
    one = Received(header)
    for count, counts in ((1, True), (1, False), (2, True), (9, False)):
        data = Profile5(7).protect(bytes(8), count)
        word = int.from_bytes(data, "little"), int.from_bytes(data, "big")
        assert one.take(data, word, count * MS) == (True, counts)


@pytest.mark.parametrize("change", [0, 1])
def test_a_frame_that_is_not_whole_says_nothing(change: int) -> None:
    """Wrong checksum, or length: that enable is off in it stops nothing; one that is right does."""
    one = Bench(variants.machine("protected")[1], "near_far")
    one.rests(10)
    name, bound = next(iter(one.deployment.joysticks.items()))
    for frame in one.joysticks(enable=False, near_far=1.0):
        if frame[:3] == bound.key:
            data = frame.data[:-1] if change else bytes([frame.data[0] ^ 1]) + frame.data[1:]
            one.gate.receive(frame[:3], data, one.now_ns)
    assert not one.gate.joysticks[name].pressed.released
    assert one.axis.demand == 0.0
    one.receive(one.joysticks(enable=False))
    assert one.gate.joysticks[name].pressed.released


def test_an_error_code_of_enable_stops_shaped() -> None:
    one = bench()
    one.ramp(60, near_far=1.0)
    one.change = lambda frame: frame._replace(data=frame.data[:4] + b"\2" + frame.data[5:])
    assert not one.sends(59, near_far=1.0)
    assert (one.axis.why, one.axis.latched) == ("joystick", False)
    assert one.axis.stop_left == one.axis.of.stop


@pytest.mark.parametrize(("name", "why"), [("forwarder", "joystick"), ("ecu-forwarder", "enable")])
def test_what_is_silent_at_the_start_latches_nothing(name: str, why: str) -> None:
    one = Bench(load(name), "near_far")
    one.gate.tick(0, 0)
    assert (one.axis.why, one.axis.latched) == (why, False)


def test_a_switch_is_off_until_it_says_otherwise() -> None:
    one = Bench(load("ecu-forwarder"), "near_far")
    one.rests()
    assert one.axis.armed
    (bound,) = one.deployment.switches
    one.change = lambda frame: None if frame[:3] == bound.key else frame
    one.gate.receive(bound.key, bound.protection.check.protect(b"\3\0\2\0", 0), one.now_ns)
    one.rests()
    assert (one.axis.why, one.axis.armed) == ("enable", False)


def test_a_joystick_stops_with_the_one_whose_switch_enables_it() -> None:
    one = Bench(load("ecu-forwarder"), "lift")
    one.rests()
    assert one.axis.armed
    silent = one.deployment.joysticks["left"].key
    one.change = lambda frame: None if frame[:3] == silent else frame
    one.rests(10)
    assert (one.axis.why, one.axis.armed) == ("enable", False)


def test_what_was_never_seen_released_is_not_pressed() -> None:
    one = bench()
    one.gate.receive(one.key, bytes(2), 0)
    one.gate.tick(0, 0)
    one.number = 60  # the second sender is silent for long enough
    one.rests(reset=True)
    assert one.axis.latched
    one.rests(enable=False)
    one.rests()
    assert one.axis.armed


@pytest.mark.parametrize(("age_ns", "armed"), [(100 * MS, True), (100 * MS + 1, False)])
def test_it_counts_until_its_timeout(age_ns: int, armed: bool) -> None:
    one = bench()
    one.rests()
    at_ns = one.now_ns - 20 * MS
    one.gate.tick(at_ns + age_ns, 0)
    assert one.axis.armed is armed


class TestSources:
    """J1939: the first joystick that comes counts, until it is silent."""

    def test_another_one_counts_after_its_silence(self) -> None:
        gate = Gate(record_of(load("j1939-forwarder")))
        axis = gate.axes["slew"]
        timeout_ns = axis.joystick.received.of.timeout_ns
        first, other = bjm(X=50.0), bjm("BJM1", 0x34, X=-70.0)
        gate.receive(first[:3], first[3], 0)
        assert gate.receive(other[:3], other[3], timeout_ns) is None
        assert axis.demand == 0.5
        gate.receive(other[:3], other[3], timeout_ns + 1)
        assert axis.demand == -0.7
        assert axis.lost  # neutral comes first
        gate.receive(first[:3], first[3], timeout_ns + 2)
        assert axis.demand == -0.7

    @pytest.mark.parametrize("first", [0x33, 0])
    def test_another_one_moves_nothing_before_neutral(self, first: int) -> None:
        """It comes between two ticks, neither of which sees a joystick that is silent."""
        gate = Gate(record_of(load("j1939-forwarder")))
        axis = gate.axes["slew"]
        for now_ms, frame in ((0, bjm("BJM1", first)), (101, bjm("BJM1", 0x34, X=50.0))):
            gate.receive(frame[:3], frame[3], now_ms * MS)
            gate.tick(-(-now_ms // 20) * 20 * MS, 0)
            assert axis.armed is (now_ms == 0)

    def test_neither_our_own_nor_another_message_counts(self) -> None:
        gate = Gate(record_of(load("j1939-forwarder")))
        for frame in (
            bjm("BJM1", OWN, X=50.0),
            Frame("crane", 0x18FF0033, True, bytes(8)),
            bjm(X=50.0)._replace(extended=False),
        ):
            gate.receive(frame[:3], frame[3], 0)
        assert gate.axes["slew"].demand is None

    def test_another_address_commands_our_valve(self) -> None:
        gate = Gate(record_of(load("j1939-forwarder")))
        bus, can_id, extended = gate.axes["slew"].of.valve
        elsewhere = bus, can_id & ~0xFF | 0x21, extended
        gate.receive(("other", *elsewhere[1:]), bytes(8), 5)
        assert gate.axes["slew"].foreign_ns < 0
        gate.receive(elsewhere, bytes(8), 5)
        assert gate.axes["slew"].foreign_ns == 5

    @pytest.mark.parametrize(("to", "ours"), [(0x20, True), (0xFF, True), (0x30, False)])
    def test_a_command_to_us_or_to_all(self, to: int, ours: bool) -> None:
        """The message has a destination."""
        gate = Gate(record_of(load("j1939-forwarder")))
        valve = gate.valves["crane", 0x0CEF2080, True] = gate.valves.pop(gate.axes["slew"].of.valve)
        valve.of = replace(valve.of, group=0x03FF0000)
        gate.receive(("crane", 0x0CEF0021 | to << 8, True), bytes(8), 5)
        assert (gate.axes["slew"].foreign_ns == 5) is ours

    def test_who_only_listens_is_no_ones_rival(self) -> None:
        gate = Gate(record_of(load("forwarder").listening()))
        gate.receive(gate.axes["slew"].of.valve, bytes(2), 5)
        assert gate.axes["slew"].foreign_ns < 0


def test_numbers_are_set_within_the_range_of_the_file() -> None:
    one = bench()
    of = one.axis.of
    of.ranges = dict.fromkeys(("limits.rise_per_s", "limits.fall_per_s"), (2.0, 4.0))
    of.ranges |= {"limits.max_pct": (50.0, 80.0), "sway.full_speed_m_s": (1.0, 2.0)}
    of.ranges["filter.a1"] = (0.5, 0.9)  # which is nothing to the gate
    for value, maximum in ((60.0, 0.6), (90.0, 0.8), (10.0, 0.5)):
        one.gate.set("axes.near_far.limits.max_pct", value)
        assert of.maximum == maximum
    one.gate.set("axes.near_far.limits.rise_per_s", 2.0)
    one.gate.set("axes.near_far.limits.fall_per_s", 4.0)
    one.gate.set("axes.near_far.limits.rise_per_s", math.nan)
    one.gate.set("axes.near_far.filter.a1", 0.7)
    assert (of.rise, of.fall) == (pytest.approx(0.04), pytest.approx(0.08))
    of.path_m = 0.6
    one.gate.set("axes.near_far.sway.full_speed_m_s", 1.5)
    assert of.path == pytest.approx(0.4)
    of.ranges = {}
    one.gate.set("axes.near_far.limits.max_pct", 100.0)
    assert of.maximum == 0.5


def test_a_measurement_is_the_demand_while_the_stick_rests() -> None:
    one = bench(max_pct=40.0, tail_s=0.1)
    one.gate.measure("near_far", 0.0)
    one.rests()
    for part in (0.01, 0.2, 0.4):
        one.gate.measure("near_far", part)
        assert not one.sends(round(part * 125), near_far=0.02)
    one.gate.measure("near_far", 0.8)
    assert "limit=asked allowed=0.400" in one.sends(51)
    one = bench()
    one.gate.measure("near_far", -0.3)
    one.rests()
    assert not one.sends(-37)
    one.receive(one.joysticks(near_far=0.3))
    one.gate.tick(one.now_ns, 0)
    assert not one.axis.armed
