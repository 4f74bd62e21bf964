"""Export of a drive to MCAP and MF4: one form, and one writer for each suffix.

An export has the frames as sent, the signals of the DBC files with units, the axes with states and
reasons, the pose of the crane, and events. The daemon imports none of this.
"""

import math
from collections.abc import Callable, Iterator, Mapping, Sequence
from contextlib import contextmanager
from pathlib import Path

from cantools.database.can import Message, Signal

from canshaper.bus.packet import FDF
from canshaper.codec.frame import NULL, Frame, MessageKey, with_source
from canshaper.codec.layout import CLASSICAL_BYTES, Layout, layout_fault
from canshaper.errors import UsageError
from canshaper.machine.deployment import Deployment
from canshaper.recording.form import AXIS, EXTRAS, POSE, Channel, Group, Row, Writer, install
from canshaper.recording.listen import History, ReceivedFrame
from canshaper.recording.ticks import STATE_CHANGE, Result, Tick
from canshaper.shaping.states import Reason, State
from canshaper_sim.axes import ROTATOR
from canshaper_sim.crane import CraneParameters
from canshaper_sim.machines import AXES_OF, build_machine, machine_for
from canshaper_sim.parameters import changed_parameters

PICTURE_NS = 40_000_000  # between two poses: a film has no more
MOST_CODE_BITS = 8  # longest signal whose values are names


@contextmanager
def exporting(
    path: Path | None, deployment: Deployment, parameters: CraneParameters | None = None
) -> Iterator["Export | None"]:
    """Open an MCAP or MF4 file, by its suffix, for the export of a drive; None gives None.

    An existing file is replaced. ``parameters`` are those of the crane to draw, else the
    deployment's.

    Raises:
        UsageError: the file has another suffix, or its extra is not installed.
        OSError: the file cannot be written.
    """
    if path is None:
        yield None
        return
    writer = _writer(path, [*deployment.config.buses])
    try:
        try:
            yield Export(writer, deployment, parameters or changed_parameters([], deployment))
        finally:
            writer.close()
    except OSError as error:
        raise OSError(error.errno, error.strerror, error.filename or str(path)) from None


def _writer(path: Path, buses: Sequence[str]) -> Writer:
    """Return the writer for a file's suffix; raise UsageError for another or a missing extra."""
    extra = EXTRAS.get(path.suffix.lower())
    if extra is None:
        raise UsageError(f"--export: expected a file with {' or '.join(EXTRAS)}, got {path}")
    try:
        if extra == "mcap":
            from canshaper.recording.mcap_write import McapWriter  # noqa: PLC0415

            return McapWriter(path)
        from canshaper.recording.mf4_write import Mf4Writer  # noqa: PLC0415

        return Mf4Writer(path, buses)
    except ModuleNotFoundError as error:
        raise UsageError(f"{path}: needs {error.name}, {install(extra)}") from None


