"""Data that is not enough is reported, with what to do; nothing is made of it."""

import math
from pathlib import Path

import numpy as np
import pytest

from canshaper.commissioning.identification.data import logged, stopwatch
from canshaper.commissioning.identification.series import (
    Array,
    Kind,
    Series,
    Unit,
    ordered,
    unit_of,
)
from canshaper.commissioning.identification.verdict import identify
from canshaper.errors import IdentificationError
from canshaper.machine.binding import load_deployment
from tests.commissioning.identification.machine import Coloured
from tests.rigs.files import CONFIG

DEGREES = Unit(Kind.ANGLE, math.radians(1.0), "deg")
BAR = Unit(Kind.OTHER, 1.0, "bar")
PERIOD, RATIO = 2.3, 0.04


def decay(
    time: Array, degrees: float = 10.0, period: float = PERIOD, ratio: float = RATIO
) -> Array:
    omega = 2.0 * math.pi / period
    sigma = ratio * omega / math.sqrt(1.0 - ratio**2)
    return math.radians(degrees) * np.exp(-sigma * time) * np.cos(omega * time)


def noise(count: int, degrees: float, seed: int = 1) -> Array:
    source = Coloured(seed, math.radians(degrees), 0.7)
    return np.array([source() for _ in range(count)])


def series(time: Array, value: Array, unit: Unit = DEGREES, **known: object) -> Series:
    return Series("a.log: Sway.Angle", unit, time, value, **known)  # type: ignore[arg-type]


def times(seconds: float, step_s: float = 0.02) -> Array:
    return np.arange(0.0, seconds, step_s)


T25 = times(25.0)
GOOD = series(T25, decay(T25) + noise(len(T25), 0.1))


def short(seconds: float) -> Series:
    time = times(seconds)
    return series(time, decay(time) + noise(len(time), 0.1))


def rounded(degrees: float, step_deg: float) -> Series:
    step = math.radians(step_deg)
    return series(T25, np.round(decay(T25, degrees) / step) * step)


def clipped(degrees: float) -> Series:
    end = math.radians(degrees)
    return series(T25, np.clip(decay(T25, 20.0, ratio=0.02), -end, end))


def steady() -> Series:
    time = times(40.0)
    return series(time, decay(time, ratio=0.0) + noise(len(time), 0.3))


def two_directions() -> Series:
    both = decay(T25) + decay(T25, 5.0, period=2.05)
    return series(T25, both + noise(len(T25), 0.05))


REFUSED = {
    "too few swings": (short(2.7 * PERIOD), "expected 3 swings or more, better ten, got"),
    "too few values": (short(0.3), "only 15 values"),
    "stands": (series(T25, np.full(len(T25), 0.1)), "is it the right signal, and the sensor on?"),
    "below the noise": (
        series(T25, decay(T25, 0.5) + noise(len(T25), 0.6)),
        "touch nothing for ten swings",
    ),
    "too slow a log": (
        series(times(30.0, 0.5), decay(times(30.0, 0.5))),
        "expected 8 values or more a swing, got one every 0.5 s",
    ),
    "clipped": (clipped(8.0), "stands at 8 deg again and again: the sensor is at the end of its"),
    "too coarse": (rounded(3.0, 1.0), "steps only; use a finer signal"),
    "degrees called radians": (
        series(T25, np.degrees(GOOD.value), Unit(Kind.ANGLE, 1.0, "rad")),
        "is the unit of the signal right?",
    ),
    "no decay": (steady(), "no decay is seen"),
    "two directions": (two_directions(), "two swings are mixed, of 2.0"),
    "never left alone": (
        series(T25, decay(T25), idle=[(3.0 * k, 3.0 * k + 1.5) for k in range(10)]),
        "never left to swing freely",
    ),
}


@pytest.mark.parametrize("name", REFUSED)
def test_what_is_refused(name: str) -> None:
    one, text = REFUSED[name]
    finding = identify("slew", "", [one])
    assert not finding.usable
    assert any(text in fault for fault in finding.problems), finding.problems


def test_the_same_data_is_good_enough() -> None:
    finding = identify("slew", "", [GOOD])
    assert finding.usable, finding.problems
    assert not finding.notes


@pytest.mark.slow
def test_only_noise() -> None:
    time = times(60.0)
    for seed in range(10):
        finding = identify("slew", "", [series(time, noise(len(time), 1.0, seed))])
        assert not finding.usable
        assert any("touch nothing for ten swings" in fault for fault in finding.problems)


def test_one_step_of_a_coarse_signal_is_no_clipping() -> None:
    finding = identify("slew", "", [rounded(10.0, 0.2)])
    assert finding.usable, finding.problems


def test_dry_friction_is_reported() -> None:
    """Amplitude falls in a straight line, not exponentially."""
    omega = 2.0 * math.pi / PERIOD
    envelope = np.maximum(math.radians(10.0) - math.radians(0.45) * T25, 0.0)
    value = envelope * np.cos(omega * T25) + noise(len(T25), 0.05)
    finding = identify("slew", "", [series(T25, value)])
    assert finding.usable, finding.problems
    assert any("dry friction" in note for note in finding.notes), finding.notes


