"""The picture of a replay: joystick and command, predicted sway, and each deployment's states.

It uses the object API of matplotlib: no display and no global state.
"""

import re
from collections.abc import Iterator, Sequence
from itertools import pairwise
from typing import Any, NamedTuple

from matplotlib.axes import Axes
from matplotlib.figure import Figure

from canshaper.recording.report import Replayed
from canshaper.recording.ticks import STATE_CHANGE
from canshaper.report import style
from canshaper.report.console import axis_title
from canshaper.shaping.reasons import REASON_TEXTS
from canshaper.shaping.states import MOVING, Reason, State
from canshaper_sim.recording import Recording


class _Look(NamedTuple):
    """Look of a deployment's curves; those of later deployments are thinner and lie on top."""

    colour: str
    width: float
    style: Any


# Colours of Okabe and Ito, as in the other pictures.
LOOKS = (
    _Look(style.SHAPED_COLOUR, 2.2, "solid"),
    _Look(style.RAW_COLOUR, 1.0, style.DASHED),
    _Look("#009E73", 1.0, (0, (1.0, 1.0))),
    _Look("#CC79A7", 0.8, "solid"),
)
STRAIGHT = _Look("#888888", 0.8, "solid")
_COMMAND_PX, _SWAY_PX, _LANE_PX, _HEAD_PX, _FOOT_PX = 250, 330, 40, 185, 105
_GAPS_PX = {"command": 125, "sway": 22, "lanes": 52}  # above; reasons stand over the lanes
# Fill and hatch of a lane while an axis is in a state; the others stay white.
_LANES: dict[State, tuple[str, str]] = {
    State.READY: ("#E3E3E3", ""),
    **dict.fromkeys(MOVING, ("#9CC9E8", "")),
    State.STOPPING: ("#F5C28B", "////"),
    State.TRIPPED: ("#B03A2E", "xxxx"),
}
_KEY = "lanes: grey ready, blue moving, orange hatched stopping, red crossed tripped; ▼ others"
_NUMBERS = (
    ("largest sway", "peak_deg", "°"),
    ("residual", "residual_deg", "°"),
    ("run-on", "run_on_s", " s"),
)
_MOVES = 1e-6
_LATE = 0.8  # of the time axis: a later reason is aligned to the end of its state


def figure(replays: Sequence[Replayed]) -> Figure:
    """Return the picture of the axes that move in a replay; of the first axis if none does.

    Args:
        replays: at least one, with rows.
    """
    recordings = [one.trace.recording() for one in replays]
    straight = replays[0].trace.straight()
    names = list(dict.fromkeys(name for recording in recordings for name in recording.axes))
    moved = [name for name in names if any(_moves(r, name) for r in recordings)] or names[:1]
    lanes_px = _LANE_PX * len(replays)
    rows: list[tuple[str, str, int]] = []
    for name in moved:
        swings = any(r.axes[name].sway_deg is not None for r in recordings if name in r.axes)
        rows += [(name, "command", _COMMAND_PX), *[(name, "sway", _SWAY_PX)] * swings]
        rows.append((name, "lanes", lanes_px))
    followed = [kind for _, kind, _ in rows[1:]] + ["command"]
    gaps = [_GAPS_PX[kind] for kind in followed]
    height = _HEAD_PX + sum(h + gap for (_, _, h), gap in zip(rows, gaps, strict=True)) + _FOOT_PX
    fig = style.print_figure(height)
    _head(fig, replays, [name for name in names if name not in moved], height)
    top = height - _HEAD_PX
    panels: list[Axes] = []
    for (name, kind, tall), gap in zip(rows, gaps, strict=True):
        place = (0.1, (top - tall) / height, 0.885, tall / height)
        panel = fig.add_axes(place, sharex=panels[0] if panels else None)
        top -= tall + gap
        panels.append(panel)
        if kind == "lanes":
            _draw_lanes(panel, name, replays, (straight.t_s[0], straight.t_s[-1]))
            continue
        (_draw_sway if kind == "sway" else _draw_command)(panel, name, recordings, straight)
        if kind == "command":
            style.titled(panel, _title(name, replays), style.TITLE_PT)
        style.plain(panel, size=style.TEXT_PT)
        style.zero_line(panel)
        panel.tick_params(labelbottom=False)
    panels[-1].tick_params(labelbottom=True, labelsize=style.TEXT_PT)
    style.label(panels[-1], "time since the first tick, s")
    panels[0].set_xlim(straight.t_s[0], straight.t_s[-1])
    return fig


def _moves(recording: Recording, name: str) -> bool:
    trace = recording.axes.get(name)
    return trace is not None and any(abs(v) > _MOVES for v in (*trace.joystick, *trace.sent))


def _head(fig: Figure, replays: Sequence[Replayed], idle: Sequence[str], height: float) -> None:
    """Name the curves, the lanes, and the axes that are left out."""
    words = [("joystick straight to the valve (thin)", STRAIGHT.colour)]
    styles = ("solid", "dashed", "dotted", "thin solid")
    for i, one in enumerate(replays):
        words.append((f"{one.name} ({styles[i % len(LOOKS)]})", LOOKS[i % len(LOOKS)].colour))
    style.coloured_words(fig, words, (0.012, 1.0 - 14 / height), size=style.TEXT_PT, sep=12)
    left_out = f"; idle, left out: {', '.join(idle)}" if idle else ""
    at = 1.0 - 58 / height
    fig.text(0.012, at, _KEY + left_out, fontsize=style.TEXT_PT, color=style.TEXT_COLOUR, va="top")


