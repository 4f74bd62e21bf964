"""A fault that is rehearsed, and the rule that keeps it from moving anything."""

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
# A held joystick is not still: less than this part of full deflection is no letting go.
SLACK = 0.05

Asked = Mapping[str, float]
"""Demands of frames by signal: a velocity in [-1, 1]; 1 of a switch that allows motion, else 0."""
Alter = Callable[[Frame], tuple[Frame, ...]]
"""Function that returns the frames to receive in place of a frame."""
Begin = Callable[[Recorder, int], object]
"""Function that acts once on the recorder, at a time."""


@dataclass(frozen=True)
class Fault:
    """One fault as the input side makes it.

    Attributes:
        name: how a person asks for it, KIND:PART.
        claim: its row in the table of reactions, see docs/safety.md.
        axes: of these one has to move; none: every axis is at rest.
        within_ns: when the reaction has to begin.
        alter: what is received in place of a frame.
        once: only one frame is altered.
        age_ns: how much older an altered frame arrives.
        begin: what is made once.
        end: frame of another sender, when it is over.
        late: numbers of the ticks that are late.
        stands: the late ticks are a standstill, in which nothing is read.
        unsent: frames are reported as not sent, though they are.
        lasts_ns: it is over by itself after that; 0 until its reaction is over.
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
    """Recognises the frames of one message, and changes their bits; the check is made again."""

    def __init__(self, bound: Bound[Any]) -> None:
        self.bound, self._protection = bound, bound.protection
        self._keys, self._length = frozenset(bound.keys), bound.message.length

    def has(self, frame: Frame) -> bool:
        """Whether it is a frame of this message, of its length and its value of the multiplexor."""
        bus, can_id, extended = self.bound.key
        its = frame[:3] in self._keys
        if self.bound.any_source:
            same = group_of(frame.can_id) == group_of(can_id)
            its = same and (frame.bus, frame.extended) == (bus, extended)
        chosen = self.bound.chosen
        its = its and len(frame.data) == self._length
        return its and (chosen is None or self.raw(frame)[chosen.signal] == chosen.value)

    def raw(self, frame: Frame) -> dict[str, Any]:
        """Raw values."""
        return self.bound.layout.decode(frame.data)

    def changed(self, frame: Frame, values: Mapping[str, Any]) -> Frame:
        """The frame with other raw values: of all other bits none changes, but those of its check.

        The counter of an E2E header is that of the frame.
        """
        encode, raw = self.bound.layout.encode, self.raw(frame)
        bits = zip(frame.data, encode(raw), encode({**raw, **values}), strict=True)
        data = bytes(byte ^ before ^ after for byte, before, after in bits)
        check = self._protection.check
        if check is not None:
            data = check.protect(data, check.count(data) if isinstance(check, E2e) else 0)
        return frame._replace(data=data)

    def counted(self, frame: Frame, new: Callable[[int], int]) -> Frame:
        """The frame with another alive counter, by its own one."""
        check, counts = self._protection.check, self._protection.counts
        if isinstance(check, E2e):
            count = new(check.count(frame.data)) % counts
            return frame._replace(data=check.protect(frame.data, count))
        name = self._protection.counter or ""
        return self.changed(frame, {name: new(self.raw(frame)[name]) % counts})

    def spoiled(self, frame: Frame) -> Frame:
        """The frame with one bit of its check wrong, and every signal as it was."""
        data, check = bytearray(frame.data), self._protection.check
        data[getattr(check, "byte", 0)] ^= 1 << getattr(check, "shift", 0)
        return frame._replace(data=bytes(data))


def no_more(altered: Asked, real: Asked) -> bool:
    """Whether a frame asks for no more than the real one, and in no other direction."""
    return all(min(0.0, of) <= altered.get(key, 0.0) <= max(0.0, of) for key, of in real.items())


def takes_back(real: Asked, applied: Asked) -> bool:
    """Whether a frame asks for less than what is applied, for nothing, or the other way."""
    pairs = [(of, applied.get(key, 0.0)) for key, of in real.items()]
    return any(was and (of * was <= 0.0 or abs(of) < abs(was) - SLACK) for of, was in pairs)


class Demands:
    """Demands of joysticks, switches and emergency stop: a fault only reduces them.

    Nothing moves that the joystick did not ask for, and what it takes back acts as without a fault:

    - A frame is replaced only by one that asks, signal by signal, for no more than it does itself,
      and in no other direction (``no_more``).
    - A frame that takes something back from what the controller has applied, or holds, is never
      replaced, held or dropped: it passes as it is and ends the fault (``takes_back``).
    - Where the controller does not follow that frame, what moves trips: it refuses the frame and so
      holds more than it asks for, because frames before were lost or had other counts; or an axis
      runs out against it, in a stop of the fault (``Rehearsal.receive``).

    Gate and controller get the same frames, behind the fault. The end of a release that was
    rehearsed is the edge of a switch: in neutral it resets, and moves nothing.

    Attributes:
        keys: by axis, the key of its demand.
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
        """Return the demands of a frame; none of another message."""
        for name, editor, velocities, switches in self._inputs:
            if editor.has(frame):
                raw = editor.raw(frame)
                asked = self._demanded(name, ((one.name, one.read(raw)) for one in velocities))
                return asked | {f"{name} {key} on": float(raw[key] == on) for key, on in switches}
        return {}

    def held(self, controller: Controller, now_ns: int) -> Asked:
        """Return the demands of the last good frames of a controller, while they are fresh."""
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
    """So many ticks, of the slowest valve: its axis looks at what came when it is its turn."""
    slowest = max(axis.period_ticks for axis in deployment.axes.values())
    return (ticks + slowest) * deployment.config.tick_ms * MS


def lost_ns(deployment: Deployment, bound: Bound[Any]) -> int:
    """Until a message that is silent is lost."""
    timeout_ms: int = bound.config.timeout_ms
    return timeout_ms * MS + tick_ns(deployment)


def dropped(has: Callable[[Frame], bool]) -> Alter:
    """Drop some frames."""
    return lambda frame: () if has(frame) else (frame,)


def edited(editor: Editor, edit: Callable[[Frame], Frame]) -> Alter:
    """Edit the frames of one message."""
    return lambda frame: (edit(frame) if editor.has(frame) else frame,)


def put(editor: Editor, values: Mapping[str, Any]) -> Alter:
    """Put raw values into the frames of one message."""
    return edited(editor, lambda frame: editor.changed(frame, values))


def sent(frame: Frame) -> Begin:
    """Another sender sends a frame."""
    return lambda recorder, now_ns: Recorder.receive(recorder, frame, now_ns)


def reports(*faults: FrameFault, off: str = "") -> Begin:
    """Faults are reported, and that we are off a bus."""

    def begin(recorder: Recorder, _now_ns: int) -> None:
        for fault in faults:
            recorder.fault(fault)
        if off:
            recorder.on_bus_off(off)

    return begin
