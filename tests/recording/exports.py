"""Frames and drives for the tests of exported files."""

from collections.abc import Iterator
from pathlib import Path
from random import Random

from canshaper.bus.packet import BRS, FDF
from canshaper.codec.frame import ERR_FLAG
from canshaper.machine.binding import load_deployment
from canshaper.recording.export import exporting
from canshaper.recording.listen import ReceivedFrame
from canshaper.recording.log import TimedFrame
from canshaper.recording.replay import Replay, look
from canshaper.recording.ticks import Result, Tick
from tests.golden.replay import CONFIG, DRIVE

START_NS = 1_763_750_000_123_456_789
LENGTHS = (0, 1, 7, 8, 8, 8, 12, 64)


def frames(count: int = 400) -> list[ReceivedFrame]:
    """Data frames of two buses, classical and of CAN FD, some at one time."""
    random = Random(11)
    made, time_ns = [], START_NS
    for number in range(count):
        time_ns += random.choice((0, 1, 333, 999_999_999))
        length = LENGTHS[number % len(LENGTHS)]
        extended = bool(number % 3)
        can_id = random.getrandbits(29 if extended else 11)
        flags = (FDF | BRS, 0)[number % 16 < 8] if length > 8 else None
        bus = ("crane", "body-2")[number % 5 == 0]
        data = random.randbytes(length)
        made.append(ReceivedFrame(time_ns, bus, "", can_id, extended, data, "", flags))
    return made


def others(time_ns: int) -> list[ReceivedFrame]:
    """Frames that carry no data."""
    error = ReceivedFrame(time_ns, "crane", "", ERR_FLAG | 4, True, bytes(8), "error")
    remote = ReceivedFrame(time_ns, "crane", "", 0x123, False, b"", "remote", None)
    return [error, remote, remote]


def timed(one: ReceivedFrame) -> TimedFrame:
    return TimedFrame(one.time_ns, one.bus, one.can_id, one.extended, one.data)


def replayed(log: Path, file: str = "forwarder-robust") -> Iterator[tuple[Tick, Result]]:
    """A log through a deployment, tick by tick."""
    deployment = load_deployment(CONFIG / f"{file}.yaml")
    return Replay(deployment, look(deployment, log, {}, own=False)).run(lambda _: None)


def exported_drive(path: Path) -> list[tuple[Tick, Result]]:
    """The golden drive, in a file; and its ticks."""
    deployment = load_deployment(CONFIG / "forwarder-robust.yaml")
    ticks = list(replayed(DRIVE))
    with exporting(path, deployment) as export:
        assert export is not None
        for tick, result in ticks:
            export.tick(tick, result)
    return ticks


def frames_of(ticks: list[tuple[Tick, Result]]) -> list[TimedFrame]:
    """Frames on the buses in these ticks, in order."""
    seen = []
    for tick, result in ticks:
        for time_ns, (bus, *rest) in tick.received:
            seen.append(TimedFrame(time_ns, bus, *rest))
        last_ns = seen[-1].time_ns if seen else 0
        seen += [TimedFrame(last_ns, *frame) for frame in tick.others]
        seen += [TimedFrame(tick.now_ns, *frame) for frame in result.sent]
    return seen