class Export:
    """Takes a drive frame by frame, or tick by tick, and writes all data about it.

    Args:
        writer: writer of the file.
        deployment: the machine that is driven.
        parameters: the crane to draw.
    """

    def __init__(self, writer: Writer, deployment: Deployment, parameters: CraneParameters) -> None:
        self._writer, self._deployment = writer, deployment
        self._decoder = _Decoder(deployment, writer)
        self._axes = {n: writer.group(Group(f"axes/{n}", AXIS)) for n in deployment.axes}
        self._states = dict.fromkeys(deployment.axes, (State.NEUTRAL_WAIT, Reason.START))
        self._history = History(deployment)
        self._crane = _CranePose(writer, deployment, parameters)
        self._last_ns = 0

    def frame(self, frame: ReceivedFrame) -> None:
        """Write a frame of a bus, with the state, reason or pose of the crane that it reports."""
        decoded = self._take(frame, sent=False)
        if frame.kind:
            return
        if decoded:
            self._crane.measured(frame.time_ns, *decoded)
        history, before = self._history, len(self._history.changes)
        name = history.receive(frame)
        for change in history.changes[before:]:
            self._writer.event(change.time_ns, change.text)
        if name:
            one = history.axes[name].values
            commands = one["RawCommand"] / 100.0, one["ShapedCommand"] / 100.0
            row = (*commands, one["PredictedSway"], one["State"], one["Reason"])
            self._axes[name](frame.time_ns, row)

    def tick(self, tick: Tick, result: Result) -> None:
        """Write a tick of a replay but its ``logged``; its valve frames move a simulated crane."""
        for time_ns, frame in tick.received:
            self._take(self._received(time_ns, frame), sent=False)
        for frame in tick.others:
            self._take(self._received(self._last_ns, frame), sent=False)
        for frame in result.sent:
            self._take(self._received(tick.now_ns, frame), sent=True)
        for text in result.events:
            self._writer.event(tick.now_ns, text)
            if match := STATE_CHANGE.match(text):
                self._states[match[1]] = State[match[2]], Reason[match[3]]
        for name, row in result.rows.items():
            self._axes[name](tick.now_ns, (*row[:3], *self._states[name]))
        self._crane.simulate(tick.now_ns, result.sent)

    def seen(self, frame: Frame, time_s: float) -> None:
        """Write a frame of a simulated drive, ``time_s`` seconds after its start."""
        self.frame(self._received(round(time_s * 1e9), frame))

    def _received(self, time_ns: int, frame: Frame) -> ReceivedFrame:
        fd = frame[:3] in self._deployment.fd or len(frame.data) > CLASSICAL_BYTES
        flags = FDF if fd else None
        bus, can_id, extended, data = frame
        return ReceivedFrame(time_ns, bus, bus, can_id, extended, data, "", flags)

    def _take(self, frame: ReceivedFrame, *, sent: bool) -> tuple[str, dict[str, float]] | None:
        self._last_ns = frame.time_ns
        self._writer.frame(frame, sent=sent)
        return None if frame.kind else self._decoder.decode(frame)


_Known = tuple[Message, dict[str, Signal], Callable[[bytes], dict[str, float]]]
"""A message, its signals, and what gives their values in the units of the DBC."""


class _Decoder:
    """Decodes every message of the DBC files; builds each decoder at its first frame."""

    def __init__(self, deployment: Deployment, writer: Writer) -> None:
        self._messages, self._writer = deployment.messages, writer
        entries = [entry for file in deployment.messages.files for entry in file.entries]
        self._names = {entry.key: entry.name for entry in entries}
        self._known: dict[MessageKey, _Known | None] = {}
        self._rows: dict[str, Row] = {}

    def decode(self, frame: ReceivedFrame) -> tuple[str, dict[str, float]] | None:
        """Write a frame's signals; return (message, values by signal), None if not decoded."""
        key = frame.bus, frame.can_id, frame.extended
        if key not in self._known:
            self._known[key] = self._found(frame)
        if (known := self._known[key]) is None:
            return None
        message, signals, decoding = known
        try:
            values = decoding(frame.data)
        except Exception:  # a frame shorter than its message: cantools has no base class
            return None
        pages = [f"{name}{values[name]:g}" for name in values if signals[name].is_multiplexer]
        place = "/".join(("signals", frame.bus, message.name, *pages))
        if (row := self._rows.get(place)) is None:
            channels = (*(_channel(signals[name]) for name in values),)
            row = self._rows[place] = self._writer.group(Group(place, channels))
        row(frame.time_ns, [*values.values()])
        return message.name, values

    def _found(self, frame: ReceivedFrame) -> _Known | None:
        name = self._names.get((frame.can_id, frame.extended))
        if name is None and frame.extended:  # a J1939 frame from any address
            name = self._names.get((with_source(frame.can_id, NULL), True))
        entry = self._messages.find(name) if name else ""
        if isinstance(entry, str):
            return None
        message = entry[1]
        return message, {one.name: one for one in message.signals}, _decoding(message)


