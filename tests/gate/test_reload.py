"""The gate over a reload: a latch stays latched; good news has to come again."""

from dataclasses import replace
from pathlib import Path
from typing import Any

from canshaper.gate.build import record_of
from canshaper.gate.gate import Gate
from canshaper.gate.received import NEVER
from tests.faults import variants
from tests.gate.bench import Bench, bench


def reloaded(one: Bench, *reopened: str, **changed: Any) -> Bench:
    after = Bench(replace(one.deployment, **changed), "near_far")
    after.number, after.hand = one.number, one.hand
    after.sender = one.sender
    after.gate.carry_over(one.gate, frozenset(reopened))
    return after


def test_a_trip_and_a_second_sender() -> None:
    one = bench()
    one.ramp(60, near_far=1.0)
    assert one.sends(-60, near_far=1.0)
    one.gate.receive(one.gate.axes["lift"].of.valve, bytes(2), one.now_ns)
    after = reloaded(one)
    assert after.gate.axes["lift"].foreign_ns == one.now_ns
    after.rests(10)
    assert not after.restarts(10, near_far=0.5)
    after.rests(3, enable=False)
    after.rests()
    assert not after.sends(10, near_far=0.5)


def test_a_trip_that_no_tick_has_seen() -> None:
    one = bench()
    one.ramp(60, near_far=1.0)
    one.receive(one.joysticks(enable=False))
    after = reloaded(one)
    assert after.axis.hard == "enable"
    assert after.axis.joystick.pressed.released


def test_an_emergency_stop_that_is_held() -> None:
    deployment = variants.machine("protected")[1]
    one = Bench(deployment, "near_far")
    one.rests(10)
    stop = deployment.emergency_stop
    assert stop is not None
    assert stop.protection.check is not None
    pressed = stop.protection.check.protect(b"\1\1", 0)
    one.gate.receive(stop.key, pressed, one.now_ns)
    after = reloaded(one)
    assert after.axis.latches
    after.axis.hard, after.axis.latches = "", False  # as if a tick had seen it before
    after.gate.tick(after.now_ns, 0)
    assert after.axis.latched


def test_counters_go_on() -> None:
    one = bench()
    one.rests(5)
    count = one.gate.valves[one.key].count
    after = reloaded(one)
    assert after.gate.valves[one.key].count == count
    assert after.axis.joystick.received.count == one.axis.joystick.received.count
    assert after.axis.joystick.received.good_ns is None
    assert after.axis.joystick.received.intact_ns >= 0
    after = reloaded(one, "crane")
    assert after.axis.joystick.received.intact_ns == NEVER


def test_of_another_machine_nothing_is_carried_over(tmp_path: Path) -> None:
    one = bench()
    one.ramp(60, near_far=1.0)
    assert one.sends(-60, near_far=1.0)
    buses = {"crane": one.deployment.config.buses["crane"].model_copy(update={"channel": "x"})}
    config = one.deployment.config.model_copy(update={"buses": buses})
    after = reloaded(one, config=config)
    assert all(valve.count is None for valve in after.gate.valves.values())
    assert after.axis.joystick.received.count is None
    assert after.axis.latched  # an axis is known by its name too


def test_another_protection_begins_anew() -> None:
    one = bench()
    one.rests(5)
    message = one.gate.messages["left"]
    message.of = replace(message.of, protection=replace(message.of.protection, counts=16))
    valve = one.gate.valves[one.key]
    valve.of = replace(valve.of, protection=replace(valve.of.protection, counts=16))
    after = reloaded(one)
    assert after.gate.messages["left"].count is None
    assert after.gate.valves[one.key].count is None


def test_an_axis_of_another_name_is_known_by_its_valve() -> None:
    one = bench()
    one.ramp(60, near_far=1.0)
    assert one.sends(-60, near_far=1.0)
    near_far = replace(one.deployment.axes["near_far"], name="boom")
    axes = {"boom" if n == "near_far" else n: axis for n, axis in one.deployment.axes.items()}
    after = Gate(record_of(replace(one.deployment, axes=axes | {"boom": near_far})))
    after.carry_over(one.gate, frozenset())
    assert [name for name, axis in after.axes.items() if axis.latched] == ["boom"]
