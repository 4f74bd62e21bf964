"""A shipped deployment by its bytes: hand, nodes and bus, ticked by hand.

Frames are made and read by ``tests.faults``: plain YAML, and cantools for bits; no codec of ours.
"""

from collections.abc import Callable, Iterable, Iterator
from typing import Any

import pytest

from canshaper.codec.frame import Frame
from canshaper.controller.controller import Controller
from canshaper.controller.events import RefusalEvent
from canshaper.controller.gated import GatedController
from tests.faults.machine import Key
from tests.faults.shipped import NAMES
from tests.promises.seen import Buses
from tests.promises.valve_frames import ValveFrames

REST = 25  # ticks until claims, nodes and neutral are seen
SMALLEST = 1e-9
HOUR_NS = 3_600_000_000_000

# To the gate each of these is as another one in its place is; they differ in filters and sensors.
ALIKE = (
    *("forwarder", "forwarder-sensor", "forwarder-joints", "two-cranes", "canfd-sensor"),
    *("j1939-profiles", "j1939-sensor", "js6000-forwarder", "canopen-sensor"),
)
every = pytest.mark.parametrize(
    "name", [pytest.param(n, marks=pytest.mark.slow) if n in ALIKE else n for n in NAMES]
)

Plant = Callable[[list[Frame]], Iterable[Frame]]
Change = Callable[[Frame], Iterable[Frame]]


class Evil(Controller):
    """Computes sound frames, and hands out what is planted in their place.

    Attributes:
        of: what a gateway received, while it passes that on.
    """

    plant: Plant = staticmethod(list)
    substitute: Callable[[Frame], Frame] = staticmethod(lambda frame: frame)
    of: bytes | None = None

    def tick(self, now_ns: int, missed: int = 0) -> Iterator[Frame]:
        yield from self.plant(list(super().tick(now_ns, missed)))

    def receive(self, frame: Frame, arrived_ns: int) -> Frame | None:
        passed = super().receive(frame, arrived_ns)
        self.of = frame.data
        passed = next(iter([*self.plant([passed])]), None) if passed else None
        self.of = None
        return passed

    def refused(self, frame: Frame) -> Frame:
        return self.substitute(super().refused(frame))


