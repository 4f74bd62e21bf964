"""A sway sensor damps what slewing makes the grapple swing along the boom."""

import math
from dataclasses import replace
from itertools import product
from pathlib import Path

import pytest

from canshaper.design.lockstep import Simulation
from canshaper.design.lockstep import drive as lock_step
from canshaper.machine.binding import load_deployment
from canshaper.machine.deployment import Deployment
from canshaper.shaping.states import Trust
from canshaper_sim.crane import CraneParameters
from canshaper_sim.grapple import Sway
from canshaper_sim.recording import Recording
from canshaper_sim.strokes import Script, Stroke
from canshaper_sim.sway_sensor import SwaySensor
from tests.rigs.files import machine_file
from tests.rigs.swing import last_swing

FILE = Path(__file__).resolve().parents[2] / "config" / "forwarder-sensor.yaml"


def watching(tmp_path: Path) -> Deployment:
    """The shipped deployment whose sensors are only watched."""
    return load_deployment(machine_file(tmp_path, FILE, ("use: damp", "use: watch")))


def drive_both(deployment: Deployment, strokes: tuple[Stroke, ...], length_pct: float) -> Recording:
    """A drive of 13 s, or 15, with a grapple that is so much longer."""
    crane = CraneParameters()
    crane = replace(crane, grapple=crane.grapple.longer(length_pct))
    end_s = 13.0 if strokes[-1].end_s < 9.0 else 15.0
    return lock_step(deployment, Script("both", strokes, end_s), parameters=crane)


def tilt_deg(deployment: Deployment, strokes: tuple[Stroke, ...], length_pct: float) -> float:
    """Largest tilt of the grapple in the last three seconds."""
    return last_swing(drive_both(deployment, strokes, length_pct))


@pytest.mark.slow
def test_a_slew_is_damped_in_its_plane(tmp_path: Path) -> None:
    reversal = (Stroke("slew", 0.5, 1.5, 1.0, 0.1), Stroke("slew", 2.0, 1.5, -1.0, 0.1))
    damped, watched = load_deployment(FILE), watching(tmp_path)
    for length_pct in (-15.0, 15.0):
        planes = [
            drive_both(one, reversal, length_pct).axes["slew"].sway_deg or []
            for one in (damped, watched)
        ]
        left = [max(map(abs, plane[300:])) for plane in planes]
        print(f"{length_pct:+.0f} %: {left[0]:.2f} degrees, only watched {left[1]:.2f}")
        assert left[0] < 0.8
        assert left[1] > 2.0


# Near-far proves its sensor; 3.7 s later slew, and for a reversal it turns at 8 s.
PROVED = (Stroke("near_far", 0.3, 0.8, 0.5), Stroke("near_far", 1.3, 0.8, -0.5))
SLEWS = {
    "stroke": (Stroke("slew", 6.5, 2.5, 1.0),),
    "reversal": (Stroke("slew", 6.5, 1.5, 1.0, 0.1), Stroke("slew", 8.0, 1.5, -1.0, 0.1)),
}


def along_boom_deg(
    deployment: Deployment, slew: tuple[Stroke, ...], length_pct: float, seed: int = 1
) -> float:
    """Swing along the boom that slewing leaves, where no one touches the joystick."""
    crane = CraneParameters()
    grapple = crane.grapple.longer(length_pct)
    sensor = replace(crane.sway_sensor, seed=seed)
    crane = replace(crane, grapple=grapple, sway_sensor=sensor)
    recording = lock_step(deployment, Script("slew", (*PROVED, *slew), 15.0), parameters=crane)
    return max(map(abs, (recording.axes["near_far"].sway_deg or [])[600:]))


@pytest.mark.slow
@pytest.mark.parametrize("slew", SLEWS)
def test_what_slewing_swings_along_the_boom_is_damped(slew: str, tmp_path: Path) -> None:
    damped, watched = load_deployment(FILE), watching(tmp_path)
    left = [along_boom_deg(one, SLEWS[slew], 15.0) for one in (damped, watched)]
    print(f"{left[0]:.2f} degrees, only watched {left[1]:.2f}")
    assert left[0] < 0.6
    assert left[1] > 1.0


@pytest.mark.study
@pytest.mark.slow
def test_twelve_seeds_of_slewing(tmp_path: Path) -> None:
    damped, watched, worst = load_deployment(FILE), watching(tmp_path), {}
    for length_pct in (0.0, -15.0, 15.0, -30.0, 30.0):
        worst[length_pct] = max(
            along_boom_deg(damped, slew, length_pct, seed)
            for slew in SLEWS.values()
            for seed in range(1, 13)
        )
        left = max(along_boom_deg(watched, slew, length_pct) for slew in SLEWS.values())
        print(f"{length_pct:+.0f} %: {worst[length_pct]:.2f} degrees, only watched {left:.2f}")
    assert worst[0.0] < 0.6
    assert max(worst[-15.0], worst[15.0]) < 0.8
    assert max(worst.values()) < 1.2


