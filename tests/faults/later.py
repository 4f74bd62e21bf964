"""Kinds of faults that came later: a seed without them is the sequence that it was before.

paired  a bad frame of a joystick in the same tick as a good one, before it or behind it
stamp   frames whose time of arrival is wrong: the clock was set, or an adapter has none
hand    full strokes to and fro, also with the axis at its end stop
set     another set of filters: the operator's choice, the load, a file with other filters
"""

import random
from collections.abc import Callable, Iterable

from canshaper.codec.frame import Frame
from tests.faults.fault import Fault, Raw
from tests.faults.inputs import Joystick
from tests.faults.machine import Machine

HOUR_NS = 3_600_000_000_000
STAMPS: dict[str, Callable[[Fault], int]] = {
    "stamp: an hour back": lambda _: -HOUR_NS,
    "stamp: an hour ahead": lambda _: HOUR_NS,
    "stamp: a tick back": lambda fault: -fault.machine.tick_ns,
    "stamp: anything": lambda fault: fault.rng.randint(-200_000_000, 0),
}
PAIRED = ("paired: bad first", "paired: bad last")
STROKES, PRESSED, CHOSEN = "hand: to and fro", "set: button", "set: load or switch"
AT_ITS_END, REFILTERED = "hand: at its end stop", "set: other filters in the file"


def kinds_for(machine: Machine) -> list[str]:
    """Those that a machine can have."""
    kinds = [*STAMPS, *PAIRED, STROKES, REFILTERED]
    kinds += [PRESSED] * any(one.next_profile for one in machine.joysticks.values())
    return kinds + [CHOSEN] * bool(machine.choices) + [AT_ITS_END] * bool(machine.ends)


def plan(
    machine: Machine, rng: random.Random, faults: list[Fault], first: int, ticks: int
) -> list[Fault]:
    """Return up to two of them, often in one of the other faults or right behind it."""
    planned = []
    for _ in range(rng.choice((0, 1, 1, 2))):
        start = rng.randrange(first, ticks)
        if faults and rng.random() < 0.6:
            start = rng.choice(faults).start + rng.choice((-3, -1, 0, 0, 1, 2, 5, 12))
        start = max(first, min(start, ticks - 1))
        stop = min(start + rng.choice((1, 2, 5, 12, 30, 60)), ticks)
        axis = rng.choice(list(machine.axes.values()))
        kind = rng.choice(kinds_for(machine))
        planned.append(Fault(kind, start, stop, machine, rng, axis.joystick, axis))
    return planned


def stamp(now_ns: int, active: Iterable[Fault]) -> int:
    """Time at which a frame of now is said to have come."""
    return now_ns + sum(STAMPS[one.kind](one) for one in active if one.kind in STAMPS)


def hand(joystick: Joystick, raw: Raw, active: Iterable[Fault]) -> Raw:
    """Raw values of a joystick with what the hand does to it."""
    for fault in active:
        if fault.joystick is not joystick:
            continue
        if fault.kind in (STROKES, AT_ITS_END):
            every = fault.memory.setdefault("every", fault.rng.choice((1, 2, 4, 8, 15)))
            number = fault.memory["number"] = fault.memory.get("number", -1) + 1
            for axis in joystick.axes:
                raw |= axis.raw(axis.signal.full * (-1) ** (number // every))
        elif fault.kind == PRESSED and joystick.next_profile:
            raw[joystick.next_profile.name] = fault.rng.choice((0, 1))
    return raw


def paired(joystick: Joystick, frames: list[bytes], active: Iterable[Fault]) -> list[bytes]:
    """Frames of a tick with a bad one before or behind them."""
    for fault in active:
        if fault.kind in PAIRED and fault.joystick is joystick and any(frames):
            rng, data = fault.rng, max(frames, key=len)
            flipped = bytearray(data)
            flipped[rng.randrange(len(data))] ^= 1 << rng.randrange(8)
            noise, old = rng.randbytes(len(data)), fault.memory.setdefault("old", data)
            bad = rng.choice((data[:-1], data + b"\0", bytes(flipped), noise, old, b""))
            frames = [bad, *frames] if fault.kind == PAIRED[0] else [*frames, bad]
    return frames


def choices(fault: Fault) -> list[Frame]:
    """Load, and what a switch chooses: anything that its bits hold."""
    if fault.kind != CHOSEN:
        return []
    return [
        Frame(*key, field.put(fault.rng.randint(0, field.mask)).to_bytes(length, "little"))
        for key, length, field in fault.machine.choices
    ]
