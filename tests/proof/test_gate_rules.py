"""Rules of the gate, proved for all numbers: of its own functions, on every path of them.

Numbers are exact reals where the gate has floats; what that differs by is far below EPSILON. Limits
are unknown too: what is proved holds for every file.
"""

from dataclasses import replace
from typing import Any

import pytest
import z3

from canshaper.gate import fields, rules
from canshaper.gate.axis import Asked
from canshaper.gate.build import record_of
from canshaper.gate.fields import EPSILON
from canshaper.gate.gate import Gate
from canshaper.gate.record import Protection
from canshaper.machine.binding import load_deployment
from tests.faults.shipped import CONFIG
from tests.proof.symbolic import (
    Paths,
    Unknown,
    both,
    either,
    implies,
    integer,
    most,
    no,
    real,
    size,
    truth,
    value,
)

pytestmark = pytest.mark.slow
LONGEST = 5  # periods


def gate(name: str) -> Gate:
    return Gate(record_of(load_deployment(CONFIG / f"{name}.yaml")))


class Demand:
    """Any demand in one direction, within the tail."""

    def __init__(self, name: str) -> None:
        self.most, self.before, self.remaining = real(f"{name}.most"), real(f"{name}.before"), 0.0

    def note(self, *_: object) -> None:
        """The induction takes any."""

    def forget(self) -> None:
        self.most = 0.0


class AnyState:
    """An axis in any state, of any file; what holds of its numbers is ``assumed``."""

    def __init__(self) -> None:
        axis = self.axis = gate("forwarder").axes["slew"]
        of = self.of = axis.of
        of.maximum, of.rise, of.fall, of.step = map(real, ("maximum", "rise", "fall", "step"))
        of.faster, of.reverse = map(truth, ("faster", "reverse"))
        of.added, of.slack, of.path, of.run_on = map(real, ("added", "slack", "path", "run_on"))
        of.stop, of.silent, of.reversal = map(integer, ("stop", "silent", "reversal"))
        of.stick = replace(of.stick, band=real("band"))
        axis.forth, axis.back = Demand("forth"), Demand("back")  # type: ignore[assignment]
        axis.now, axis.last, axis.top, axis.ran = map(real, ("now", "last", "top", "ran"))
        axis.high = real("high")
        axis.held = integer("held")
        axis.armed, axis.latched = truth("armed"), truth("latched")
        axis.asked, axis.stop_left = truth("asked"), integer("stop_left")
        self.velocity = real("velocity")
        sides = axis.forth, axis.back
        self.assumed = [
            *(one > 0.0 for one in (of.rise, of.fall, of.step)),
            *(both(one >= 0.0, one <= 1.0) for one in (of.maximum, of.added, of.stick.band)),
            *(both(one.most >= 0.0, one.before >= one.most, one.before <= 1.0) for one in sides),
            both(of.slack >= 0.0, of.path >= 0.0, axis.stop_left >= 0, of.stop >= 1),
            both(axis.now >= -1.0, axis.now <= 1.0),
            both(axis.top >= size(axis.last) - EPSILON, axis.top <= size(axis.last) + of.step),
            size(self.velocity) >= 2 * EPSILON,  # any command, see test_every_frame_of_a_valve
        ]

    def passes(self) -> bool:
        """Whether the velocity may leave."""
        axis = self.axis
        axis.least, axis.most = rules.bounds(axis)
        return not rules.velocity_refused(axis, self.velocity, 0)


def without(monkeypatch: pytest.MonkeyPatch, *names: str) -> None:
    """Without other rules, which only refuse more: what is proved holds with them."""
    for name in names:
        monkeypatch.setattr(rules, name, lambda *_: "")


