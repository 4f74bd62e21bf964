"""Replay of a black box: every call that the daemon made, in order, with every frame compared."""

import json
from collections.abc import Callable, Iterator

from canshaper.blackbox.file import Box
from canshaper.blackbox.ring import Kind, Record, records
from canshaper.blackbox.state import States
from canshaper.codec.frame import Frame, FrameFault
from canshaper.controller.adjust import Adjuster
from canshaper.controller.controller import Controller
from canshaper.controller.gated import GatedController
from canshaper.errors import BoxError
from canshaper.machine.deployment import Deployment
from canshaper.recording.channels import TimedFrame
from canshaper.recording.ticks import Difference, Result, Tick, Timed, rows_of

# Calls that the daemon may make between two frames of one tick.
WITHIN = frozenset((Kind.FAILED, Kind.WITHHELD, Kind.FAULT))
SENT = frozenset((Kind.TX,))
OF_A_FRAME = frozenset((Kind.RX, Kind.TX, Kind.FAILED, Kind.WITHHELD))


def of_same_files(box: Box, deployment: Deployment) -> bool:
    """Return whether a box is of this deployment, by hashes of its files and added packages."""
    return bool(box.header["identity"][2:] == deployment.identity.lines()[2:])


def of_its_copies(box: Box, deployment: Deployment) -> bool:
    """Return whether this deployment consists of the files in the bundle of a black box.

    A box of an older program, which does not name them, gives True.
    """
    identity = deployment.identity
    carried = box.header.get("carried") or [identity.deployment, *identity.content]
    return bool(carried == [identity.deployment, *identity.content])


def frames_of(box: Box) -> Iterator[TimedFrame]:
    """Yield the frames that the daemon received, at ns since 1970; the channel is the bus."""
    buses = box.header["buses"]
    since_1970_ns = box.header["time_ns"] - box.header["clock_ns"]
    for segment in box.segments:
        for record in records(segment.records):
            if record.kind == Kind.RX:
                data = record.payload
                at_ns = record.time_ns + since_1970_ns
                yield TimedFrame(at_ns, buses[record.bus], record.number, record.extended, data)


class Player:
    """Replays a black box.

    Args:
        box: the black box.
        deployment: the deployment of the daemon.

    Raises:
        StateError: a controller of this deployment cannot take recorded states.
    """

    def __init__(self, box: Box, deployment: Deployment) -> None:
        self._box = box
        program = box.header["identity"][1]
        same = program == deployment.identity.lines()[1]
        self._other = "" if same else f"; it was recorded by {program}: play it with that version"
        if box.header.get("listen_only"):
            deployment = deployment.listening()
        controller = Controller(deployment)
        self._states = States(GatedController(controller), controller)

    def run(self, progress: Callable[[float], None]) -> Iterator[tuple[Tick, Result]]:
        """Yield every tick at ns since 1970, with all frames received and sent since the last one.

        ``progress`` gets the part done, 0 to 1, after each segment.

        Raises:
            BoxError: the recording does not fit this program or deployment.
        """
        number, box = -1, self._box
        since_1970_ns = box.header["time_ns"] - box.header["clock_ns"]
        played: _Played | None = None
        for index, segment in enumerate(box.segments):
            try:
                if played is None or not segment.follows:
                    played = _Played(*self._states.load(segment.state), box.header["buses"])
                for missed, tick, result in played.run(segment.records):
                    number += 1 + missed
                    tick.number = number
                    tick.now_ns += since_1970_ns
                    tick.received = [(at + since_1970_ns, frame) for at, frame in tick.received]
                    yield tick, result
            except Exception as error:  # the state of another version fails anywhere
                if not (self._other or isinstance(error, ValueError | LookupError)):
                    raise
                text = f"{box.path}: segment {index + 1}: {error}{self._other}"
                raise BoxError(text) from None
            progress((index + 1) / len(box.segments))


