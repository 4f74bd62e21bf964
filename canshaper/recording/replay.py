"""Replay of a recorded drive: the frames that canshaper would have sent in it, or did send."""

from collections import Counter
from collections.abc import Callable, Iterator, Mapping
from dataclasses import dataclass, field
from itertools import islice
from pathlib import Path

from canshaper.blackbox.file import SUFFIX, Box, read_box
from canshaper.codec.frame import Frame, MessageKey, group_of, new_frame
from canshaper.controller.controller import Controller
from canshaper.errors import BoxError, CutOffError, LogError, StateError
from canshaper.machine.deployment import Deployment
from canshaper.recording.channels import Kind, Sorter, TimedFrame, bus_of_channel
from canshaper.recording.log import LogFile
from canshaper.recording.play import Player, frames_of, of_its_copies, of_same_files
from canshaper.recording.ticks import Difference, Result, Sorted, Stepper, Tick, clocked
from canshaper.shaping.reasons import REASON_TEXTS
from canshaper.shaping.states import Reason, State

# Frames read before a replay, to find the channels.
LOOKED_AT = 20_000
EXAMPLES = 5
MOST_NAMED = 8


@dataclass
class Verdict:
    """A replay of a black box, compared with the frames that the daemon sent.

    Attributes:
        compared: number of compared frames.
        different: number of frames that differ.
        examples: the first ``EXAMPLES`` differences: (time of the tick in ns, difference).
    """

    compared: int = 0
    different: int = 0
    examples: list[tuple[int, Difference]] = field(default_factory=list)

    def add(self, tick: Tick, result: Result) -> None:
        """Take the result of a tick."""
        self.different += len(result.differences)
        self.compared += result.compared
        for difference in result.differences[: EXAMPLES - len(self.examples)]:
            self.examples.append((tick.now_ns, difference))


@dataclass
class Drive:
    """A log before its replay: its channels, and its black box if it is one.

    Attributes:
        path: the log.
        channels: bus by channel.
        box: the log if it is a black box, else None.
        exact: the black box is of this deployment: its replay compares every frame.
    """

    path: Path
    channels: dict[str, str]
    box: Box | None
    exact: bool


def look(deployment: Deployment, path: Path, given: Mapping[str, str], *, own: bool) -> Drive:
    """Find the channels in the first ``LOOKED_AT`` frames of a log; read a black box as a whole.

    Args:
        deployment: the machine.
        path: the log.
        given: channel by bus from the command line.
        own: the deployment came with the log, in one bundle.

    Raises:
        LogError: the log cannot be used, or its channels are not those of the deployment.
        OSError: a black box cannot be read.
    """
    if path.suffix == SUFFIX:
        try:
            box = read_box(path)
        except BoxError as error:
            raise LogError(str(error)) from None
        if own and not of_its_copies(box, deployment):
            text = "expected the files that its daemon had loaded, got changed ones"
            raise LogError(f"{path.name} and {deployment.path.name}: {text}")
        if own or of_same_files(box, deployment):
            return Drive(path, {bus: bus for bus in box.header["buses"]}, box, True)
        return Drive(path, bus_of_channel(deployment, box.header["buses"], given), box, False)
    head: list[TimedFrame] = []
    try:
        head += islice(LogFile(path), LOOKED_AT)
    except CutOffError:
        if not head:
            raise
    channels = {frame.channel for frame in head}
    return Drive(path, bus_of_channel(deployment, channels, given), None, False)


