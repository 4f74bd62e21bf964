"""Frames of a sway sensor: which of them measure, and when a value is new."""

import math
from dataclasses import replace

import pytest

from canshaper.codec.frame import FrameFault
from canshaper.inputs.sway_sensor import SwaySensorInput, SwaySignal
from canshaper.machine.binding import load_deployment
from tests.rigs.files import ROOT

FILE = ROOT / "config" / "forwarder-sensor.yaml"


def test_a_frame_that_does_not_count_is_no_measurement() -> None:
    sensor = load_deployment(FILE).axes["near_far"].sway_sensor
    assert sensor is not None
    message = SwaySensorInput(sensor.message)
    signal = SwaySignal(message, sensor)
    message.on_frame({"Across": 0, "Along": 100}, 0, accepted=False)
    assert signal.new_value() is None
    message.on_frame({"Across": 0, "Along": 100}, 0, accepted=True)
    assert signal.new_value() == pytest.approx(math.radians(1.0))
    assert signal.new_value() is None
    assert SwaySignal(message, sensor).new_value() is None  # it came before


def test_after_a_standstill_nothing_is_known_of_it() -> None:
    sensor = load_deployment(FILE).axes["near_far"].sway_sensor
    assert sensor is not None
    message = SwaySensorInput(sensor.message)
    message.invalidate()  # before the first frame too
    assert message.receive(bytes(sensor.message.message.length), 1) is FrameFault.NONE
    assert message.received_ns == 1
    message.invalidate()
    assert message.received_ns is None
    assert not message.values


@pytest.mark.parametrize(("merit", "counts"), [(0, True), (1, False), (2, False), (3, False)])
def test_only_a_good_figure_of_merit_measures(merit: int, counts: bool) -> None:
    """Of SSI2: that of the roll angle says nothing of the pitch angle in the same frame."""
    deployment = load_deployment(ROOT / "config" / "j1939-sensor.yaml")
    sensors = [deployment.axes[name].sway_sensor for name in ("slew", "near_far")]
    roll, pitch = (one for one in sensors if one is not None)
    message = SwaySensorInput(roll.message)
    across, along = SwaySignal(message, roll), SwaySignal(message, pitch)
    middle = 250 * (1 << 15)  # no angle
    raw = {"RollAngle": middle, "PitchAngle": middle, "RollMerit": merit, "PitchMerit": 0}
    fault = message.on_frame(raw, 0, accepted=True)
    assert fault is (FrameFault.NONE if counts else FrameFault.INVALID_SIGNAL)
    assert (across.new_value() is not None) == counts
    assert along.new_value() == pytest.approx(0.0)


@pytest.mark.parametrize(
    ("turns", "counts"), [(0.9, True), (1.1, False), (-1.1, False), (1e30, False)]
)
def test_more_than_a_turn_is_no_measurement(turns: float, counts: bool) -> None:
    sensor = load_deployment(FILE).axes["near_far"].sway_sensor
    assert sensor is not None
    message = SwaySensorInput(sensor.message)
    signal = SwaySignal(message, replace(sensor, factor=math.tau * turns))
    message.on_frame({"Across": 0, "Along": 100}, 0, accepted=True)  # 1 in its unit
    assert (signal.new_value() is not None) == counts
