"""A rehearsed fault, and the rule that keeps it from moving an axis."""

from collections.abc import Callable, Iterable, Mapping
from dataclasses import dataclass
from typing import Any

from canshaper.blackbox.recorder import Recorder
from canshaper.codec.e2e import E2e
from canshaper.codec.frame import Frame, FrameFault, group_of
from canshaper.controller.controller import Controller
from canshaper.machine.deployment import Deployment
from canshaper.machine.inputs import Bound
from canshaper.shaping.states import Reason

MS, S = 1_000_000, 1_000_000_000
# A hand does not hold a joystick still: a smaller reduction, in parts of full deflection, is no
# release.
SLACK = 0.05

Asked = Mapping[str, float]
"""Demands by input and signal: a velocity in [-1, 1]; 1 for a switch that allows motion, else 0."""
Alter = Callable[[Frame], tuple[Frame, ...]]
"""Function that returns the frames to receive instead of a frame."""
Begin = Callable[[Recorder, int], object]
"""Function that makes a fault once, through the recorder, at a time in ns."""


@dataclass(frozen=True)
class Fault:
    """One fault, made on the input side of controller and gate.

    Attributes:
        name: name by which a person requests it, KIND:PART.
        claim: its row in the table of reactions, see docs/safety.md.
        axes: axes of which one has to move; if empty, every axis has to be at rest.
        within_ns: time from the first altered input in which the reaction has to begin.
        alter: returns the frames to receive instead of a frame.
        once: whether only one frame is altered.
        age_ns: time by which an altered frame arrives earlier.
        begin: makes the fault once.
        end: frame received at the end, as of another sender, unless that has sent one itself.
        late: numbers of the ticks that are late, from 0 when the fault is made.
        stands: whether the late ticks are a standstill, in which no frame is read.
        unsent: whether valve frames are reported as not sent, although they are sent.
        lasts_ns: time after which it is over by itself; 0: see ``rehearsed_faults``.
    """

    name: str
    claim: str
    axes: tuple[str, ...]
    within_ns: int
    alter: Alter = lambda frame: (frame,)
    once: bool = False
    age_ns: int = 0
    begin: Begin | None = None
    end: Frame | None = None
    late: range = range(0)
    stands: bool = False
    unsent: bool = False
    lasts_ns: int = 0


class Editor:
    """Recognises the frames of one message, and changes their bits and their checksum."""

    def __init__(self, bound: Bound[Any]) -> None:
        self.bound, self._protection = bound, bound.protection
        self._keys, self._length = frozenset(bound.keys), bound.message.length

    def has(self, frame: Frame) -> bool:
        """Return whether a frame is of this message, with its length and multiplexor value."""
        bus, can_id, extended = self.bound.key
        its = frame[:3] in self._keys
        if self.bound.any_source:
            same = group_of(frame.can_id) == group_of(can_id)
            its = same and (frame.bus, frame.extended) == (bus, extended)
        chosen = self.bound.chosen
        its = its and len(frame.data) == self._length
        return its and (chosen is None or self.raw(frame)[chosen.signal] == chosen.value)

    def raw(self, frame: Frame) -> dict[str, Any]:
        """Return the raw values of a frame by signal."""
        return self.bound.layout.decode(frame.data)

    def changed(self, frame: Frame, values: Mapping[str, Any]) -> Frame:
        """Return a frame with other raw values and a right checksum; no other bit changes.

        The counter of an E2E header stays that of the frame.
        """
        encode, raw = self.bound.layout.encode, self.raw(frame)
        bits = zip(frame.data, encode(raw), encode({**raw, **values}), strict=True)
        data = bytes(byte ^ before ^ after for byte, before, after in bits)
        check = self._protection.check
        if check is not None:
            data = check.protect(data, check.count(data) if isinstance(check, E2e) else 0)
        return frame._replace(data=data)

    def counted(self, frame: Frame, new: Callable[[int], int]) -> Frame:
        """Return a frame with a right checksum and another counter: ``new`` of its own, wrapped."""
        check, counts = self._protection.check, self._protection.counts
        if isinstance(check, E2e):
            count = new(check.count(frame.data)) % counts
            return frame._replace(data=check.protect(frame.data, count))
        name = self._protection.counter or ""
        return self.changed(frame, {name: new(self.raw(frame)[name]) % counts})

    def spoiled(self, frame: Frame) -> Frame:
        """Return a frame with one wrong bit in its checksum, and all other signals unchanged."""
        data, check = bytearray(frame.data), self._protection.check
        data[getattr(check, "byte", 0)] ^= 1 << getattr(check, "shift", 0)
        return frame._replace(data=bytes(data))


def no_more(altered: Asked, real: Asked) -> bool:
    """Return whether a frame demands no more than the real one, and in no other direction."""
    return all(min(0.0, of) <= altered.get(key, 0.0) <= max(0.0, of) for key, of in real.items())