@pytest.mark.slow
def test_viscous_damping_is_not_taken_for_friction() -> None:
    for seed in range(20):
        finding = identify("slew", "", [series(T25, decay(T25) + noise(len(T25), 1.0, seed))])
        assert not any("damping ratio changes" in note for note in finding.notes), finding.notes


def test_a_pressure_serves_too() -> None:
    bars = 120.0 + 0.05 * T25 + 300.0 * decay(T25) + 100.0 * noise(len(T25), 0.3)
    finding = identify("slew", "", [series(T25, bars, BAR)])
    assert finding.usable, finding.problems
    assert finding.period_s and finding.damping_ratio
    assert finding.period_s.value == pytest.approx(PERIOD, rel=0.005)
    assert finding.damping_ratio.value == pytest.approx(RATIO, rel=0.1)


@pytest.mark.slow
def test_a_period_that_is_known_about_leads_to_the_swing() -> None:
    """A stronger oscillation, of the pump or the boom, is passed over."""
    value = decay(T25, 2.0) + decay(T25, 6.0, period=0.7, ratio=0.02) + noise(len(T25), 0.05)
    finding = identify("slew", "", [series(T25, value)], about_s=2.2)
    assert finding.usable, finding.problems
    assert finding.period_s
    assert finding.period_s.value == pytest.approx(PERIOD, rel=0.01)
    alone = identify("slew", "", [series(T25, value)])
    assert alone.period_s
    assert alone.period_s.value == pytest.approx(0.7, rel=0.01)


@pytest.mark.slow
def test_of_a_filter_for_two_modes_the_slower_one_is_looked_for(tmp_path: Path) -> None:
    deployment = load_deployment(CONFIG / "bridge-crane-hook.yaml")
    time = np.arange(0.0, 60.0, 0.05)
    value = decay(time, 4.0, 5.885, 0.01) + decay(time, 6.0, 2.369, 0.01) + noise(len(time), 0.05)
    table = tmp_path / "angle.csv"
    rows = (f"{at:.2f},{math.degrees(one):.4f}" for at, one in zip(time, value, strict=True))
    table.write_text("\n".join(("Time (s),Angle (deg)", *rows)) + "\n")
    known = {"axis": None, "channel": None, "about_s": None, "on_progress": lambda *_, **__: None}
    for file, period_s in ((deployment, 5.885), (None, 2.369)):
        of = {"bridge": "Angle (deg)"}, file, deployment.messages
        (finding,) = logged([str(table)], *of, **known)  # type: ignore[arg-type]
        assert finding.period_s
        assert finding.period_s.value == pytest.approx(period_s, rel=0.05)


def test_a_useless_log_does_not_spoil_a_good_one() -> None:
    finding = identify("slew", "", [series(T25, np.zeros(len(T25))), GOOD])
    assert finding.usable, finding.problems
    assert any("it stands at 0" in note for note in finding.notes)


def test_neighbours_that_were_logged_the_wrong_way_round() -> None:
    time, value = ordered("a", np.array([0.0, 0.02, 0.01, 0.03]), np.array([0.0, 2.0, 1.0, 3.0]))
    assert list(time) == [0.0, 0.01, 0.02, 0.03]
    assert list(value) == [0.0, 1.0, 2.0, 3.0]


@pytest.mark.parametrize(
    ("text", "kind", "factor"),
    [
        ("deg", Kind.ANGLE, math.radians(1.0)),
        ("°", Kind.ANGLE, math.radians(1.0)),
        ("rad", Kind.ANGLE, 1.0),
        ("deg/s", Kind.RATE, math.radians(1.0)),
        ("°/s", Kind.RATE, math.radians(1.0)),
        ("dps", Kind.RATE, math.radians(1.0)),
        ("rad/s", Kind.RATE, 1.0),
        ("bar", Kind.OTHER, 1.0),
        ("", Kind.OTHER, 1.0),
    ],
)
def test_units(text: str, kind: Kind, factor: float) -> None:
    unit = unit_of(text)
    assert (unit.kind, unit.factor) == (kind, pytest.approx(factor))


def test_stopwatch() -> None:
    """Ten swings of a pendulum from 20 to 5 degrees, whose mean square makes it 0.3 % slower."""
    period, ratio = stopwatch(10, 23.6, 20.0, 5.0)
    assert ratio.value == pytest.approx(math.log(4.0) / (20.0 * math.pi), rel=0.001)
    assert 2.36 * 0.995 < period.value < 2.36 * 0.998
    assert 0.02 < period.half < 0.06


def test_a_stopwatch_with_next_to_no_amplitude_left() -> None:
    assert 0.9 < stopwatch(10, 23.6, 20.0, 1e-320)[1].value < 1.0


@pytest.mark.parametrize(
    ("swings", "seconds", "first", "last", "text"),
    [
        (2, 5.0, 20, 10, "--swings"),
        (float("nan"), 5.0, 20, 10, "--swings"),
        (10, 1.0, 20, 10, "--seconds"),
        (10, 300.0, 20, 10, "--seconds"),
        (10, 23.0, 10, 20, "--first, --last"),
        (10, 23.0, 90, 20, "--first, --last"),
        (10, 23.0, 20, 0, "--first, --last"),
    ],
)
def test_a_stopwatch_that_makes_no_swing(
    swings: float, seconds: float, first: float, last: float, text: str
) -> None:
    with pytest.raises(IdentificationError, match=text):
        stopwatch(swings, seconds, first, last)
