"""Wrong bytes, identifiers and turns between controller and gate, on shipped deployments."""

from collections.abc import Callable, Iterator
from copy import deepcopy

import pytest

from canshaper.codec.frame import Frame
from tests.gate.attacker import World, get, put
from tests.gate.kinds import NAMES, REST

pytestmark = pytest.mark.slow

Frames = list[Frame]
# What replaces or follows the valve frames of a tick; each of them is one wrong output.
Change = Callable[[World, str, Frame], Iterator[Frame]]


def lengths(world: World, axis: str, frame: Frame) -> Iterator[Frame]:
    for n in (0, 1, len(frame.data) - 1):
        yield frame._replace(data=frame.data[:n])
    yield frame._replace(data=frame.data + b"\0")
    yield frame._replace(data=frame.data.ljust(64, b"\0"))


def identifiers(world: World, axis: str, frame: Frame) -> Iterator[Frame]:
    yield frame._replace(extended=not frame.extended)
    for bit in range(29 if frame.extended else 11):
        other = frame._replace(can_id=frame.can_id ^ 1 << bit)
        if other[:3] not in {world.valve(one) for one in world.axes}:
            yield other
    for bus in [*world.file["buses"], "", "nowhere"]:
        if bus != frame.bus and (bus, *frame[1:3]) not in {world.valve(a) for a in world.axes}:
            yield frame._replace(bus=bus)


def joysticks_of_others(world: World, axis: str, frame: Frame) -> Iterator[Frame]:
    for name in world.file["joysticks"]:
        yield world.joystick(name)


def network(world: World, axis: str, frame: Frame) -> Iterator[Frame]:
    """NMT, SYNC, SDO, EMCY, heartbeats of CANopen; requests, claims, transport of J1939."""
    for bus in world.file["buses"]:
        for command in (2, 0x80, 0x81, 0x82, 3):
            yield Frame(bus, 0, False, bytes([command, 0]))
            yield Frame(bus, 0, False, bytes([command, 0x20]))
        yield Frame(bus, 0, False, b"\x01")
        yield Frame(bus, 0x80, False, b"")
        yield Frame(bus, 0x620, False, bytes.fromhex("2b40600006000000"))
        yield Frame(bus, 0xA0, False, bytes(8))
        yield Frame(bus, 0x720, False, b"\x05")
        yield Frame(bus, 0x77E, False, b"\x04")
        yield Frame(bus, 0x77E, False, b"\x05\0")
        for number in (0x18EAFF9C, 0x18EA339C, 0x18ECFF9C, 0x18EBFF9C, 0x18FED89C, 0x18D0FF9C):
            yield Frame(bus, number, True, bytes(8))
            yield Frame(bus, number, True, bytes(3))
        yield Frame(bus, 0x18EEFF33, True, bytes(8))


def counters(world: World, axis: str, frame: Frame) -> Iterator[Frame]:
    valve = world.axes[axis]["valve"]
    message, name = world.messages[valve["message"]], valve.get("alive_counter")
    if name:
        now = get(message, frame.data, name)
        for ahead in (-1, 1, 2, 128):
            yield frame._replace(data=put(message, frame.data, {name: now + ahead}))


def command_bits(world: World, axis: str) -> int:
    """Bits of a valve's frame that are command, direction or counter."""
    bits = 0
    for one in world.axes.values():
        valve = one["valve"]
        if valve["message"] != world.axes[axis]["valve"]["message"]:
            continue
        names = [valve["signal"], *valve.get("also", []), valve.get("alive_counter")]
        names += [valve["direction"]["signal"]] if "direction" in valve else []
        names += [valve["cia408"]["control"]] if "cia408" in valve else []
        for name in names:
            if name:
                signal = world.messages[valve["message"]].get_signal_by_name(name)
                bits |= ((1 << signal.length) - 1) << signal.start
    return bits


def other_bits(world: World, axis: str, frame: Frame) -> Iterator[Frame]:
    ours, word = command_bits(world, axis), int.from_bytes(frame.data, "little")
    for bit in range(8 * len(frame.data)):
        if not ours >> bit & 1:
            yield frame._replace(data=(word ^ 1 << bit).to_bytes(len(frame.data), "little"))


def disagreeing(world: World, axis: str, frame: Frame) -> Iterator[Frame]:
    """Signals of one frame that contradict each other."""
    valve = world.axes[axis]["valve"]
    message = world.messages[valve["message"]]
    for also in valve.get("also", []):
        for raw in (0, 10, 250, 251, 255):
            if abs(raw - get(message, frame.data, also)) > 1:
                yield frame._replace(data=put(message, frame.data, {also: raw}))
    if direction := valve.get("direction"):
        now = get(message, frame.data, direction["signal"])
        for code in range(16):
            if code != now and (code or world.seen[axis]):
                data = put(message, frame.data, {direction["signal"]: code})
                yield frame._replace(data=data)


def control_words(world: World, axis: str, frame: Frame) -> Iterator[Frame]:
    valve = world.axes[axis]["valve"]
    if "cia408" in valve:
        message = world.messages[valve["message"]]
        for word in (*range(16), 0x1F, 0x8F, 0x10F, 0x800F, 0xFFFF, 0x8000):
            if word not in (0, 1, 3, 7, 8, 9, 11, 15):  # those of its state machine
                data = put(message, frame.data, {valve["cia408"]["control"]: word})
                yield frame._replace(data=data)


