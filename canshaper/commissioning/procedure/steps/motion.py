"""Steps: the dry drive, without a valve frame; the first motion, at reduced speed."""

import math
from collections.abc import Sequence
from functools import partial

import numpy as np
from matplotlib.figure import Figure

from canshaper.commissioning.identification.series import Command
from canshaper.commissioning.procedure.bench import STILL_MOVES, Mode, Task
from canshaper.commissioning.procedure.state import FILE, Context, Outcome, Step
from canshaper.commissioning.procedure.steps.joysticks import LEAST
from canshaper.commissioning.procedure.traffic import AxisTraffic, Traffic, read_traffic
from canshaper.config.bus import REDUCED_PCT
from canshaper.config.source import Source
from canshaper.edit.edit import change
from canshaper.errors import UsageError
from canshaper.machine.deployment import Deployment
from canshaper.report import style
from canshaper.report.console import axis_title, new_table
from canshaper.shaping.states import Reason, State
from canshaper_sim.strokes import Script, Stroke

FIRST_S, HOLD_S, PAUSE_S = 1.0, 1.5, 3.5
# States in which an axis is driven by its joystick.
DRIVEN = {State.ACTIVE.name, State.BYPASS_ON.name}


def ends(axes: Sequence[str], level: float) -> tuple[Stroke, ...]:
    """Return strokes of each joystick to +``level``, part of full, then to -``level``, in turn."""
    strokes, begin_s = [], FIRST_S
    for name in axes:
        for sign in (1.0, -1.0):
            strokes.append(Stroke(name, begin_s, HOLD_S, sign * level))
            begin_s += HOLD_S + PAUSE_S
    return tuple(strokes)


def drive_dry(context: Context) -> Outcome:
    """Let every joystick be moved while the daemon sends nothing; judge reach and states."""
    deployment = context.deployment
    log = context.folder / "dry.log"
    strokes = ends([*deployment.axes], 1.0)
    script = Script("dry", strokes, strokes[-1].end_s + PAUSE_S)
    words = (
        "Enable held, move each joystick to both ends, one after the other:"
        f" {', '.join(deployment.axes)}. {script.duration_s:.0f} s. {STILL_MOVES}"
    )
    context.bench.drive(deployment, log, Task(words, script, Mode.DRY))
    traffic = read_traffic(log, deployment)
    outcome = Outcome(files=[log])
    show_states(outcome, traffic)
    for name, axis in traffic.axes.items():
        least, most = axis.reach
        if min(-least, most) < LEAST:
            text = f"its joystick went from {100 * least:.0f} to {100 * most:.0f} %"
            outcome.problems.append(f"{name}: {text}: move it to both ends, enable held")
        elif axis.states and not {state for _, state, _ in axis.states} & DRIVEN:
            reasons = dict.fromkeys(f"{state} ({reason})" for _, state, reason in axis.states)
            text = f"{name}: it was never {State.ACTIVE.name}, but {', '.join(reasons)}"
            if context.bench.simulated and axis.states[-1][2] == Reason.NODE_FAULT.name:
                text = f"NOTE: {text}: at the desk no other controller starts the nodes"
                outcome.sheet.print(text)
            else:
                outcome.problems.append(f"{text}: see docs/states.md for that reason")
    if context.bench.simulated:
        sent = sum(len(axis.valve.value) for axis in traffic.axes.values())
        outcome.numbers["valve_frames"] = sent
        outcome.sheet.print(f"valve frames: {sent}")
        if sent:
            outcome.problems.append(f"expected no valve frame, got {sent}; do not go on")
    title = "Dry drive: the joysticks as the daemon sees them"
    outcome.figures[""] = lambda: figure(traffic, title)
    return outcome


