"""Logs of frames, and the controller driven by one."""

from collections.abc import Iterator
from contextlib import contextmanager
from itertools import groupby
from math import floor
from pathlib import Path
from typing import Any

from canshaper.codec.frame import Frame
from canshaper.codec.message import FieldSet
from canshaper.controller.controller import Controller
from canshaper.controller.gated import GatedController
from canshaper.machine.binding import load_deployment
from canshaper.shaping import output
from canshaper.shaping.limits import with_deadband

HERE = Path(__file__).parent
CONFIG = HERE.parents[1] / "config"
DRIVE = HERE / "drive.log"
DEPLOYMENTS = ("forwarder", "forwarder-robust")

TICK_NS = 20_000_000
TICKS = range(1, 901)
MISSED = (430, 431, 700)  # in the middle of strokes

Timed = tuple[int, Frame]


def ticks() -> Iterator[tuple[int, int]]:
    """(time, deadlines missed before) of every tick."""
    missed = 0
    for number in TICKS:
        if number in MISSED:
            missed += 1
            continue
        yield number * TICK_NS, missed
        missed = 0


def line(now_ns: int, frame: Frame) -> str:
    """A frame as ``candump -L`` writes it, the bus by its name in the deployment."""
    seconds, ns = divmod(now_ns, 10**9)
    can_id = f"{frame.can_id:08X}" if frame.extended else f"{frame.can_id:03X}"
    return f"({seconds}.{ns // 1000:06d}) {frame.bus} {can_id}#{frame.data.hex().upper()}"


def parsed(text: str) -> Timed:
    """The other way."""
    time, bus, rest = text.split()
    seconds, microseconds = time.strip("()").split(".")
    can_id, data = rest.split("#")
    frame = Frame(bus, int(can_id, 16), len(can_id) == 8, bytes.fromhex(data))
    return int(seconds) * 10**9 + int(microseconds) * 1000, frame


def read(path: Path) -> list[str]:
    """Lines of a log; none where there is no file yet."""
    return path.read_text(encoding="ascii").splitlines() if path.exists() else []


def write(path: Path, rows: list[str]) -> None:
    """A log of these lines."""
    path.write_text("".join(f"{row}\n" for row in rows), encoding="ascii")


def golden(name: str) -> Path:
    """Where what a deployment sends is kept."""
    return HERE / f"{name}.log"


def replay(name: str, drive: list[str]) -> list[str]:
    """Frames of a deployment at the ticks, in order."""
    controller = GatedController(Controller(load_deployment(CONFIG / f"{name}.yaml")))
    waiting = [parsed(row) for row in drive]
    waiting.reverse()
    sent = []
    for now_ns, missed in ticks():
        while waiting and waiting[-1][0] <= now_ns:
            at_ns, frame = waiting.pop()
            controller.receive(frame, at_ns)
        sent += [line(now_ns, frame) for frame in controller.tick(now_ns, missed)]
    return sent


def difference(old: list[str], new: list[str]) -> str:
    """The first tick that differs, both ways, and how many do; empty where none does."""
    was, now = _by_time(old), _by_time(new)
    times = [time for time in sorted({*was, *now}) if was.get(time) != now.get(time)]
    if not times:
        return ""
    first = times[0]
    before, after = was.get(first, []), now.get(first, [])
    rows = [f"{len(times)} ticks differ, first tick {first // TICK_NS} at {first / 1e9:.3f} s:"]
    for number in range(max(len(before), len(after))):
        a = before[number] if number < len(before) else "nothing"
        b = after[number] if number < len(after) else "nothing"
        if a != b:
            rows.append(f"  frame {number}: was {a}, is {b}")
    return "\n".join(rows)


def _by_time(rows: list[str]) -> dict[int, list[str]]:
    groups = groupby(rows, key=lambda row: parsed(row)[0])
    return {time: [row.split(" ", 1)[1] for row in group] for time, group in groups}


class Margin:
    """How near values came to half-way between two steps without lying on it.

    Attributes:
        least: the smallest distance, in steps.
        of: what that was.
        exact: how many lay on it.
    """

    def __init__(self) -> None:
        self.least = 0.5
        self.of = ""
        self.exact = 0

    def see(self, value: float, of: str) -> None:
        """A value in steps, before it is rounded."""
        distance = abs(value - floor(value) - 0.5)
        if not distance:
            self.exact += 1
        elif distance < self.least:
            self.least, self.of = distance, f"{of} {value:.6g}"


@contextmanager
def margin() -> Iterator[Margin]:
    """Watch the values that are rounded: the valve's steps and the fields of the status."""
    least = Margin()
    on_grid, raw = output.on_grid, FieldSet.raw

    def watched_grid(
        velocity: float, low: float, high: float, deadband: float, steps: int, **curve: Any
    ) -> tuple[int, float]:
        least.see(with_deadband(velocity, deadband) * steps, "valve")
        return on_grid(velocity, low, high, deadband, steps, **curve)

    def watched_raw(self: FieldSet, name: str, value: float) -> int:
        signal = next(s for s in self.message.signals if s.name == name)
        least.see((value - signal.offset) / signal.scale, f"{self.message.name}.{name}")
        return raw(self, name, value)

    output.on_grid, FieldSet.raw = watched_grid, watched_raw  # type: ignore[method-assign]
    try:
        yield least
    finally:
        output.on_grid, FieldSet.raw = on_grid, raw  # type: ignore[method-assign]
