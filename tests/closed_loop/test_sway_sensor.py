"""Near-far with a sway sensor on the nonlinear crane with a real valve: the figures, and faults."""

import math
from collections.abc import Callable
from dataclasses import replace
from itertools import accumulate
from pathlib import Path

import pytest

from canshaper.design.lockstep import drive as lock_step
from canshaper.design.tuning.robust import least_residual
from canshaper.machine.binding import load_deployment
from canshaper.machine.deployment import Deployment
from canshaper.shaping.sway_sensor import Measured
from canshaper.shaping.trust import Trust
from canshaper_sim.crane import CraneParameters
from canshaper_sim.recording import Recording
from canshaper_sim.strokes import Script, Stroke
from canshaper_sim.sway_sensor import SwaySensorParameters
from tests.rigs.sensed import LENGTH_M, MODE, SCRIPTS, TICK_S, Setup

ENCODER, GYRO = Setup(), Setup(measured=Measured.RATE)
KINDS = pytest.mark.parametrize("sensor", [ENCODER, GYRO], ids=["encoder", "gyro"])
PLAIN = Setup(measured=None)


def residuals(setup: Setup, errors_pct: tuple[int, ...]) -> dict[tuple[str, int], float]:
    return {
        (name, error): replace(setup, length_m=LENGTH_M * (1.0 + error / 100.0))
        .drive(name)
        .residual_deg
        for name in SCRIPTS
        for error in errors_pct
    }


@pytest.mark.parametrize(
    ("setup", "within_15_deg", "within_30_deg"),
    [
        (ENCODER, 0.6, 1.2),
        (GYRO, 0.6, 1.2),
        (replace(ENCODER, every=2), 0.7, 1.4),
        (replace(ENCODER, every=5), 0.7, 1.6),
        (replace(GYRO, every=5), 0.6, 1.3),
        (
            replace(ENCODER, delay_s=0.08, sensor=SwaySensorParameters(delay_s=0.08)),
            0.7,
            1.4,
        ),
    ],
    ids=["encoder", "gyro", "25 Hz", "10 Hz", "gyro 10 Hz", "80 ms late"],
)
def test_a_wrong_length_leaves_a_sixth_of_the_swing(
    setup: Setup, within_15_deg: float, within_30_deg: float
) -> None:
    small, large = residuals(setup, (0, -15, 15)), residuals(setup, (-30, 30))
    print(f"15 %: {max(small.values()):.2f}, 30 %: {max(large.values()):.2f} degrees")
    assert max(small.values()) < within_15_deg
    assert max(large.values()) < within_30_deg
    without = residuals(PLAIN, (-30, 30))
    assert max(without.values()) > 6.0


@pytest.mark.study
@pytest.mark.long
@pytest.mark.parametrize(
    ("setup", "within_15_deg", "within_30_deg", "at_start_deg"),
    [(ENCODER, 0.6, 1.5, 0.4), (GYRO, 0.65, 1.6, 0.4), (replace(ENCODER, every=5), 0.8, 1.8, 0.5)],
    ids=["encoder", "gyro", "10 Hz"],
)
def test_twelve_seeds_of_noise(
    setup: Setup, within_15_deg: float, within_30_deg: float, at_start_deg: float
) -> None:
    worst = [0.0, 0.0, 0.0]
    for seed in range(1, 13):
        seeded = replace(setup, sensor=SwaySensorParameters(seed=seed))
        left = (
            max(residuals(seeded, (0, -15, 15)).values()),
            max(residuals(seeded, (-30, 30)).values()),
            replace(seeded, swing_deg=10.0).drive("pulse").residual_deg,
        )
        worst = [max(pair) for pair in zip(worst, left, strict=True)]
    print("15 %: {:.2f}, 30 %: {:.2f}, 10 degrees at the start: {:.2f}".format(*worst))
    assert worst[0] < within_15_deg
    assert worst[1] < within_30_deg
    assert worst[2] < at_start_deg


@KINDS
def test_the_quickest_filter_stops_as_quickly_as_without(sensor: Setup) -> None:
    drive = sensor.drive("pulse")
    print(f"stop {drive.stop_s:.2f} s, {drive.residual_deg:.2f} degrees left")
    assert drive.stop_s < 1.35
    assert drive.residual_deg < 0.2
    assert drive.states == [Trust.UNPROVED, Trust.TRUSTED]


