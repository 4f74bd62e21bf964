"""State of a machine, known from the frames on its buses; rows of the monitor's screen."""

from collections import Counter, deque
from collections.abc import Iterator, Sequence
from dataclasses import dataclass, field
from typing import Any, NamedTuple

from rich.text import Text

from canshaper.codec.frame import Frame, MessageKey
from canshaper.machine.deployment import Deployment
from canshaper.recording.channels import InputFinder
from canshaper.recording.listen import AxisStatus, History, HistoryEvent, ReceivedFrame

# Rates are counted over so long.
WINDOW_NS = 2_000_000_000
# A message that is missing for LATE_CYCLES is silent, and a status stale; not before LEAST_LATE_NS,
# which an eye would not see, and after LATE_NS where the DBC has no cycle.
LATE_CYCLES, LEAST_LATE_NS, LATE_NS = 3, 300_000_000, 1_000_000_000
MOST_EVENTS = 200
MOST_SAMPLES = 2000  # of an axis: its status comes ten times a second or more often


class Sample(NamedTuple):
    """Setpoint and predicted sway in one status message of an axis."""

    time_ns: int
    valve_pct: float
    sway_deg: float


@dataclass
class MessageRate:
    """How often one message of the deployment comes.

    Attributes:
        cycle_ms: its cycle in the DBC; None without one.
        last_ns: when it came last; None before.
    """

    name: str
    cycle_ms: int | None
    last_ns: int | None = None
    times: deque[int] = field(default_factory=deque)

    def received(self, time_ns: int) -> None:
        """Take a frame of this message."""
        self.last_ns = time_ns
        self.times.append(time_ns)
        self.invalidate(time_ns)

    def invalidate(self, now_ns: int) -> None:
        """Drop frames that are older than the window."""
        while self.times and self.times[0] <= now_ns - WINDOW_NS:
            self.times.popleft()

    def per_s(self, now_ns: int) -> float:
        """Return the frames a second within the window."""
        self.invalidate(now_ns)
        return len(self.times) * 1e9 / WINDOW_NS

    def silent_s(self, now_ns: int) -> float | None:
        """Return for how long the message is missing, s; None where it is not, or never came."""
        if self.last_ns is None:
            return None
        limit_ns = LATE_NS
        if self.cycle_ms:
            limit_ns = max(LATE_CYCLES * self.cycle_ms * 1_000_000, LEAST_LATE_NS)
        silent_ns = now_ns - self.last_ns
        return silent_ns / 1e9 if silent_ns > limit_ns else None


