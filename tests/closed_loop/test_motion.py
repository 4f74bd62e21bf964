"""Both axes at once with the robust filter, on the nonlinear crane in lock-step."""

import dataclasses
import math
import random
import re
import statistics
from pathlib import Path

import pytest

from canshaper.design.lockstep import Simulation, drive
from canshaper.design.tuning.robust import least_residual
from canshaper.machine.binding import load_deployment
from canshaper.machine.deployment import Deployment
from canshaper.report.metrics import axis_metrics
from canshaper.report.stroke_metrics import crane_metrics
from canshaper_sim.operator import SCRIPTS
from canshaper_sim.recording import Recording
from canshaper_sim.strokes import Script, Stroke
from tests.cli.invocation import invoke
from tests.closed_loop.test_twin import TIMINGS
from tests.rigs.files import machine_file
from tests.rigs.swing import crane_of

FILE = Path(__file__).resolve().parents[2] / "config" / "forwarder.yaml"
SLEW = "    filter: { kind: gff, a1: 0.708, a2: 0.12 }\n    limits: {"
FIXED = "radius_m: 3.0"
MEASURED = "radius: { bus: crane, message: TipPosition, signal: Radius, timeout_ms: 100 }"
# The joystick is back after 3.6 s; the impulse response lasts 1.8 s, the valve a little more.
SETTLED_S = 6.0


@pytest.fixture(scope="module")
def taps() -> str:
    sway = load_deployment(FILE).axes["slew"].config.sway
    assert sway is not None
    shaper = least_residual(
        sway.mode(), tick_s=0.02, duration_s=1.8, range_pct=15.0, rate_per_s=5.0
    )
    return ", ".join(f"{tap:.8f}" for tap in shaper.taps)


def deployment(tmp_path: Path, taps: str, radius: str | None) -> Deployment:
    robust = f"    filter: {{ kind: robust, tick_ms: 20, taps: [{taps}] }}\n    limits: {{"
    more = ""
    if radius is not None:
        more = f"motion: {{ crane: {{ slew: slew, near_far: near_far, {radius} }} }}\n"
    changes = (SLEW, robust), (": 4.7 }", ": 5.3 }")
    return load_deployment(machine_file(tmp_path, FILE, *changes, more=more))


def residuals_deg(recording: Recording) -> tuple[float, float]:
    """Largest swing across and along the boom after the crane has settled."""
    late = [i for i, t in enumerate(recording.t_s) if t >= SETTLED_S]
    assert len(late) > 100
    slew, near_far = recording.axes["slew"].sway_deg, recording.axes["near_far"].sway_deg
    assert slew is not None
    assert near_far is not None
    return max(abs(slew[i]) for i in late), max(abs(near_far[i]) for i in late)


@pytest.mark.parametrize("radius", [FIXED, MEASURED], ids=["fixed", "measured"])
def test_a_slew_leaves_no_swing_in_either_plane(tmp_path: Path, taps: str, radius: str) -> None:
    recording = drive(deployment(tmp_path, taps, radius), SCRIPTS["pulse-slew"])
    across, along = residuals_deg(recording)
    print(f"residual: {across:.3f} degrees across the boom, {along:.3f} along it")
    assert across < 0.15
    assert along < 0.15
    near_far = recording.axes["near_far"]
    assert min(near_far.sent) < -0.1  # in, and out again by as much
    assert sum(near_far.sent) * 0.02 == pytest.approx(0.0, abs=0.01)
    assert near_far.sent[-1] == 0.0


def test_without_compensation_the_plane_of_the_boom_keeps_its_swing(
    tmp_path: Path, taps: str
) -> None:
    recording = drive(deployment(tmp_path, taps, None), SCRIPTS["pulse-slew"])
    across, along = residuals_deg(recording)
    print(f"residual: {across:.3f} degrees across the boom, {along:.3f} along it")
    assert along > 1.5
    assert across > 0.5  # the swing along the boom turns with it, and comes over


# -- both joysticks at once, with the recommended deployment ---------------------------------------


def tilt_deg(recording: Recording) -> list[float]:
    slew, near_far = recording.axes["slew"].sway_deg, recording.axes["near_far"].sway_deg
    assert slew is not None
    assert near_far is not None
    return [math.hypot(a, b) for a, b in zip(slew, near_far, strict=True)]


@pytest.mark.slow
def test_both_joysticks_at_once_leave_little_swing_whatever_the_timing() -> None:
    deployment = load_deployment(FILE.with_name("forwarder-robust.yaml"))
    apart = dataclasses.replace(deployment, motions={})
    residuals, alone, peaks = [], [], []
    for script in TIMINGS:
        tilt = tilt_deg(drive(deployment, script))
        residuals.append(max(tilt[-150:]))
        peaks.append(max(tilt))
        alone.append(max(tilt_deg(drive(apart, script))[-150:]))
    mean, without = statistics.mean(residuals), statistics.mean(alone)
    print(f"{mean:.2f} degrees in the mean, {max(residuals):.2f} at worst, peak {max(peaks):.1f};")
    print(f"each axis by itself: {without:.2f}, {max(alone):.2f}")
    assert mean < 0.3
    assert max(residuals) < 0.8
    assert max(peaks) < 17.5
    assert without > 2.0


