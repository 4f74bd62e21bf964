"""Recorder around the controller: it records every call and every result."""

import json
from collections.abc import Iterator, Mapping
from typing import Any

from canshaper.blackbox.ring import CHUNK, Kind, Ring
from canshaper.codec.frame import Frame, FrameFault
from canshaper.controller.controller import Controller
from canshaper.controller.gated import GatedController

# Plain numbers: each use of a member of an enumeration costs a look-up.
TICK, RX, TX = int(Kind.TICK), int(Kind.RX), int(Kind.TX)

# kind, frame, number, time in ns; see canshaper.blackbox.ring
Call = tuple[int, Frame | None, int, int]


class Recorder:
    """A controller behind its gate whose calls are all recorded.

    During a tick a call is only noted, because the valves wait for their frames. ``flush`` packs
    the notes into the ring after the tick.

    Args:
        gated: controller behind its gate, which executes the calls.
        controller: the controller itself.
        ring: ring for the records.
    """

    def __init__(self, gated: GatedController, controller: Controller, ring: Ring) -> None:
        self._gated, self._controller = gated, controller
        self._put = ring.put
        self._calls: list[Call] = []
        self._note = self._calls.append
        self._bus = {name: i for i, name in enumerate(controller.deployment.config.buses)}

    def receive(self, frame: Frame, now_ns: int) -> Frame | None:
        """Receive a frame; return the frame for the other bus of a gateway, or None."""
        self._note((RX, frame, 0, now_ns))
        passed = self._gated.receive(frame, now_ns)
        if passed is not None:
            self._note((TX, passed, 0, 0))
        return passed

    @property
    def moves(self) -> bool:
        """Whether the frame that was yielded or returned last may move a valve."""
        return self._controller.moves

    def tick(self, now_ns: int, missed: int = 0) -> Iterator[Frame]:
        """Run one tick, and yield the frames to send now."""
        note = self._note
        note((TICK, None, missed, now_ns))
        for frame in self._gated.tick(now_ns, missed):
            yield frame
            note((TX, frame, 0, 0))

    def stalled(self) -> None:
        """Take note that the loop stood still: frames up to the next tick have waited."""
        self._note((Kind.STALLED, None, 0, 0))
        self._gated.stalled()

    def send_failed(self, frame: Frame) -> None:
        """Take note that a frame did not reach its bus."""
        self._note((Kind.FAILED, frame, 0, 0))
        self._gated.send_failed(frame)

    def withhold(self, frame: Frame) -> bool:
        """Return whether a late valve frame moves a valve, and so must not leave."""
        self._note((Kind.WITHHELD, frame, 0, 0))
        return self._gated.withhold(frame)

    def neutral_frames(self) -> list[Frame]:
        """Return the neutral frames to send last, but for those that the gate refuses."""
        self._note((Kind.NEUTRAL, None, 0, 0))
        frames = self._gated.neutral_frames()
        for frame in frames:
            self._note((TX, frame, 0, 0))
        return frames

    def on_bus_off(self, bus: str) -> None:
        """Take note that our CAN controller is off a bus."""
        self._note((Kind.OFF_BUS, None, self._bus[bus], 0))
        self._controller.on_bus_off(bus)

    def fault(self, fault: FrameFault) -> None:
        """Count a fault of a bus."""
        self._note((Kind.FAULT, None, fault, 0))
        self._controller.counters.add(fault)

    def set(self, values: Mapping[str, object]) -> None:
        """Give the gate numbers of the file, by key, that an operator has changed."""
        self._gated.set(values)
        self.flush()
        text = json.dumps(values).encode()
        for at in range(0, len(text), CHUNK):
            part = text[at : at + CHUNK]
            self._put(Kind.SET, 0, len(part), False, len(text) - at, 0, part)

    def rehearse(self, what: object, who: str) -> Mapping[str, Any]:
        """Refuse to rehearse a fault; ``Rehearsal`` can.

        Raises:
            ValueError: always; the deployment file does not allow it.
        """
        raise ValueError("faults are rehearsed where the file has control.rehearse_faults")

    def reloads(self) -> None:
        """Prepare for a reload, which replaces the controller; here there is nothing to do."""

    def flush(self) -> None:
        """Pack the notes into the ring."""
        put, buses = self._put, self._bus
        for kind, frame, number, time_ns in self._calls:
            if frame is None:
                put(kind, 0, 0, False, number, time_ns, b"")
            else:
                bus, can_id, extended, data = frame
                length = len(data)
                while len(data) > CHUNK:
                    put(Kind.BEFORE, buses[bus], CHUNK, extended, can_id, time_ns, data[:CHUNK])
                    data = data[CHUNK:]
                put(kind, buses[bus], length, extended, can_id, time_ns, data)
        self._calls.clear()
