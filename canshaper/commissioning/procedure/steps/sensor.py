"""Sign, delay, offset and noise of the sway sensors."""

from functools import partial
from pathlib import Path

from canshaper.commissioning.plots import of_sensors
from canshaper.commissioning.procedure.bench import Task
from canshaper.commissioning.procedure.state import Context, Outcome, Step
from canshaper.commissioning.sensor.finding import DRIVE_IT, Finding, examine
from canshaper.commissioning.sensor.fit import hand_driven, read_sensors
from canshaper.commissioning.sensor.report import heading, table, write_sensors
from canshaper.machine.deployment import Deployment


def run(context: Context) -> Outcome:
    """Let each axis with a sensor be driven, and compare with its model."""
    deployment, bench = context.deployment, context.bench
    axes = [name for name, axis in deployment.axes.items() if axis.sway_sensor]
    log = context.folder / "sensor.log"
    script = hand_driven(axes)
    words = f"{', '.join(axes)}, one after the other: {DRIVE_IT}. {script.duration_s:.0f} s."
    bench.drive(deployment, log, Task(words, script, bench.raw_mode("sensor")))
    series = read_sensors(log, deployment, axes)
    findings = [examine(deployment.axes[name], series[name]) for name in axes]
    outcome = Outcome(files=[log])
    for finding in findings:
        outcome.sheet.print(heading(finding))
        if finding.fit:
            outcome.sheet.print(table(deployment.axes[finding.axis], finding))
            outcome.numbers[finding.axis] = {
                "invert": finding.invert,
                "delay_s": round(finding.delay_s.value, 4),
            }
        outcome.sheet.print(*(f"  note: {note}" for note in finding.notes))
        outcome.problems += [f"{finding.axis}: {fault}" for fault in finding.problems]
    if any(finding.fit for finding in findings):
        outcome.figures[""] = partial(of_sensors, findings)
    given = None if bench.simulated else log
    outcome.edit = partial(_write, findings=findings, log=given)
    return outcome


def _write(deployment: Deployment, findings: list[Finding], log: Path | None) -> list[str]:
    write_sensors(deployment, findings, log, live=False)
    return []


def _has_one(deployment: Deployment) -> bool:
    return any(axis.sway_sensor for axis in deployment.axes.values())


SENSOR = Step(
    "sensor",
    "Sway sensor, found",
    "only with a sway sensor: its sign, delay, offset and noise",
    run,
    writes="`sway_sensor`",
    needs=("swing", "valve"),
    applies=_has_one,
)
