"""Other nodes by CiA 301, CiA 408 and SAE J1939-81: valves, joysticks, who wants our address."""

import random
from typing import TYPE_CHECKING

from canshaper.codec.frame import Frame
from tests.faults.axis import Node
from tests.faults.machine import Machine
from tests.rigs.canopen import (
    ACTIVE,
    BOOT_UP,
    HOLD,
    INIT,
    OPERATIONAL,
    PRE_OPERATIONAL,
    STOPPED,
    ValveNode,
)

if TYPE_CHECKING:
    from tests.faults.world import World

HEARTBEAT, EMERGENCY, NMT, START = 0x700, 0x80, 0, 1
HEARTBEAT_CYCLE_NS = 150_000_000
STATUS_CYCLE_NS = 100_000_000
# From a command to what it does, and between an emergency and the message that it is over.
ANSWER_NS, SHORT_NS = 1_000_000, 300_000


class CanopenNode:
    """A joystick or a valve with heartbeats, emergencies and, for a valve, its status word."""

    def __init__(self, world: "World", node: Node, machine: Machine, rng: random.Random) -> None:
        self._world, self._node = world, node
        self.axis = next(
            (a for a in machine.axes.values() if a.words and a.words.node is node), None
        )
        self.valve = ValveNode() if self.axis else None
        self._state = PRE_OPERATIONAL
        self.silent = self.mute = False  # no heartbeats; no status word
        world.every(HEARTBEAT_CYCLE_NS, rng.randrange(HEARTBEAT_CYCLE_NS), self._heartbeat)
        if self.axis:
            world.every(STATUS_CYCLE_NS, rng.randrange(STATUS_CYCLE_NS), self.status)

    @property
    def operational(self) -> bool:
        """Whether it sends and takes process data."""
        return self._state == OPERATIONAL

    def _frame(self, base: int, data: bytes) -> None:
        self._world.put(Frame(self._node.bus, base + self._node.number, False, data))

    def _heartbeat(self) -> None:
        if not self.silent:
            self._frame(HEARTBEAT, bytes((self._state,)))

    def status(self) -> None:
        """The status word, by the event timer or because it has changed."""
        if self.axis and self.valve and self.operational and not self.mute:
            assert self.axis.words
            word = self.axis.words.status.put(self.valve.state)
            self._world.put(
                Frame(*self.axis.words.key, word.to_bytes(self.axis.words.length, "little"))
            )

    def command(self, frame: Frame) -> None:
        """Take what the daemon sends."""
        if frame[:3] == (self._node.bus, NMT, False) and frame.data == bytes(
            (START, self._node.number)
        ):
            self._world.at(self._world.now_ns + ANSWER_NS, self._start)
        elif self.axis and self.valve and self.operational and frame[:3] == self.axis.valve_key:
            assert self.axis.words
            before = self.valve.state
            self.valve.command(self.axis.words.control.get(int.from_bytes(frame.data, "little")))
            if self.valve.state != before:
                self._world.at(self._world.now_ns + ANSWER_NS, self.status)

    def _start(self) -> None:
        if self._state != OPERATIONAL:
            self._state = OPERATIONAL
            self._heartbeat()

    # -- what goes wrong --------------------------------------------------------------------------

    def boot(self) -> None:
        """It restarts."""
        self._frame(HEARTBEAT, bytes((BOOT_UP,)))
        self._state = PRE_OPERATIONAL
        if self.valve:
            self.valve.state = INIT

    def stop(self) -> None:
        """It leaves OPERATIONAL, and says so."""
        self._state = self._world.rng.choice((STOPPED, PRE_OPERATIONAL))
        self._heartbeat()

    def emergency(self, code: int, register: int) -> None:
        """An emergency message; code and register 0 when all is over."""
        self._frame(EMERGENCY, code.to_bytes(2, "little") + bytes((register, 0, 0, 0, 0, 0)))

    def short_emergency(self) -> None:
        """One that is over at once."""
        self.emergency(0x8003, 0x81)
        self._world.at(self._world.now_ns + SHORT_NS, lambda: self.emergency(0, 0))

    def leave_active(self) -> None:
        """The valve has a fault, or falls back by itself."""
        if self.valve:
            if self._world.rng.random() < 0.5:
                self.valve.fault()
            else:
                self.valve.state = HOLD
            self.status()

    def blink(self) -> None:
        """The valve leaves its state active, and is back at once."""
        if self.valve and self.valve.state == ACTIVE:
            self.valve.state = HOLD
            self.status()
            self.valve.state = ACTIVE
            self._world.at(self._world.now_ns + SHORT_NS, self.status)


class Claimant:
    """Who wants our address on a bus of J1939; our NAME is known from our claim."""

    def __init__(self, bus: str, own: int) -> None:
        self._bus, self._own = bus, own
        self.name: int | None = None

    def sent(self, frame: Frame) -> None:
        """Take what the daemon sends."""
        if frame[:3] == (self._bus, 0x18EEFF00 | self._own, True):
            self.name = int.from_bytes(frame.data, "little")

    def claim(self, difference: int) -> Frame | None:
        """A claim with a NAME so much higher than ours; None before we have claimed."""
        if self.name is None:
            return None
        data = (self.name + difference).to_bytes(8, "little")
        return Frame(self._bus, 0x18EEFF00 | self._own, True, data)

    def command(self, key: tuple[str, int, bool], data: bytes) -> Frame:
        """A command to a valve of ours from another address."""
        return Frame(key[0], key[1] & ~0xFF | 0x42, True, data)