class Replay:
    """Replay of one log through one deployment.

    Args:
        deployment: the machine.
        drive: the log.

    Attributes:
        exact: the replay makes every call of the daemon and compares every frame.
        log: the log, for the counts of left-out frames.
        received: number of received frames by bus, id and whether the id is extended.
        verdict: result of the comparison with a black box.
        cut_off: why the log is cut off; empty if it is whole.
        never_ready: ticks by reason of each axis that was never ready; empty if ``exact``.
    """

    def __init__(self, deployment: Deployment, drive: Drive) -> None:
        self.exact = drive.exact
        self.received: Counter[MessageKey] = Counter()
        self.verdict = Verdict()
        self.cut_off = drive.box.cut_off if drive.box else ""
        self.never_ready: dict[str, Counter[Reason]] = {}
        self._deployment = deployment
        self._drive = drive
        self.log = LogFile(drive.path)

    def run(self, progress: Callable[[float], None]) -> Iterator[tuple[Tick, Result]]:
        """Yield every tick with its result.

        Raises:
            LogError: the log cannot be used; a log that is cut off is used up to its end.
        """
        for tick, result in self._played(progress) if self.exact else self._clocked(progress):
            for _, frame in tick.received:
                self.received[frame[:3]] += 1
            self.verdict.add(tick, result)
            yield tick, result

    def _played(self, progress: Callable[[float], None]) -> Iterator[tuple[Tick, Result]]:
        assert self._drive.box is not None  # only one is exact
        try:
            yield from Player(self._drive.box, self._deployment).run(progress)
        except (BoxError, StateError) as error:
            raise LogError(str(error)) from None

    def _clocked(self, progress: Callable[[float], None]) -> Iterator[tuple[Tick, Result]]:
        self.log = LogFile(self._drive.path, progress)
        controller = Controller(self._deployment)
        stepper = Stepper(controller)
        waiting = self.never_ready = {name: Counter() for name in controller.axes}
        tick_ns = self._deployment.config.tick_ms * 1_000_000
        for tick in clocked(self._frames(Sorter(self._deployment)), tick_ns):
            result = stepper.step(tick)
            for name in [*waiting]:
                control = controller.axes[name]
                if control.axis.state is State.READY:
                    del waiting[name]
                else:
                    waiting[name][control.reason] += 1
            yield tick, result

    def check_joysticks(self) -> None:
        """Check after a replay that is not ``exact`` that the log had a joystick.

        Raises:
            LogError: the log has no frame of any joystick.
        """
        deployment = self._deployment
        missed = self._missing()
        if len(missed) == len(deployment.joysticks) and not self.exact:
            named = "; ".join(missed)
            other = ", ".join(f"{k[0]} {k[1]:#x}" for k in sorted(self.received)[:MOST_NAMED])
            got = f"none of its joystick messages ({named})"
            got += f", of what it receives only {other}" if other else ""
            raise LogError(
                f"{self._drive.path}: expected a log of the buses of {deployment.path.name},"
                f" got {got}: see --channel and the ids in the DBC files"
            )

    def _missing(self) -> list[str]:
        """Return the joysticks without frames in the log, as texts."""
        there = {(bus, group_of(i) if extended else i) for bus, i, extended in self.received}
        return [
            f"{joystick.message.name}, id {joystick.key[1]:#x} on {joystick.key[0]}"
            for joystick in self._deployment.joysticks.values()
            if self.received.keys().isdisjoint(joystick.keys)
            and not (joystick.by_group and (joystick.key[0], group_of(joystick.key[1])) in there)
        ]

    def ticks_of(self) -> str:
        """Return a sentence for a person on where the ticks come from: the daemon or a clock."""
        box = self._drive.box
        if self.exact:
            return "the ticks are those of the daemon that the black box is of"
        why = "the black box is of other files" if box else "the log has none"
        return f"the ticks are those of a clock: {why}"

    def warnings(self) -> Iterator[str]:
        """Yield warnings about the log, to read before relying on its replay."""
        box, program = self._drive.box, self._deployment.identity.lines()[1]
        if self.exact and box and program not in box.header["identity"]:
            yield "the black box is of another program than this one; what is different may be that"
        if self.cut_off:
            yield f"{self.cut_off}; replayed up to there"
        for name in self._missing():
            yield f"no joystick frame of {name}"
        for name, reasons in self.never_ready.items():
            ((reason, _),) = reasons.most_common(1) or [(Reason.START, 0)]
            yield f"{name} was never ready: {REASON_TEXTS[reason].words} ({reason.name})"
        yield from self.log.warnings()

    def _frames(self, sorter: Sorter) -> Iterator[Sorted]:
        """Yield the frames of the log that a daemon would see; set ``cut_off`` if it is cut off."""
        channels, box = self._drive.channels, self._drive.box
        known: dict[MessageKey, tuple[str, Kind]] = {}
        new, ignored = new_frame, Kind.IGNORED
        try:
            for time_ns, channel, can_id, extended, data in frames_of(box) if box else self.log:
                source = (channel, can_id, extended)
                if (target := known.get(source)) is None:
                    bus = channels.get(channel, "")
                    kind = sorter.kind((bus, can_id, extended)) if bus else ignored
                    target = known[source] = bus, kind
                bus, kind = target
                if kind is not ignored:
                    yield time_ns, new(Frame, (bus, can_id, extended, data)), kind
        except CutOffError as error:
            self.cut_off = str(error)
