"""Daemons and controllers that do one thing wrong each: rules and judge have to catch them all.

They stand between daemon and buses, so they stay what they are however it is built.
"""

from collections.abc import Callable
from typing import Protocol

from canshaper.codec.frame import Frame
from tests.faults.axis import Axis
from tests.faults.axis_judge import TRIPPED
from tests.faults.inputs import Joystick
from tests.faults.machine import Machine

Change = Callable[[Frame], Frame | None]


class Hooks(Protocol):
    """Where frames can be changed, in and out."""

    incoming: Change
    outgoing: Change


Lie = Callable[[Hooks, Machine], None]
JOYSTICKS = "forwarder"


def _joystick(machine: Machine, frame: Frame) -> Joystick | None:
    source = machine.inputs.get(frame[:3])
    return source if isinstance(source, Joystick) and len(frame.data) == source.length else None


def _incoming(change: Callable[[Machine, Frame], Frame | None]) -> Lie:
    def lie(hooks: Hooks, machine: Machine) -> None:
        hooks.incoming = lambda frame: change(machine, frame)

    return lie


def _steps(change: Callable[[Axis, int], int]) -> Lie:
    """Every command changed."""

    def lie(hooks: Hooks, machine: Machine) -> None:
        valves = machine.valves

        def changed(frame: Frame) -> Frame:
            if (axis := valves.get(frame[:3])) is None:
                return frame
            word = int.from_bytes(frame.data, "little")
            raw = axis.valve.get(word)
            new = max(-axis.steps, min(axis.steps, change(axis, raw)))
            word += axis.valve.put(new) - axis.valve.put(raw)
            return frame._replace(data=word.to_bytes(len(frame.data), "little"))

        hooks.outgoing = changed

    return lie


def _enabled(machine: Machine, frame: Frame) -> Frame:
    """Enable is on, whatever the frame says."""
    joystick = _joystick(machine, frame)
    if joystick is None or joystick.enable is None or joystick.checksum:
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


def _holds_on(hooks: Hooks, machine: Machine) -> None:
    """Neutral goes out a frame late."""
    last: dict[str, int] = {}

    def late(axis: Axis, raw: int) -> int:
        before = last.get(axis.name, 0)
        last[axis.name] = raw
        return raw if raw else before

    _steps(late)(hooks, machine)


def _counter_stands(hooks: Hooks, machine: Machine) -> None:
    """The alive counter of a valve stands still now and then."""

    def stands(frame: Frame) -> Frame:
        if frame[:3] not in machine.valves or frame.data[1] % 50 != 49:
            return frame
        return frame._replace(data=frame.data[:1] + bytes([frame.data[1] - 1]))

    hooks.outgoing = stands


def _checksum_wrong(hooks: Hooks, machine: Machine) -> None:
    """A gateway's frame leaves with another checksum, where it moves."""
    axes = {axis.valve_key: axis for axis in machine.axes.values()}

    def spoiled(frame: Frame) -> Frame:
        if frame[:3] not in axes or not axes[frame[:3]].sent(frame.data)[0]:
            return frame
        at = axes[frame[:3]].joystick.checksum_byte
        data = frame.data[:at] + bytes([frame.data[at] ^ 1]) + frame.data[at + 1 :]
        return frame._replace(data=data)

    hooks.outgoing = spoiled


def _no_stop(machine: Machine, frame: Frame) -> Frame:
    """The emergency stop is heard and taken for free."""
    stop = machine.stop
    if stop is None or frame[:3] != stop.key or len(frame.data) != stop.length:
        return frame
    assert stop.counter
    count = stop.counter.get(int.from_bytes(frame.data, "little"))
    return frame._replace(data=stop.data({stop.counter.name: count}))


def _left_out(hooks: Hooks, machine: Machine) -> None:
    """A frame of a valve is left out now and then."""
    hooks.outgoing = lambda frame: (
        None if frame[:3] in machine.valves and frame.data[1] % 60 == 59 else frame
    )


def _untold(hooks: Hooks, machine: Machine) -> None:
    """A trip is not reported."""
    hooks.outgoing = lambda frame: (
        None if frame[:3] in machine.statuses and frame.data[0] & 0xF == TRIPPED else frame
    )


def _never_back(hooks: Hooks, machine: Machine) -> None:
    """Each valve stays neutral for good once it has moved and stopped."""
    moved, over = set[str](), set[str]()

    def neutral(axis: Axis, raw: int) -> int:
        if raw:
            moved.add(axis.name)
        elif axis.name in moved:
            over.add(axis.name)
        return 0 if axis.name in over else raw

    _steps(neutral)(hooks, machine)


LIES: dict[str, tuple[str, Lie]] = {
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
# Of a controller: what is a lie of frames alone, and what only the judge sees.
OF_FRAMES = ("enable forced", "another sender unseen", "neutral late", "counter stands")
OF_FRAMES += ("a little too fast", "wrong way", "creeps")
JUDGED: dict[str, Lie] = {
    **{name: LIES[name][1] for name in OF_FRAMES},
    "stop unseen": _incoming(_no_stop),
    "frame left out": _left_out,
    "trip untold": _untold,
    "never back": _never_back,
}
