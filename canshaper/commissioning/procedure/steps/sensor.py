"""Sign, delay, offset and noise of the sway sensors."""

from functools import partial

from canshaper.commissioning.plots import of_sensors
from canshaper.commissioning.procedure.bench import Task
from canshaper.commissioning.procedure.state import Context, Outcome, Step
from canshaper.commissioning.sensor.finding import DRIVE_IT, examine, heading, table, write_sensors
from canshaper.commissioning.sensor.fit import hand_driven, read_sensors
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

    def edit(copy: Deployment) -> None:
        write_sensors(copy, findings, given, live=False)

    outcome.edit = edit
    return outcome


SENSOR = Step(
    "sensor",
    "Sway sensor, found",
    "only with a sway sensor: its sign, delay, offset and noise",
    run,
    writes="`sway_sensor`",
    needs=("swing", "valve"),
    applies=lambda deployment: any(axis.sway_sensor for axis in deployment.axes.values()),
)
