"""Wrong outputs at rest, at the start, and with the stick held or released."""

import pytest

from tests.gate.kinds import (
    NAMES,
    RATE,
    Kind,
    again,
    down,
    drop,
    flag,
    goes_no_farther,
    held,
    release,
    saw,
    turned,
    up,
)

pytestmark = pytest.mark.slow

KINDS = {
    # at rest, joysticks in neutral and enabled
    "jump from rest": Kind(lambda k, was: 1.0),
    "ramp from rest": Kind(up),
    "creep from rest": Kind(lambda k, was: 0.03),
    "one frame from rest": Kind(lambda k, was: 0.5 if k == 0 else 0.0, ticks=5),
    "saw tooth from rest": Kind(saw),
    "chatter around rest": Kind(lambda k, was: 0.06 * (-1) ** k),
    "slow swing around rest": Kind(lambda k, was: 0.05 * (k % 10 - 5) / 5),
    "enable is off": Kind(up, flag(enable=0)),
    "stick held, enable is off": Kind(up, flag(enable=0), before=20),
    # at the start
    "nothing received": Kind(up, drop(), before=-1),
    "held since the start": Kind(up, before=-1),
    "held since the start, enable comes later": Kind(up, again(0, 0, 20), before=-1),
    "held since the start, enable twice": Kind(up, again(0, 20, 30), before=-1),
    # stick held
    "faster than asked": Kind(up, before=20, bound=0.7, why="what was asked"),
    "against the stick at once": Kind(lambda k, was: -0.3, before=20),
    "against the stick by the rates": Kind(
        lambda k, was: max(-1, was - RATE * (k + 1)), before=20, bound=0.15, why="the way to zero"
    ),
    "jump to what is asked": Kind(lambda k, was: 1.0, size=1.0, before=1),
    "fall at once, not to zero": Kind(
        lambda k, was: 0.1,
        before=40,
        bound=0.13,
        why="with a motion a part of it may end at once: slower",
    ),
    "saw tooth of 25 Hz": Kind(
        lambda k, was: 0.1 if k % 2 else 0.5,
        before=40,
        bound=0.02,
        why="the frame that is as before",
    ),
    "slower than asked": Kind(lambda k, was: was * 0.8, before=40, bound=0.7, why="slower"),
    "the other way and back": Kind(lambda k, was: -0.05, before=40),
    # stick released
    "goes on": Kind(held, release, before=60, ticks=200, bound=2.8, why="tail"),
    "goes on after a tap": Kind(
        held, release, before=5, ticks=200, bound=1.2, why="tail, distance"
    ),
    "falls too slowly": Kind(down, release, before=60, ticks=200, bound=2.8, why="tail"),
    "goes on faster": Kind(up, release, before=20, ticks=200, bound=1.6, why="tail, distance"),
    "after the tail": Kind(
        lambda k, was: 0.0 if k < 150 else 0.09 * min(5, k - 150),
        release,
        before=30,
        ticks=200,
        bound=0.02,
        why="nothing",
    ),
    "again within the tail": Kind(
        lambda k, was: max(0, was - RATE * k) if k < 20 else min(0.4, RATE * (k - 20)),
        release,
        before=30,
        ticks=200,
        bound=0.9,
        why="tail, distance",
    ),
    "reversed, output stays": Kind(held, turned, before=40, ticks=200, bound=1.6, why="distance"),
    "reversed, jump": Kind(
        lambda k, was: -0.5, turned, before=40, ticks=5, bound=0.02, why="through zero"
    ),
}


@pytest.mark.parametrize("name", NAMES)
@pytest.mark.parametrize("what", KINDS)
def test_goes_no_farther(what: str, name: str) -> None:
    goes_no_farther(name, KINDS[what])
