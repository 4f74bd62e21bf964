"""Every kind of fault that is put into a drive, by name.

A fault acts from tick ``start`` to tick ``stop`` and lies at one of these places:

    RAW     on the raw values of a joystick, before its frame is made
    WIRE    on the bytes of a joystick's frames
    EXTRA   frames that someone else sends
    LOOP    on the loop of the daemon: ticks that come late, frames that do not go out
    STOP    on the emergency stop, where there is one
    RADIUS  on the measured radius, where there is one
"""

import random
from collections.abc import Callable
from dataclasses import dataclass, field
from typing import Any

from canshaper.codec.frame import Frame
from tests.faults.inputs import Input, Joystick
from tests.faults.machine import Axis, Machine

Raw = dict[str, int]


@dataclass
class Fault:
    """One fault of a drive."""

    kind: str
    start: int
    stop: int
    machine: Machine
    rng: random.Random
    joystick: Joystick
    axis: Axis
    memory: dict[str, Any] = field(default_factory=dict)

    def active(self, tick: int) -> bool:
        return self.start <= tick < self.stop

    def __str__(self) -> str:
        return f"{self.kind} {self.joystick.name}/{self.axis.name} {self.start}..{self.stop}"


# -- raw values of a joystick ---------------------------------------------------------------------


def _code(name: str) -> Callable[[Fault, Raw], None]:
    def act(fault: Fault, raw: Raw) -> None:
        code = fault.axis.signal.code(name)
        if code is not None:
            raw[fault.axis.signal.name] = code

    return act


def _out_of_range(fault: Fault, raw: Raw) -> None:
    joystick, rng = fault.axis.signal, fault.rng
    least = min(joystick.full + 1, joystick.high)  # one that fills its bits has no more
    beyond = (least, -joystick.full - 1, joystick.low, rng.randint(least, joystick.high))
    raw[joystick.name] = rng.choice(beyond)


def _frozen_joystick(fault: Fault, raw: Raw) -> None:
    for axis in fault.joystick.axes:
        for signal in (axis.signal, *(axis.flags or ())):
            raw[signal.name] = fault.memory.setdefault(signal.name, raw[signal.name])


def _jumping_joystick(fault: Fault, raw: Raw) -> None:
    full = fault.axis.signal.full
    raw[fault.axis.signal.name] = fault.rng.randint(-full, full)


def _flags(*values: int) -> Callable[[Fault, Raw], None]:
    def act(fault: Fault, raw: Raw) -> None:
        for flag in fault.axis.flags or ():
            raw[flag.name] = fault.rng.choice(values)

    return act


def _enable(*values: int, share: float = 1.0) -> Callable[[Fault, Raw], None]:
    def act(fault: Fault, raw: Raw) -> None:
        if fault.rng.random() < share:
            raw[fault.joystick.enable.name] = fault.rng.choice(values)

    return act


def _reset(*values: int) -> Callable[[Fault, Raw], None]:
    def act(fault: Fault, raw: Raw) -> None:
        if fault.joystick.reset:
            raw[fault.joystick.reset.name] = fault.rng.choice(values)

    return act


def _anti_sway_off(*values: int) -> Callable[[Fault, Raw], None]:
    def act(fault: Fault, raw: Raw) -> None:
        if fault.joystick.off:
            raw[fault.joystick.off.name] = fault.rng.choice(values)

    return act


def _frozen_counter(fault: Fault, raw: Raw) -> None:
    if counter := fault.joystick.counter:
        raw[counter.name] = fault.memory.setdefault("count", raw[counter.name])


def _jumping_counter(fault: Fault, raw: Raw) -> None:
    if counter := fault.joystick.counter:
        raw[counter.name] = fault.rng.randint(0, counter.mask)


def _stepping_counter(fault: Fault, raw: Raw) -> None:
    """Every frame a few steps too far: up to the largest step it is still the next one."""
    if counter := fault.joystick.counter:
        step = fault.memory.setdefault("step", fault.rng.randint(1, 5))
        count = fault.memory.get("count", raw[counter.name]) + step
        raw[counter.name] = fault.memory["count"] = count & counter.mask