def _title(name: str, replays: Sequence[Replayed]) -> str:
    """Return an axis' name and what is known of its sway and run-on, straight and replayed."""
    having = [one for one in replays if name in one.measures]
    texts = []
    for words, key, unit in _NUMBERS:
        values = [getattr(having[0].straight[name], key)] if having else []
        values += [getattr(one.measures[name], key) for one in having]
        shown = ["-" if value is None else f"{value:.1f}{unit}" for value in values]
        if any(value is not None for value in values):
            texts.append(f"{words} {shown[0]} straight, {', '.join(shown[1:])}")
    if not texts:
        return axis_title(name)
    return "\n".join([f"{axis_title(name)}: {'; '.join(texts[:2])}", *texts[2:]])


def _draw_command(
    panel: Axes, name: str, recordings: Sequence[Recording], straight: Recording
) -> None:
    """Draw the joystick as a filled step, and on it the valve command of each replay."""
    if name in straight.axes:
        joystick, colour = straight.axes[name].joystick, style.JOYSTICK_COLOUR
        panel.fill_between(straight.t_s, joystick, step="post", color=colour, linewidth=0)
    style.command_scale(panel, 1.1)
    style.label(panel, y="command, %")
    for i, recording in enumerate(recordings):
        if name in recording.axes:
            sent = recording.axes[name].sent
            _plot(panel, recording.t_s, sent, LOOKS[i % len(LOOKS)], drawstyle="steps-post")


def _draw_sway(
    panel: Axes, name: str, recordings: Sequence[Recording], straight: Recording
) -> None:
    """Draw the predicted sway, also that of the joystick straight to the valve."""
    style.label(panel, y="predicted\nsway, degrees")
    joystick = straight.axes.get(name)
    if joystick is not None and joystick.sway_deg is not None:
        _plot(panel, straight.t_s, joystick.sway_deg, STRAIGHT)
    for i, recording in enumerate(recordings):
        if name in recording.axes and (sway := recording.axes[name].sway_deg) is not None:
            _plot(panel, recording.t_s, sway, LOOKS[i % len(LOOKS)])


def _plot(panel: Axes, x: Sequence[float], y: Sequence[float], look: _Look, **options: Any) -> None:
    panel.plot(x, y, color=look.colour, linewidth=look.width, linestyle=look.style, **options)


def _draw_lanes(
    panel: Axes, name: str, replays: Sequence[Replayed], shown_s: tuple[float, float]
) -> None:
    """Draw a lane for each replay: states of the axis, events as marks; reasons of the first."""
    first_s, last_s = shown_s
    late_s = first_s + _LATE * (last_s - first_s)
    for i, one in enumerate(replays):
        low = len(replays) - 1 - i
        for start_s, end_s, state, reason in _spans(one, name):
            inside = start_s < last_s and end_s > first_s
            if i == 0 and inside and state in (State.STOPPING, State.TRIPPED):
                words = REASON_TEXTS[reason].words
                side: Any = "right" if start_s > late_s else "left"
                at_s = max(start_s, first_s) if side == "left" else min(end_s, last_s)
                place = (at_s, len(replays) + 0.12)
                panel.text(*place, words, fontsize=style.TEXT_PT, va="bottom", ha=side)
            if state in _LANES:
                colour, hatch = _LANES[state]
                spans = [(start_s, end_s - start_s)]
                panel.broken_barh(
                    spans, (low + 0.08, 0.84), facecolor=colour, hatch=hatch, edgecolor="white",
                    linewidth=0,
                )  # fmt: skip
        others = [_seconds(one, at) for at, text in one.events if not STATE_CHANGE.match(text)]
        panel.plot(others, [low + 0.5] * len(others), "v", color=style.TEXT_COLOUR, markersize=3.5)
        look = LOOKS[i % len(LOOKS)]
        panel.plot([0.0, 0.0], [low + 0.1, low + 0.9], color=look.colour, linewidth=4.0)
    panel.set_ylim(0.0, len(replays))
    panel.set_yticks([])
    panel.spines[["top", "right", "left"]].set_visible(False)
    panel.tick_params(labelbottom=False, labelcolor=style.TEXT_COLOUR)


def _spans(one: Replayed, axis: str) -> Iterator[tuple[float, float, State, Reason]]:
    """Yield (begin, end, state, reason) of an axis from its first event on; s since the start."""
    changes = [(_seconds(one, at), m[2], m[3]) for at, m in _matches(one) if m[1] == axis]
    end = (_seconds(one, one.trace.end_ns), "", "")
    for (start_s, state, reason), (end_s, *_) in pairwise([*changes, end]):
        yield start_s, end_s, State[state], Reason[reason]


def _matches(one: Replayed) -> Iterator[tuple[int, re.Match[str]]]:
    for at_ns, text in one.events:
        if match := STATE_CHANGE.match(text):
            yield at_ns, match


def _seconds(one: Replayed, at_ns: int) -> float:
    return (at_ns - (one.trace.start_ns or 0)) / 1e9
