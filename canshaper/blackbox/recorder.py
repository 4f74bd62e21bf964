"""Stands around the controller and writes down whatever goes in and comes out."""

import json
from collections.abc import Iterator, Mapping

from canshaper.blackbox.records import CHUNK, Kind
from canshaper.blackbox.ring import Ring
from canshaper.codec.frame import Frame, FrameFault
from canshaper.controller.controller import Controller
from canshaper.controller.guarded import Guarded

# Members of an enumeration cost a look-up each.
TICK, RX, TX = int(Kind.TICK), int(Kind.RX), int(Kind.TX)


class Recorder:
    """A controller behind its output guard, every call of which is recorded.

    What the valves wait for comes first: a frame is recorded when it has been sent.

    Args:
        guarded: who does the work.
        controller: the controller in it.
        ring: where to record.
    """

    def __init__(self, guarded: Guarded, controller: Controller, ring: Ring) -> None:
        self._guarded, self._controller = guarded, controller
        self._put = ring.put
        self._bus = {name: i for i, name in enumerate(controller.deployment.config.buses)}

    def receive(self, frame: Frame, now_ns: int) -> Frame | None:
        """Take a frame from a bus, see ``Guarded``."""
        bus, can_id, extended, data = frame
        self._put(RX, self._bus[bus], len(data), extended, can_id, now_ns, data)
        passed = self._guarded.receive(frame, now_ns)
        if passed is not None:
            self._frame(TX, passed)
        return passed

    @property
    def moves(self) -> bool:
        """Whether the frame that was handed out last may move a valve."""
        return self._controller.moves

    def tick(self, now_ns: int, missed: int = 0) -> Iterator[Frame]:
        """One tick: the frames to send now."""
        put, buses = self._put, self._bus
        put(TICK, 0, 0, False, missed, now_ns, b"")
        for frame in self._guarded.tick(now_ns, missed):
            yield frame
            bus, can_id, extended, data = frame
            put(TX, buses[bus], len(data), extended, can_id, 0, data)

    def stalled(self) -> None:
        """The loop stood still for too long."""
        self._note(Kind.STALLED)
        self._guarded.stalled()

    def send_failed(self, frame: Frame) -> None:
        """A frame did not reach its bus."""
        self._frame(Kind.FAILED, frame)
        self._guarded.send_failed(frame)

    def withhold(self, frame: Frame) -> bool:
        """A valve frame comes too late: whether it moves one, and so must not leave."""
        self._frame(Kind.WITHHELD, frame)
        return self._guarded.withhold(frame)

    def neutral_frames(self) -> list[Frame]:
        """A neutral frame for every valve."""
        self._note(Kind.NEUTRAL)
        frames = self._guarded.neutral_frames()
        for frame in frames:
            self._frame(TX, frame)
        return frames

    def on_bus_off(self, bus: str) -> None:
        """We are not on a bus now."""
        self._note(Kind.OFF_BUS, bus=self._bus[bus])
        self._controller.on_bus_off(bus)

    def fault(self, fault: FrameFault) -> None:
        """A bus has a fault."""
        self._note(Kind.FAULT, number=fault)
        self._controller.counters.add(fault)

    def set(self, values: Mapping[str, object]) -> None:
        """Numbers have been changed by hand."""
        text = json.dumps(values).encode()
        for at in range(0, len(text), CHUNK):
            part = text[at : at + CHUNK]
            self._put(Kind.SET, 0, len(part), False, len(text) - at, 0, part)

    def _note(self, kind: int, *, bus: int = 0, number: int = 0) -> None:
        self._put(kind, bus, 0, False, number, 0, b"")

    def _frame(self, kind: int, frame: Frame) -> None:
        bus, can_id, extended, data = frame
        self._put(kind, self._bus[bus], len(data), extended, can_id, 0, data)
