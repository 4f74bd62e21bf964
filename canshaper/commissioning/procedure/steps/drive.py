"""Comparison of the same work without and with the filters."""

from dataclasses import replace
from functools import partial
from pathlib import Path
from typing import Any

from canshaper.commissioning.identification.canlog import bind
from canshaper.commissioning.identification.series import Kind
from canshaper.commissioning.procedure.bench import Mode, Simulated, Task
from canshaper.commissioning.procedure.state import FILE, Context, Outcome, Step
from canshaper.commissioning.procedure.steps.motion import LEAST_MOVED
from canshaper.commissioning.procedure.steps.motion import figure as joysticks_figure
from canshaper.commissioning.procedure.steps.swing import swinging
from canshaper.commissioning.procedure.traffic import (
    AxisTraffic,
    Traffic,
    machine_recording,
    read_traffic,
    simulated_recording,
)
from canshaper.report.console import new_table, print_report
from canshaper.report.metrics import MIN_RAW_DEG, report_dict
from canshaper.report.plot import figure
from canshaper.report.strokes import RESIDUAL_DWELL_S, RESIDUAL_WINDOW_MIN_S
from canshaper_sim.operator import script_for
from canshaper_sim.recording import Recording

# Where more than a tenth of the swing is left, the filter is for another swing than this one.
LEAST_REDUCTION_PCT = 90.0
LEAST_SWING_DEG = 1.0  # of which a tenth is still above the noise of a sensor
LEAST_DRIVEN_S = 0.5  # of full deflection, all strokes together
MOST_UNLIKE = 2.0  # times as much driven before as after, or the other way round
DRIVES = {"before": ("off", Mode.RAW), "after": ("on", Mode.SHAPED)}
BY_EYE = "judged by eye"
LESS, SAME, UNSEEN = "less", "same", "-"


def run(context: Context) -> Outcome:
    """Let the same work be driven twice; compare what was measured, or what the person saw."""
    deployment = context.deployment
    axes = swinging(deployment) or [*deployment.axes]
    outcome = Outcome(files=_driven(context, axes))
    before, after = (read_traffic(log, deployment) for log in outcome.files)
    _compare_work(outcome, axes, before, after)
    if outcome.problems:
        for name, traffic in (("before", before), ("after", after)):
            title = f"Filters {DRIVES[name][0]}: what was driven"
            outcome.figures[name] = partial(joysticks_figure, traffic, title)
        return outcome
    fastest = ", ".join(f"{n} {a.limits.max_pct:g} %" for n, a in deployment.config.axes.items())
    outcome.sheet.print(f"max_pct in both drives: {fastest}")
    if isinstance(context.bench, Simulated):
        crane = context.bench.parameters(deployment)
        raw, shaped = (simulated_recording(log, deployment, crane) for log in outcome.files)
        _measured(context, outcome, raw, shaped)
        return outcome
    signals = _signals(context)
    if signals:
        text = ", ".join(f"{name} by {signal}" for name, signal in signals.items())
        outcome.sheet.print(f"Swing measured: {text}")
        raw, shaped = (machine_recording(log, deployment, signals) for log in outcome.files)
        _measured(context, outcome, raw, shaped)
    if left := [name for name in axes if name not in signals]:
        _by_eye(context, outcome, left)
    return outcome


def _driven(context: Context, axes: list[str]) -> list[Path]:
    """Let both drives be driven; return their logs."""
    demo = script_for(context.deployment, "demo")
    # As the words say it: without the corrections, which pull against the run-on.
    script = replace(demo, strokes=tuple(s for s in demo.strokes if s.duration_s >= 1.0))
    logs = []
    for name, (filters, mode) in DRIVES.items():
        words = (
            f"Filters {filters}. {' and '.join(axes)} together for two seconds, let go of all, wait"
            " six seconds; then the same back, and wait again. The same both times, before and"
            f" after. Watch the swing after letting go. {script.duration_s:.0f} s."
        )
        logs.append(context.folder / f"drive-{name}.log")
        context.bench.drive(context.deployment, logs[-1], Task(words, script, mode))
    return logs


def _signals(context: Context) -> dict[str, str]:
    """Return MESSAGE.SIGNAL of the swing of each axis: that of the step swing, else of its sensor.

    Raises:
        IdentificationError: it is not in the DBC files.
    """
    deployment, swings = context.deployment, context.numbers.get("swing", {})
    signals = {}
    for name, axis in deployment.axes.items():
        sensor = axis.sway_sensor
        signal = swings.get(name, {}).get("signal") or (sensor.name if sensor else None)
        if signal and bind(signal, deployment.messages)[2].kind is not Kind.OTHER:
            signals[name] = signal
    return signals


