"""A fault that is rehearsed, and the rule that keeps it from moving anything."""

from collections.abc import Callable, Mapping
from dataclasses import dataclass
from typing import Any

from canshaper.codec.e2e import E2e
from canshaper.codec.frame import Frame, FrameFault
from canshaper.codec.identifier import group_of
from canshaper.machine.deployment import Deployment
from canshaper.machine.inputs import Bound
from canshaper.shaping.states import Reason

MS, S = 1_000_000, 1_000_000_000
# A held joystick is not still: less than this part of full deflection is no letting go.
SLACK = 0.05
LONGEST_S = 30.0  # of a fault

Asked = Mapping[str, float]
"""What frames ask for, by signal: a demand of [-1, 1]; 1 of a switch that lets move, else 0."""


@dataclass(frozen=True)
class Fault:
    """One fault as the input side makes it.

    Attributes:
        name: how a person asks for it, KIND:PART.
        claim: its row in the table of reactions, see docs/safety.md.
        axes: of these one has to move; none: every axis is at rest.
        within_ns: when the reaction has to begin.
        alter: what is received in place of a frame: itself, another one, or None.
        once: only one frame is altered.
        age_ns: how much older a frame arrives.
        begins, ends: frames of another sender, when it begins and when it is over.
        copy: what another sender sends behind a frame, or None.
        late: whether a tick is late, by its number.
        stall: the late ticks are a standstill, in which nothing is read.
        reports: what the bus reports.
        unsent: frames are reported as not sent, though they are.
        off: name of the bus that is reported off.
        lasts_ns: it is over by itself after that; 0 until its reaction is over.
    """

    name: str
    claim: str
    axes: tuple[str, ...]
    within_ns: int
    alter: Callable[[Frame], Frame | None] = lambda frame: frame
    once: bool = False
    age_ns: int = 0
    begins: tuple[Frame, ...] = ()
    ends: tuple[Frame, ...] = ()
    copy: Callable[[Frame], Frame | None] = lambda _frame: None
    late: Callable[[int], bool] = lambda _tick: False
    stall: bool = False
    reports: FrameFault | None = None
    unsent: bool = False
    off: str = ""
    lasts_ns: int = 0


class Editor:
    """Recognises the frames of one message, and changes their bits; the check is made again."""

    def __init__(self, bound: Bound[Any]) -> None:
        self.bound = bound
        self._keys, self._length = frozenset(bound.keys), bound.message.length

    def has(self, frame: Frame) -> bool:
        """Whether it is a frame of this message, of its length and page."""
        bound = self.bound
        bus, can_id, extended = bound.key
        if bound.any_source:
            its = (frame[0], frame[2]) == (bus, extended)
            its = its and group_of(frame[1]) == group_of(can_id)
        else:
            its = frame[:3] in self._keys
        if not its or len(frame.data) != self._length:
            return False
        chosen = bound.chosen
        return chosen is None or self.raw(frame)[chosen.signal] == chosen.value

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
        check = self.bound.protection.check
        if check is not None:
            data = check.protect(data, check.count(data) if isinstance(check, E2e) else 0)
        return frame._replace(data=data)

    def count(self, frame: Frame) -> int:
        """Its alive counter."""
        protection = self.bound.protection
        if isinstance(protection.check, E2e):
            return protection.check.count(frame.data)
        return int(self.raw(frame)[protection.counter or ""])

    def counted(self, frame: Frame, count: int) -> Frame:
        """The frame with another count."""
        protection = self.bound.protection
        count %= protection.counts
        if isinstance(protection.check, E2e):
            return frame._replace(data=protection.check.protect(frame.data, count))
        return self.changed(frame, {protection.counter or "": count})

    def spoiled(self, frame: Frame) -> Frame:
        """The frame with a wrong check and every signal as it was."""
        check = self.bound.protection.check
        at, shift = (0, 0) if check is None or isinstance(check, E2e) else (check.byte, check.shift)
        data = bytearray(frame.data)
        data[at] ^= 1 << shift
        return frame._replace(data=bytes(data))


class Demands:
    """What the frames of joysticks, switches and emergency stop ask for, and the one rule.

    Nothing moves that the joystick did not ask for, because of two facts. A frame is replaced only
    by one that asks, signal by signal, for no more than it does itself, and in no other direction
    (``no_more``): a fault only takes. And a frame that takes something back from what the
    controller was told is never replaced, held or dropped: it passes as it is and ends the fault
    (``takes_back``). Gate and controller get the same frames, behind the fault. The end of a
    release that was rehearsed is the edge of a switch: in neutral it resets, and moves nothing.

    Open: behind altered counters or lost frames the sequence check may refuse the frame that ends
    the fault, so what is let go counts as many frames later as that check needs.
    """

    def __init__(self, deployment: Deployment) -> None:
        self._inputs: list[tuple[str, Editor, tuple[Any, ...], list[tuple[str, int]]]] = []
        conditions = {(of, name) for one in deployment.joysticks.values() for of, name in
                      one.conditions}  # fmt: skip
        for joystick in deployment.joysticks.values():
            own = [(name, 1) for of, name in sorted(conditions, key=str) if of == joystick.name]
            self._inputs.append((joystick.name, Editor(joystick), joystick.velocities, own))
        for one in deployment.switches:
            self._inputs.append((str([*one.switches]), Editor(one), (), [*one.switches.values()]))
        if stop := deployment.emergency_stop:
            self._inputs.append(("stop", Editor(stop), (), [(stop.config.signal, 0)]))

    def read(self, frame: Frame) -> Asked:
        """What a frame asks for; of another message nothing."""
        for name, editor, velocities, switches in self._inputs:
            if editor.has(frame):
                raw = editor.raw(frame)
                read = {one.name: one.read(raw) for one in velocities}
                asked = {
                    f"{name} {k}": 0.0 if isinstance(v, Reason) else v for k, v in read.items()
                }
                return asked | {f"{name} {k} on": float(raw[k] == on) for k, on in switches}
        return {}

    @staticmethod
    def no_more(altered: Asked, real: Asked) -> bool:
        """Whether a frame asks for no more than the real one, and in no other direction."""
        return all(
            min(0.0, of) <= altered.get(key, 0.0) <= max(0.0, of) for key, of in real.items()
        )

    @staticmethod
    def takes_back(real: Asked, told: Asked) -> bool:
        """Whether a frame asks for less than what was told, or for the other direction."""
        pairs = [(of, told.get(key, 0.0)) for key, of in real.items()]
        return any(was and of * (was > 0 or -1) < abs(was) - SLACK for of, was in pairs)


def tick_ns(deployment: Deployment, ticks: int = 2) -> int:
    """So many ticks, of the slowest valve: its axis looks at what came when it is its turn."""
    slowest = max(axis.period_ticks for axis in deployment.axes.values())
    return (ticks + slowest) * deployment.config.tick_ms * MS


def dropped(editor: Editor) -> Callable[[Frame], Frame | None]:
    """Drop the frames of one message."""
    return lambda frame: None if editor.has(frame) else frame


def edited(editor: Editor, edit: Callable[[Frame], Frame]) -> Callable[[Frame], Frame | None]:
    """Edit the frames of one message."""
    return lambda frame: edit(frame) if editor.has(frame) else frame


def put(editor: Editor, **values: int) -> Callable[[Frame], Frame | None]:
    """Put raw values into the frames of one message."""
    return edited(editor, lambda frame: editor.changed(frame, values))