def beyond(world: World, axis: str, frame: Frame) -> Iterator[Frame]:
    """Raw values that no speed has."""
    valve = world.axes[axis]["valve"]
    message = world.messages[valve["message"]]
    signal = message.get_signal_by_name(valve["signal"])
    full, zero = round(world.full(axis)), valve.get("zero", 0)
    for raw in (full + 1, -full - 1, full * 2, -(1 << signal.length - 1), (1 << signal.length) - 1):
        data = put(message, frame.data, {valve["signal"]: raw + zero})
        if abs(world.decode(axis, data)) > 1 or raw > full:
            yield frame._replace(data=data)


def of_another(world: World, axis: str, frame: Frame) -> Iterator[Frame]:
    """The bytes of another valve that moves, and this frame on the other's identifier."""
    for other in world.axes:
        if world.valve(other) != frame[:3]:
            wrong = world.encode(other, frame.data.ljust(8, b"\0")[: len(frame.data)], 0.9)
            yield Frame(*world.valve(other), wrong)


def twice(world: World, axis: str, frame: Frame) -> Iterator[Frame]:
    yield frame
    yield frame


def old(world: World, axis: str, frame: Frame) -> Iterator[Frame]:
    """Frames that left before."""
    for before in world.before:
        yield from (one for one in before if one[:3] == frame[:3])


def status(world: World, axis: str, frame: Frame) -> Iterator[Frame]:
    """Status messages in another length, on another bus, or of 29 bits."""
    sections = [one["status"] for one in world.axes.values() if "status" in one]
    for section in [*sections, world.file["status"]]:
        key = world.key(section, own=True)
        for n in (0, 1, 7, 64):
            yield Frame(*key, bytes(n))
        yield Frame(key[0], key[1], not key[2], bytes(8))


def inverted(world: World, axis: str, frame: Frame) -> Iterator[Frame]:
    yield frame._replace(data=bytes(255 - one for one in frame.data))
    yield frame._replace(data=frame.data[::-1])
    yield frame._replace(data=b"\xff" * len(frame.data))
    yield frame._replace(data=b"\x7f" * len(frame.data))


KINDS: dict[str, Change] = {
    change.__name__: change
    for change in (
        lengths, identifiers, joysticks_of_others, network, counters, other_bits, disagreeing,
        control_words, beyond, of_another, twice, old, status, inverted,
    )
}  # fmt: skip


class Bytes:
    """Asks a copy of the gate, in the turn of each valve, whether wrong frames would leave.

    Attributes:
        planted: so many were asked for; ``through`` those that would leave, with where.
    """

    def __init__(self, name: str, change: Change) -> None:
        self.world, self._change = World(name), change
        self.planted = 0
        self.through: list[tuple[str, str, Frame, Frame]] = []
        self.world.before = []

    def moment(self, where: str) -> None:
        """A tick: wrong frames instead of each valve's frame, and behind it."""
        world = self.world
        keys = {world.valve(axis): axis for axis in world.axes}

        def plant(frames: list[Frame]) -> Iterator[Frame]:
            for frame in frames:
                axis = keys.get(frame[:3])
                wrong = [] if axis is None else [*self._change(world, axis, frame)]
                for one in wrong:
                    if one != frame:
                        self._ask(where, frame, one)
                yield frame
                for one in wrong:
                    self._ask(where + ", behind", frame, one)

        world.step(plant)

    def _ask(self, where: str, sound: Frame, wrong: Frame) -> None:
        """Whether it would leave; behind the sound frame where ``where`` says so."""
        gate, of = self.world.guarded._gate, self.world.evil.of
        # What the gate knows of the machine does not change, and is not copied.
        record = gate.record
        known = (record, *record.valves.values(), *record.axes.values(), *record.others.values())
        known += (*record.messages.values(), *record.joysticks.values())
        gate = deepcopy(gate, {id(one): one for one in known})
        self.planted += 1
        if of is not None and where.endswith("behind"):  # in a gateway that has not left yet
            gate.leaving(sound[:3], sound[3], of)
        if not gate.leaving(wrong[:3], wrong[3], of):
            self.through.append((where, str(sound[1]), sound, wrong))


def asked(name: str, change: Change) -> Bytes:
    """Wrong frames at rest, in motion, and after enable was released."""
    bytes_ = Bytes(name, change)
    world = bytes_.world

    def go(ticks: int, **stick: float) -> None:
        world.stick = stick
        for _ in range(ticks):
            world.before = [*world.before[-5:], list(world.step())]

    go(REST)
    bytes_.moment("at rest")
    go(15, **{axis: 0.6 * (-1) ** i for i, axis in enumerate(world.axes)})
    bytes_.moment("in motion")
    world.enable = 0
    go(2)
    bytes_.moment("tripped")
    return bytes_


@pytest.mark.parametrize("name", NAMES)
@pytest.mark.parametrize("what", KINDS)
def test_leaves_not(what: str, name: str) -> None:
    through = asked(name, KINDS[what]).through
    assert not [one for one in through if not harmless(what, name, one[3])], through[:5]


def harmless(what: str, name: str, frame: Frame) -> bool:
    """Wrong frames that may leave, and why no valve moves by them as it was not asked."""
    if what == "identifiers" and name == "gateway-forwarder":
        return frame.can_id in (784, 785)  # those of the status messages, in their length
    if what == "old":  # of the last 0.1 s: as slow as was asked, by the rates, and no counter
        return name.startswith(("j1939", "canopen", "moog", "cia402"))
    return what == "status" and len(frame.data) in (8, 64)  # the content moves nothing