def test_a_calm_filter_stays_calm() -> None:
    shaper = least_residual(MODE, tick_s=TICK_S, duration_s=1.8, range_pct=15.0, rate_per_s=5.0)
    robust = replace(ENCODER, taps=list(shaper.taps))
    assert max(residuals(robust, (-30, 30)).values()) < 1.1
    assert max(map(abs, robust.drive("pulse").swing_deg)) < 4.9


def test_swing_that_was_there_is_damped() -> None:
    assert replace(PLAIN, swing_deg=10.0).drive("pulse").residual_deg > 3.5
    assert replace(ENCODER, swing_deg=10.0).drive("pulse").residual_deg < 0.4
    assert replace(GYRO, swing_deg=10.0).drive("pulse").residual_deg < 0.4


def test_another_load_is_damped() -> None:
    assert replace(ENCODER, load=3.0).drive("reversal").residual_deg < 0.8
    assert replace(ENCODER, length_m=1.6).drive("pulse").residual_deg < 1.4


@pytest.mark.parametrize("lag_s", [0.05, 0.15])
def test_the_lag_of_the_valve_may_be_wrong(lag_s: float) -> None:
    assert max(residuals(replace(ENCODER, lag_s=lag_s), (-30, 0, 30)).values()) < 1.5


# Lag of the real valve, where the observer has 0.1 s: most that is left with the right length, and
# with one that is 15 % wrong.
LAGS = {0.05: (0.45, 0.95), 0.075: (0.25, 0.7), 0.1: (0.2, 0.6), 0.125: (0.55, 0.95)}
LAGS |= {0.15: (1.05, 1.4), 0.2: (1.9, 2.4)}


@pytest.mark.study
@pytest.mark.long
@pytest.mark.parametrize("lag_s", LAGS)
def test_what_a_wrong_lag_costs_by_length(lag_s: float) -> None:
    """With the right length a valve 25 ms slower is worse than no sensor: docs/sensor.md."""
    right, wrong = LAGS[lag_s]
    row = []
    for errors, bound in (((0,), right), ((-15, 15), wrong)):
        left = max(residuals(replace(ENCODER, lag_s=lag_s), errors).values())
        without = max(residuals(replace(PLAIN, lag_s=lag_s), errors).values())
        assert left < bound
        row.append(f"{left:.1f} (no sensor {without:.1f})")
        if errors == (0,):
            assert (left > without) == (lag_s not in (0.075, 0.1))
    print(f"valve {1000 * lag_s:.0f} ms: right length {row[0]}, 15 % wrong {row[1]}")


@pytest.mark.study
@pytest.mark.long
@KINDS
@pytest.mark.parametrize("lag_s", [0.05, 0.15])
def test_what_a_wrong_lag_and_a_wrong_length_cost_together(sensor: Setup, lag_s: float) -> None:
    """Most degrees left, and how far the command falls while the joystick is held."""
    worst, dip = 0.0, 0.0
    for seed in range(1, 13):
        for length_m in (0.84, 1.56):
            noisy = SwaySensorParameters(seed=seed)
            setup = replace(sensor, lag_s=lag_s, length_m=length_m, sensor=noisy)
            worst = max(worst, *(setup.drive(name).residual_deg for name in SCRIPTS))
            pulse = setup.drive("pulse")
            pairs = zip(pulse.time_s, pulse.sent, strict=True)
            held = [v for t, v in pairs if t < pulse.script.strokes[0].end_s - 0.1]
            dip = max(dip, *(top - v for top, v in zip(accumulate(held, max), held, strict=True)))
    print(f"{worst:.2f} degrees, command falls by {100.0 * dip:.0f} %")
    assert worst < (5.0 if sensor is GYRO else 1.8)
    assert dip < 0.2


@KINDS
@pytest.mark.parametrize("length_m", [0.84, LENGTH_M, 1.56])
@pytest.mark.parametrize("swing_deg", [0.0, 10.0])
def test_of_the_wrong_sign_it_is_never_trusted_and_nothing_changes(
    sensor: Setup, length_m: float, swing_deg: float
) -> None:
    wrong = replace(sensor, sensor=SwaySensorParameters(gain=-1.0), length_m=length_m)
    for name in SCRIPTS:
        drive = replace(wrong, swing_deg=swing_deg).drive(name)
        plain = replace(PLAIN, length_m=length_m, swing_deg=swing_deg).drive(name)
        assert drive.sent == plain.sent
        assert Trust.TRUSTED not in drive.states


