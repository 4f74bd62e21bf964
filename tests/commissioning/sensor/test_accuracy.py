"""Findings about a known sensor: for every sign, delay, offset, noise and length."""

import itertools
import math
from collections.abc import Sequence

import pytest

from canshaper.commissioning.sensor.verdict import WIDEST_DELAY_S, SensorFinding, changes
from tests.commissioning.sensor.drives import AXES, FILE, GYRO, Drive, machine

ROBUST = FILE.parent / "j1939-sensor.yaml"
SIGNS, DELAYS_S, LENGTHS_PCT = (1.0, -1.0), (0.0, 0.1, 0.2), (-10.0, 10.0)
OFFSETS_DEG, NOISES_DEG = (0.0, -2.5), (0.05, 0.4)
EVERY = list(itertools.product(SIGNS, DELAYS_S, OFFSETS_DEG, NOISES_DEG, LENGTHS_PCT))
SOME = [(case, AXES[i % 2]) for i, case in enumerate(EVERY[::11])]


def judge(drive: Drive, case: Sequence[float], part: float = 1.0) -> SensorFinding:
    """Hold what is found against the truth; ``part`` of the noise of an angle is that of a rate."""
    sign, delay_s, offset, noise, _ = case
    noise *= part
    finding = drive.finding(gain=sign, delay_s=delay_s, offset_deg=offset, noise_deg=noise)
    print(
        f"{drive.axis} {case}: {finding.invert} {1000 * finding.delay_s.value:.0f} ms"
        f" {finding.offset.value:.2f} {finding.noise:.3f} {finding.problems}"
    )
    # In the most noise a swing of a degree says the delay to a little more than is asked.
    unsure = finding.delay_s.half > WIDEST_DELAY_S and noise >= max(NOISES_DEG)
    assert len(finding.problems) == unsure
    assert finding.delay_s.half < 1.2 * WIDEST_DELAY_S
    assert finding.invert == (sign < 0.0) ^ (drive.axis == "slew")
    assert abs(finding.delay_s.value - delay_s) < 0.015
    assert abs(finding.offset.value - offset) < 0.2
    # 0.01 degrees of the signal besides.
    assert finding.noise == pytest.approx(noise, rel=0.25)
    # A case in twenty is outside of an interval of 95 %, none by much.
    assert abs(finding.delay_s.value - delay_s) < 1.5 * finding.delay_s.half
    return finding


@pytest.mark.slow
@pytest.mark.parametrize(("case", "axis"), SOME)
def test_an_angle(case: Sequence[float], axis: str) -> None:
    judge(Drive(machine(), axis, case[-1]), case)


@pytest.mark.slow
@pytest.mark.parametrize(("case", "axis"), SOME[::2])
def test_a_rate(case: Sequence[float], axis: str) -> None:
    judge(Drive(machine(*GYRO), axis, case[-1]), case, 3.0)


@pytest.mark.study
@pytest.mark.slow
@pytest.mark.parametrize("axis", AXES)
@pytest.mark.parametrize("case", EVERY)
def test_every_combination(axis: str, case: Sequence[float]) -> None:
    judge(Drive(machine(), axis, case[-1]), case)
    judge(Drive(machine(*GYRO), axis, case[-1]), case, 3.0)


@pytest.mark.slow
@pytest.mark.parametrize("axis", AXES)
def test_an_inclinometer_of_j1939_leads_by_what_corrects_its_gyro(axis: str) -> None:
    """Delay and lead come as one, which is what the observer needs."""
    drive = Drive(machine(file=ROBUST), axis)
    omega = 2.8
    for fusion_s in (4.0, 10.0):
        lead_s = math.atan(1.0 / (omega * fusion_s)) / omega
        finding = drive.finding(delay_s=0.1, fusion_s=fusion_s)
        assert not finding.problems
        assert abs(finding.delay_s.value - (0.1 - lead_s)) < 0.02


@pytest.mark.slow
def test_the_period_and_the_full_speed_are_those_of_the_crane() -> None:
    longer = Drive(machine(), length_pct=20.0).finding()
    assert longer.period_s.value == pytest.approx(2.2 * math.sqrt(1.2), rel=0.01)
    assert any("pendulum 20 % longer" in note for note in longer.notes)
    assert longer.size_m_s.value == pytest.approx(1.0, rel=0.03)
    assert not Drive(machine()).finding().notes


@pytest.mark.slow
def test_what_is_written() -> None:
    deployment = machine()
    bound = deployment.axes["near_far"]
    plain = changes(bound, Drive(deployment).finding(delay_s=0.06, gain=-1.0, noise_deg=0.2))
    assert plain["invert"] is True
    assert abs(plain["delay_ms"] - 60) < 15
    assert plain["noise_deg"] == pytest.approx(0.2, rel=0.1)
    assert plain.keys() == {"invert", "delay_ms", "noise_deg"}
    off = changes(bound, Drive(deployment).finding(offset_deg=-4.0))
    assert off["offset_max_deg"] == 6


@pytest.mark.slow
def test_a_valve_that_is_quicker_than_the_file_says_lowers_its_lag() -> None:
    slow = machine(("timeout_ms: 80 }", "timeout_ms: 80, valve_lag_ms: 200 }"))
    bound = slow.axes["near_far"]
    values = changes(bound, Drive(slow).finding(delay_s=0.02))
    assert values["delay_ms"] == 0
    assert 100 < values["valve_lag_ms"] < 160
