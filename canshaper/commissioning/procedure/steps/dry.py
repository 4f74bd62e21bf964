"""The dry drive: the daemon computes what the valves would get, and sends them nothing."""

from collections.abc import Sequence

from matplotlib.figure import Figure

from canshaper.commissioning.procedure.bench import STILL_MOVES, Mode, Task
from canshaper.commissioning.procedure.state import FILE, Context, Outcome, Step
from canshaper.commissioning.procedure.steps.joysticks import LEAST
from canshaper.commissioning.procedure.traffic import Traffic, read_traffic
from canshaper.report import style
from canshaper.report.console import axis_title, new_table
from canshaper.shaping.states import Reason, State
from canshaper_sim.strokes import Script, Stroke

FIRST_S, HOLD_S, PAUSE_S = 1.0, 1.5, 3.5
# States in which an axis is driven by its joystick.
DRIVEN = {State.ACTIVE.name, State.BYPASS_ON.name}


def ends(axes: Sequence[str], level: float) -> tuple[Stroke, ...]:
    """Every joystick forth and back, one after the other."""
    strokes, begin_s = [], FIRST_S
    for name in axes:
        for sign in (1.0, -1.0):
            strokes.append(Stroke(name, begin_s, HOLD_S, sign * level))
            begin_s += HOLD_S + PAUSE_S
    return tuple(strokes)


def run(context: Context) -> Outcome:
    """Let every joystick be moved while the daemon listens."""
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
    outcome.figures[""] = lambda: figure(
        traffic, "Dry drive: the joysticks as the daemon sees them"
    )
    return outcome


def show_states(outcome: Outcome, traffic: Traffic) -> None:
    """States that each axis went through, where its status message is in the log."""
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
    """Joystick and valve of each axis over time, and when its joystick was enabled."""
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
    run,
    needs=(FILE,),
)
