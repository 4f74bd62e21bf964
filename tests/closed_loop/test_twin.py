"""Both joysticks at once on the independent crane: the figures that the documentation states.

``pytest -s tests/closed_loop/test_twin.py`` prints them: mean and largest swing that is left, and
the peak, degrees of total tilt.
"""

import math
import random
from collections.abc import Callable
from pathlib import Path
from typing import Any

import pytest
import yaml

from canshaper.config.limits import Sway
from canshaper.machine.binding import load_deployment
from canshaper.machine.deployment import Deployment
from canshaper.shaping.shapers.fir import zv_taps
from canshaper_sim.crane import Crane
from canshaper_sim.parameters import changed_parameters
from canshaper_sim.strokes import Script, Stroke
from tests.closed_loop.mujoco_twin import Twin, TwinCrane, drive, figures
from tests.rigs.files import ROOT, text_of

ROBUST = "forwarder-robust.yaml"
Change = Callable[[dict[str, Any]], object]


def machine(tmp_path: Path, change: Change) -> Deployment:
    """The recommended deployment with both axes' sections of the file changed."""
    data = yaml.safe_load(text_of(ROBUST))
    for name in ("slew", "near_far"):
        change(data["axes"][name])
    file = tmp_path / "machine.yaml"
    file.write_text(yaml.safe_dump(data), encoding="utf-8")
    return load_deployment(file)


def shipped() -> Deployment:
    return load_deployment(ROOT / "config" / ROBUST)


def both(late_s: float, sign: int, near_far_s: float = 3.0) -> Script:
    """A slew of 3 s, and a stroke of near-far that begins so much later: out, or a little in."""
    slew_begin_s, begin_s = 0.5 - min(0.0, late_s), 0.5 + max(0.0, late_s)
    out = Stroke("near_far", begin_s, near_far_s, 1.0)
    little_in = Stroke("near_far", begin_s, 2.0, -0.4)
    strokes = (Stroke("slew", slew_begin_s, 3.0, 1.0), out if sign > 0 else little_in)
    return Script("both", strokes, 13.0)


LATE_S = (-2.0, -1.2, -0.6, 0.0, 0.6, 1.2, 2.0)
TIMINGS = [both(late_s, sign) for late_s in LATE_S for sign in (1, -1)]
FAR_OUT = [both(late_s, sign, 2.0) for late_s in LATE_S for sign in (1, -1)]


def operator(seed: int) -> Script:
    """Twenty seconds of strokes on both axes, near-far between 2 and 6 m, with pauses or none."""
    hand = random.Random(seed)
    strokes: list[Stroke] = []
    for axis in ("slew", "near_far"):
        now_s, radius_m = 0.5, 3.0
        while True:
            duration_s = hand.uniform(0.3, 2.5)
            level = hand.choice((-1.0, 1.0)) * hand.uniform(0.3, 1.0)
            if axis == "near_far":
                if not 2.0 < radius_m + duration_s * level < 6.0:
                    level = -level
                radius_m += duration_s * level
            if now_s + duration_s > 20.0:
                break
            strokes.append(Stroke(axis, now_s, duration_s, level))
            pause_s = hand.uniform(0.0, 0.5) if hand.random() < 0.6 else hand.uniform(0.5, 2.0)
            now_s += duration_s + 0.13 + pause_s
    return Script("random", tuple(strokes), 26.0)


OPERATORS = [operator(seed) for seed in range(20)]


def pulse(axis: str) -> Script:
    return Script("pulse", (Stroke(axis, 0.5, 3.0, 1.0),), 12.0)


def reversal(axis: str) -> Script:
    strokes = (Stroke(axis, 0.5, 2.5, 1.0), Stroke(axis, 3.0, 2.5, -1.0))
    return Script("reversal", strokes, 14.0)


def judged(
    name: str, residuals: tuple[float, float, float], mean: float, worst: float, peak: float = 90.0
) -> None:
    in_the_mean, at_worst, highest = residuals
    print(f"{name}: {in_the_mean:.2f} in the mean, {at_worst:.2f} at worst, peak {highest:.1f}")
    assert in_the_mean <= mean
    assert at_worst <= worst
    assert highest <= peak


def test_the_twin_swings_as_a_pendulum_does() -> None:
    """A tip that goes from rest to 1 m/s within 0.2 s, below it a pendulum of 1.2 m."""
    driven = drive(shipped(), pulse("near_far"), bypass=True)
    assert driven.peak_deg == pytest.approx(20.0, abs=3.0)
    assert driven.residual_deg > 5.0
    assert drive(shipped(), Script("none", (), 3.0)).peak_deg < 1e-6


@pytest.mark.parametrize(("axis", "most"), [("slew", 0.10), ("near_far", 0.05)])
def test_a_pulse_of_one_axis(axis: str, most: float) -> None:
    judged(f"pulse {axis}", figures(shipped(), [pulse(axis)]), most, most)


@pytest.mark.parametrize(("axis", "most", "peak"), [("slew", 0.3, 20.5), ("near_far", 0.1, 14.0)])
def test_a_reversal(axis: str, most: float, peak: float) -> None:
    judged(f"reversal {axis}", figures(shipped(), [reversal(axis)]), most, most, peak)


@pytest.mark.slow
def test_both_axes_at_fourteen_timings() -> None:
    judged("14 timings", figures(shipped(), TIMINGS), 0.4, 0.8, 17.0)


