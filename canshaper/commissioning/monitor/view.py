"""The monitor's picture: text in 80 columns, and one line for pipes.

Nothing is shown by colour alone: what is stale says so, what is late too.
"""

from collections.abc import Iterator, Sequence
from datetime import datetime

from rich.text import Text

from canshaper.commissioning.monitor.state import MessageRate, Monitor

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
SHORT = {
    "MissedDeadlines": "missed",
    "WrongLength": "length",
    "UnknownId": "unknown id",
    "ErrorFrames": "error frames",
    "InvalidSignals": "invalid",
    "SendFailures": "send failed",
}
IN_FIRST_LINE = 4
# A rate so much below that of the DBC is shown.
SLOW = 0.8


def screen(monitor: Monitor, now_ns: int, width: int, height: int, *, plain: bool) -> Text:
    """Everything at a moment, in as many lines as there are.

    Args:
        monitor: what is known.
        now_ns: wall clock.
        width: columns of the terminal.
        height: its lines.
        plain: only characters of ASCII.
    """
    lines = [_head(monitor, now_ns)]
    for name in monitor.deployment.axes:
        lines += _axis(monitor, name, now_ns, plain=plain)
    lines += [Text(), *_counters(monitor, now_ns)]
    rates = _rates(monitor, now_ns, width)
    least_events = 4
    room = height - len(lines) - least_events - 2
    shown = rates[: max(0, room)]
    if shown:
        lines += [Text("frames a second (of the DBC)", DIM), *shown]
    if len(shown) < len(rates):
        late = [rate for rate in monitor.messages.values() if _wrong(rate, now_ns)]
        text = ", ".join(f"{rate.name} {_wrong(rate, now_ns)}" for rate in late)
        lines.append(Text(f"late: {text}" if late else "all other messages in time", DIM))
    room = height - len(lines) - 1
    events = list(monitor.events)[-room:] if room > 0 else []
    if events:
        lines.append(Text("events", DIM))
        lines += [Text(f"{clock(event.time_ns)} {event.text}") for event in events]
    for line in lines:
        line.truncate(width)
    return Text("\n").join(lines[:height])


def status_line(monitor: Monitor, now_ns: int) -> str:
    """One line with the state of everything, for pipes."""
    parts = []
    for name in monitor.deployment.axes:
        status = monitor.history.axes.get(name)
        if status is None:
            parts.append(f"{name}=no-status")
            continue
        stale_s = monitor.stale_s(name, now_ns)
        stale = f" STALE {stale_s:.1f}s" if stale_s is not None else ""
        parts.append(
            f"{name}={status.state}({status.reason}) raw={status.values['RawCommand']:+.0f}%"
            f" sent={status.values['ShapedCommand']:+.0f}%"
            f" sway={status.values['PredictedSway']:+.1f}deg{stale}"
        )
    missed = monitor.history.counters.get("MissedDeadlines")
    parts.append(f"missed={'unknown' if missed is None else missed}")
    for bus in monitor.deployment.config.buses:
        parts.append(f"{bus}={monitor.frames_per_s(bus, now_ns):.0f}/s")
    return f"{clock(now_ns)} {' '.join(parts)}"


def clock(time_ns: int) -> str:
    """Time of the day, as the terminal's owner has it."""
    return f"{datetime.fromtimestamp(time_ns / 1e9):%H:%M:%S.%f}"[:-3]


def bar(percent: float, *, plain: bool) -> str:
    """A bar from the middle to the left or right; full at 100 %."""
    full, empty, middle = ("#", ".", "|") if plain else ("█", "·", "│")
    size = min(HALF, round(abs(percent) / 100.0 * HALF))
    if size == 0 and abs(percent) >= 1.0:
        size = 1  # what moves is seen
    left = full * size if percent < 0 else ""
    right = full * size if percent > 0 else ""
    return f"{left.rjust(HALF, empty)}{middle}{right.ljust(HALF, empty)}"


def _head(monitor: Monitor, now_ns: int) -> Text:
    text = Text("canshaper monitor", "bold")
    text.append(f"  {monitor.deployment.path.name}", "default")
    for bus, config in monitor.deployment.config.buses.items():
        rate = monitor.frames_per_s(bus, now_ns)
        said = f"{rate:.0f} frames/s" if rate else "SILENT"
        text.append(f"  {bus} {config.channel}: {said}", "default" if rate else STALE)
    return text.append(f"  {clock(now_ns)[:8]}", DIM)


# Fields of an axis that have a place of their own.
IN_ROWS = ("State", "Reason", "RawCommand", "ShapedCommand", "PredictedSway", "ActiveSet")


