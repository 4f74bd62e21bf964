"""Near-far with a sway sensor that has a fault, or sees a second swing."""

import math
from collections.abc import Callable
from dataclasses import replace

import pytest

from canshaper.shaping.sway import Measured
from canshaper_sim.sway_sensor import SwaySensorParameters
from tests.closed_loop.sensor_drives import KINDS, PLAIN, residuals
from tests.rigs.sensed import LENGTH_M, MODE, SCRIPTS, Setup

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


@pytest.mark.slow
@KINDS
@pytest.mark.parametrize("fault", FAULTS)
def test_a_fault_leaves_little_more_than_no_sensor(sensor: Setup, fault: str) -> None:
    beyond, worst = faults(sensor, fault, [1.15, 2.3, 3.4])
    print(f"{beyond:.2f} degrees beyond its case, {worst:.2f} beyond the worst of all")
    assert beyond < 3.0
    assert worst < 0.3


@pytest.mark.study
@pytest.mark.slow
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


@pytest.mark.slow
@pytest.mark.parametrize("measured", Measured)
def test_a_long_log_whose_second_swing_is_known(measured: Measured) -> None:
    beyond, path = beyond_no_sensor(measured, (8.0,), 1.0)
    assert beyond < 0.35
    assert path < 1.5
    beyond, path = beyond_no_sensor(measured, (8.0,), None)
    assert beyond > 1.0
    assert path > 1.7


@pytest.mark.study
@pytest.mark.slow
@pytest.mark.parametrize("measured", Measured)
@pytest.mark.parametrize("share", [None, 0.8, 1.0, 1.2])
def test_every_long_log(measured: Measured, share: float | None) -> None:
    beyond, path = beyond_no_sensor(measured, (8.0, 10.0, 12.0), share)
    assert beyond < (0.9 if share else 4.1)
    assert path < (1.6 if share else 2.5)


@pytest.mark.study
@pytest.mark.slow
@KINDS
def test_what_a_second_swing_that_is_not_there_costs(sensor: Setup) -> None:
    two_modes = replace(sensor, second_s=0.63)
    small, large = residuals(two_modes, (0, -15, 15)), residuals(two_modes, (-30, 30))
    print(f"15 %: {max(small.values()):.2f}, 30 %: {max(large.values()):.2f} degrees")
    assert max(small.values()) < 2.2
    assert max(large.values()) < 7.2
