"""Every kind of fault that is put into a drive, by name.

A fault acts from tick ``start`` to tick ``stop`` and lies at one of these places:

    RAW     on the raw values of a joystick, before its frame is made
    WIRE    on the bytes of a joystick's frames
    EXTRA   frames that someone else sends
    LOOP    on the loop of the daemon: ticks that come late, frames that do not go out
    STOP    on the emergency stop, where there is one
    SWITCHES  on a message with switches that have to agree, where there is one
    RADIUS  on the measured radius, where there is one
    SENSOR  on a sway sensor and the tool that it watches, where there is one
"""

import random
from collections.abc import Callable, Iterable
from typing import Any

from canshaper.codec.frame import Frame
from tests.faults.fault import Fault, Raw
from tests.faults.inputs import Input, Switches
from tests.faults.joystick_faults import RAW, WIRE
from tests.faults.machine import Machine
from tests.faults.sensor import KINDS as SENSOR_FAULTS
from tests.faults.swing import KINDS as TOOL_FAULTS

# -- frames of others ------------------------------------------------------------------------------


def _foreign(fault: Fault) -> list[Frame]:
    rng, machine = fault.rng, fault.machine
    bus, can_id, extended = fault.joystick.key
    data = rng.randbytes(rng.choice([0, 2, 8]))
    used = {*machine.inputs, *machine.valves, *machine.statuses, machine.service, machine.identity}
    if machine.radius:
        used.add(machine.radius[0])
    frames = [
        Frame(bus, rng.randrange(1 << 11), False, data),
        Frame(bus, rng.randrange(1 << 29), True, data),
        Frame(bus, can_id, not extended, data),
        Frame(next((b for b in machine.buses if b != bus), bus), can_id, extended, data),
        Frame(bus, 0x401, False, data),
    ]
    return [f for f in rng.sample(frames, 2) if f[:3] not in used]


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
    "loop: late, reported later",
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


def _switches(share: float, *, every: bool = False) -> Callable[[Fault, Switches, Raw], bytes]:
    def act(fault: Fault, switches: Switches, raw: Raw) -> bytes:
        which = fault.memory.setdefault("which", fault.rng.choice([*switches.codes]))
        for name, code in switches.codes.items():
            if every or which == name:
                field = switches.fields[name]
                if fault.rng.random() < share:
                    raw[name] = fault.rng.choice([n for n in range(field.mask + 1) if n != code])
        return switches.data(raw)

    return act


SWITCHES: dict[str, Callable[[Fault, Switches, Raw], bytes]] = {
    "switch: off": _switches(1.0),
    "switch: flickers": _switches(0.3),
    "switch: anything": _switches(0.5, every=True),
    "switch: no frames": lambda _fault, _switches, _raw: b"",
    "switch: wrong checksum": lambda _fault, one, raw: one.data(raw, spoiled=1),
}


def input_frames(
    source: Input,
    raw: Raw,
    active: Iterable[Fault],
    kinds: dict[str, Callable[[Fault, Any, Raw], bytes]],
) -> list[bytes]:
    """A frame of an input by its raw values, with those faults of STOP or SWITCHES that act."""
    data = source.data(raw)
    for fault in active:
        if change := kinds.get(fault.kind):
            data = change(fault, source, dict(raw))
    return [data] if data else []


RADIUS = ("radius: none", "radius: jumping", "radius: anything", "radius: wrong length")

SENSOR = (*SENSOR_FAULTS, *TOOL_FAULTS)

KINDS = (*RAW, *WIRE, *EXTRA, *LOOP, *STOP, *SWITCHES, *RADIUS, *SENSOR)


def kinds_for(machine: Machine) -> list[str]:
    """Every kind of fault that can happen to a machine."""
    joysticks, axes = machine.joysticks.values(), machine.axes.values()
    impossible = {
        "stop": machine.stop is None,
        "radius": machine.radius is None,
        "switch": not machine.switches,
        "sensor": not machine.sensors,
        "tool": not machine.sensors,
        "flags": not any(a.flags for a in axes),
        "reset": not any(v.reset for v in joysticks),
        "counter": not any(v.counter for v in joysticks),
        "frames: wrong checksum": not any(v.checksum for v in joysticks),
    }
    return [k for k in KINDS if not (impossible.get(k) or impossible.get(k.split(":")[0]))]


RARE = ("stop", "radius", "flags", "switch", "sensor", "tool")
COMMON = {k for k in KINDS if k.split(":")[0] not in RARE} - {"frames: wrong checksum"}


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