def _axis(monitor: Monitor, name: str, now_ns: int, *, plain: bool) -> Iterator[Text]:
    """Two lines: state and joystick, reason and what is sent."""
    status = monitor.history.axes.get(name)
    if status is None:
        has_status = monitor.deployment.axes[name].status is not None
        missing = "no status received" if has_status else "it has no status message"
        yield Text(f"{name:{NAME}.{NAME}} {missing}", DIM)
        yield Text()
        return
    stale_s = monitor.stale_s(name, now_ns)
    style = DIM if stale_s is not None else ""
    first = _row(name, status.state, "input", status.values["RawCommand"], style, plain=plain)
    number = status.values.get("ActiveSet")
    yield first.append(f"  set {number}" if number else "", style)
    reason = status.reason if stale_s is None else f"STALE {stale_s:.1f} s"
    second = _row("", reason, "valve", status.values["ShapedCommand"], style, plain=plain)
    if stale_s is not None:
        second.stylize(STALE, NAME + 1, NAME + 1 + len(reason))
    swings = monitor.deployment.axes[name].config.sway is not None
    second.append(f"  sway {status.values['PredictedSway']:+.1f}" if swings else "", style)
    others = (f"  {one} {text}" for one, text in status.shown.items() if one not in IN_ROWS)
    yield second.append("".join(others), style)


def _row(name: str, word: str, of: str, percent: float, style: str, *, plain: bool) -> Text:
    text = Text(f"{name:{NAME}.{NAME}} ", style or "bold")
    text.append(f"{word:22.22} ", style or STYLES.get(word, ""))
    return text.append(f"{of} {bar(percent, plain=plain)} {percent:+4.0f}%", style)


def _counters(monitor: Monitor, now_ns: int) -> Iterator[Text]:
    history = monitor.history
    if monitor.deployment.status is None:
        yield Text("the deployment gives the service no status message", DIM)
        return
    if history.counted_ns is None:
        yield Text("no counters received", DIM)
        return
    text = Text("counters", DIM)
    stale_s = monitor.counters_stale_s(now_ns)
    if stale_s is not None:
        text.append(f" STALE {stale_s:.1f} s", STALE)
    shown = [f"  {SHORT.get(name, name)} {count}" for name, count in history.counters.items()]
    counts = list(history.counters.values())
    for word, count in zip(shown[:IN_FIRST_LINE], counts, strict=False):
        text.append(word, "bold yellow" if count else "default")
    yield text
    text = Text("        ")
    for word, count in zip(shown[IN_FIRST_LINE:], counts[IN_FIRST_LINE:], strict=True):
        text.append(word, "bold yellow" if count else "default")
    text.append(f"  last fault {history.last_fault}")
    others = "".join(f"  {count} {kind} frames" for kind, count in monitor.others.items())
    yield text.append(others, "bold yellow")


def _rates(monitor: Monitor, now_ns: int, width: int) -> list[Text]:
    """Rates of the messages, as many in a line as fit."""
    cells = [_rate(rate, now_ns) for rate in monitor.messages.values()]
    if not cells:
        return []
    cell = max(len(text) for text, _ in cells) + 2
    each = max(1, width // cell)
    return [_line(cells[i : i + each], cell) for i in range(0, len(cells), each)]


def _line(cells: Sequence[tuple[str, str]], width: int) -> Text:
    line = Text()
    for text, style in cells:
        line.append(text.ljust(width), style)
    return line


def _rate(rate: MessageRate, now_ns: int) -> tuple[str, str]:
    expected = f" ({1000 / rate.cycle_ms:.3g})" if rate.cycle_ms else ""
    wrong = _wrong(rate, now_ns)
    text = f"{rate.name} {rate.per_s(now_ns):.3g}{expected}"
    return (f"{text} {wrong}", STALE) if wrong else (text, "")


def _wrong(rate: MessageRate, now_ns: int) -> str:
    """What is wrong with how a message comes; empty when nothing is."""
    if rate.last_ns is None:
        return "NEVER"
    if (silent_s := rate.silent_s(now_ns)) is not None:
        return f"SILENT {silent_s:.1f}s"
    slow = rate.cycle_ms and len(rate.times) > 2
    if slow and rate.per_s(now_ns) < SLOW * 1000 / (rate.cycle_ms or 1):
        span_ns = rate.times[-1] - rate.times[0]
        if (len(rate.times) - 1) * 1e9 / max(1, span_ns) < SLOW * 1000 / (rate.cycle_ms or 1):
            return "SLOW"
    return ""
