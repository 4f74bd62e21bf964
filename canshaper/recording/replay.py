"""What canshaper would have done with a recorded drive, or what it did."""

import statistics
from collections import Counter
from collections.abc import Callable, Iterator, Mapping
from dataclasses import dataclass, field
from functools import partial
from itertools import islice, pairwise
from pathlib import Path

from canshaper.codec.frame import Frame, new_frame
from canshaper.codec.j1939 import group_of
from canshaper.controller.controller import Controller
from canshaper.machine.deployment import Deployment
from canshaper.recording.frames import CutOffError, LogError, TimedFrame
from canshaper.recording.log import LogFile
from canshaper.recording.sorting import Key, Kind, Sorter, bus_of_channel
from canshaper.recording.stepper import Difference, Result, Stepper, count_of
from canshaper.recording.ticks import Recovery, Sorted, Tick, clocked
from canshaper.recording.verify import Verifier

# What is looked at before a replay, to know the channels and whether a daemon sent there.
LOOKED_AT = 20_000
# Frames of a daemon come at its ticks, those of another controller at times of its own; but on a
# PC that is too busy many ticks are missing.
MUCH_FASTER, MUCH_SLOWER = 0.7, 1.5
EXAMPLES = 5
MOST_NAMED = 8


@dataclass
class Verdict:
    """A replay beside what the log says was sent.

    Attributes:
        compared: frames of valves and axes that were compared, and of the service.
        different: how many of them are not the same.
        service_compared, service_different: the same of the status of the service.
        examples: the first differences, with the time in the log.
        settled: ticks in which only what was sent told what had been read.
        starts: daemons that start in the log.
        ran_before: whether one ran already when the log begins.
        last_ns: time of the last difference; None where there is none.
    """

    compared: int = 0
    different: int = 0
    service_compared: int = 0
    service_different: int = 0
    examples: list[tuple[int, Difference]] = field(default_factory=list)
    settled: int = 0
    starts: int = 0
    ran_before: bool = False
    last_ns: int | None = None

    def add(self, tick: Tick, result: Result, service: Key | None) -> None:
        """Take the result of a tick; ``service`` is the message of the service's status."""
        self.starts += tick.starts
        self.ran_before |= bool(tick.says)
        of_service = sum(frame[:3] == service for _, frame in tick.sent)
        self.different += len(result.differences)
        self.compared += result.compared - of_service
        self.service_different += len(result.service)
        self.service_compared += of_service
        if result.differences:
            self.last_ns = tick.now_ns
        for difference in result.differences[: EXAMPLES - len(self.examples)]:
            self.examples.append((tick.now_ns, difference))


@dataclass
class Drive:
    """What is known of a log before it is replayed.

    Attributes:
        path: the log.
        channels: bus by channel.
        daemon: whether canshaper's own frames are in it.
        why_not: why its ticks are not taken from there.
        recovery: makes what finds its ticks.
    """

    path: Path
    channels: dict[str, str]
    daemon: bool
    why_not: str
    recovery: Callable[[], Recovery]


def look(deployment: Deployment, path: Path, given: Mapping[str, str]) -> Drive:
    """Look at the beginning of a log: which channel is which bus, and did a daemon send there?

    Raises:
        LogError: the log cannot be used, or its channels are not those of the deployment.
    """
    head: list[TimedFrame] = []
    try:
        head += islice(LogFile(path), LOOKED_AT)
    except CutOffError:
        if not head:
            raise
    channels = bus_of_channel(deployment, {frame.channel for frame in head}, given)
    marker, period = marker_of(deployment)
    times: dict[Key, list[int]] = {}
    for time_ns, channel, can_id, extended, _ in head:
        if bus := channels.get(channel):
            times.setdefault((bus, can_id, extended), []).append(time_ns)
    why = ""
    gaps = [after - before for before, after in pairwise(times.get(marker, []))]
    status = [a.status.sender.key for a in deployment.axes.values() if a.status]
    wanted_ns = deployment.config.tick_ms * period * 1_000_000
    if not gaps:
        why = "no valve frames of this deployment"
    elif (
        statistics.median(gaps) < MUCH_FASTER * wanted_ns or _often(gaps) > MUCH_SLOWER * wanted_ns
    ):
        found = f"every {_often(gaps) / 1e6:.1f} ms, not {wanted_ns / 1e6:g} ms"
        why = f"valve frames {marker[1]:#x} {found}: those of another controller"
    elif status and not any(key in times for key in status):
        why = "valve frames without status of an axis: those of another controller"
    return Drive(path, channels, not why, why, _recovery(deployment))


def _recovery(deployment: Deployment) -> Callable[[], Recovery]:
    """What finds the ticks of a daemon; of a deployment that has not sent anything yet."""
    marker, period = marker_of(deployment)
    periods = {
        axis.status.sender.key: axis.status_ticks
        for axis in deployment.axes.values()
        if axis.status
    }
    if deployment.status:
        periods[deployment.status.sender.key] = deployment.status_ticks
    neutral = Controller(deployment).neutral_frames()
    sender = next(one for one in deployment.senders() if one.key == marker)
    return partial(
        Recovery,
        deployment.config.tick_ms * 1_000_000,
        (marker, period),
        next((frame.data for frame in neutral if frame[:3] == marker), b""),
        count=partial(count_of, sender) if sender.protection.counts else None,
        periods=periods,
    )