def _compare_work(outcome: Outcome, axes: list[str], before: Traffic, after: Traffic) -> None:
    """Note as problems that an axis was not driven, or not about as much in both drives."""
    problems = outcome.problems
    table = new_table("axis", "driven before, s of full deflection", "after")
    for name in axes:
        both = [_driven_s(one.axes[name]) for one in (before, after)]
        table.add_row(name, *(f"{value:.1f}" for value in both))
        for when, one, driven_s in zip(DRIVES, (before, after), both, strict=True):
            moved = max(map(abs, one.axes[name].valve.value), default=0.0) > LEAST_MOVED
            if driven_s < LEAST_DRIVEN_S:
                text = f"{name}: its joystick was moved for {driven_s:.1f} s of full deflection"
                problems.append(f"{text} in the drive {when}: drive it as it says")
            elif not moved:
                text = f"{name}: its valve received no motion in the drive {when}"
                problems.append(f"{text}: hold the enable; see docs/states.md for the reason")
        if min(both) > LEAST_DRIVEN_S and max(both) > MOST_UNLIKE * min(both):
            text = f"driven for {both[0]:.1f} s of full deflection before, {both[1]:.1f} s after"
            problems.append(f"{name}: {text}: drive the same both times")
    outcome.sheet.print(table)


def _driven_s(axis: AxisTraffic) -> float:
    """Return the area under the deflection of the joystick, s of full deflection."""
    times, values = axis.joystick.arrays()
    return float((abs(values[:-1]) * (times[1:] - times[:-1])).sum())


def _measured(context: Context, outcome: Outcome, raw: Recording, shaped: Recording) -> None:
    """Print the report of both drives, judge the swing that is left, note the figure to draw."""
    measures = report_dict(
        raw,
        shaped,
        transport="lock-step, no bus" if context.bench.simulated else "the machine",
        missed_deadlines=None,
        facts={"script": "demo", "deployment": context.deployment.path.name},
    )
    print_report(measures, outcome.sheet)
    _judge(outcome, measures["crane"])
    outcome.figures[""] = partial(figure, raw, shaped, measures)


def _judge(outcome: Outcome, measures: dict[str, Any]) -> None:
    """Note the swing that is left; a problem where it is too much, or data is missing."""
    problems = outcome.problems
    before, after = (measures[one]["residual_deg"] for one in ("raw", "shaped"))
    if before is None or after is None:
        rest_s = RESIDUAL_DWELL_S + RESIDUAL_WINDOW_MIN_S
        text = f"no rest of {rest_s:g} s after all joysticks were let go"
        problems.append(f"{text}, so no swing is left to compare: let go, and wait six seconds")
        return
    if before < LEAST_SWING_DEG or measures["shaped"]["peak_deg"] < MIN_RAW_DEG:
        peak = measures["shaped"]["peak_deg"]
        text = f"a swing of {before} degrees was left without filters, at most {peak} with them"
        remedy = "nothing to compare: push harder; is it the right signal, and the sensor on?"
        problems.append(f"{text}: {remedy}")
        return
    left_pct = 100.0 * after / before
    outcome.numbers["crane"] = {
        "residual_before_deg": before,
        "residual_after_deg": after,
        "residual_left_pct": round(left_pct, 1),
    }
    if left_pct > 100.0 - LEAST_REDUCTION_PCT:
        text = f"{left_pct:.0f} % of the swing is left ({before} to {after} degrees)"
        remedy = "do swing, valve and filter again with what hangs on the crane now"
        problems.append(f"{text}, expected less than a tenth: {remedy}")


def _by_eye(context: Context, outcome: Outcome, axes: list[str]) -> None:
    """Ask what the person has seen of axes whose swing no signal measures."""
    problems = outcome.problems
    names = ", ".join(axes)
    outcome.sheet.print(f"NOTHING MEASURED the swing of {names}: judge it by eye")
    question = (
        f"drive: by eye: {names}: I drove both times, and saw the swing after letting go:"
        f" {LESS} = hardly any with the filters, {SAME} = as without them, {UNSEEN} = not looked"
    )
    saw = context.bench.person.answer(question, UNSEEN, (LESS, SAME, UNSEEN))
    if saw == LESS:
        outcome.note = f"{names} {BY_EYE}"
        outcome.sheet.print(
            f"{names}: {BY_EYE}, not measured: drove both times, and saw less swing"
        )
        outcome.numbers.update({name: {"judged": "by eye", "saw": saw} for name in axes})
    elif saw == SAME:
        text = f"{names}: by eye the filters take no swing away"
        problems.append(f"{text}: do swing, valve and filter again")
    else:
        text = f"{names}: nothing measured the swing, and no one has judged it by eye"
        problems.append(f"{text}: watch the grapple in both drives, then answer {LESS} or {SAME}")


DRIVE = Step(
    "drive",
    "Before and after",
    "the same work without and with the filters: the swing that is left",
    run,
    needs=(FILE,),
)
