"""The simulated sway sensor: what it makes of the swing, and its faults."""

import math
import statistics

import pytest

from canshaper.config.inputs import Kind
from canshaper.errors import DesignError
from canshaper_sim.grapple import Sway
from canshaper_sim.parameters import changed_parameters
from canshaper_sim.sway_sensor import SwaySensor, SwaySensorParameters

TICK_S = 0.02
QUIET = {"noise_deg": 0.0, "delay_s": 0.0}


def shown(
    seconds: float, *, across: bool = True, kind: Kind = "angle", **parameters: float
) -> list[float]:
    """Measurements of a swing that grows by ten degrees per second, each tick."""
    sensor = SwaySensor(SwaySensorParameters(**parameters), "slew", across=across, kind=kind)
    values = []
    for tick in range(round(seconds / TICK_S)):
        time_s = tick * TICK_S
        angle, speed = math.radians(10.0 * time_s), math.radians(10.0)
        sensor.swing(time_s, Sway(angle, -angle, speed, -speed))
        values.append(sensor.value(time_s))
    return values


def test_it_shows_the_angle_or_the_rate_of_its_plane() -> None:
    assert shown(1.0, **QUIET)[-1] == pytest.approx(9.8)
    assert shown(1.0, across=False, **QUIET)[-1] == pytest.approx(-9.8)
    assert shown(1.0, kind="rate", **QUIET)[-1] == pytest.approx(10.0)


def test_an_inclination_is_led_back_to_zero() -> None:
    """A ramp of 10 degrees per second behind a high-pass of so many seconds, and without a gyro."""
    one = shown(10.0, kind="inclination", fusion_s=1.0, **QUIET)
    assert one[-1] == pytest.approx(10.0, rel=0.02)
    assert shown(0.2, kind="inclination", fusion_s=100.0, **QUIET)[-1] == pytest.approx(
        1.8, abs=0.01
    )
    assert max(map(abs, shown(1.0, kind="inclination", fusion_s=0.0, **QUIET))) == 0.0


def test_a_delay_shows_what_was() -> None:
    assert shown(1.0, noise_deg=0.0, delay_s=0.1)[-1] == pytest.approx(8.8)


def test_noise_has_its_spread_and_is_the_same_again() -> None:
    noise = [a - b for a, b in zip(shown(20.0, delay_s=0.0), shown(20.0, **QUIET), strict=True)]
    assert statistics.stdev(noise) == pytest.approx(0.1, rel=0.1)
    assert shown(1.0) == shown(1.0)
    assert shown(1.0) != shown(1.0, seed=2)


@pytest.mark.parametrize(
    ("parameters", "value"),
    [
        ({"offset_deg": 2.0}, 11.8),
        ({"gain": -1.0}, -9.8),
        ({"resolution_deg": 0.5}, 10.0),
        ({"stuck_s": 0.5}, 5.0),
        ({"reversed_s": 0.5}, -9.8),
        ({"jump_s": 0.5, "jump_deg": 3.0}, 12.8),
    ],
)
def test_what_may_be_wrong_with_it(parameters: dict[str, float], value: float) -> None:
    values = shown(1.0, **QUIET, **parameters)
    assert values[-1] == pytest.approx(value)


def test_it_is_set_by_name() -> None:
    crane = changed_parameters(["sway_sensor.noise_deg=0.5", "sway_sensor.lost_s=3"])
    assert (crane.sway_sensor.noise_deg, crane.sway_sensor.lost_s) == (0.5, 3.0)
    with pytest.raises(DesignError, match="noise_deg"):
        changed_parameters(["sway_sensor.noise_deg=21"])
