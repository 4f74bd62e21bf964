"""Near-far with a sway sensor on the nonlinear crane with a real valve: the figures, and faults."""

import math
from collections.abc import Callable
from dataclasses import replace
from pathlib import Path

import pytest

from canshaper.design.lockstep import drive as lock_step
from canshaper.design.tuning.robust import least_residual
from canshaper.machine.binding import load_deployment
from canshaper.machine.deployment import Deployment
from canshaper.shaping.observer import Measured
from canshaper.shaping.trust import Trust
from canshaper_sim.crane import CraneParameters, CraneState
from canshaper_sim.strokes import Script, Stroke
from canshaper_sim.sway_sensor import SwaySensorParameters
from tests.rigs.sensed import LENGTH_M, MODE, SCRIPTS, TICK_S, Drive, Setup, script

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
    assert replace(GYRO, swing_deg=10.0).drive("pulse").residual_deg < 2.0


def test_another_load_is_damped() -> None:
    assert replace(ENCODER, load=3.0).drive("reversal").residual_deg < 0.8
    assert replace(ENCODER, length_m=1.6).drive("pulse").residual_deg < 1.4


@pytest.mark.parametrize("lag_s", [0.05, 0.15])
def test_the_lag_of_the_valve_may_be_wrong(lag_s: float) -> None:
    assert max(residuals(replace(ENCODER, lag_s=lag_s), (-30, 0, 30)).values()) < 1.5


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


def faults(sensor: Setup, fault: str, times_s: list[float]) -> tuple[float, float]:
    """Most that a fault leaves beyond no sensor in the same drive, and beyond the worst of all."""
    beyond, worst, open_worst = 0.0, 0.0, 0.0
    for name in ("pulse", "reversal", "early release"):
        for length_m in (0.84, LENGTH_M, 1.56):
            plain = replace(PLAIN, length_m=length_m).drive(name).residual_deg
            open_worst = max(open_worst, plain)
            for time_s in times_s:
                setup = replace(sensor, sensor=FAULTS[fault](time_s), length_m=length_m)
                left = setup.drive(name).residual_deg
                beyond, worst = max(beyond, left - plain), max(worst, left)
    return beyond, worst - open_worst


# A gyro whose offset jumps by no more than a grapple's rate can leaves more, see below.
@pytest.mark.parametrize(
    ("sensor", "fault", "most_deg"),
    [
        *((ENCODER, fault, 3.0) for fault in FAULTS),
        *((GYRO, fault, 3.0) for fault in FAULTS if fault != "jump"),
    ],
)
def test_a_fault_leaves_little_more_than_no_sensor(
    sensor: Setup, fault: str, most_deg: float
) -> None:
    beyond, worst = faults(sensor, fault, [1.15, 2.3, 3.4])
    print(f"{beyond:.2f} degrees beyond its case, {worst:.2f} beyond the worst of all")
    assert beyond < most_deg
    assert worst < 0.35


def test_a_gyro_with_a_new_offset_leaves_more() -> None:
    beyond, worst = faults(GYRO, "jump", [1.15, 2.3, 3.4])
    print(f"{beyond:.2f} degrees beyond its case, {worst:.2f} beyond the worst of all")
    assert beyond < 6.5
    assert worst < 0.35


@pytest.mark.long
@pytest.mark.parametrize("fault", FAULTS)
def test_a_fault_at_any_instant(fault: str) -> None:
    beyond, worst = faults(ENCODER, fault, [0.5 + 0.04 * k for k in range(200)])
    print(f"{beyond:.2f} degrees beyond its case, {worst:.2f} beyond the worst of all")
    assert beyond < 3.0
    assert worst < 0.5


# -- contact --------------------------------------------------------------------------------------

LONG = script("long", (2.5, 0.6, -0.5), (7.5, 3.0, 1.0), rest_s=7.0)


def still(from_s: float, angle_deg: float) -> Callable[[CraneState], float | None]:
    """The grapple leans on something that does not move."""
    return lambda state: math.radians(angle_deg) if state.time_s >= from_s else None