def _often(gaps: list[int]) -> int:
    """Of the gaps between frames the one that a tenth of them does not exceed."""
    return sorted(gaps)[len(gaps) // 10]


def marker_of(deployment: Deployment) -> tuple[Key, int]:
    """The valve message that goes out first in a tick, most often; and its period in ticks."""
    # As in the controller: an axis that asks something of another goes first, and a message goes
    # out when the last of its axes has moved.
    axes = sorted(deployment.axes.values(), key=lambda axis: axis.radial is None)
    last = {axis.valve.message.sender.key: axis.period_ticks for axis in reversed(axes)}
    key = min(reversed(last), key=lambda one: last[one])
    return key, last[key]


class Replay:
    """One deployment through one log.

    Args:
        load: reads the deployment.
        drive: the log.
        by_daemon: take the ticks of the daemon that sent the valve frames of the log, and compare;
            else those of a clock.

    Attributes:
        log: for what it has left out.
        heard: frames of each message that is taken.
        verdict: beside the log, where its ticks are taken.
        cut_off: the log is cut off, and why.
    """

    def __init__(self, load: Callable[[], Deployment], drive: Drive, *, by_daemon: bool) -> None:
        self.stepper = Stepper(load, compare=by_daemon)
        self.heard: Counter[Key] = Counter()
        self.verdict = Verdict()
        self.cut_off: CutOffError | None = None
        self._drive = drive
        self._by_daemon = by_daemon
        self.log = LogFile(drive.path)

    def run(self, progress: Callable[[float], None]) -> Iterator[tuple[Tick, Result]]:
        """Every tick with what it made.

        Raises:
            LogError: the log cannot be used; one that is cut off is used up to there.
        """
        self.log = LogFile(self._drive.path, progress)
        deployment = self.stepper.deployment
        sorter = Sorter(deployment)
        if not self._by_daemon:
            tick_ns = deployment.config.tick_ms * 1_000_000
            for tick in clocked(self._frames(sorter), tick_ns):
                if tick.number == 0:
                    self.stepper.begin(tick)
                self._count(tick)
                yield tick, self.stepper.step(tick)
            return
        verifier = Verifier(self.stepper)
        service = deployment.status.sender.key if deployment.status else None
        for tick, result in verifier.run(self._drive.recovery().ticks(self._frames(sorter))):
            self._count(tick)
            self.verdict.add(tick, result, service)
            yield tick, result
        self.verdict.settled = verifier.settled

    def _count(self, tick: Tick) -> None:
        for _, frame in tick.taken:
            self.heard[frame[:3]] += 1

    def check_joysticks(self) -> None:
        """Look whether there was anything to replay.

        Raises:
            LogError: the log has no frame of any joystick.
        """
        deployment = self.stepper.deployment
        missing = self._missing()
        if len(missing) == len(deployment.joysticks):
            named = "; ".join(missing)
            found = ", ".join(f"{k[0]} {k[1]:#x}" for k in sorted(self.heard)[:MOST_NAMED])
            text = f"found none of its joystick messages ({named})"
            text += f", of what it takes only {found}" if found else ""
            raise LogError(
                f"{self._drive.path}: {text}; allowed is a log of the buses of"
                f" {deployment.path.name}: see --channel and the ids in the DBC files"
            )

    def _missing(self) -> list[str]:
        """Joysticks without frames in the log."""
        heard = {(bus, group_of(i) if extended else i) for bus, i, extended in self.heard}
        return [
            f"{joystick.message.name}, id {joystick.key[1]:#x} on {joystick.key[0]}"
            for joystick in self.stepper.deployment.joysticks.values()
            if self.heard.keys().isdisjoint(joystick.keys)
            and not (joystick.by_group and (joystick.key[0], group_of(joystick.key[1])) in heard)
        ]

    def ticks_of(self) -> str:
        """Whose ticks these are, for people."""
        if self._by_daemon:
            return "the ticks are those of the daemon that the log is of"
        return f"the ticks are those of a clock ({self._drive.why_not or 'as asked'})"

    def warnings(self) -> Iterator[str]:
        """What is to be known of the log before its replay is believed."""
        if self.cut_off:
            yield f"{self.cut_off}; replayed up to there"
        for name in self._missing():
            yield f"no joystick frame of {name}"
        if self.log.left_out:
            counts = ", ".join(f"{count} {kind}" for kind, count in self.log.left_out.items())
            yield f"frames that are no classical data frames are left out: {counts}"
        if self.log.disordered:
            yield f"{self.log.disordered} frames stand behind later ones; the log's order counts"

    def _frames(self, sorter: Sorter) -> Iterator[Sorted]:
        """Frames of the log on the buses of the deployment, but those that no daemon sees."""
        channels = self._drive.channels
        known: dict[tuple[str, int, bool], tuple[str, Kind]] = {}
        new, ignored = new_frame, Kind.IGNORED
        try:
            for time_ns, channel, can_id, extended, data in self.log:
                source = (channel, can_id, extended)
                if (found := known.get(source)) is None:
                    bus = channels.get(channel, "")
                    kind = sorter.kind((bus, can_id, extended)) if bus else ignored
                    found = known[source] = bus, kind
                bus, kind = found
                if kind is not ignored:
                    yield time_ns, new(Frame, (bus, can_id, extended, data)), kind
        except CutOffError as error:
            self.cut_off = error
