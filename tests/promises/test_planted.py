"""A table of wrong frames and sequences before the gate, and when each is refused at the latest.

Each row on every axis of shipped deployments. Wrong bytes, lengths, counters and identifiers are
those of test_5, in one frame each.
"""

from collections.abc import Callable, Iterable, Iterator
from typing import Any, NamedTuple

import pytest

from canshaper.codec.frame import Frame
from tests.faults.axis import Axis
from tests.faults.machine import Key
from tests.faults.shipped import NAMES
from tests.promises.events import code, counter_stands, joysticks, once, shorter, silence
from tests.promises.world import ALIKE, HOUR_NS, World
from tests.promises.worst import Worst

SOME = ("forwarder", "forwarder-robust", "gateway-forwarder", "canfd-forwarder")
# What is planted as right rises by 5 of full speed a second; those of cranes with a rope and the
# multicopter may by less. The joints of the excavator are those of forwarder-joints.
ROPES = ("bridge-crane", "bridge-crane-hook", "tower-crane", "telehandler", "multicopter")
OTHERS = (*ALIKE, *ROPES, "excavator")
MACHINES = ("forwarder", *(name for name in NAMES if name not in OTHERS))
DIRECT = tuple(name for name in MACHINES if not name.startswith("gateway"))
MOTION = ("forwarder-robust", "forwarder-pump")
EMERGENCY, SWITCHES = ("remote-forwarder",), ("j1939-rollers", "ecu-forwarder")


class Planted(Worst):
    """A gate that is handed what is planted, and neutral in the place of what it refuses.

    Attributes:
        send: velocity of each axis; ``exact`` steps instead of it.
        alter: frames in the place of that.
        k: ticks since it began.
        refused: of each axis the first refusal, and in which tick.
    """

    def __init__(self, name: str) -> None:
        super().__init__(name)
        self.send: dict[str, float] = {}
        self.exact = self.k = 0
        self.alter: Callable[[Frame], Iterable[Frame]] = lambda frame: [frame]
        self.refused: dict[str, tuple[int, str]] = {}

    def set(self, send: float, stick: float | None = None, **others: Any) -> None:
        """Velocities and sticks, of every second axis to the other side; and more of a world."""
        self.send = self.held(send)
        self.stick = self.stick if stick is None else self.held(stick)
        vars(self).update(others)

    def plants(self, row: "Row", ticks: int) -> None:
        """Neutral is seen, it moves, and then the row; what was refused moves no more."""
        if row.asked is not None:
            self.go(4)
            self.go(1, None, **self.held(row.asked))
            for k in range(1, int(row.sent / 0.09) + 2):
                self.set(min(0.09 * k, row.sent))
                self.step()
        assert not self.refused
        self.judge = self.rests
        for self.k in range(ticks):
            row.act(self, self.k)
            self.step()

    def rests(self, axis: str, before: float, now: float) -> None:
        assert not now or self.refused.get(axis, (self.k,))[0] >= self.k, axis

    def steps_of(self, axis: str) -> int:
        of, speed = self.axes[axis], self.send.get(axis, 0.0)
        size = int((of.deadband + abs(speed) * (1.0 - of.deadband)) * of.steps + 1e-6)
        return ((speed > 0.0) - (speed < 0.0)) * (self.exact or size)

    def _sent(self, key: Key, of: bytes | None = None) -> Iterator[Frame]:
        axes, data = self.moved_by[key], self._next[key]
        neutral = data = of if of is not None and len(of) == len(data) else data
        for axis in axes:
            data = self.encode(axis, data, self.steps_of(axis))
            neutral = self.encode(axis, neutral, 0)
        for frame in self.alter(Frame(*key, data)):
            left = frame.data
            if why := self.gate.leaving(key, left, of):
                for axis in axes:
                    self.refused.setdefault(axis, (self.k, why))
                self.gate.refused(key)
                left = neutral
                if self.gate.leaving(key, left, of):
                    continue
            self._next[key] = self.counted(axes[0], left, 1)
            yield Frame(*key, left)


Act = Callable[[Planted, int], None]
Of = Callable[[Planted, Axis], Any]


class Row(NamedTuple):
    """Attributes:
    act: before each tick, called with the number of ticks since it began.
    within: ticks after which it is refused at the latest, or one of WITHIN.
    on: machines that can have it; where it is long only SOME of them.
    of: which of its axes are judged, one of AXES.
    asked, sent: before that; without the first one neutral was not seen.
    """

    act: Act
    within: int | str = 0
    on: tuple[str, ...] = MACHINES
    of: str = "all"
    asked: float | None = 0.6
    sent: float = 0.59