class World(ValveFrames):
    """Hand, nodes and bus of a deployment.

    Attributes:
        stick: position of the joystick by axis, [-1, 1].
        raw: raw values of some signals, by joystick, whatever the hand does.
        change: what becomes of a frame before it is received: none, one or more.
        judge: looks at each velocity that leaves: axis, the one before, and now.
        age_ns: by its stamp so long ago every frame comes.
        left: what left in the last tick.
        speed: of each axis; its last command holds until the valve's timeout.
        way: of each axis, s of full speed.
        buses: what was on the buses, as an operator knows it.
    """

    def __init__(self, name: str) -> None:
        super().__init__(name)
        self.evil = Evil(self.deployment)
        self.gated = GatedController(self.evil)
        self.buses = Buses(self.machine)
        self.stick: dict[str, float] = {}
        self.raw: dict[str, dict[str, int]] = {}
        self.enable, self.reset, self.stop, self.agree = 1, 0, 0, True
        self.change: Change = lambda frame: [frame]
        self.judge: Callable[[str, float, float], None] = lambda *_: None
        self.n, self.age_ns = HOUR_NS // self.machine.tick_ns, 0
        self.left: list[Frame] = []
        self.speed = dict.fromkeys(self.axes, 0.0)
        self.way = dict.fromkeys(self.axes, 0.0)
        self.moved_by: dict[Key, list[str]] = {}
        for axis, one in self.axes.items():
            self.moved_by.setdefault(one.valve_key, []).append(axis)
        self._last = dict.fromkeys(self.axes, self.n)
        self._counts: dict[Key, int] = {}
        self._control: dict[str, int] = {}

    @property
    def now_ns(self) -> int:
        return self.n * self.machine.tick_ns

    # --- frames of others ------------------------------------------------------------------------

    def joystick(self, name: str) -> Frame:
        """Its frame of this tick."""
        of = self.machine.joysticks[name]
        raw = of.pressed(self.enable)
        if of.reset:
            raw[of.reset.name] = self.reset
        for axis in of.axes:
            raw |= axis.raw(round(self.stick.get(axis.name, 0.0) * axis.signal.full))
        return Frame(*of.key, of.data(self._counted(of, raw) | self.raw.get(name, {})))

    def _counted(self, of: Any, raw: dict[str, int]) -> dict[str, int]:
        if of.counter:
            count = self._counts[of.key] = self._counts.get(of.key, -1) + 1
            raw[of.counter.name] = count & of.counter.mask
        return raw

    def others(self) -> Iterator[Frame]:
        """Frames of other nodes."""
        machine = self.machine
        for node in machine.nodes.values():
            yield Frame(node.bus, 0x700 + node.number, False, b"\x05")
        for axis, of in self.axes.items():
            if of.words:
                word = of.words.status.put(self._control.get(axis, 0) & 7 | 8)
                yield Frame(*of.words.key, word.to_bytes(of.words.length, "little"))
        if machine.radius:
            key, length, field = machine.radius
            yield Frame(*key, field.put(6000).to_bytes(length, "little"))
        for switches in machine.switches:
            codes = {name: code if self.agree else 0 for name, code in switches.codes.items()}
            yield Frame(*switches.key, switches.data(self._counted(switches, codes)))
        if machine.stop:
            raw = self._counted(machine.stop, {machine.stop_field.name: self.stop})
            yield Frame(*machine.stop.key, machine.stop.data(raw))

    # --- a tick ----------------------------------------------------------------------------------

    def receive(self, frame: Frame) -> list[Frame]:
        """A frame comes in; what of it goes through a gateway."""
        at_ns = self.now_ns - self.age_ns
        self.buses.receive(frame, at_ns)
        return self.passed(frame, at_ns)

    def passed(self, frame: Frame, at_ns: int) -> list[Frame]:
        """Return the frames that leave for it at once."""
        passed = self.gated.receive(frame, at_ns)
        return [passed] if passed else []

    def ticked(self, missed: int) -> Iterable[Frame]:
        """Yield the frames that leave in the tick."""
        return self.gated.tick(self.now_ns, missed)

    def step(self, plant: Plant | None = None, missed: int = 0) -> list[Frame]:
        """A tick; what left."""
        self.evil.plant = plant or list
        self.n += missed
        self.left = []
        for frame in [*self.others(), *(self.joystick(one) for one in self.machine.joysticks)]:
            for changed in self.change(frame):
                self._leave(self.receive(changed))
        self.buses.look(self.now_ns, self.n)
        self._leave(self.ticked(missed))
        self.n += 1
        for axis, of in self.axes.items():
            if self.n - self._last[axis] > of.valve_timeout_ns // self.machine.tick_ns:
                self.speed[axis] = 0.0
            self.way[axis] += abs(self.speed[axis]) * of.tick_s
        self.buses.speed = self.speed
        return self.left

    def _leave(self, frames: Iterable[Frame]) -> None:
        for frame in frames:
            self.left.append(frame)
            for axis in self.moved_by.get(frame[:3], ()):
                steps = self.decode(axis, frame.data)
                assert steps is not None, (axis, frame)
                before, speed = self.speed[axis], self.axes[axis].velocity(steps)
                speed = speed or SMALLEST * steps  # within the dead band it is a command, too
                self.speed[axis], self._last[axis] = speed, self.n + 1
                if words := self.axes[axis].words:
                    self._control[axis] = words.control.get(int.from_bytes(frame.data, "little"))
                self.judge(axis, before, speed)

    def go(self, ticks: int, plant: Plant | None = None, **stick: float) -> None:
        """Ticks with the joysticks held so."""
        self.stick = stick
        for _ in range(ticks):
            self.step(plant)

    def refusals(self) -> list[str]:
        """Return the refusals of the gate since the last call."""
        refused = [one.why for one in self.evil.events if isinstance(one, RefusalEvent)]
        self.evil.events.clear()
        return refused

    def held(self, size: float) -> dict[str, float]:
        """Every joystick deflected, one this way and the next one the other."""
        return {axis: size * (-1) ** i for i, axis in enumerate(self.axes)}

    def commands(self, **speed: float) -> Plant:
        """Plants other speeds, parts of full command, in the frames of these axes' valves."""

        def plant(frames: list[Frame]) -> Iterable[Frame]:
            for frame in frames:
                data = frame.data
                for axis in self.moved_by.get(frame[:3], ()):
                    if axis in speed:
                        data = self.encode(axis, data, round(self.axes[axis].steps * speed[axis]))
                yield frame._replace(data=data)

        return plant

    # --- what goes wrong -------------------------------------------------------------------------

    def well(self) -> None:
        """Nothing is wrong any more."""
        self.enable, self.stop, self.agree, self.raw = 1, 0, True, {}
        self.change, self.age_ns = lambda frame: [frame], 0

    def second_sender(self) -> None:
        """Another node sends what our valves receive."""
        for key, axes in self.moved_by.items():
            self.receive(Frame(*key, bytes(self.axes[axes[0]].valve_message.length)))

    def send_failed(self) -> None:
        """No valve frame of the last tick got out."""
        for frame in self.left:
            for axis in self.moved_by.get(frame[:3], ()):
                self.buses.axes[axis].failed()
        for frame in [one for one in self.left if one[:3] in self.moved_by]:
            self.fails(frame)

    def fails(self, frame: Frame) -> None:
        self.gated.send_failed(frame)

    def stalled(self, ticks: int = 15) -> None:
        """The loop stood still for so long."""
        self.n += ticks
        self.buses.stalled()
        self.stands()

    def stands(self) -> None:
        self.gated.stalled()

    def reload(self) -> None:
        """The file is read again."""
        evil = Evil(self.deployment)
        evil.carry_over(self.evil)
        before, self.evil, self.gated = self.gated, evil, GatedController(evil)
        self.gated.carry_over(before)
        self.buses.reload()
