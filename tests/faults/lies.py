"""Daemons that do one thing wrong each: the rules have to catch them all.

They stand between the daemon and its buses, so they stay what they are however it is built.
"""

from collections.abc import Callable

from canshaper.codec.frame import Frame
from tests.faults.axis import Axis
from tests.faults.inputs import Joystick
from tests.faults.machine import Machine
from tests.faults.sequence import Sequence

JOYSTICKS = "forwarder"


def _joystick(machine: Machine, frame: Frame) -> Joystick | None:
    source = machine.inputs.get(frame[:3])
    return source if isinstance(source, Joystick) and len(frame.data) == source.length else None


def _incoming(change: Callable[[Machine, Frame], Frame | None]) -> Callable[[Sequence], None]:
    def lie(sequence: Sequence) -> None:
        sequence.bench.incoming = lambda frame: change(sequence.machine, frame)

    return lie


def _steps(change: Callable[[Axis, int], int]) -> Callable[[Sequence], None]:
    """Every command changed."""

    def lie(sequence: Sequence) -> None:
        valves = sequence.machine.valves

        def changed(frame: Frame) -> Frame:
            if (axis := valves.get(frame[:3])) is None:
                return frame
            word = int.from_bytes(frame.data, "little")
            raw = axis.valve.get(word)
            new = max(-axis.steps, min(axis.steps, change(axis, raw)))
            word += axis.valve.put(new) - axis.valve.put(raw)
            return frame._replace(data=word.to_bytes(len(frame.data), "little"))

        sequence.bench.outgoing = changed

    return lie


def _enabled(machine: Machine, frame: Frame) -> Frame:
    """Enable is on, whatever the frame says."""
    joystick = _joystick(machine, frame)
    if joystick is None or joystick.enable is None:
        return frame
    word = int.from_bytes(frame.data, "little")
    word += joystick.enable.put(1) - joystick.enable.put(joystick.enable.get(word))
    return frame._replace(data=word.to_bytes(joystick.length, "little"))


def _no_error(machine: Machine, frame: Frame) -> Frame:
    """An error code is full deflection."""
    if (joystick := _joystick(machine, frame)) is None:
        return frame
    word = int.from_bytes(frame.data, "little")
    for axis in joystick.axes:
        raw = axis.signal.get(word)
        if raw in axis.signal.special:
            word += axis.signal.put(axis.signal.full) - axis.signal.put(raw)
    return frame._replace(data=word.to_bytes(joystick.length, "little"))


def _no_others(machine: Machine, frame: Frame) -> Frame | None:
    """No other sender of a valve's frame is seen."""
    return None if frame[:3] in machine.valves else frame


def _no_emergency(machine: Machine, frame: Frame) -> Frame | None:
    """No emergency is seen."""
    ids = [0x80 + node.number for node in machine.nodes.values()]
    return None if frame.can_id in ids else frame


def _always_operational(machine: Machine, frame: Frame) -> Frame:
    """Every heartbeat says operational."""
    ids = [0x700 + node.number for node in machine.nodes.values()]
    return frame._replace(data=b"\x05") if frame.can_id in ids else frame


def _always_active(machine: Machine, frame: Frame) -> Frame:
    """Once a valve was active, every status word says so."""
    keys = [axis.words.key for axis in machine.axes.values() if axis.words]
    low = frame.data[0] & 0xF if frame.data else 0
    leaves = frame[:3] in keys and low == 0x3
    return frame._replace(data=b"\x0f\x00") if leaves else frame


def _no_claim(machine: Machine, frame: Frame) -> Frame | None:
    """No claim of our address is seen."""
    return None if frame.extended and frame.can_id >> 8 & 0xFF00 == 0xEE00 else frame


def _holds_on(sequence: Sequence) -> None:
    """Neutral goes out a frame late."""
    last: dict[str, int] = {}

    def late(axis: Axis, raw: int) -> int:
        before = last.get(axis.name, 0)
        last[axis.name] = raw
        return raw if raw else before

    _steps(late)(sequence)


def _counter_stands(sequence: Sequence) -> None:
    """The alive counter of a valve stands still now and then."""
    valves = sequence.machine.valves

    def stands(frame: Frame) -> Frame:
        if frame[:3] not in valves or frame.data[1] % 50 != 49:
            return frame
        return frame._replace(data=frame.data[:1] + bytes([frame.data[1] - 1]))

    sequence.bench.outgoing = stands


def _checksum_wrong(sequence: Sequence) -> None:
    """A gateway's frame leaves with another checksum, where it moves."""
    axes = {axis.valve_key: axis for axis in sequence.machine.axes.values()}

    def spoiled(frame: Frame) -> Frame:
        if frame[:3] not in axes or not axes[frame[:3]].sent(frame.data)[0]:
            return frame
        at = axes[frame[:3]].joystick.checksum_byte
        data = frame.data[:at] + bytes([frame.data[at] ^ 1]) + frame.data[at + 1 :]
        return frame._replace(data=data)

    sequence.bench.outgoing = spoiled


LIES: dict[str, tuple[str, Callable[[Sequence], None]]] = {
    "enable forced": (JOYSTICKS, _incoming(_enabled)),
    "error code unseen": (JOYSTICKS, _incoming(_no_error)),
    "another sender unseen": (JOYSTICKS, _incoming(_no_others)),
    "emergency unseen": ("canopen-forwarder", _incoming(_no_emergency)),
    "always operational": ("canopen-forwarder", _incoming(_always_operational)),
    "always active": ("canopen-forwarder", _incoming(_always_active)),
    "claim unseen": ("j1939-forwarder", _incoming(_no_claim)),
    "neutral late": (JOYSTICKS, _holds_on),
    "counter stands": (JOYSTICKS, _counter_stands),
    "a little too fast": (JOYSTICKS, _steps(lambda _, raw: raw + (raw > 0) * 3 - (raw < 0) * 3)),
    "wrong way": (JOYSTICKS, _steps(lambda _, raw: -raw)),
    "creeps": (JOYSTICKS, _steps(lambda axis, raw: raw or round(axis.deadband * axis.steps) + 1)),
    "checksum wrong": ("gateway-protected", _checksum_wrong),
    "never moves": (JOYSTICKS, _steps(lambda _, __: 0)),
}