def _channel(signal: Signal) -> Channel:
    codes = {int(number): str(text) for number, text in (signal.choices or {}).items()}
    # A measurement has names too, for an error: a code is what has its first two named.
    coded = signal.length <= MOST_CODE_BITS and {0, 1} <= codes.keys()
    return Channel(signal.name, signal.unit or "", codes if coded else None)


def _decoding(message: Message) -> Callable[[bytes], dict[str, float]]:
    """Return the function that decodes a frame into values in the units of the DBC."""
    if message.is_multiplexed() or layout_fault(message):
        return lambda data: message.decode(data, decode_choices=False)  # type: ignore[return-value]
    decode = Layout(message).decode
    scales = [(one.name, one.scale, one.offset) for one in message.signals]

    def decoding(data: bytes) -> dict[str, float]:
        raw = decode(data)
        return {name: raw[name] * scale + offset for name, scale, offset in scales}

    return decoding


class _CranePose:
    """Pose of the crane: measured by its frames, or simulated behind its valve frames."""

    def __init__(self, writer: Writer, deployment: Deployment, parameters: CraneParameters) -> None:
        self._writer, self._grapple = writer, parameters.grapple
        self._row = writer.group(Group("crane", POSE))
        self._tip: tuple[float, float, float] | None = None
        self._next_ns = -math.inf
        moves = deployment.coordinates
        axes = [name for name in deployment.axes if name != ROTATOR]
        self._valves = {moves.get(name, name): deployment.axes[name].valve for name in axes}
        self._openings = dict.fromkeys(self._valves, 0.0)
        kind = machine_for(moves.values())
        fits = self._valves.keys() <= {*AXES_OF[kind]}
        self._machine = build_machine(kind, parameters) if fits else None
        self._tick_s = deployment.config.tick_ms / 1000.0

    def measured(self, time_ns: int, message: str, values: Mapping[str, float]) -> None:
        """Write the pose at each GrappleSway of ``canshaper sim`` that follows a TipPosition."""
        if message == "TipPosition":
            self._tip = values["SlewAngle"], values["Radius"], values["Height"]
        elif message == "GrappleSway" and self._tip:
            across, along = values["SwayPerpendicular"], values["SwayParallel"]
            self._write(time_ns, (*self._tip, across, along))

    def simulate(self, time_ns: int, sent: Sequence[Frame]) -> None:
        """Drive the simulated crane, if there is one for the axes, for a tick; write its pose."""
        if self._machine is None:
            return
        data = {frame[:3]: frame.data for frame in sent}
        for name, valve in self._valves.items():
            if (one := data.get(valve.message.key)) is not None:
                raw = valve.message.fields.layout.decode(one)
                self._openings[name] = (valve.read(raw) or 0) / valve.steps
        self._machine.step(self._tick_s, self._openings)
        state = self._machine.crane.state
        slew, across, along = map(
            math.degrees, (state.theta1_rad, state.theta5_rad, state.theta6_rad)
        )
        self._write(time_ns, (slew, state.radius_m, state.height_m, across, along))

    def _write(self, time_ns: int, row: tuple[float, float, float, float, float]) -> None:
        self._row(time_ns, row)
        if time_ns < self._next_ns:
            return
        self._next_ns = time_ns + PICTURE_NS
        slew, across, along = (math.radians(row[i]) for i in (0, 3, 4))
        _, radius, height, *_ = row
        cosine, sine = math.cos(slew), math.sin(slew)
        tip = radius * cosine, radius * sine, height
        out, side = self._grapple.offset_m(across, along)
        down = (self._grapple.l1_m + self._grapple.l2_m * math.cos(along)) * math.cos(across)
        hangs = tip[0] + out * cosine - side * sine, tip[1] + out * sine + side * cosine
        self._writer.pose(
            time_ns, ((0.0, 0.0, 0.0), (0.0, 0.0, height), tip), (*hangs, height - down)
        )