def test_direction_and_size(monkeypatch: pytest.MonkeyPatch) -> None:
    """Rule 4: no faster than was asked in that direction, unless on its way back by the fall."""
    without(monkeypatch, "neutral_first", "rise", "fall", "distance")
    one = AnyState()
    axis, of, v = one.axis, one.of, one.velocity
    forth = v > 0.0

    def run() -> Any:
        if not one.passes():
            return True
        asked = Unknown(z3.If(value(forth), value(axis.forth.most), value(axis.back.most)))
        other = Unknown(z3.If(value(forth), value(axis.back.most), value(axis.forth.most)))
        before = Unknown(z3.If(value(forth), value(axis.forth.before), value(axis.back.before)))
        way_back = both(v * axis.last >= 0.0, size(v) <= axis.top - of.fall + EPSILON)
        within = size(v) <= of.maximum + EPSILON
        usual = no(either(of.faster, of.reverse, of.added > 0.0))
        held = either(both(forth, axis.now < 0.0), both(no(forth), axis.now > 0.0))
        free = either(of.reverse, axis.held < of.reversal)
        return both(
            either(way_back, within),
            implies(usual, either(way_back, size(v) <= asked + EPSILON)),
            implies(
                no(of.reverse),
                either(way_back, of.faster, size(v) <= most(asked, before, of.added) + EPSILON),
            ),
            implies(
                both(of.reverse, no(of.faster), of.added == 0.0),
                either(way_back, size(v) <= most(asked, other) + EPSILON),
            ),
            implies(both(held, no(free)), way_back),
        )

    paths = Paths(*one.assumed)
    paths.prove(run)
    assert paths.count > 50


def test_rise_and_fall(monkeypatch: pytest.MonkeyPatch) -> None:
    """Rules 5 and 6: by a rise, by a fall, and a step and a half; neutral is another matter."""
    without(monkeypatch, "neutral_first", "direction_and_size", "distance")
    one = AnyState()
    axis, of, v = one.axis, one.of, one.velocity

    def run() -> Any:
        if rules.velocity_refused(axis, v, 0):
            return True
        rounded, same = 1.5 * of.step + EPSILON, v * axis.last >= 0.0
        through = size(v) <= of.rise + rounded
        return both(
            implies(same, size(v) <= size(axis.last) + of.rise + rounded),
            implies(same, size(v) >= size(axis.last) - of.fall - rounded),
            implies(no(same), through),
            implies(no(same), size(axis.last) <= of.fall + rounded),
            implies(both(no(same), size(axis.last) > of.step), size(v) < of.rise + rounded),
        )

    Paths(*one.assumed).prove(run)


def test_neutral_first() -> None:
    """Rule 3, by induction over all histories: what moves was seen in neutral since it stopped."""
    one = AnyState()
    axis, of = one.axis, one.of
    seen, demand, there = truth("seen"), real("demand"), truth("there")
    stops, latches, press, cause = (
        truth("stops"),
        truth("latches"),
        integer("press"),
        integer("cause"),
    )
    passed, sent_at, at = integer("passed"), integer("sent_at"), integer("at")
    start = (axis.armed, axis.latched, axis.stop_left, axis.last, axis.top, axis.now)
    most_of = axis.forth.most, axis.back.most

    def run() -> Any:
        axis.armed, axis.latched, axis.stop_left, axis.last, axis.top, axis.now = start
        axis.forth.most, axis.back.most = most_of
        axis.sent_at, axis.cause, axis.hard, axis.ramp = sent_at, cause, "", None
        axis.joystick.pressed.press = press
        why = "enable" if stops else ""
        given = demand if there else None
        axis.look(why, given, 1000, 1000, passed, cause=at, latches=bool(latches))
        neutral = both(no(stops), there, size(demand) <= of.stick.band)
        pressed = press > cause
        now_seen = both(no(stops), either(seen, both(neutral, either(no(start[1]), pressed))))
        may = bool(axis.armed) or bool(axis.stop_left)
        may_move = not rules.neutral_first(axis)
        return both(
            may == may_move,
            implies(may, now_seen),
            implies(
                axis.now != 0.0, both(there, no(stops), size(demand) > of.stick.band, start[0])
            ),
            implies(
                both(stops, either(latches, start[3] != 0.0), sent_at >= 1000 - of.silent),
                axis.latched,
            ),
            # A latch ends by a press behind its cause alone, and not while a reason lasts.
            implies(both(start[1], no(both(no(stops), pressed))), axis.latched),
            # A shaped stop ends: it begins with stop_s, where the axis was armed, and shrinks.
            implies(no(start[0]), axis.stop_left <= most(start[2] - passed, 0)),
            axis.stop_left <= most(of.stop, start[2]),
        )

    held = implies(either(axis.armed, axis.stop_left > 0), seen)
    lasts = implies(axis.latched, no(axis.armed))
    Paths(*one.assumed, held, lasts, passed >= 1).prove(run)


