"""Steps: valve curve and sway sensor of each axis, found by driving it."""

from functools import partial

from canshaper.commissioning.calibration.drive import CalibrationDrive
from canshaper.commissioning.calibration.fit import Calibration, curve_lines, write_curve
from canshaper.commissioning.calibration.ramp import RATE_PER_S, Ramp, speed_signal, usual_top
from canshaper.commissioning.origins import origin_of
from canshaper.commissioning.plots import of_sensors, of_valve
from canshaper.commissioning.procedure.bench import Bench, Task
from canshaper.commissioning.procedure.state import Context, Outcome, Step
from canshaper.commissioning.procedure.steps.swing import swinging
from canshaper.commissioning.sensor.fit import hand_driven, read_sensors
from canshaper.commissioning.sensor.verdict import DRIVE_IT, examine, heading, table, write_sensors
from canshaper.errors import CalibrationError
from canshaper.machine.deployment import Deployment
from canshaper_sim.axes import SPEED_SIGNALS

NONE = "-"


def calibrate_valves(context: Context) -> Outcome:
    """Measure the valve of every axis that swings and whose speed is on a bus."""
    deployment, bench = context.deployment, context.bench
    outcome = Outcome()
    results: dict[str, Calibration] = {}
    ramps: dict[str, Ramp] = {}
    left = []
    for name in swinging(deployment):
        speed = _speed(bench, deployment, name)
        if speed == NONE:
            left.append(name)
            continue
        ramp = ramps[name] = Ramp(RATE_PER_S, usual_top(deployment.config.axes[name].limits))
        drive = CalibrationDrive(deployment, name, speed_signal(deployment, name, speed), ramp)
        words = (
            f"{name} moves BY ITSELF for {ramp.duration_s:.0f} s, up to {100 * ramp.top:.0f} % of"
            f" its command: in positive direction, at most as far as in {ramp.travel_s:.1f} s at"
            " full deflection, and as far back. Bring it first to where it has that room. No other"
            " controller sends to its valve. Everybody away; hold the enable switch all the time,"
            " joystick in neutral: letting go ends it."
        )
        try:
            bench.calibrate(deployment, drive, words)
            results[name] = drive.result()
        except CalibrationError as error:
            outcome.problems.append(f"{name}: {error}; do it again")
    for name, result in results.items():
        top_pct = 100.0 * ramps[name].top
        outcome.sheet.print("\n".join(curve_lines(deployment, name, result, top_pct)))
        outcome.numbers[name] = {
            "opens_pct": [
                round(100.0 * one.opens, 1) for one in (result.negative, result.positive)
            ],
            "delay_pct": round(100.0 * result.positive.delay, 2),
        }
        limits = deployment.axes[name].config.limits.output_limits()
        outcome.figures[name] = partial(of_valve, name, limits, result, top_pct)
    if left:
        text = f"{', '.join(left)}: nothing on a bus shows the speed, so the valve is not measured"
        outcome.sheet.print(f"NOTE: {text}; put deadband_pct of its data sheet into the file")
    if left and not results:
        outcome.problems.append(
            "no valve can be measured; skip it, or name MESSAGE.SIGNAL of a speed"
        )
    if results:
        outcome.edit = partial(_write, results=results, simulated=bench.simulated)
    return outcome


def _speed(bench: Bench, deployment: Deployment, name: str) -> str:
    """Ask for MESSAGE.SIGNAL of the measured speed of an axis; ``NONE`` for none.

    The feedback of the file, else the simulated crane's signal where the DBC files have it, is
    proposed; a rehearsal takes it without asking.
    """
    default = SPEED_SIGNALS.get(deployment.coordinates.get(name, name), NONE)
    if isinstance(deployment.messages.find(default.partition(".")[0]), str):
        default = NONE
    if feedback := deployment.axes[name].config.feedback:
        default = f"{feedback.message}.{feedback.signal}"
    if bench.simulated:
        return default
    question = f"valve: {name}: MESSAGE.SIGNAL of its speed, {NONE} for none"
    return bench.person.answer(question, default)


def _write(deployment: Deployment, results: dict[str, Calibration], simulated: bool) -> None:
    for name, result in results.items():
        bus = deployment.config.buses[deployment.axes[name].config.valve.bus]
        origin = origin_of("calibrate", live=[] if simulated else [bus])
        write_curve(deployment, name, result, origin)


VALVE = Step(
    "valve",
    "Valves, calibrated",
    "a slow ramp of each of these axes measures its valve",
    calibrate_valves,
    writes="`limits.curve_*`",
    needs=("joysticks",),
    applies=swinging,
)


def examine_sensors(context: Context) -> Outcome:
    """Let each axis with a sensor be driven, and compare the sensor with the axis' model."""
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
    examine_sensors,
    writes="`sway_sensor`",
    needs=("swing", "valve"),
    applies=lambda deployment: any(axis.sway_sensor for axis in deployment.axes.values()),
)