@pytest.mark.slow
@pytest.mark.parametrize(("kind", "mean"), [("G_FF", 1.5), ("limit-aware ZV", 0.8)])
def test_other_filters_at_fourteen_timings(tmp_path: Path, kind: str, mean: float) -> None:
    def other(section: dict[str, Any]) -> None:
        taps = zv_taps(Sway(**section["sway"]).mode(), 0.02)
        section["filter"] = {
            "G_FF": {"kind": "gff", "a1": 0.708, "a2": 0.12},
            "limit-aware ZV": {"kind": "robust", "tick_ms": 20, "taps": taps},
        }[kind]

    judged(f"14 timings, {kind}", figures(machine(tmp_path, other), TIMINGS), mean, 90.0)


@pytest.mark.slow
def test_far_out() -> None:
    residuals = figures(shipped(), FAR_OUT, TwinCrane(radius_m=6.8))
    judged("6.8 to 9 m", residuals, 1.8, 1.8)


@pytest.mark.slow
def test_twenty_operators(tmp_path: Path) -> None:
    def stops(section: dict[str, Any]) -> None:
        section["limits"]["reversal"] = "stop"

    stopped = figures(machine(tmp_path, stops), OPERATORS)
    judged("20 operators, reversal: stop", stopped, 1.0, 4.0)
    judged("20 operators", figures(shipped(), OPERATORS), 0.5, 1.5, min(35.0, stopped[2]))


@pytest.mark.slow
@pytest.mark.parametrize("length", [0.85, 1.15])
def test_a_length_that_is_wrong(length: float) -> None:
    residuals = figures(shipped(), TIMINGS, TwinCrane(length=length))
    judged(f"length x {length}", residuals, 3.0, 90.0)


@pytest.mark.slow
@pytest.mark.parametrize("lag_s", [(0.2, 0.1), (0.1, 0.2)], ids=["slew", "near_far"])
def test_a_valve_that_is_slow(lag_s: tuple[float, float]) -> None:
    residuals = figures(shipped(), TIMINGS, TwinCrane(lag_s=lag_s))
    judged(f"valves of {lag_s} s", residuals, 1.5, 1.5)


@pytest.mark.slow
def test_a_radius_that_is_lost_in_motion() -> None:
    residuals = figures(shipped(), TIMINGS, TwinCrane(radius_until_s=2.0))
    judged("radius lost after 2 s", residuals, 0.6, 0.6)


TICK_S = 0.02
ENDS_M = (1.8, 5.0)
STOPPED = ("radius_max_m=5",)
TILTED = ("carrier.pitch_deg=10", "carrier.roll_deg=-6")
TYRES = (1.2, 0.1, 4e4)
ROCKING = (
    *("carrier.rock_hz=1.2", "carrier.rock_damping=0.1", "carrier.boom_kg=0"),
    *("carrier.roll_kg_m2=4e4", "carrier.pitch_kg_m2=4e4"),
)
DRAG_M2 = 2.0
WIND = ("wind.speed_m_s=12", f"wind.drag_m2={DRAG_M2}")
WIND_N = 0.5 * 1.225 * DRAG_M2 * 12.0**2
LOG = ("log.grip_s=0", "log.mass_kg=300", "log.below_m=0", "log.length_m=4", "rotator.start_deg=30")


def commands(tick: int) -> tuple[float, float]:
    """Slew and near-far at once, there and back, with releases."""
    return (0.0, 0.6, 0.6, -0.3, 0.0)[tick // 60 % 5], (0.7, 0.7, -0.4, 0.0)[tick // 75 % 4]


@pytest.mark.parametrize(
    ("twin", "changes", "part", "apart_deg"),
    [
        (TwinCrane(), (), 1.0, 0.2),
        (TwinCrane(pump=0.8), ("pump_flow=0.8",), 1.0, 0.2),
        (TwinCrane(ends_m=ENDS_M), STOPPED, 1.0, 0.2),
        (TwinCrane(ends_m=ENDS_M, cushion_s=0.5), (*STOPPED, "ends.cushion_s=0.5"), 1.0, 0.2),
        (TwinCrane(slope_deg=(10.0, -6.0)), TILTED, 1.0, 0.2),
        (TwinCrane(tyres=TYRES), ROCKING, 1.0, 0.8),
        (TwinCrane(wind_n=WIND_N), WIND, 1.0, 0.2),
        (TwinCrane(log=(300.0, 4.0, 30.0)), LOG, 0.3, 0.2),  # small angles
    ],
    ids=["plain", "pump", "stop", "cushion", "slope", "tyres", "wind", "log"],
)
def test_both_swing_alike(
    twin: TwinCrane, changes: tuple[str, ...], part: float, apart_deg: float
) -> None:
    crane = Crane(changed_parameters(["radius_max_m=12", *changes]))
    judge, apart, swing = Twin(twin), 0.0, 0.0
    carrier = crane.around.carrier
    judge.begin(crane.rest_rad, (carrier.roll[0], carrier.pitch[0]) if carrier else (0.0, 0.0))
    for tick in range(500):
        slew, near_far = (part * one for one in commands(tick))
        judge.valves["slew"].command, judge.valves["near_far"].command = slew, near_far
        judge.step()
        crane.step(TICK_S, {"slew": slew, "near_far": near_far})
        pairs = zip(judge.sway_rad, crane.state[7:9], strict=True)
        apart = max(apart, *(abs(a - b) for a, b in pairs))
        swing = max(swing, *map(abs, judge.sway_rad))
        assert crane.state.radius_m == pytest.approx(judge.radius_m, abs=5e-3)
    print(f"{math.degrees(apart):.3f} degrees apart, of {math.degrees(swing):.1f}")
    assert math.degrees(swing) > 7.0
    assert math.degrees(apart) < apart_deg