class Dragged:
    """The grapple lies on the ground: it follows only when the crane pulls it at this angle."""

    def __init__(self, from_s: float, angle_deg: float) -> None:
        self._from_s, self._most = from_s, math.radians(angle_deg)

    def __call__(self, state: CraneState) -> float | None:
        if state.time_s < self._from_s:
            return None
        turned = state.theta6_rad + state.radius_rate_m_s / LENGTH_M * TICK_S
        return min(max(turned, -self._most), self._most)


def late(drive: Drive) -> float:
    """Largest command later than three seconds after the last release."""
    release_s = drive.script.strokes[-1].end_s
    rows = zip(drive.time_s, drive.sent, strict=True)
    return max(abs(v) for t, v in rows if t > release_s + 3.0)


@KINDS
@pytest.mark.parametrize("angle_deg", [3.0, 10.0])
@pytest.mark.parametrize("from_s", [0.0, 6.0, 8.5, 9.5])
@pytest.mark.parametrize("contact", [still, Dragged])
def test_a_grapple_that_leans_on_something_hardly_changes_the_travel(
    sensor: Setup,
    contact: Callable[[float, float], Callable[[CraneState], float | None]],
    from_s: float,
    angle_deg: float,
) -> None:
    held = replace(sensor, contact=contact(from_s, angle_deg)).drive(LONG)
    plain = replace(PLAIN, contact=contact(from_s, angle_deg)).drive(LONG)
    more = held.travel_m / plain.travel_m - 1.0
    print(f"travel {100.0 * more:+.1f} %, {[state.name for state in held.states]}")
    assert abs(more) < 0.06
    assert late(held) == 0.0


# -- both axes, by frames --------------------------------------------------------------------------

FILE = Path(__file__).resolve().parents[2] / "config" / "forwarder-sensor.yaml"


def watching(tmp_path: Path) -> Deployment:
    """The shipped deployment whose sensors are only watched."""
    text = FILE.read_text(encoding="utf-8").replace("../dbc", str(FILE.parents[1] / "dbc"))
    path = tmp_path / "machine.yaml"
    path.write_text(text.replace("use: damp", "use: watch"), encoding="utf-8")
    return load_deployment(path)


def tilt_deg(deployment: Deployment, strokes: tuple[Stroke, ...], length_pct: float) -> float:
    """Largest tilt of the grapple in the last three seconds."""
    crane = CraneParameters()
    crane = replace(crane, grapple=crane.grapple.longer(length_pct))
    recording = lock_step(deployment, Script("both", strokes, 13.0), parameters=crane)
    assert recording.crane is not None
    return max(recording.crane.sway_deg[-150:])


def test_a_slew_is_damped_in_its_plane(tmp_path: Path) -> None:
    reversal = (Stroke("slew", 0.5, 1.5, 1.0, 0.1), Stroke("slew", 2.0, 1.5, -1.0, 0.1))
    damped, watched = load_deployment(FILE), watching(tmp_path)
    for length_pct in (-15.0, 15.0):
        left = tilt_deg(damped, reversal, length_pct), tilt_deg(watched, reversal, length_pct)
        print(f"{length_pct:+.0f} %: {left[0]:.2f} degrees, only watched {left[1]:.2f}")
        assert left[0] < 0.85 * left[1]


@pytest.mark.parametrize("late_s", [-1.2, 0.6])
def test_both_joysticks_at_once_are_better_with_a_wrong_length_and_little_worse_with_the_right_one(
    tmp_path: Path, late_s: float
) -> None:
    """What the two-axis motion adds is no swing to damp."""
    slew = Stroke("slew", 0.5 - min(0.0, late_s), 3.0, 1.0)
    strokes = (slew, Stroke("near_far", 0.5 + max(0.0, late_s), 3.0, 1.0))
    damped, watched = load_deployment(FILE), watching(tmp_path)
    left = [tilt_deg(one, strokes, pct) for pct in (0.0, 15.0) for one in (damped, watched)]
    print(", ".join(f"{one:.2f}" for one in left))
    assert left[0] < left[1] + 0.7
    assert left[2] < 0.8 * left[3]
