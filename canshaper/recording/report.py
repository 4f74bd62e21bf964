"""Report of a replay for people and as numbers, and the replay as a recorded drive."""

import math
from array import array
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import asdict, dataclass, field
from typing import Any

from rich.box import SIMPLE_HEAD
from rich.console import Console
from rich.text import Text

from canshaper.machine.deployment import Deployment
from canshaper.recording.replay import Replay
from canshaper.recording.ticks import Difference, Result, Tick
from canshaper.report.console import NOTHING, WholeTable, axis_title
from canshaper.report.metrics import AxisMetrics, axis_metrics
from canshaper.shaping.sway import SwayModel
from canshaper_sim.recording import AxisTrace, Recording

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


# Three hours of a loop of 20 ms; a longer drive is replayed, but not drawn, to its end.
MOST_ROWS = 540_000


class Trace:
    """Rows of the ticks of one replay.

    A log has no sway and no speed of the crane. The trace takes sway from the deployment's own
    model, and as speed of an axis the setpoint sent to its valve.

    Args:
        deployment: the machine of the axes.
        begin_s: time of the first row to keep, seconds after the first tick.
        end_s: time of the last row to keep; None for the end.

    Attributes:
        start_ns: time of the first tick; None before it.
        end_ns: time of the last tick.
        full: more than ``MOST_ROWS`` rows were to be kept; the rest was dropped.
    """

    def __init__(self, deployment: Deployment, begin_s: float, end_s: float | None) -> None:
        self.start_ns: int | None = None
        self.end_ns = 0
        self.full = False
        self._begin_s, self._end_s = begin_s, end_s
        self._t_s = array("d")
        self._rows = {name: [array("d") for _ in range(4)] for name in deployment.axes}
        self._models: dict[str, tuple[SwayModel, float]] = {}
        tick_s = deployment.config.tick_ms / 1000.0
        for name, axis in deployment.axes.items():
            if axis.config.sway is not None:
                sway = axis.config.sway
                self._models[name] = SwayModel(sway.mode(), tick_s), sway.full_speed_m_s

    def add(self, tick: Tick, result: Result) -> None:
        """Take a tick and its result; one not later than the row before gives no row."""
        if self.start_ns is None:
            self.start_ns = tick.now_ns
        self.end_ns = tick.now_ns
        time_s = (tick.now_ns - self.start_ns) / 1e9
        kept = time_s >= self._begin_s and (self._end_s is None or time_s <= self._end_s)
        kept = kept and not (self._t_s and time_s <= self._t_s[-1])
        if kept and len(self._t_s) >= MOST_ROWS:
            kept, self.full = False, True
        if kept:
            self._t_s.append(time_s)
        for name, row in result.rows.items():
            straight = 0.0
            if name in self._models:
                model, full_speed = self._models[name]
                model.step(row.command)
                straight = math.degrees(model.sway_rad(full_speed))
            if kept:
                for column, value in zip(self._rows[name], (*row[:3], straight), strict=True):
                    column.append(value)

    @property
    def rows(self) -> int:
        """Number of ticks kept."""
        return len(self._t_s)

    def recording(self) -> Recording:
        """Return the drive as it was replayed."""
        return self._recording(sent=1, sway=2)

    def straight(self) -> Recording:
        """Return the drive as it would be with the joystick straight to the valve."""
        return self._recording(sent=0, sway=3)

    def _recording(self, sent: int, sway: int) -> Recording:
        axes = {}
        for name, columns in self._rows.items():
            applied = list(columns[sent])
            swings = list(columns[sway]) if name in self._models else None
            axes[name] = AxisTrace(list(columns[0]), applied, applied, swings)
        return Recording(list(self._t_s), axes)


@dataclass
class Replayed:
    """A finished replay of one deployment.

    Attributes:
        name: unique name for people.
        deployment: the machine.
        replay: the replay.
        trace: rows of the replay.
        events: (time in the log, ns; text) of each event that the daemon would have reported.
        ticks: number of ticks.
        missed: number of deadlines that the daemon missed.
        measures: measures by axis; empty for a drive of fewer than two rows.
        straight: the same with the joystick straight to the valve.
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
        """Set ``measures`` and ``straight``, unless the trace has fewer than two rows."""
        if self.trace.rows < 2:
            return
        recording, straight = self.trace.recording(), self.trace.straight()
        for axis in self.deployment.axes:
            still_deg = self.deployment.config.still_deg
            self.measures[axis] = axis_metrics(recording, axis, still_deg)
            self.straight[axis] = axis_metrics(straight, axis, still_deg)

    def count(self, axis: str, state: str) -> int:
        """Return how often an axis entered a state."""
        begin = f"axis={axis} state={state} "
        return sum(text.startswith(begin) for _, text in self.events)

    def as_dict(self) -> dict[str, Any]:
        """Return counts, measures by axis and result of the comparison as JSON types."""
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
    """Print one table for each axis: the joystick straight to the valve, then each deployment."""
    for axis in dict.fromkeys(axis for one in replays for axis in one.measures):
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
    """Yield lines on the comparison with a black box; nothing if no frame was compared."""
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
    """Return a difference as text, in names and values of the DBC where the frame has them."""
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


def _number(value: float | None, scale: float, digits: int) -> str:
    return NOTHING if value is None else f"{scale * value:.{digits}f}"
