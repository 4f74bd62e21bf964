"""Slewing with the robust filter and radial compensation, on the nonlinear crane in lock-step."""

from pathlib import Path

import pytest

from canshaper.design.lockstep import drive
from canshaper.design.tuning.robust import least_residual
from canshaper.machine.binding import load_deployment
from canshaper.machine.deployment import Deployment
from canshaper_sim.operator import SCRIPTS
from canshaper_sim.recording import Recording

FILE = Path(__file__).resolve().parents[2] / "config" / "forwarder.yaml"
SLEW = "    filter: { kind: gff, a1: 0.708, a2: 0.12 }\n    limits: {"
FIXED = "radius_m: 3.0"
MEASURED = "radius: { bus: crane, message: TipPosition, signal: Radius, timeout_ms: 100 }"
# The stick is back after 3.6 s; the impulse response lasts 1.8 s, the valve a little more.
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
    text = FILE.read_text().replace("../dbc", str(FILE.parent.parent / "dbc"))
    changed = f"    filter: {{ kind: robust, tick_ms: 20, taps: [{taps}] }}\n"
    if radius is not None:
        changed += "    radial_compensation:\n"
        changed += f"      {{ axis: near_far, full_speed_rad_s: 0.5, {radius} }}\n"
    assert SLEW in text
    file = tmp_path / "machine.yaml"
    file.write_text(text.replace(SLEW, f"{changed}    limits: {{", 1))
    return load_deployment(file)


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
