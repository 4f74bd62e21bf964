"""The picture of an identification: which swing it shows, and what stands over it."""

import math
from dataclasses import replace

import numpy as np

from canshaper.commissioning.identification.data import timed_by_hand
from canshaper.commissioning.identification.plot import figure
from canshaper.commissioning.identification.report import advice_on, headlines
from canshaper.commissioning.identification.series import Kind, Series, Unit
from canshaper.commissioning.identification.verdict import SwingFinding, identify


def by_hand(axis: str) -> SwingFinding:
    timed = {"swings": 10.0, "seconds": 23.6, "first": 20.0, "last": 6.0}
    return timed_by_hand(dict(timed), [], axis)


def test_a_picture_says_only_what_its_headings_do_not() -> None:
    good, poor = by_hand("slew"), replace(by_hand("lift"), problems=["Too short."])
    states = [by_hand("near_far"), replace(by_hand("near_far"), label="loaded")]
    findings = [good, poor, *states]
    advice = advice_on(findings, None)
    assert headlines(findings, advice) == [advice[1].text, advice[2].text]
    assert "Too short." in advice[1].text


def test_it_shows_the_largest_swing() -> None:
    """Not the longest: a little one, by the push of another axis, may go on for longer."""
    time = np.arange(0.0, 80.0, 0.02)
    angle = np.random.default_rng(1).normal(0.0, math.radians(0.02), len(time))
    for begin_s, end_s, deg in ((3.0, 45.0, 2.0), (50.0, 75.0, 6.0)):
        at = time - begin_s
        swing = np.exp(-0.05 * at) * np.sin(2.0 * math.pi * at / 2.4)
        angle += np.where((time > begin_s) & (time < end_s), math.radians(deg) * swing, 0.0)
    series = Series("log: S", Unit(Kind.ANGLE, 1.0, "rad"), time, angle)
    finding = identify("slew", "", [series])
    assert finding.free and len(finding.free.segments) == 2
    swing_panel = figure([finding], []).axes[0]
    assert swing_panel.get_xlim()[0] > 40.0
