"""Rows of an axis in the monitor's picture: bars, lines over time on a wide terminal."""

from collections.abc import Iterator, Sequence

from rich.text import Text

from canshaper.commissioning.monitor.state import Monitor
from canshaper.recording.history import AxisStatus

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
AT, LABEL = 80, 12  # where a line over time begins, and what it is
LEAST_LINE = 16
LINE_S = 30.0
LEVELS, PLAIN_LEVELS = "▁▂▃▄▅▆▇█", "_.,-~=*#"
LEAST_SWAY_DEG = 1.0  # half of the height of a line
# Fields of an axis that have a place of their own.
IN_ROWS = ("State", "Reason", "RawCommand", "ShapedCommand", "PredictedSway", "ActiveSet")


def rows(monitor: Monitor, name: str, now_ns: int, width: int, *, plain: bool) -> Iterator[Text]:
    """State and joystick, reason and what is sent; on a narrow terminal numbers without bars."""
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
        _add(first, "valve 100 %", line_over_time(commands, now_ns, size, plain=plain), style)
        if swings:
            reach = max([LEAST_SWAY_DEG, *(abs(one.sway_deg) for one in samples)])
            swing = [(one.time_ns, one.sway_deg / reach) for one in samples]
            line = line_over_time(swing, now_ns, size, plain=plain)
            _add(second, f"sway {reach:.1f} deg", line, style)
    yield first
    yield second


def bar(percent: float, *, plain: bool) -> str:
    """A bar from the middle to the left or right; full at 100 %."""
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
    """The last half minute, the newest at the right; spaces where nothing came.

    Args:
        values: time in ns, and a value of -1 to 1, which is the whole height.
        now_ns: the right edge.
        columns: of the line; each shows the largest value of its time.
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
    """Put a line over time behind a row."""
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