class Monitor:
    """State of a machine, from every frame that is received.

    Attributes:
        history: of the status messages.
        messages: rate of each message of the deployment, by bus, id and whether that is extended.
        digest: what the daemon says that it runs; None before it says it.
        events: what changed lately, oldest first.
        others: number of frames that are no data frames of classical CAN, by kind.
        samples: of the last status messages of each axis.
    """

    def __init__(self, deployment: Deployment) -> None:
        self.deployment = deployment
        self.history = History(deployment)
        self.events: deque[HistoryEvent] = deque(maxlen=MOST_EVENTS)
        self.others: Counter[str] = Counter()
        self.messages: dict[MessageKey, MessageRate] = {}
        self._finder = InputFinder(deployment.config.buses, deployment.inputs())
        self._buses = {name: MessageRate(name, None) for name in deployment.config.buses}
        self.samples: dict[str, deque[Sample]] = {
            name: deque(maxlen=MOST_SAMPLES) for name in deployment.axes
        }
        self.digest: int | None = None
        for bound in deployment.inputs():
            self.messages[bound.key] = MessageRate(bound.message.name, bound.message.cycle_time)
        sent: list[Any] = [
            message
            for axis in deployment.axes.values()
            for message in (axis.valve.message, axis.status and axis.status.message)
        ]
        sent += [one and one.message for one in (deployment.status, deployment.identity_status)]
        for message in filter(None, sent):
            dbc = message.fields.message
            self.messages.setdefault(message.key, MessageRate(dbc.name, dbc.cycle_time))

    def receive(self, frame: ReceivedFrame) -> None:
        """Take a frame into rates, history, samples and events; one of another kind is counted."""
        self._buses[frame.bus].received(frame.time_ns)
        if frame.kind:
            self.others[frame.kind] += 1
            return
        key = (frame.bus, frame.can_id, frame.extended)
        bound = self._finder.find(Frame(*key, frame.data), frame.time_ns)
        rate = self.messages.get(bound.key if bound else key)
        if rate is not None:
            rate.received(frame.time_ns)
        if name := self.history.receive(frame):
            of_axis = self.history.axes[name].values
            shaped, sway = (of_axis[one] for one in ("ShapedCommand", "PredictedSway"))
            self.samples[name].append(Sample(frame.time_ns, shaped, sway))
        identity = self.deployment.identity_status
        if identity and key == identity.message.key and (values := identity.decode(frame.data)):
            self._compare_identity(values["Digest"], frame.time_ns)
        changes = self.history.changes
        self.events.extend(changes)
        changes.clear()  # for a day there are many

    def _compare_identity(self, digest: int, time_ns: int) -> None:
        """Note a new digest of the daemon, and whether it is that of files and program here."""
        if digest == self.digest:
            return
        self.digest, ours = digest, self.deployment.identity.digest
        differs = "" if digest == ours else f", not {ours:#06x} of the files and program here"
        self.note(time_ns, f"daemon runs digest {digest:#06x}{differs}")

    def note(self, time_ns: int, text: str) -> None:
        """Note an event that did not come with a frame."""
        self.events.append(HistoryEvent(time_ns, text))

    def frames_per_s(self, bus: str, now_ns: int) -> float:
        """Return the frames a second of a bus."""
        return self._buses[bus].per_s(now_ns)

    def stale_s(self, axis: str, now_ns: int) -> float | None:
        """Return for how long an axis' status is missing; None where it is fresh, or never came."""
        bound = self.deployment.axes[axis].status
        return self.messages[bound.message.key].silent_s(now_ns) if bound else None

    def counters_stale_s(self, now_ns: int) -> float | None:
        """Return for how long the service's counters are missing; None as of ``stale_s``."""
        status = self.deployment.status
        return self.messages[status.message.key].silent_s(now_ns) if status else None


STYLES = {
    "ACTIVE": "bold green",
    "READY": "green",
    "BYPASS_ON": "bold yellow",
    "STOPPING": "bold yellow",
    "TRIPPED": "bold red",
}
STALE = "bold red"
DIM = "dim"
HALF = 10  # columns of a bar on either side of its middle
NAME = 11
NARROW = 66  # columns that a row with its bar needs
AT, LABEL = 80, 12  # column where a line over time begins; width of its label
LEAST_LINE = 16
LINE_S = 30.0
LEVELS, PLAIN_LEVELS = "▁▂▃▄▅▆▇█", "_.,-~=*#"
LEAST_SWAY_DEG = 1.0  # least sway that half of the height of a line stands for
# Fields of an axis that have a place of their own.
IN_ROWS = ("State", "Reason", "RawCommand", "ShapedCommand", "PredictedSway", "ActiveSet")