def show_states(outcome: Outcome, traffic: Traffic) -> None:
    """Show the states that each axis went through, where the log has its status message."""
    table = new_table("axis", "least, %", "most, %", "states")
    for name, axis in traffic.axes.items():
        states = list(dict.fromkeys(state for _, state, _ in axis.states))
        ends = (f"{100 * end:.0f}" for end in axis.reach)
        table.add_row(name, *ends, ", ".join(states) or "no status message")
        outcome.numbers[name] = {"states": states}
    outcome.sheet.print(table)
    if traffic.missed_deadlines is not None:
        outcome.numbers["missed_deadlines"] = traffic.missed_deadlines
        outcome.sheet.print(f"missed deadlines: {traffic.missed_deadlines}")


def figure(traffic: Traffic, title: str) -> Figure:
    """Draw joystick and valve of each axis over time, and when the enable was held."""
    height = 190 + 300 * len(traffic.axes)
    fig = style.print_figure(height)
    for number, (name, axis) in enumerate(traffic.axes.items()):
        bottom = (height - 110 - 300 * (number + 1) + 95) / height
        panel = fig.add_axes((0.11, bottom, 0.86, 185 / height))
        style.plain(panel, size=style.TEXT_PT)
        style.titled(panel, axis_title(name), style.TITLE_PT)
        style.zero_line(panel)
        enabled = [110.0 * value for value in axis.enabled.value]
        panel.fill_between(
            axis.enabled.time_s, 0.0, enabled, color=style.JOYSTICK_COLOUR, alpha=0.4,
            label="enable", linewidth=0, step="post",
        )  # fmt: skip
        panel.plot(
            axis.joystick.time_s, _percent(axis.joystick.value), color=style.RAW_COLOUR,
            linewidth=1.2, linestyle=style.DASHED, label="joystick",
        )  # fmt: skip
        panel.plot(
            axis.valve.time_s, _percent(axis.valve.value), color=style.SHAPED_COLOUR, linewidth=1.6,
            label="valve",
        )  # fmt: skip
        for time_s, state, _ in axis.states:
            if state == State.TRIPPED.name:
                panel.axvline(time_s, color=style.TEXT_COLOUR, linewidth=0.8)
        panel.set_xlim(0.0, traffic.duration_s)
        panel.set_ylim(-110.0, 110.0)
        style.label(panel, y="%")
        if not number:
            panel.legend(loc="upper right", fontsize=style.TEXT_PT, frameon=False, ncols=3)
    style.label(panel, "time, s")
    style.headline(fig, title)
    return fig


def _percent(values: Sequence[float]) -> list[float]:
    return [100.0 * value for value in values]


DRY = Step(
    "dry",
    "Dry drive",
    "the daemon computes and sends no valve frame: does every axis become ACTIVE?",
    drive_dry,
    needs=(FILE,),
)


MOTION = "motion"  # name of the step
LEVEL = 0.4  # of full deflection
LEAST_MOVED = 0.02  # of full command
# Valves may be away from neutral for two periods of the joystick's and the valve's frame after the
# enable was let go: each of both frames may just have been sent.
FRAMES = 2
GUIDE = (
    "no one near, the crane free of everything, engine at low speed, a hand on the emergency stop."
    " The controller that drove the valves so far sends no more to them"
)