@KINDS
def test_watched_only_it_changes_nothing(sensor: Setup) -> None:
    watched = replace(sensor, damps=False, length_m=1.56).drive("reversal")
    assert watched.trust[-1] is Trust.TRUSTED
    assert watched.sent == replace(PLAIN, length_m=1.56).drive("reversal").sent


FAULTS: dict[str, Callable[[float], SwaySensorParameters]] = {
    "lost": lambda s: SwaySensorParameters(lost_s=s),
    "stuck": lambda s: SwaySensorParameters(stuck_s=s),
    "reversed": lambda s: SwaySensorParameters(reversed_s=s),
    "jump": lambda s: SwaySensorParameters(jump_s=s, jump_deg=5.0),
    "offset": lambda s: SwaySensorParameters(jump_s=s, jump_deg=2.0),
}


def faults(sensor: Setup, fault: str, times_s: list[float], seeds: int = 1) -> tuple[float, float]:
    """Most that a fault leaves beyond no sensor in the same drive, and beyond the worst of all.

    Each instant has one of so many seeds of noise, in turn.
    """
    beyond, worst, open_worst = 0.0, 0.0, 0.0
    for name in ("pulse", "reversal", "early release"):
        for length_m in (0.84, LENGTH_M, 1.56):
            plain = replace(PLAIN, length_m=length_m).drive(name).residual_deg
            open_worst = max(open_worst, plain)
            for count, time_s in enumerate(times_s):
                noisy = replace(FAULTS[fault](time_s), seed=1 + count % seeds)
                setup = replace(sensor, sensor=noisy, length_m=length_m)
                left = setup.drive(name).residual_deg
                beyond, worst = max(beyond, left - plain), max(worst, left)
    return beyond, worst - open_worst


@KINDS
@pytest.mark.parametrize("fault", FAULTS)
def test_a_fault_leaves_little_more_than_no_sensor(sensor: Setup, fault: str) -> None:
    beyond, worst = faults(sensor, fault, [1.15, 2.3, 3.4])
    print(f"{beyond:.2f} degrees beyond its case, {worst:.2f} beyond the worst of all")
    assert beyond < 3.0
    assert worst < 0.3


@pytest.mark.study
@pytest.mark.long
@KINDS
@pytest.mark.parametrize("fault", FAULTS)
def test_a_fault_at_any_instant(sensor: Setup, fault: str) -> None:
    beyond, worst = faults(sensor, fault, [0.5 + 0.04 * k for k in range(200)], seeds=12)
    print(f"{beyond:.2f} degrees beyond its case, {worst:.2f} beyond the worst of all")
    assert beyond < 3.0
    assert worst < 0.3


# -- long logs: a double pendulum ------------------------------------------------------------------


def beyond_no_sensor(
    measured: Measured, seconds: tuple[float, ...], share: float | None
) -> tuple[float, float]:
    """Most that is left beyond no sensor, degrees, and the path of what is sent against that.

    Args:
        measured: by the sensor on the log.
        seconds: natural frequencies of the second swing, rad/s.
        share: of its period in the file; None where the file has none.
    """
    path = 0.0
    left: list[tuple[float, float]] = []
    for second in seconds:
        for error in (0.85, 1.0, 1.15):
            log = MODE.omega_rad_s * error, second
            second_s = 2.0 * math.pi / second * share if share else None
            for name in SCRIPTS:
                plain = replace(PLAIN, long_log=log).drive(name)
                setup = Setup(measured=measured, long_log=log, second_s=second_s)
                drive = setup.drive(name)
                left.append((plain.residual_deg, drive.residual_deg))
                path = max(path, drive.path / plain.path)
    beyond = max(new - old for old, new in left)
    print(f"{beyond:.2f} degrees beyond no sensor, path {path:.2f}, mean left without and with:")
    print(*(f"{sum(column) / len(left):.2f}" for column in zip(*left, strict=True)))
    return beyond, path


