"""Faults of a joystick: in its raw values, and in the bytes of its frames."""

from collections.abc import Callable, Iterable

from tests.faults.fault import Fault, Raw
from tests.faults.inputs import Joystick

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
            raw |= fault.joystick.pressed(fault.rng.choice(values))

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


def joystick_frames(
    joystick: Joystick, raws: Iterable[Raw], active: Iterable[Fault]
) -> list[bytes]:
    """Frames of a joystick by their raw values, with the faults that act on it."""
    own = [fault for fault in active if fault.joystick is joystick]
    frames = []
    for raw in raws:
        for fault in own:
            if act := RAW.get(fault.kind):
                act(fault, raw)
        frames.append(joystick.data(raw))
    for fault in own:
        if spoil := WIRE.get(fault.kind):
            frames = spoil(fault, frames)
    return frames