@pytest.mark.slow
@pytest.mark.parametrize("late_s", [-1.2, 0.0, 0.6])
def test_both_joysticks_at_once_are_better_with_a_wrong_length_and_as_good_with_the_right_one(
    tmp_path: Path, late_s: float
) -> None:
    """What the two-axis motion adds is no swing to damp."""
    slew = Stroke("slew", 0.5 - min(0.0, late_s), 3.0, 1.0)
    strokes = (slew, Stroke("near_far", 0.5 + max(0.0, late_s), 3.0, 1.0))
    damped, watched = load_deployment(FILE), watching(tmp_path)
    left = [tilt_deg(one, strokes, pct) for pct in (0.0, 15.0) for one in (damped, watched)]
    print(", ".join(f"{one:.2f}" for one in left))
    assert left[0] < left[1] + 0.15
    assert left[2] < 0.6 * left[3]


# The first drive of the day: near-far has not moved, its sensor is unproved, slew turns at 2 s.
COLD = (Stroke("slew", 0.5, 1.5, 1.0, 0.1), Stroke("slew", 2.0, 1.5, -1.0, 0.1))


@pytest.mark.slow
@pytest.mark.parametrize("length_pct", [0.0, 30.0])
@pytest.mark.parametrize("strokes", [COLD, (*PROVED, *SLEWS["reversal"])], ids=["cold", "proved"])
def test_it_leaves_no_more_than_its_filters_alone(
    strokes: tuple[Stroke, ...], length_pct: float, tmp_path: Path
) -> None:
    left = [
        tilt_deg(one, strokes, length_pct) for one in (load_deployment(FILE), watching(tmp_path))
    ]
    print(", ".join(f"{one:.2f}" for one in left))
    assert left[0] < left[1] + 0.05
    assert left[0] < (0.5 if length_pct == 0.0 else 4.0)


@pytest.mark.slow
@pytest.mark.parametrize("shown", ["along", "-along", "across", "-across"])
def test_slewing_proves_no_signal_that_is_swapped_or_reversed(
    shown: str, monkeypatch: pytest.MonkeyPatch
) -> None:
    swing, sign = SwaySensor.swing, -1.0 if shown.startswith("-") else 1.0

    def wired(sensor: SwaySensor, time_s: float, sway: Sway) -> None:
        across, along, across_rate, along_rate = sway
        if shown.endswith("across"):
            across, along, across_rate, along_rate = along, across, along_rate, across_rate
        swing(sensor, time_s, Sway(across, sign * along, across_rate, sign * along_rate))

    monkeypatch.setattr(SwaySensor, "swing", wired)
    deployment, trusted = load_deployment(FILE), list[bool]()
    for strokes in (COLD, (Stroke("slew", 0.5, 2.5, 1.0),), (Stroke("slew", 0.5, 2.5, -0.6),)):
        for across_deg, along_deg in product((0.0, 8.0), (-10.0, 0.0, 10.0)):
            sway = Sway(math.radians(across_deg), math.radians(along_deg))
            simulation = Simulation(deployment, Script("slew", strokes, 7.0), sway=sway)
            sensed = simulation.controller.axes["near_far"].axis.sensed
            assert sensed
            trusted.append(any(sensed.state is Trust.TRUSTED for _ in simulation.ticks()))
    print(f"{shown}: trusted in {sum(trusted)} of {len(trusted)} drives")
    assert all(trusted) if shown == "along" else not any(trusted)


# Near-far is pressed on the way, or not; then slew.
PRESSED = (Stroke("near_far", 0.5, 0.8, 0.5), Stroke("slew", 2.0, 2.5, 1.0))


@pytest.mark.slow
@pytest.mark.parametrize(
    ("strokes", "most_deg"), [((Stroke("slew", 0.5, 2.5, 1.0),), 0.3), (PRESSED, 0.3)]
)
def test_ten_degrees_along_the_boom_at_the_start_of_a_slew(
    strokes: tuple[Stroke, ...], most_deg: float, tmp_path: Path
) -> None:
    left = []
    for deployment in (load_deployment(FILE), watching(tmp_path)):
        script, swing = Script("slew", strokes, 15.0), Sway(theta6_rad=math.radians(10.0))
        left.append(last_swing(lock_step(deployment, script, sway=swing)))
    print(", ".join(f"{one:.2f}" for one in left))
    assert left[0] < most_deg < left[1]