def takes_back(real: Asked, applied: Asked) -> bool:
    """Return whether a frame demands the opposite of what is applied, or less by ``SLACK``."""
    pairs = [(of, applied.get(key, 0.0)) for key, of in real.items()]
    return any(was and (of * was <= 0.0 or abs(of) < abs(was) - SLACK) for of, was in pairs)


class Demands:
    """Demands of joysticks, switches and emergency stop: a fault only reduces them.

    No axis moves unless its joystick demands that. A joystick that reduces its demand acts as if
    there were no fault:

    - A frame is replaced only by frames that demand, signal by signal, no more than it does, and in
      no other direction (``no_more``).
    - A frame that demands less than the controller has applied, or holds, is never replaced, held
      or dropped: it passes unchanged and ends the fault (``takes_back``).
    - If the controller does not follow that frame, the axes that move trip (``Rehearsal.receive``).
      Either it refuses the frame, because earlier frames were lost or had other counts, and so
      holds more than the frame demands; or an axis still runs out against the demand, in a stop
      that the fault caused.

    Gate and controller receive the same altered frames. When a rehearsed release of a switch ends,
    the switch has an edge: in neutral that edge resets, and moves no axis.

    Attributes:
        keys: key of the demand of each axis, by name of the axis.
    """

    def __init__(self, deployment: Deployment) -> None:
        self._inputs: list[tuple[str, Editor, tuple[Any, ...], list[tuple[str, int]]]] = []
        joysticks, self._bands = deployment.joysticks.values(), dict[str, float]()
        conditions = {one for joystick in joysticks for one in joystick.conditions}
        for joystick in joysticks:
            own = [(name, 1) for of, name in conditions if of == joystick.name]
            self._inputs.append((joystick.name, Editor(joystick), joystick.velocities, own))
        for one in deployment.switches:
            self._inputs.append((str([*one.switches]), Editor(one), (), [*one.switches.values()]))
        if stop := deployment.emergency_stop:
            self._inputs.append(("emergency stop", Editor(stop), (), [(stop.config.signal, 0)]))
        commands = {name: axis.config.command for name, axis in deployment.axes.items()}
        self.keys = {name: f"{one.joystick} {one.signal}" for name, one in commands.items()}
        for name, command in commands.items():
            key, band = self.keys[name], command.neutral_pct / 100.0
            self._bands[key] = min(band, self._bands.get(key, 1.0))

    def read(self, frame: Frame) -> Asked:
        """Return the demands of a frame, 0 for a neutral or invalid one; empty if it has none."""
        for name, editor, velocities, switches in self._inputs:
            if editor.has(frame):
                raw = editor.raw(frame)
                asked = self._demanded(name, ((one.name, one.read(raw)) for one in velocities))
                return asked | {f"{name} {key} on": float(raw[key] == on) for key, on in switches}
        return {}

    def held(self, controller: Controller, now_ns: int) -> Asked:
        """Return the demands of the joysticks that a controller has not lost, as it holds them."""
        held: dict[str, float] = {}
        for name, joystick in controller.joysticks.items():
            if joystick.lost(now_ns) is None:
                held |= self._demanded(name, joystick.commands.items())
        return held

    def _demanded(self, name: str, read: Iterable[tuple[str, float | Reason]]) -> dict[str, float]:
        keys = ((f"{name} {signal}", value) for signal, value in read)
        return {
            key: 0.0 if isinstance(v, Reason) or abs(v) <= self._bands.get(key, 0.0) else v
            for key, v in keys
        }


def tick_ns(deployment: Deployment, ticks: int = 2) -> int:
    """Return the time (ns) of so many ticks and one period of the slowest valve.

    An axis acts on an input only in the ticks of its valve.
    """
    slowest = max(axis.period_ticks for axis in deployment.axes.values())
    return (ticks + slowest) * deployment.config.tick_ms * MS


def lost_ns(deployment: Deployment, bound: Bound[Any]) -> int:
    """Return the longest time until a silent message counts as lost, ns."""
    timeout_ms: int = bound.config.timeout_ms
    return timeout_ms * MS + tick_ns(deployment)


def dropped(has: Callable[[Frame], bool]) -> Alter:
    """Return a function that drops the frames for which ``has`` is true."""
    return lambda frame: () if has(frame) else (frame,)


def edited(editor: Editor, edit: Callable[[Frame], Frame]) -> Alter:
    """Return a function that edits the frames of one message."""
    return lambda frame: (edit(frame) if editor.has(frame) else frame,)


def put(editor: Editor, values: Mapping[str, Any]) -> Alter:
    """Return a function that puts raw values into the frames of one message."""
    return edited(editor, lambda frame: editor.changed(frame, values))


def sent(frame: Frame) -> Begin:
    """Return a function that lets the recorder receive a frame, as from another sender."""
    return lambda recorder, now_ns: Recorder.receive(recorder, frame, now_ns)


def reports(*faults: FrameFault, off: str = "") -> Begin:
    """Return a function that reports faults, and that we are off the bus ``off`` if it is named."""

    def begin(recorder: Recorder, _now_ns: int) -> None:
        for fault in faults:
            recorder.fault(fault)
        if off:
            recorder.on_bus_off(off)

    return begin