RAW: dict[str, Callable[[Fault, Raw], None]] = {
    "joystick: error": _code("Error"),
    "joystick: not available": _code("NotAvailable"),
    "joystick: out of range": _out_of_range,
    "joystick: frozen": _frozen_joystick,
    "joystick: jumping": _jumping_joystick,
    "flags: contradictory": _flags(0, 1),
    "flags: anything": _flags(0, 1, 2, 3),
    "enable: released": _enable(0),
    "enable: flickers": _enable(0, share=0.3),
    "enable: invalid": _enable(2, 3),
    "enable: anything": _enable(0, 1, 2, 3),
    "reset: held": _reset(1),
    "reset: anything": _reset(0, 1, 2, 3),
    "anti-sway: off": _anti_sway_off(1),
    "anti-sway: anything": _anti_sway_off(0, 1, 2, 3),
    "counter: frozen": _frozen_counter,
    "counter: jumping": _jumping_counter,
    "counter: stepping": _stepping_counter,
}


# -- frames of a joystick -------------------------------------------------------------------------


def _silent(_fault: Fault, _frames: list[bytes]) -> list[bytes]:
    return []


def _lossy(fault: Fault, frames: list[bytes]) -> list[bytes]:
    return [f for f in frames if fault.rng.random() < 0.5]


def _twice(_fault: Fault, frames: list[bytes]) -> list[bytes]:
    return [f for frame in frames for f in (frame, frame)]


def _held_up(fault: Fault, frames: list[bytes]) -> list[bytes]:
    """The frames come later, all at once."""
    waiting: list[bytes] = fault.memory.setdefault("waiting", [])
    waiting += frames
    if fault.rng.random() < 0.8:
        return []
    frames, fault.memory["waiting"] = waiting, []
    return frames


def _wrong_length(fault: Fault, frames: list[bytes]) -> list[bytes]:
    rng = fault.rng
    return [(f + bytes(4))[: rng.choice([0, 1, len(f) - 1, len(f) + 1])] for f in frames]


def _old(fault: Fault, frames: list[bytes]) -> list[bytes]:
    """Someone plays frames again that were sent before."""
    kept: list[bytes] = fault.memory.setdefault("kept", [])
    kept += frames
    return [fault.rng.choice(kept) for _ in frames]


def _bit_errors(fault: Fault, frames: list[bytes]) -> list[bytes]:
    def spoil(data: bytes) -> bytes:
        spoiled = bytearray(data)
        for _ in range(fault.rng.randint(1, 4)):
            spoiled[fault.rng.randrange(len(data))] ^= 1 << fault.rng.randrange(8)
        return bytes(spoiled)

    return [spoil(f) if f and fault.rng.random() < 0.5 else f for f in frames]


def _wrong_checksum(fault: Fault, frames: list[bytes]) -> list[bytes]:
    if fault.joystick.checksum is None:
        return frames
    at = fault.joystick.checksum_byte
    return [f[:at] + bytes([f[at] ^ 0x40]) + f[at + 1 :] if len(f) > at else f for f in frames]


def _noise(fault: Fault, frames: list[bytes]) -> list[bytes]:
    return [fault.rng.randbytes(len(f)) for f in frames]


WIRE: dict[str, Callable[[Fault, list[bytes]], list[bytes]]] = {
    "frames: none": _silent,
    "frames: lost": _lossy,
    "frames: twice": _twice,
    "frames: held up": _held_up,
    "frames: wrong length": _wrong_length,
    "frames: old": _old,
    "frames: bit errors": _bit_errors,
    "frames: wrong checksum": _wrong_checksum,
    "frames: noise": _noise,
}


# -- frames of others ------------------------------------------------------------------------------


def _foreign(fault: Fault) -> list[Frame]:
    rng, machine = fault.rng, fault.machine
    bus, can_id, extended = fault.joystick.key
    data = rng.randbytes(rng.choice([0, 2, 8]))
    taken = {*machine.inputs, *machine.valves, *machine.statuses, machine.service}
    if machine.radius:
        taken.add(machine.radius[0])
    frames = [
        Frame(bus, rng.randrange(1 << 11), False, data),
        Frame(bus, rng.randrange(1 << 29), True, data),
        Frame(bus, can_id, not extended, data),
        Frame(next((b for b in machine.buses if b != bus), bus), can_id, extended, data),
        Frame(bus, 0x401, False, data),
    ]
    return [f for f in rng.sample(frames, 2) if f[:3] not in taken]


