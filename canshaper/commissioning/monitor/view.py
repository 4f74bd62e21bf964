"""Screen of the monitor: text for terminals of any width, and one line for pipes.

Colour alone says nothing: stale and late values are marked by words too.
"""

import os
import select
import sys
from collections.abc import Iterator, Sequence
from contextlib import contextmanager
from datetime import datetime

from rich.console import Console
from rich.text import Text

from canshaper.commissioning.monitor.state import DIM, NARROW, STALE, MessageRate, Monitor, rows

HELP = "p pause, a axis, q end"


class Keys:
    """Choices of a person by keys.

    Args:
        axes: their names, in the order in which they are chosen.

    Attributes:
        paused: whether the picture stands still; listening goes on.
        axis: the only one that is shown; None for all.
        ended: whether the person ends the monitor.
    """

    def __init__(self, axes: Sequence[str]) -> None:
        self._choices: list[str | None] = [None, *axes]
        self.paused = False
        self.axis: str | None = None
        self.ended = False

    def press(self, pressed: str) -> None:
        """Take keys: p or space pauses, a shows the next axis, q ends; others do nothing."""
        for key in pressed:
            if key in "p ":
                self.paused = not self.paused
            elif key == "a":
                after = self._choices.index(self.axis) + 1
                self.axis = self._choices[after % len(self._choices)]
            elif key == "q":
                self.ended = True


@contextmanager
def pressed_keys() -> Iterator[bool]:
    """Switch the terminal to keys one by one, without echo; yield whether it has keys."""
    try:
        import termios  # noqa: PLC0415  # not everywhere
        import tty  # noqa: PLC0415
    except ModuleNotFoundError:
        yield False
        return
    if not sys.stdin or not sys.stdin.isatty():
        yield False
        return
    file = sys.stdin.fileno()
    before = termios.tcgetattr(file)
    tty.setcbreak(file)
    try:
        yield True
    finally:
        termios.tcsetattr(file, termios.TCSADRAIN, before)


def waiting() -> str:
    """Return the keys that were pressed since the last call."""
    file = sys.stdin.fileno()
    if not select.select([file], [], [], 0.0)[0]:
        return ""
    return os.read(file, 64).decode("utf-8", "replace")


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


def screen(
    monitor: Monitor, now_ns: int, width: int, height: int, *, plain: bool, keys: Keys | None = None
) -> Text:
    """Return the whole state at a moment, in as many lines as the terminal has.

    Args:
        monitor, now_ns: what is known, and the wall clock.
        width, height: columns and lines of the terminal.
        plain: only characters of ASCII.
        keys: what a person has chosen; None where no key can come.
    """
    lines = [_head(monitor, now_ns, keys)]
    only = keys.axis if keys else None
    for name in [only] if only else monitor.deployment.axes:
        lines += rows(monitor, name, now_ns, width, plain=plain)
    lines += [Text(), *_counters(monitor, now_ns)]
    lines = [part for line in lines for part in _wrapped(line, width)]
    height -= bool(keys)
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
    events = _events(monitor, only, width)[-room:] if room > 0 else []
    if events:
        lines += [Text("events", DIM), *events]
    lines = lines[:height]
    if keys:
        lines += [Text()] * (height - len(lines)) + [Text(HELP, DIM)]
    for line in lines:
        line.truncate(width)
    return Text("\n").join(lines)


def _events(monitor: Monitor, only: str | None, width: int) -> list[Text]:
    """Return the events as lines wrapped to ``width``, of axis ``only`` if there is one."""
    shown = [e for e in monitor.events if only is None or f"axis={only} " in f"{e.text} "]
    lines = (Text(f"{clock(event.time_ns)} {event.text}") for event in shown)
    return [part for line in lines for part in _wrapped(line, width)]


def _wrapped(line: Text, width: int) -> list[Text]:
    """Return a line, as several where a narrow terminal needs them."""
    if width >= NARROW or len(line) <= width:
        return [line]
    first, *others = line.wrap(Console(), width, tab_size=8)
    rest = Text(" ").join(others)
    rest.rstrip()
    return [first, *(Text("  ").append(part) for part in rest.wrap(Console(), width - 2))]


def status_line(monitor: Monitor, now_ns: int) -> str:
    """Return the state of all axes and buses as one line, for pipes."""
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
    """Return the local time of day."""
    return f"{datetime.fromtimestamp(time_ns / 1e9):%H:%M:%S.%f}"[:-3]


def _head(monitor: Monitor, now_ns: int, keys: Keys | None) -> Text:
    text = Text("canshaper monitor", "bold")
    if keys and keys.paused:
        text.append(" PAUSED", STALE)
    text.append(f"  {monitor.deployment.path.name}", "default")
    for bus, config in monitor.deployment.config.buses.items():
        rate = monitor.frames_per_s(bus, now_ns)
        said = f"{rate:.0f} frames/s" if rate else "SILENT"
        text.append(f"  {bus} {config.channel}: {said}", "default" if rate else STALE)
    return text.append(f"  {clock(now_ns)[:8]}", DIM)


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
    """Return the rates of the messages, as many in a line as fit."""
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
    """Return the fault of a message's rate; empty without one."""
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
