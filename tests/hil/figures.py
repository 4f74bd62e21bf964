"""Measurements of stops and silence: whether they are right, and the table of docs/safety.md."""

from collections.abc import Sequence
from pathlib import Path
from typing import NamedTuple

from tools.marks import stamped, with_sections

PAGE = Path(__file__).resolve().parents[2] / "docs" / "safety.md"
SECTION = "stops and silence"
# Of the shipped machine: age limit of its joysticks, tick.
T_MS, TICK_MS = 100, 20
# From the clock to the kernel's time of the frame.
MARGIN_MS = 1.0


class Stop(NamedTuple):
    """A stop of the process in motion.

    Attributes:
        stop_ms: how long it was set to be.
        gap_ms: between two frames of the valve, the longest one.
        neutral: the first frame after the gap was.
        latched: so was every later one.
        stalled: the status said LOOP_STALLED.
    """

    stop_ms: float
    gap_ms: float
    neutral: bool
    latched: bool
    stalled: bool


class Silence(NamedTuple):
    """A joystick that fell silent in motion.

    Attributes:
        falls_ms: from its last frame to the first command that is less.
        stopped: the process was stopped meanwhile, and went on in time.
    """

    falls_ms: float
    stopped: bool


def wrong_stops(stops: Sequence[Stop]) -> list[str]:
    """Those that went on and must not, or tripped and need not."""
    wrong = []
    for stop in stops:
        tripped = stop.neutral and stop.latched and stop.stalled
        if stop.gap_ms > T_MS + MARGIN_MS and not tripped:
            wrong.append(f"not neutral and latched: {stop}")
        if stop.gap_ms < T_MS - TICK_MS and (stop.neutral or stop.stalled):
            wrong.append(f"tripped: {stop}")
    return wrong


def wrong_silences(silences: Sequence[Silence]) -> list[str]:
    """Those after which the command fell too late."""
    longest_ms = T_MS + TICK_MS + MARGIN_MS
    return [f"too late: {one}" for one in silences if one.falls_ms > longest_ms]


def table(stops: Sequence[Stop], silences: Sequence[Silence]) -> list[str]:
    """Lines of the table of the page."""
    beyond = [s for s in stops if s.gap_ms > T_MS + MARGIN_MS]
    within = [s for s in stops if s.gap_ms < T_MS - TICK_MS]
    wrong = wrong_stops(stops)
    rows = [
        "| measured | allowed | seen |",
        "|---|---|---|",
        f"| stops of 60 to 180 ms, gap between two valve frames longer than {T_MS} ms"
        f" | all neutral and latched, LOOP_STALLED | {len(beyond)} of {len(stops)} stops,"
        f" {sum(w.startswith('not') for w in wrong)} went on |",
        f"| the same, gap shorter than {T_MS - TICK_MS} ms | none trips | {len(within)} of"
        f" {len(stops)} stops, {sum(w.startswith('tripped') for w in wrong)} tripped |",
    ]
    for stopped, what in ((False, "without a stop"), (True, "with a stop that ends by then")):
        falls = [s.falls_ms for s in silences if s.stopped is stopped]
        rows.append(
            f"| silence of a joystick to the first command that is less, {what}"
            f" | {T_MS} + {TICK_MS} + {MARGIN_MS:g} ms"
            f" | {len(falls)} times, {min(falls):.1f} to {max(falls):.1f} ms |"
        )
    return rows


def write(stops: Sequence[Stop], silences: Sequence[Silence], *, rewrite: bool) -> int:
    """Print what was measured; rewrite the page where that is asked and all is right.

    Returns:
        0 where all is right.
    """
    rows = table(stops, silences)
    print("\n".join(rows))
    wrong = wrong_stops(stops) + wrong_silences(silences)
    for line in wrong:
        print(line)
    if rewrite and not wrong:
        lines = {SECTION: [*rows, "", f"{stamped('canshaper')}."]}
        text = with_sections(PAGE.read_text("utf-8"), lines, "measured")
        PAGE.write_text(text, "utf-8")
    return 1 if wrong else 0