def _second_sender(fault: Fault) -> list[Frame]:
    return [Frame(*fault.axis.valve_key, fault.rng.randbytes(2))]


def _second_status(fault: Fault) -> list[Frame]:
    key = fault.axis.status_key
    return [Frame(*key, fault.rng.randbytes(8))] if key else []


EXTRA: dict[str, Callable[[Fault], list[Frame]]] = {
    "others: foreign frames": _foreign,
    "others: our valve": _second_sender,
    "others: our status": _second_status,
}

# -- loop, emergency stop, radius: done where the drive is made ------------------------------------

LOOP = (
    "loop: late once",
    "loop: late often",
    "loop: late, told later",
    "loop: stands still",
    "loop: valve not sent",
    "loop: status not sent",
)


def _stop_bits(*values: int) -> Callable[[Fault, Input, Raw], bytes]:
    def act(fault: Fault, stop: Input, raw: Raw) -> bytes:
        raw = {**raw, fault.machine.stop_field.name: fault.rng.choice(values)}
        return stop.data(raw)

    return act


def _stop_frozen(fault: Fault, stop: Input, raw: Raw) -> bytes:
    assert stop.counter
    count = fault.memory.setdefault("count", raw[stop.counter.name])
    return stop.data({**raw, stop.counter.name: count})


def _stop_jumping(fault: Fault, stop: Input, raw: Raw) -> bytes:
    assert stop.counter
    count = fault.rng.randint(0, stop.counter.mask)
    said = fault.rng.choice((0, 0, 1))
    return stop.data({fault.machine.stop_field.name: said, stop.counter.name: count})


STOP: dict[str, Callable[[Fault, Input, Raw], bytes]] = {
    "stop: pressed": _stop_bits(1),
    "stop: flickers": _stop_bits(0, 1),
    "stop: invalid": _stop_bits(2, 3),
    "stop: no frames": lambda _fault, _stop, _raw: b"",
    "stop: frozen": _stop_frozen,
    "stop: jumping": _stop_jumping,
    "stop: wrong checksum": lambda _fault, stop, raw: stop.data(raw, spoiled=1),
}

RADIUS = ("radius: none", "radius: jumping", "radius: anything", "radius: wrong length")

KINDS = (*RAW, *WIRE, *EXTRA, *LOOP, *STOP, *RADIUS)


def kinds_for(machine: Machine) -> list[str]:
    """Every kind of fault that can happen to a machine."""
    joysticks, axes = machine.joysticks.values(), machine.axes.values()
    impossible = {
        "stop": machine.stop is None,
        "radius": machine.radius is None,
        "flags": not any(a.flags for a in axes),
        "reset": not any(v.reset for v in joysticks),
        "counter": not any(v.counter for v in joysticks),
        "frames: wrong checksum": not any(v.checksum for v in joysticks),
    }
    return [k for k in KINDS if not (impossible.get(k) or impossible.get(k.split(":")[0]))]


COMMON = {k for k in KINDS if k.split(":")[0] not in ("stop", "radius", "flags")}
COMMON -= {"frames: wrong checksum"}


def random_faults(machine: Machine, rng: random.Random, ticks: int) -> list[Fault]:
    """A few faults at random times, often several at once."""
    kinds = kinds_for(machine)
    own = [k for k in kinds if k not in COMMON] or kinds  # what few machines can have comes often
    faults = []
    for _ in range(rng.choice((0, 1, 1, 2, 2, 2, 3, 3, 4, 6))):
        start = rng.randrange(ticks) if rng.random() < 0.95 else 0
        stop = start + rng.choice((1, 1, 2, 3, 5, 7, 12, 30))
        axis = rng.choice(list(machine.axes.values()))
        kind = rng.choice(own if rng.random() < 0.15 else kinds)
        faults.append(Fault(kind, start, min(stop, ticks), machine, rng, axis.joystick, axis))
    return faults
