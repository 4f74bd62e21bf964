"""The same work without and with the filters: what they are worth."""

from functools import partial
from pathlib import Path
from typing import Any

from canshaper.commissioning.procedure.bench import Mode, Simulated, Task
from canshaper.commissioning.procedure.recorded import machine_recording, simulated_recording
from canshaper.commissioning.procedure.step import FILE, Context, Outcome, Step
from canshaper.errors import IdentificationError
from canshaper.report.metrics import report_dict
from canshaper.report.plot import figure
from canshaper.report.table import print_report
from canshaper_sim.axes import ALL_AXES
from canshaper_sim.operator import script_named
from canshaper_sim.recording import Recording

# A tenth of the swing: with more, the filter is for another swing than this one.
LEAST_REDUCTION_PCT = 90.0
DRIVES = {"before": ("off", Mode.RAW), "after": ("on", Mode.SHAPED)}


def run(context: Context) -> Outcome:
    """Let the same be driven twice, and compare."""
    deployment = context.deployment
    script = script_named("demo", [axis for axis in ALL_AXES if axis in deployment.axes])
    outcome = Outcome()
    for name, (filters, mode) in DRIVES.items():
        log = context.folder / f"drive-{name}.log"
        words = (
            f"Filters {filters}. Slew and reach out together for two seconds, let go of both, wait"
            " six seconds; then the same back. The same both times, before and after."
            f" {script.duration_s:.0f} s."
        )
        context.bench.drive(deployment, log, Task(words, script, mode))
        outcome.files.append(log)
    raw, shaped = (_recording(context, log) for log in outcome.files)
    measures = report_dict(
        raw,
        shaped,
        transport="lock-step, no bus" if context.bench.simulated else "the machine",
        missed_deadlines=None,
        facts={"script": script.name, "deployment": deployment.path.name},
    )
    print_report(measures, outcome.sheet)
    fastest = ", ".join(f"{n} {a.limits.max_pct:g} %" for n, a in deployment.config.axes.items())
    outcome.sheet.print(f"max_pct in both drives: {fastest}")
    parts = {"crane": measures["crane"]} if measures["crane"] else measures["axes"]
    for name, one in parts.items():
        _judge(outcome, name, one)
    outcome.figures[""] = partial(figure, raw, shaped, measures)
    return outcome


def _recording(context: Context, log: Path) -> Recording:
    if isinstance(context.bench, Simulated):
        return simulated_recording(log, context.deployment, context.bench.parameters)
    swings = context.numbers.get("swing", {})
    signals = {name: one["signal"] for name, one in swings.items() if one.get("signal")}
    if not signals:
        text = "no signal on a bus shows the swing: judge before and after by eye, then skip it"
        raise IdentificationError(text)
    return machine_recording(log, context.deployment, signals)


def _judge(outcome: Outcome, name: str, measures: dict[str, Any]) -> None:
    """Keep the residual, and say where too much of it is left."""
    reduction = measures["residual_reduction_pct"]
    raw, shaped = (measures[one]["residual_deg"] for one in ("raw", "shaped"))
    if reduction is None:
        return
    outcome.numbers[name] = {
        "residual_before_deg": raw,
        "residual_after_deg": shaped,
        "residual_left_pct": round(100.0 - reduction, 1),
    }
    if reduction < LEAST_REDUCTION_PCT:
        text = f"{100.0 - reduction:.0f} % of the swing is left ({raw} to {shaped} degrees)"
        remedy = "do swing, valve and filter again with what hangs on the crane now"
        outcome.poor.append(f"{name}: {text}, expected less than a tenth: {remedy}")


DRIVE = Step("drive", "Before and after", run, needs=(FILE,))