@pytest.mark.parametrize("stop", [None, *range(LONGEST)])
@pytest.mark.parametrize("tail", [0, 1, 2])
def test_what_was_asked_is_forgotten_after_the_tail(tail: int, stop: int | None) -> None:
    """By a bounded model check: any demands in five periods, and a stop after one of them."""
    of = gate("forwarder").axes["slew"].of
    of.tail, of.period_s = tail, real("period_s")
    sizes = [real(f"size {n}") for n in range(LONGEST)]

    def run() -> Any:
        asked, claims = Asked(), []
        for n, one in enumerate(sizes):
            asked.note(one, one * of.period_s, n, of)
            counts = [other for k, other in enumerate(sizes[: n + 1]) if n - k <= tail]
            since = [other for k, other in enumerate(sizes[: n + 1])
                     if n - k <= tail and (stop is None or k > stop or n <= stop)]  # fmt: skip
            claims += [asked.before == most(0.0, *counts), asked.most == most(0.0, *since)]
            room = most(0.0, *since) * tail * of.period_s
            claims.append(both(asked.remaining >= 0.0, asked.remaining <= room))
            if n == stop:
                asked.forget()
                claims += [asked.most == 0.0, asked.remaining == 0.0]
        return both(*claims)

    Paths(*(both(one >= 0.0, one <= 1.0) for one in sizes), of.period_s > 0.0).prove(run)


def number(raw: Unknown) -> Unknown:
    """The integer of some bits: no command has more than 16, and a sign."""
    return Unknown(z3.BV2Int(z3.Extract(19, 0, raw.of), is_signed=True))


BY_BITS = (
    "forwarder",
    "canfd-forwarder",
    "remote-forwarder",
    "gateway-forwarder",
    "canopen-forwarder",
)


@pytest.mark.parametrize("name", BY_BITS)
def test_every_frame_of_a_valve(name: str, monkeypatch: pytest.MonkeyPatch) -> None:
    """All 2^n contents: no bit but a command's is another, and none is faster than full speed."""
    monkeypatch.setattr(fields, "int", number, raising=False)
    for valve in gate(name).valves.values():
        of, axes = valve.of, valve.axes
        bits = 8 * of.length
        little = z3.BitVec("frame", bits + 8)  # so that no sum of an 8-bit field overflows
        ordered = [z3.Extract(8 * n + 7, 8 * n, little) for n in range(of.length)]
        word = Unknown(little), Unknown(z3.Concat(z3.BitVecVal(0, 8), *ordered))
        words = tuple((f, tuple(v)) for f, v in of.words)
        valve.of = replace(of, protection=Protection(), words=words)

        def run(valve: Any = valve, axes: Any = axes, word: Any = word, bits: int = bits) -> Any:
            if rules.bytes_refused(valve, bytes(bits // 8), word, None):
                return True
            claims: list[Any] = [(word[0] & valve.of.fixed) == valve.of.fixed_value]
            for axis in axes:
                steps = axis.of.command.steps(word)
                if steps is not None:
                    velocity = axis.of.velocity(steps)
                    claims += [size(velocity) <= 1.0 + EPSILON]
                    claims += [either(velocity == 0.0, size(velocity) >= 2 * EPSILON)]
            return both(*claims)

        Paths(Unknown(z3.Extract(bits + 7, bits, little) == 0)).prove(run)