def rows(monitor: Monitor, name: str, now_ns: int, width: int, *, plain: bool) -> Iterator[Text]:
    """Yield the rows of an axis: state and demand, reason and setpoint; no bars where narrow."""
    status = monitor.history.axes.get(name)
    if status is None:
        has_status = monitor.deployment.axes[name].status is not None
        missing = "no status received" if has_status else "it has no status message"
        yield Text(f"{name:{NAME}.{NAME}} {missing}", DIM)
        yield Text()
        return
    stale_s = monitor.stale_s(name, now_ns)
    style = DIM if stale_s is not None else ""
    reason = status.reason if stale_s is None else f"STALE {stale_s:.1f} s"
    swings = monitor.deployment.axes[name].config.sway is not None
    number = status.values.get("ActiveSet")
    active = f"  set {number}" if number else ""
    sway = f"  sway {status.values['PredictedSway']:+.1f}" if swings else ""
    sway += "".join(f"  {one} {text}" for one, text in status.shown.items() if one not in IN_ROWS)
    if width < NARROW:
        yield from _narrow(name, status, reason, f"{active}{sway}", style)
        return
    first = _row(name, status.state, "input", status.values["RawCommand"], style, plain=plain)
    second = _row("", reason, "valve", status.values["ShapedCommand"], style, plain=plain)
    if stale_s is not None:
        second.stylize(STALE, NAME + 1, NAME + 1 + len(reason))
    first.append(active, style)
    second.append(sway, style)
    if width >= AT + LABEL + LEAST_LINE:
        samples, size = monitor.samples[name], width - AT - LABEL - 1
        commands = [(one.time_ns, one.valve_pct / 100.0) for one in samples]
        _add(first, "to 100 %", line_over_time(commands, now_ns, size, plain=plain), style)
        if swings:
            reach = max([LEAST_SWAY_DEG, *(abs(one.sway_deg) for one in samples)])
            swing = [(one.time_ns, one.sway_deg / reach) for one in samples]
            line = line_over_time(swing, now_ns, size, plain=plain)
            _add(second, f"to {reach:.1f} deg", line, style)
    yield first
    yield second


def bar(percent: float, *, plain: bool) -> str:
    """Return a bar from the middle to the left or right; full at 100 %."""
    full, empty, middle = ("#", ".", "|") if plain else ("█", "·", "│")
    size = min(HALF, round(abs(percent) / 100.0 * HALF))
    if size == 0 and abs(percent) >= 1.0:
        size = 1  # what moves is seen
    left = full * size if percent < 0 else ""
    right = full * size if percent > 0 else ""
    return f"{left.rjust(HALF, empty)}{middle}{right.ljust(HALF, empty)}"


def line_over_time(
    values: Sequence[tuple[int, float]], now_ns: int, columns: int, *, plain: bool
) -> str:
    """Return the last half minute as characters, the newest at the right; spaces without values.

    Args:
        values: time in ns, and a value of -1 to 1, which is the whole height.
        now_ns: the right edge.
        columns: of the line; each shows the value of its time that is farthest from 0.
        plain: only characters of ASCII.
    """
    levels = PLAIN_LEVELS if plain else LEVELS
    largest: list[float | None] = [None] * columns
    for time_ns, value in values:
        column = columns - 1 - int((now_ns - time_ns) / 1e9 * columns / LINE_S)
        if 0 <= column < columns:
            before = largest[column]
            largest[column] = value if before is None or abs(value) > abs(before) else before
    top = len(levels) - 1
    return "".join(
        " " if one is None else levels[max(0, min(top, round((one + 1.0) / 2.0 * top)))]
        for one in largest
    )


def _add(row: Text, label: str, line: str, style: str) -> None:
    """Append a line over time to a row."""
    row.pad_right(max(0, AT - 1 - len(row)))
    row.append(f" {label:{LABEL}.{LABEL}}", DIM).append(line, style or "cyan")


def _narrow(name: str, status: AxisStatus, reason: str, more: str, style: str) -> Iterator[Text]:
    yield Text(f"{name:{NAME}.{NAME}} ", style or "bold").append(
        status.state, style or STYLES.get(status.state, "")
    )
    yield Text(f"  {reason}", STALE if reason.startswith("STALE") else style)
    raw, shaped = (status.values[one] for one in ("RawCommand", "ShapedCommand"))
    yield Text(f"  in {raw:+.0f}%  valve {shaped:+.0f}%{more}", style)


def _row(name: str, word: str, of: str, percent: float, style: str, *, plain: bool) -> Text:
    text = Text(f"{name:{NAME}.{NAME}} ", style or "bold")
    text.append(f"{word:22.22} ", style or STYLES.get(word, ""))
    return text.append(f"{of} {bar(percent, plain=plain)} {percent:+4.0f}%", style)