def sends(*speeds: float, **others: Any) -> Act:
    """One after the other, and again."""
    return lambda world, k: world.set(speeds[k % len(speeds)], **others)


def after(ticks: int, act: Callable[[Any], None]) -> Act:
    """An event, sticks in neutral so long, then they are deflected; a tick later a slow start."""

    def acts(world: Planted, k: int) -> None:
        if k == 0:
            act(world)
        world.set(0.05 * (k > ticks), 0.6 * (k >= ticks))

    return acts


def slew_only(send: Callable[[int], float], **stick: float) -> Act:
    """Its stick is held; so fast the others are sent."""

    def act(world: Planted, k: int) -> None:
        world.stick = {"slew": 0.6, **stick}
        world.send = dict.fromkeys(("near_far", "lift"), send(k))

    return act


wrong = joysticks(lambda one: [one._replace(data=one.data[:-1] + bytes([one.data[-1] ^ 1]))])
WITHIN: dict[str, Of] = {
    "tail_s": lambda w, axis: axis.tail + bool(axis.moves_with),  # which adds to it until then
    "stop_s": lambda w, axis: axis.stop,
    "timeout, stop_s": lambda w, axis: axis.joystick.timeout_ns // w.machine.tick_ns + axis.stop,
    "reversal_s": lambda w, axis: axis.reversal,
}
AXES: dict[str, Of] = {
    "all": lambda w, axis: True,
    "leads": lambda w, axis: not axis.moves_with or axis.name == "slew",
    "apart": lambda w, axis: not axis.moves_with and axis.name != "slew",
    "near_far": lambda w, axis: axis.name == "near_far",
}
ROWS: dict[str, Row] = {
    # direction and size
    "the other way by a step": Row(sends(-0.6, exact=1)),
    "the other way as fast": Row(sends(-0.6)),
    "the other way from rest": Row(sends(-0.05), asked=0.3, sent=0.0),
    "faster than asked": Row(sends(0.61)),
    "faster by a rise": Row(sends(0.68)),
    "beyond full": Row(sends(1.01), asked=1.0, sent=1.0),
    "another axis": Row(slew_only(lambda k: 0.05), of="apart", asked=0.0, sent=0.0),
    "turned round": Row(sends(0.59, stick=-0.6), "reversal_s"),
    # rates; a motion lets the other one of its axes fall when one is refused
    "rises too fast": Row(sends(0.2), asked=1.0, sent=0.0),
    "full from rest": Row(sends(1.0), asked=1.0, sent=0.0),
    "falls too fast": Row(sends(0.4), of="leads"),
    "1.0 to 0.1": Row(sends(0.1), of="leads", asked=1.0, sent=1.0),
    "to one step": Row(sends(0.6, exact=1), of="leads"),
    "on and off": Row(sends(0.0, 0.59), 1),
    "off and slowly on": Row(sends(0.0, 0.05), 1, of="leads"),
    "coarse saw tooth": Row(sends(0.59, 0.3), 1, of="leads"),
    # run-on
    "goes on": Row(sends(0.59, stick=0.0), "tail_s", SOME),
    "goes on slowly": Row(sends(0.2, stick=0.0), "tail_s", SOME, sent=0.2),
    "fine saw tooth": Row(sends(0.59, 0.54, stick=0.0), "tail_s", SOME),
    "rises again": Row(
        sends(0.27, 0.18, 0.09, 0.09, 0.18, 0.27, stick=0.0), "tail_s", SOME, sent=0.27
    ),
    "falls too slowly": Row(sends(*[0.3] * 90, *[0.2] * 30, stick=0.0), "tail_s", SOME, sent=0.3),
    "a small demand": Row(sends(0.59, stick=0.1), "tail_s", SOME),
    # without an operator
    "starts by a step": Row(sends(0.6, exact=1), asked=0.0, sent=0.0),
    "starts slowly": Row(sends(0.05), asked=0.0, sent=0.0),
    "starts fast": Row(sends(1.0), asked=0.0, sent=0.0),
    "before neutral": Row(sends(0.05, stick=0.6), asked=None),
    "before a joystick": Row(sends(0.05, change=lambda one: []), on=DIRECT, asked=None),
    "starts without enable": Row(sends(0.05, enable=0), sent=0.0),
    "starts with a wrong enable": Row(sends(0.05, enable=2), "stop_s", SOME, sent=0.0),
    "starts in an emergency stop": Row(sends(0.05, stop=1), on=EMERGENCY, sent=0.0),
    "starts without a switch": Row(sends(0.05, agree=False), on=SWITCHES, sent=0.0),
    "enable comes back": Row(lambda w, k: w.set(0.05 * (k > 4), enable=int(k > 2)), 5, sent=0.0),
    "without a reset": Row(after(60, World.second_sender), 61, SOME),
    "within a second": Row(after(18, World.second_sender), 19, asked=0.0, sent=0.0),
    "when the loop goes on": Row(after(0, World.stalled), 1),
    "after a reload": Row(after(0, lambda world: world.reload()), 1),
    # at once
    "enable": Row(sends(0.59, enable=0)),
    "enable, slower": Row(sends(0.5, enable=0)),
    "emergency stop": Row(sends(0.59, stop=1), on=EMERGENCY),
    "a switch": Row(sends(0.59, agree=False), on=SWITCHES),
    "second sender": Row(once(World.second_sender)),
    "failed send": Row(once(World.send_failed)),
    "stalled loop": Row(once(World.stalled)),
    "decoders disagree": Row(lambda w, k: w.gate.disagrees(w.gate.axes.values())),
    # shaped
    "silence": Row(silence, "timeout, stop_s", ("forwarder", "canfd-forwarder")),
    "too short": Row(shorter, "timeout, stop_s", SOME),
    "joystick's counter stands": Row(counter_stands, "timeout, stop_s", SOME),
    "wrong checksum": Row(wrong, "timeout, stop_s", ("canfd-forwarder",)),
    "error code": Row(code(0), "stop_s", SOME),
    "beyond the range": Row(code(-1), "stop_s", SOME),
    "wrong enable": Row(sends(0.59, enable=2), "stop_s", SOME),
    "an hour ago": Row(sends(0.59, age_ns=HOUR_NS), "stop_s", SOME),
    "frozen": Row(sends(0.59), 1100, ("forwarder",)),
    # added
    "too much": Row(slew_only(lambda k: 0.09 * (k + 1)), 2, MOTION, "near_far", 0.0, 0.0),
    "against a stick": Row(
        slew_only(lambda k: 0.05, near_far=-0.3), 0, MOTION, "near_far", 0.0, 0.0
    ),
    "too far": Row(slew_only(lambda k: min(0.09 * (k + 1), 0.2)), 90, MOTION, "near_far", 0.0, 0.0),
    "too long": Row(
        slew_only(lambda k: 0.05 * (-1) ** (k // 20)), 302, MOTION, "near_far", 0.0, 0.0
    ),
    "twice": Row(sends(0.59, alter=lambda frame: [frame, frame])),
}
RIGHT = {
    "neutral": sends(0.0),
    "as asked": sends(0.59),
    "slower": lambda w, k: w.set(max(0.59 - 0.09 * k, 0.3)),
    "up and down while it is asked": sends(0.59, 0.54),
    "run-on": lambda w, k: w.set(max(0.59 - 0.09 * max(k - 3, 0), 0.0), stick=0.0),
    "nothing": sends(0.59, alter=lambda frame: []),
}


@pytest.mark.parametrize(("what", "name"), [(one, name) for one in ROWS for name in ROWS[one].on])
def test_what_is_wrong_is_refused_in_time(what: str, name: str) -> None:
    """And from then on nothing moves, whatever is planted; in a gateway a tick later."""
    row, world = ROWS[what], Planted(name)
    most: Of = WITHIN.get(str(row.within), lambda w, axis: row.within)
    within = {k: most(world, of) for k, of in world.axes.items() if AXES[row.of](world, of)}
    world.plants(row, max(within.values()) + 4)
    for axis, ticks in within.items():
        assert world.refused[axis][0] <= ticks + world.machine.gateway, (axis, world.refused)


@pytest.mark.parametrize("name", MACHINES)
@pytest.mark.parametrize("what", RIGHT)
def test_what_is_slower_or_nothing_passes(what: str, name: str) -> None:
    world = Planted(name)
    world.plants(Row(RIGHT[what]), 9)
    assert not world.refused