def move_first(context: Context) -> Outcome:
    """Let every axis be moved a little, and the enable be let go in motion; judge both.

    Raises:
        UsageError: an axis may move faster than at reduced speed.
    """
    deployment = context.deployment
    fast = [n for n, one in deployment.config.axes.items() if one.limits.max_pct > REDUCED_PCT]
    if fast:
        text = f"expected max_pct up to {REDUCED_PCT:g} for the first motion"
        raise UsageError(f"{', '.join(fast)}: {text}; do the step check again, which proposes it")
    log = context.folder / "motion.log"
    axes = [*deployment.axes]
    strokes = ends(axes, LEVEL)
    begin_s = strokes[-1].end_s + PAUSE_S
    last = Stroke(axes[0], begin_s, 2.0, LEVEL)
    script = Script("motion", (*strokes, last), last.end_s + PAUSE_S)
    released = (begin_s + 1.0, last.end_s + 0.5)
    words = (
        f"FIRST MOTION: {GUIDE}. Enable held: a little deflection forth and back of each of"
        f" {', '.join(axes)}; then let go of the enable while {axes[0]} moves."
        f" {script.duration_s:.0f} s."
    )
    context.bench.drive(deployment, log, Task(words, script, Mode.SHAPED, released))
    traffic = read_traffic(log, deployment)
    outcome = Outcome(files=[log])
    show_states(outcome, traffic)
    slowest_s: float | None = None
    for name, axis in traffic.axes.items():
        bound = deployment.axes[name]
        cycle_ms = deployment.joysticks[bound.config.command.joystick].message.cycle_time or 0
        period_ms = bound.period_ticks * deployment.config.tick_ms
        allowed_s = FRAMES * (period_ms + cycle_ms) / 1000.0
        if not _follows(axis):
            text = "its valve did not follow its joystick in both directions"
            outcome.problems.append(f"{name}: {text}: see the picture, then move it again")
        for after_s in _releases(axis):
            slowest_s = max(slowest_s or 0.0, after_s)
            if after_s > allowed_s:
                text = f"neutral only {after_s:.3f} s after the enable was let go"
                outcome.problems.append(f"{name}: {text}, expected {allowed_s:.3f} s; do not go on")
    if slowest_s is None:
        text = "the enable was not let go while an axis moved, or is in no message of a joystick"
        outcome.problems.append(f"{text}: let it go in motion; neutral has to follow at once")
    else:
        outcome.numbers["enable_to_neutral_s"] = round(slowest_s, 3)
        outcome.sheet.print(f"enable let go in motion: neutral after {slowest_s:.3f} s")
    if not context.bench.simulated:
        outcome.sheet.print("Accept it only if each axis moved, and in its right direction.")
    data = Source(deployment.path).data.get("motion", {})
    if names := [name for name, motion in data.items() if motion.get("waits")]:
        outcome.sheet.print(f"Two-axis motion begins with the next step: {', '.join(names)}")
        outcome.edit = partial(_begin, names=names)
    outcome.figures[""] = lambda: figure(traffic, "First motion, at reduced speed")
    return outcome


def _begin(deployment: Deployment, names: list[str]) -> None:
    change(deployment.path, [(("motion", name), {"waits": None}, "") for name in names])


def _follows(axis: AxisTraffic) -> bool:
    """Return whether the valve follows a held joystick to both sides.

    Slew moves near-far a little too, so motion without the joystick says nothing.
    """
    time_s, joystick = axis.joystick.arrays()
    valve = Command(*axis.valve.arrays()).at(time_s)
    far = 0.5 * np.abs(joystick).max(initial=0.0)
    sent = [side * valve[side * joystick > far] for side in (1.0, -1.0)]
    return all(len(one) and one.mean() >= LEAST_MOVED for one in sent)


def _releases(axis: AxisTraffic) -> list[float]:
    """Return the times, s, from each release of enable in motion to neutral; infinite for never."""
    (time_s, valve), (at_s, enabled) = axis.valve.arrays(), axis.enabled.arrays()
    times_s = []
    for released_s in at_s[1:][(enabled[:-1] > 0.0) & (enabled[1:] == 0.0)]:
        after = np.searchsorted(time_s, released_s)
        if after and abs(valve[after - 1]) > LEAST_MOVED:
            neutral_s = time_s[after:][valve[after:] == 0.0]
            times_s.append(float(neutral_s[0] - released_s) if len(neutral_s) else math.inf)
    return times_s


# It does not need FILE: its own change of the file makes the crane faster.
FIRST_MOTION = Step(
    MOTION,
    "First motion, at reduced speed",
    "first motion at reduced speed: each valve follows its joystick, and is neutral when the"
    " enable is let go",
    move_first,
    writes="`motion` without `waits`",
    needs=("valve", "filter"),
)
