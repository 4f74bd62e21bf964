"""Valve curve of each axis, measured."""

from functools import partial

from canshaper.commissioning.calibration.drive import CalibrationDrive
from canshaper.commissioning.calibration.fit import Calibration
from canshaper.commissioning.calibration.ramp import RATE_PER_S, Ramp, usual_top
from canshaper.commissioning.calibration.write import (
    curve_lines,
    speed_signal,
    write_curve,
)
from canshaper.commissioning.plots import of_valve
from canshaper.commissioning.procedure.bench import Bench
from canshaper.commissioning.procedure.state import Context, Outcome, Step
from canshaper.commissioning.procedure.steps.swing import swinging
from canshaper.errors import CalibrationError
from canshaper.machine.deployment import Deployment
from canshaper_sim.axes import SPEED_SIGNALS

NONE = "-"


def run(context: Context) -> Outcome:
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
    """MESSAGE.SIGNAL of the speed of an axis; a dash where there is none."""
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
        write_curve(deployment, name, result, simulated=simulated or bus.is_virtual)


VALVE = Step(
    "valve",
    "Valves, calibrated",
    "a slow ramp of each of these axes measures its valve",
    run,
    writes="`limits.curve_*`",
    needs=("joysticks",),
    applies=swinging,
)
