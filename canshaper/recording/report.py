"""Report of a replay, for people and as numbers."""

from collections.abc import Iterator, Mapping, Sequence
from dataclasses import asdict, dataclass, field
from typing import Any

from rich.box import SIMPLE_HEAD
from rich.console import Console
from rich.text import Text

from canshaper.machine.deployment import Deployment
from canshaper.recording.replay import Replay
from canshaper.recording.ticks import Difference
from canshaper.recording.trace import Trace
from canshaper.report.console import WholeTable
from canshaper.report.metrics import AxisMetrics, axis_metrics
from canshaper.report.table import NOTHING, axis_title

STRAIGHT = "joystick"
ROWS = (
    ("still after, s", "still_s", 1.0, 1),
    ("peak sway, deg", "peak_deg", 1.0, 1),
    ("RMS sway, deg", "rms_deg", 1.0, 1),
    ("residual sway, deg", "residual_deg", 1.0, 1),
    ("time to 95 %, s", "time_to_95_s", 1.0, 2),
    ("run-on, s", "run_on_s", 1.0, 2),
    ("dip after press, %", "dip", 100.0, 0),
    ("re-rise, %", "re_rise", 100.0, 0),
)


@dataclass
class Replayed:
    """One deployment's replay, done.

    Attributes:
        name: for people; no two have the same.
        deployment: the machine.
        replay: it.
        trace: its rows.
        events: (time in the log, ns; text) of what the daemon would have reported.
        ticks: how many.
        missed: deadlines that the daemon missed.
        measures: by axis; None for an axis that cannot be measured.
    """

    name: str
    deployment: Deployment
    replay: Replay
    trace: Trace
    events: list[tuple[int, str]] = field(default_factory=list)
    ticks: int = 0
    missed: int = 0
    measures: dict[str, AxisMetrics] = field(default_factory=dict)
    straight: dict[str, AxisMetrics] = field(default_factory=dict)

    def measure(self) -> None:
        """Measure the drive, and the drive with the joystick straight to the valve."""
        if self.trace.rows < 2:
            return
        recording, straight = self.trace.recording(), self.trace.straight()
        for axis in self.deployment.axes:
            still_deg = self.deployment.config.still_deg
            self.measures[axis] = axis_metrics(recording, axis, still_deg)
            self.straight[axis] = axis_metrics(straight, axis, still_deg)

    def count(self, axis: str, state: str) -> int:
        """How often an axis went into a state."""
        begin = f"axis={axis} state={state} "
        return sum(text.startswith(begin) for _, text in self.events)

    def as_dict(self) -> dict[str, Any]:
        """Everything as plain data."""
        replay, verdict = self.replay, self.replay.verdict
        start_ns = self.trace.start_ns or 0
        return {
            "file": str(self.deployment.path),
            "ticks": self.ticks,
            "missed_deadlines": self.missed,
            "seconds": (self.trace.end_ns - start_ns) / 1e9,
            "received": {
                f"{bus} {can_id:#x}": count
                for (bus, can_id, _), count in sorted(replay.received.items())
            },
            "axes": {
                axis: {
                    "straight": asdict(self.straight[axis]),
                    "replayed": asdict(self.measures[axis]),
                    "stops": self.count(axis, "STOPPING"),
                    "trips": self.count(axis, "TRIPPED"),
                }
                for axis in self.measures
            },
            "compared": {"frames": verdict.compared, "different": verdict.different}
            if verdict.compared
            else None,
        }


def print_replays(replays: Sequence[Replayed], console: Console) -> None:
    """A table an axis: the joystick straight to the valve, then each deployment."""
    for axis in _axes(replays):
        table = WholeTable(box=SIMPLE_HEAD, padding=(0, 1), pad_edge=False, title_justify="left")
        table.add_column(axis_title(axis), no_wrap=True)
        having = [one for one in replays if axis in one.measures]
        columns = [(STRAIGHT, having[0].straight[axis])]
        columns += [(one.name, one.measures[axis]) for one in having]
        for name, _ in columns:
            table.add_column(name, justify="right", overflow="fold")
        for title, key, scale, digits in ROWS:
            values = [getattr(measures, key) for _, measures in columns]
            if any(value is not None for value in values):
                table.add_row(title, *(_number(value, scale, digits) for value in values))
        for title, state in (("stops", "STOPPING"), ("trips", "TRIPPED")):
            table.add_row(title, "", *(str(one.count(axis, state)) for one in having))
        console.print(table)
    text = "Sway is that of each deployment's own model, speed is what was sent to the valve."
    console.print(Text(text, "dim"))


def verdict_lines(one: Replayed, *, examples: bool) -> Iterator[str]:
    """Yield the result of the comparison with the log, with the first differences or without."""
    verdict = one.replay.verdict
    if not verdict.compared:
        return
    yield f"{one.name}: {verdict.compared} frames sent, {_same(verdict.different)}"
    start_ns = one.trace.start_ns or 0
    for time_ns, difference in verdict.examples if examples else ():
        text = _difference_text(one.deployment, difference)
        yield f"  {(time_ns - start_ns) / 1e9:.3f} s: {text}"


def _same(different: int) -> str:
    if not different:
        return "every one the same to the last bit"
    return f"{different} not the same"


def _difference_text(deployment: Deployment, difference: Difference) -> str:
    """A difference in the words of the DBC."""
    bus, can_id, extended = difference.key
    messages = [
        m
        for m in deployment.messages.all()
        if m.is_extended_frame == extended and m.frame_id == can_id
    ]
    name = messages[0].name if messages else f"{can_id:#x}"

    def shown(data: bytes | None) -> str:
        if data is None:
            return "nothing"
        if not messages or len(data) != messages[0].length:
            return data.hex(" ")
        values = messages[0].decode(data, decode_choices=False)
        assert isinstance(values, Mapping)
        return " ".join(f"{k}={v:g}" for k, v in values.items() if isinstance(v, int | float))

    return f"{bus} {name}: black box {shown(difference.recorded)}; replay {shown(difference.ours)}"


def _axes(replays: Sequence[Replayed]) -> list[str]:
    return list(dict.fromkeys(axis for one in replays for axis in one.measures))


def _number(value: float | None, scale: float, digits: int) -> str:
    return NOTHING if value is None else f"{scale * value:.{digits}f}"