class _Played:
    """Repeats the recorded calls of the daemon to its controller with a controller of its own."""

    def __init__(self, gated: GatedController, controller: Controller, buses: list[str]) -> None:
        self._gated, self._controller, self._buses = gated, controller, buses
        self._adjuster = Adjuster(controller)
        self._rows = rows_of(controller)
        controller.events.clear()  # the daemon has logged them
        self._records: list[Record] = []
        self._at = 0
        self._text = b""
        self._begin_tick()

    def _begin_tick(self) -> None:
        self._received: list[Timed] = []
        self._result = Result([], {}, [])

    def run(self, data: bytes) -> Iterator[tuple[int, Tick, Result]]:
        """Yield (deadlines missed before the tick, tick, result) for every tick."""
        self._records, self._at = list(records(data)), 0
        while (record := self._next()) is not None:
            if record.kind != Kind.TICK:
                self._call(record)
                continue
            self._tick(record)
            controller, result = self._controller, self._result
            result.rows = self._rows()
            result.events = [event.text for event in controller.events]
            controller.events.clear()
            tick = Tick(0, record.time_ns, self._received)
            self._begin_tick()
            yield record.number, tick, result

    def _next(self) -> Record | None:
        if self._at == len(self._records):
            return None
        self._at += 1
        return self._records[self._at - 1]

    def _next_of(self, kinds: frozenset[Kind]) -> Record | None:
        """Return the next record if it is of one of these kinds, else None."""
        if self._at < len(self._records) and self._records[self._at].kind in kinds:
            return self._next()
        return None

    def _compare(self, ours: Frame) -> None:
        """Add a frame computed now to the result, and compare it with the recorded one."""
        result = self._result
        result.sent.append(ours)
        record = self._next_of(SENT)
        if record is None:
            if self._at < len(self._records):  # no recording that ends in the middle of a tick
                self._differs(Difference(ours[:3], ours.data, None))
            return
        result.compared += 1
        then = self._frame(record)
        if then != ours:
            same = then[:3] == ours[:3]
            self._differs(Difference(then[:3], ours.data if same else None, then.data))

    def _differs(self, difference: Difference) -> None:
        self._result.differences.append(difference)

    def _frame(self, record: Record) -> Frame:
        bus = self._buses[record.bus]
        return Frame(bus, record.number, record.extended, record.payload)

    def _tick(self, record: Record) -> None:
        for frame in self._gated.tick(record.time_ns, record.number):
            while (call := self._next_of(WITHIN)) is not None:
                self._call(call)
            self._compare(frame)

    def _call(self, record: Record) -> None:
        if record.kind in OF_A_FRAME:
            self._call_with(self._frame(record), record)
            return
        gated, controller, kind = self._gated, self._controller, record.kind
        if kind == Kind.STALLED:
            gated.stalled()
        elif kind == Kind.NEUTRAL:
            for frame in gated.neutral_frames():
                self._compare(frame)
        elif kind == Kind.OFF_BUS:
            controller.on_bus_off(self._buses[record.number])
        elif kind == Kind.FAULT:
            controller.counters.add(FrameFault(record.number))
        elif kind == Kind.SET:
            self._text += record.payload
            if record.number == record.length:  # that was the last part
                values, self._text = json.loads(self._text), b""
                self._adjuster.change(values)
                gated.set(values)
        else:
            raise ValueError(f"expected a known kind of record, got {kind}")

    def _call_with(self, frame: Frame, record: Record) -> None:
        gated, kind = self._gated, record.kind
        if kind == Kind.RX:
            self._received.append((record.time_ns, frame))
            if (passed := gated.receive(frame, record.time_ns)) is not None:
                self._compare(passed)
        elif kind == Kind.TX:
            self._differs(Difference(frame[:3], None, frame.data))
        elif kind == Kind.FAILED:
            gated.send_failed(frame)
        else:
            gated.withhold(frame)
