"""A grapple with a sway sensor that leans on something, or lies on the ground and is dragged."""

import math
from collections.abc import Callable
from dataclasses import replace

import pytest

from canshaper.shaping.sway import Measured
from canshaper_sim.crane import CraneState
from canshaper_sim.sway_sensor import SwaySensorParameters
from tests.rigs.sensed import LENGTH_M, TICK_S, Drive, Setup, script

KINDS = pytest.mark.parametrize(
    "sensor", [Setup(), Setup(measured=Measured.RATE)], ids=["encoder", "gyro"]
)
PLAIN = Setup(measured=None)
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


Holding = Callable[[float, float], Callable[[CraneState], float | None]]
"""What holds the grapple from a time, s, at an angle, degrees."""


def late(drive: Drive) -> float:
    """Largest command later than three seconds after the last release."""
    release_s = drive.script.strokes[-1].end_s
    rows = zip(drive.time_s, drive.sent, strict=True)
    return max(abs(v) for t, v in rows if t > release_s + 3.0)


@KINDS
@pytest.mark.parametrize("angle_deg", [3.0, 10.0])
@pytest.mark.parametrize(
    "from_s", [4.0, 8.5, *(pytest.param(one, marks=pytest.mark.slow) for one in (0.0, 6.0, 9.5))]
)
@pytest.mark.parametrize("contact", [still, Dragged])
def test_a_grapple_that_leans_on_something_hardly_changes_the_travel(
    sensor: Setup, contact: Holding, from_s: float, angle_deg: float
) -> None:
    plain = replace(PLAIN, contact=contact(from_s, angle_deg)).drive(LONG)
    for seed in (1, 2):
        seeded = replace(sensor, sensor=SwaySensorParameters(seed=seed))
        held = replace(seeded, contact=contact(from_s, angle_deg)).drive(LONG)
        more = held.travel_m / plain.travel_m - 1.0
        print(f"travel {100.0 * more:+.1f} %, {[state.name for state in held.states]}")
        assert abs(more) < 0.05
        assert late(held) == 0.0


@pytest.mark.study
@pytest.mark.slow
@KINDS
@pytest.mark.parametrize("contact", [still, Dragged])
def test_contact_with_twelve_seeds_of_noise(sensor: Setup, contact: Holding) -> None:
    worst = 0.0
    for from_s in (0.0, 3.0, 6.0, 8.0, 8.5, 9.5, 10.5):
        for angle_deg in (3.0, 10.0):
            plain = replace(PLAIN, contact=contact(from_s, angle_deg)).drive(LONG)
            for seed in range(1, 13):
                seeded = replace(sensor, sensor=SwaySensorParameters(seed=seed))
                held = replace(seeded, contact=contact(from_s, angle_deg)).drive(LONG)
                worst = max(worst, abs(held.travel_m / plain.travel_m - 1.0))
                assert late(held) == 0.0
    print(f"travel {100.0 * worst:.1f} %")
    assert worst < 0.05
