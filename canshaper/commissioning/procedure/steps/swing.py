"""The swing of each axis, recorded and identified."""

from collections.abc import Sequence
from dataclasses import dataclass, field
from functools import partial
from pathlib import Path
from typing import Any

from canshaper.commissioning.identification.data import (
    logged,
    measured_in,
    simulated_signals,
    timed_by_hand,
)
from canshaper.commissioning.identification.plot import figure
from canshaper.commissioning.identification.report import (
    Advice,
    advice_on,
    headlines,
    lines,
    write_sway,
)
from canshaper.commissioning.identification.verdict import SwingFinding
from canshaper.commissioning.procedure.bench import Bench, Mode, Task
from canshaper.commissioning.procedure.state import Context, Outcome, Step
from canshaper.errors import UsageError
from canshaper.machine.deployment import Deployment
from canshaper.recording.tables import is_table
from canshaper_sim.strokes import Script, Stroke

# A push as of the scripts pulse-AXIS, and a rest of ten swings of most grapples, s.
PUSH_S, RAMP_S, QUIET_S = 3.0, 0.1, 30.0
NONE = "-"


@dataclass
class _Sources:
    """Sources of the swing of each axis.

    Attributes:
        signals: MESSAGE.SIGNAL on a bus, by axis.
        tables: file of a phone or logger, by axis.
        timed: swings, seconds, first and last amplitude by a stopwatch, by axis.
    """

    signals: dict[str, str] = field(default_factory=dict)
    tables: dict[str, Path] = field(default_factory=dict)
    timed: dict[str, tuple[float, ...]] = field(default_factory=dict)


def swinging(deployment: Deployment) -> list[str]:
    """Return the axes that make the grapple swing."""
    return [name for name, axis in deployment.axes.items() if axis.config.sway]


def run(context: Context) -> Outcome:
    """Identify the swing of each axis without a rope: by a recorded push, table or stopwatch."""
    deployment, bench = context.deployment, context.bench
    outcome = Outcome()
    axes = [name for name in swinging(deployment) if not deployment.axes[name].rope]
    if ropes := [name for name in swinging(deployment) if name not in axes]:
        text = "the length of the rope is measured, which says how it swings"
        outcome.sheet.print(f"ok: {', '.join(ropes)}: {text}")
    sources = _swing_sources(bench, deployment, axes)
    shown = {**sources.signals, **sources.tables, **sources.timed}
    missing = [name for name in axes if name not in shown]
    if missing:
        text = f"{', '.join(missing)}: nothing shows the swing: name a signal of the bus, a phone's"
        outcome.problems.append(f"{text} table, or a stopwatch")
    findings: list[SwingFinding] = []
    logs: list[Path] = []
    if sources.signals:
        log = context.folder / "swing.log"
        bench.drive(deployment, log, _task([*sources.signals], bench.raw_mode("swing")))
        logs.append(log)
        findings += _identified(log, sources.signals, context)
    for name, path in sources.tables.items():
        logs.append(path)
        findings += _identified(path, {}, context, axis=name)
    for name, values in sources.timed.items():
        timed: dict[str, float | None] = dict(zip(_TIMED, values, strict=True))
        findings.append(timed_by_hand(timed, [], name))
    advice = advice_on(findings, deployment)
    _show(outcome, findings, advice)
    for name, signal in sources.signals.items():
        outcome.numbers.setdefault(name, {})["signal"] = signal
    outcome.files = [log for log in logs if log.parent == context.folder]
    usable = [one for one in advice if one.sway]
    if usable:
        origin = measured_in([*map(str, logs)], deployment.messages)
        origin |= {"source": "simulated"} if bench.simulated else {}
        outcome.edit = partial(_write, findings=findings, advice=usable, origin=origin)
    seen = [finding for finding in findings if finding.free or finding.driven]
    if seen:
        outcome.figures[""] = lambda: figure(seen, headlines(seen, advice))
    return outcome


_TIMED = ("swings", "seconds", "first", "last")


def _swing_sources(bench: Bench, deployment: Deployment, axes: Sequence[str]) -> _Sources:
    """Ask what shows the swing of each axis; a rehearsal takes the simulated crane's message."""
    sources, own = _Sources(), simulated_signals(deployment, deployment.messages)
    for name in axes:
        sensor = deployment.axes[name].sway_sensor
        default = own.get(name, sensor.name if sensor else NONE)
        question = (
            f"swing: {name}: what shows it: MESSAGE.SIGNAL of the bus, file of a phone (.csv), or"
            " stopwatch SWINGS SECONDS FIRST LAST such as 10 23.6 20 5"
        )
        answer = default if bench.simulated else bench.person.answer(question, default)
        words = answer.replace(",", " ").split()
        if answer == NONE:
            continue
        if len(words) == len(_TIMED):
            try:
                sources.timed[name] = tuple(map(float, words))
            except ValueError:
                text = f"expected four numbers, got {answer!r}"
                raise UsageError(f"swing: {name}: {text}") from None
        elif is_table(Path(answer)):
            sources.tables[name] = Path(answer)
        else:
            sources.signals[name] = answer
    return sources


def _task(axes: Sequence[str], mode: Mode) -> Task:
    strokes, begin_s = [], 0.5
    for name in axes:
        strokes.append(Stroke(name, begin_s, PUSH_S, 1.0, RAMP_S))
        begin_s += PUSH_S + QUIET_S
    words = (
        f"Anti-sway off. For each of {', '.join(axes)}, one after the other: one short push of its"
        f" joystick, let go, and touch nothing for ten swings. There are {begin_s:.0f} s."
    )
    return Task(words, Script("swing", tuple(strokes), begin_s), mode)


def _identified(
    log: Path, signals: dict[str, str], context: Context, axis: str | None = None
) -> list[SwingFinding]:
    machine = context.deployment
    with context.bench.person.progress("identifying") as shown:
        return logged([str(log)], signals, machine, machine.messages, axis=axis, on_progress=shown)


def _show(outcome: Outcome, findings: Sequence[SwingFinding], advice: Sequence[Advice]) -> None:
    for finding in findings:
        outcome.sheet.print("\n".join(lines(finding)))
        outcome.problems += [f"{finding.axis}: {fault}" for fault in finding.problems]
        if finding.period_s and finding.damping_ratio:
            outcome.numbers[finding.axis] = {
                "period_s": round(finding.period_s.value, 4),
                "period_half_s": round(finding.period_s.half, 4),
                "damping_ratio": round(finding.damping_ratio.value, 4),
                "damping_ratio_half": round(finding.damping_ratio.half, 4),
            }
            if speed := finding.full_speed_m_s:
                outcome.numbers[finding.axis]["full_speed_m_s"] = round(speed.value, 3)
    for one in advice:
        outcome.sheet.print(one.text)


def _write(
    deployment: Deployment,
    findings: Sequence[SwingFinding],
    advice: Sequence[Advice],
    origin: dict[str, Any],
) -> list[str]:
    write_sway(deployment, findings, advice, origin)
    scheduled = [one.axis for one in advice if deployment.axes[one.axis].config.gain_schedule]
    return [f"NOTE: {name}: its gain schedule stays as it is" for name in scheduled]


SWING = Step(
    "swing",
    "Swing, recorded and identified",
    "a push of each axis that swings, without filters, and rest; identifies it",
    run,
    writes="`sway`",
    needs=("joysticks",),
    applies=swinging,
)