@pytest.mark.parametrize("measured", Measured)
def test_a_long_log_whose_second_swing_is_known(measured: Measured) -> None:
    beyond, path = beyond_no_sensor(measured, (8.0,), 1.0)
    assert beyond < 0.35
    assert path < 1.5
    beyond, path = beyond_no_sensor(measured, (8.0,), None)
    assert beyond > 1.0
    assert path > 1.7


@pytest.mark.study
@pytest.mark.long
@pytest.mark.parametrize("measured", Measured)
@pytest.mark.parametrize("share", [None, 0.8, 1.0, 1.2])
def test_every_long_log(measured: Measured, share: float | None) -> None:
    beyond, path = beyond_no_sensor(measured, (8.0, 10.0, 12.0), share)
    assert beyond < (0.9 if share else 4.1)
    assert path < (1.6 if share else 2.5)


@pytest.mark.study
@pytest.mark.long
@KINDS
def test_what_a_second_swing_that_is_not_there_costs(sensor: Setup) -> None:
    two_modes = replace(sensor, second_s=0.63)
    small, large = residuals(two_modes, (0, -15, 15)), residuals(two_modes, (-30, 30))
    print(f"15 %: {max(small.values()):.2f}, 30 %: {max(large.values()):.2f} degrees")
    assert max(small.values()) < 2.2
    assert max(large.values()) < 7.2


# -- both axes, by frames --------------------------------------------------------------------------

FILE = Path(__file__).resolve().parents[2] / "config" / "forwarder-sensor.yaml"


def watching(tmp_path: Path) -> Deployment:
    """The shipped deployment whose sensors are only watched."""
    text = FILE.read_text(encoding="utf-8").replace("../dbc", str(FILE.parents[1] / "dbc"))
    path = tmp_path / "machine.yaml"
    path.write_text(text.replace("use: damp", "use: watch"), encoding="utf-8")
    return load_deployment(path)


def drive_both(deployment: Deployment, strokes: tuple[Stroke, ...], length_pct: float) -> Recording:
    """A drive of 13 s with a grapple that is so much longer."""
    crane = CraneParameters()
    crane = replace(crane, grapple=crane.grapple.longer(length_pct))
    return lock_step(deployment, Script("both", strokes, 13.0), parameters=crane)


def tilt_deg(deployment: Deployment, strokes: tuple[Stroke, ...], length_pct: float) -> float:
    """Largest tilt of the grapple in the last three seconds."""
    recording = drive_both(deployment, strokes, length_pct)
    assert recording.crane is not None
    return max(recording.crane.sway_deg[-150:])


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
        assert left[1] > 4.0


# Near-far proves its sensor; 3.7 s later slew, and for a reversal it turns at 8 s.
PROVED = (Stroke("near_far", 0.3, 0.8, 0.5), Stroke("near_far", 1.3, 0.8, -0.5))
SLEWS = {
    "stroke": (Stroke("slew", 6.5, 2.5, 1.0),),
    "reversal": (Stroke("slew", 6.5, 1.5, 1.0, 0.1), Stroke("slew", 8.0, 1.5, -1.0, 0.1)),
}


def along_boom_deg(
    deployment: Deployment, slew: tuple[Stroke, ...], length_pct: float, seed: int = 1
) -> float:
    """What slewing leaves along the boom, where no one touches the joystick."""
    crane = CraneParameters()
    grapple = crane.grapple.longer(length_pct)
    sensor = replace(crane.sway_sensor, seed=seed)
    crane = replace(crane, grapple=grapple, sway_sensor=sensor)
    recording = lock_step(deployment, Script("slew", (*PROVED, *slew), 15.0), parameters=crane)
    return max(map(abs, (recording.axes["near_far"].sway_deg or [])[600:]))


@pytest.mark.parametrize("slew", SLEWS)
def test_what_slewing_swings_along_the_boom_is_damped(slew: str, tmp_path: Path) -> None:
    damped, watched = load_deployment(FILE), watching(tmp_path)
    left = [along_boom_deg(one, SLEWS[slew], 15.0) for one in (damped, watched)]
    print(f"{left[0]:.2f} degrees, only watched {left[1]:.2f}")
    assert left[0] < 0.6
    assert left[1] > 1.5


@pytest.mark.study
@pytest.mark.long
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