@pytest.mark.parametrize(
    ("axis", "residual_deg", "peak_deg"), [("slew", 0.3, 20.5), ("near_far", 0.1, 14.0)]
)
def test_a_reversal_brakes_along_the_filter(
    axis: str, residual_deg: float, peak_deg: float
) -> None:
    deployment = load_deployment(FILE.with_name("forwarder-robust.yaml"))
    strokes = (Stroke(axis, 0.5, 2.5, 1.0), Stroke(axis, 3.12, 2.5, -1.0))
    tilt = tilt_deg(drive(deployment, Script("reversal", strokes, 12.0)))
    print(f"{max(tilt[-150:]):.2f} degrees left, peak {max(tilt):.1f}")
    assert max(tilt[-150:]) < residual_deg
    assert max(tilt) < peak_deg


# The demo with each filter, as one motion and apart: degrees left, run-on in m, dip of an axis.
ALIKE = {
    ("forwarder-gff", True): (1.3, 1.78, 0.08),
    ("forwarder-gff", False): (5.0, 1.86, 0.06),
    ("forwarder-robust", True): (0.9, 1.84, 0.02),
    ("forwarder-robust", False): (5.8, 1.93, 0.0),
}


@pytest.mark.slow
@pytest.mark.parametrize(("name", "motion"), ALIKE)
def test_filters_are_compared_with_the_motion_on_both_or_off_both(name: str, motion: bool) -> None:
    deployment = load_deployment(FILE.with_name(f"{name}.yaml"))
    if not motion:
        deployment = dataclasses.replace(deployment, motions={})
    recording = drive(deployment, SCRIPTS["demo"])
    crane = crane_metrics(recording, crane_of(recording))
    dips = [axis_metrics(recording, axis).dip or 0.0 for axis in ("slew", "near_far")]
    left, run_on_m, dip = ALIKE[name, motion]
    assert crane.residual_deg == pytest.approx(left, abs=0.05)
    assert crane.run_on_m == pytest.approx(run_on_m, abs=0.0051)
    assert max(dips) == pytest.approx(dip, abs=0.005)


@pytest.mark.slow
def test_a_motion_moves_no_axis_back_with_its_joystick_in_neutral() -> None:
    """The added part does not outlive the run-on of a short press."""
    deployment = load_deployment(FILE.with_name("forwarder-sensor.yaml"))
    back = 0.0
    for tenths in range(3, 13):
        press = Script("press", (Stroke("slew", 0.5, tenths / 10, 1.0),), 7.0)
        back = min(back, *drive(deployment, press).axes["slew"].sent)
    assert back == 0.0


# -- how far near-far is moved without its joystick ------------------------------------------------


def restless_slewing(seed: int) -> Script:
    """A stroke of near-far, which proves a sensor; then slew to and fro in any rhythm."""
    chance = random.Random(seed)
    strokes = [Stroke("near_far", 0.5, 1.5, 0.6)]
    start_s = 6.0
    while start_s < 25.0:
        length_s = chance.choice([0.3, 0.7, 1.2, 2.0, 4.0])
        level = chance.choice([1.0, -1.0]) * chance.choice([0.3, 0.6, 1.0])
        strokes.append(Stroke("slew", start_s, length_s, level))
        start_s += length_s + chance.choice([0.0, 0.0, 0.3, 1.0, 1.9, 3.0])
    return Script("restless", tuple(strokes), 30.0)


@pytest.mark.slow
@pytest.mark.parametrize("path_m", [0.02, 0.05])
@pytest.mark.parametrize("name", ["forwarder-sensor", "forwarder-robust"])
def test_near_far_is_moved_no_farther_than_check_says(
    tmp_path: Path, name: str, path_m: float
) -> None:
    """The bound is small here, so that it holds the tip back all the time."""
    own = "    near_far: near_far\n"
    file = machine_file(tmp_path, name, (own, f"{own}    max_path_m: {path_m}\n"))
    printed = invoke("check", file).stdout
    [bound_m] = [float(m) for m in re.findall("by up to .* m/s, (.*?) m in or out", printed)]
    farthest_m = 0.0
    for seed in range(3):
        simulation = Simulation(load_deployment(file), restless_slewing(seed))
        near_far = simulation.controller.axes["near_far"].axis
        way_m, moves = 0.0, []
        for time_ms in simulation.ticks():
            if time_ms > 5500:  # its own stroke is over
                way_m += near_far.output.setpoint * 0.02  # at 1 m/s full speed
                farthest_m = max(farthest_m, abs(way_m))
                moves.append(
                    near_far.output.steps
                    or simulation.controller.axes["slew"].axis.output.commanded
                )
            if not any(moves[-1:]):
                way_m = 0.0
    print(f"{farthest_m:.4f} m of {bound_m:g} m")
    step_m = 0.02 / 125 / 0.95
    assert 0.9 * bound_m < farthest_m < bound_m + 8 * step_m
