"""Sway sensors of a deployment against the swing and the filters of their axes."""

import pytest

from tests.machine.test_sway_sensor_binding import ALONG, INCLINED, changed, sensing
from tests.rigs.files import Machine


def test_an_axis_without_sway(machine: Machine) -> None:
    filters = "    filter: { kind: off }"
    line = machine.in_yaml(filters, f"    sway_sensor: {{ {ALONG} }}\n{filters}")
    assert machine.problems() == [
        f"machine.yaml:{line}: axes.lift.sway_sensor: expected an axis with sway, got 'lift'"
        " without"
    ]


def test_a_filter_that_feeds_nothing_back(machine: Machine) -> None:
    line = sensing(machine, f"{ALONG}, use: damp")
    machine.in_yaml(
        "filter: { kind: gff, a1: 0.708, a2: 0.12 } # near-far",
        "filter: { kind: zv }\n    profiles: { calm: { filter: { kind: zvd } } } # near-far",
    )
    starts = f"machine.yaml:{line}: axes.near_far.sway_sensor.use: expected watch with the filter"
    assert [p for p in machine.problems() if "sway_sensor" in p] == [
        f"{starts} {kind}: it does not feed the swing back" for kind in ("zv", "zvd")
    ]


def test_a_sensor_that_only_watches_goes_with_any_filter(machine: Machine) -> None:
    sensing(machine, ALONG)
    machine.in_yaml(
        "filter: { kind: gff, a1: 0.708, a2: 0.12 } # near-far", "filter: { kind: zv } # near-far"
    )
    assert machine.load().axes["near_far"].sway_sensor is not None


@pytest.mark.parametrize(
    ("period", "text"),
    [
        (2.5, f"{ALONG}, second_period_s: 1.25"),
        (2.5, f"{ALONG}, second_period_s: 1.2"),
        (2.0, f"{ALONG}, delay_ms: 500"),
        (2.5, f"{INCLINED}, fusion_s: 3.75"),
    ],
)
def test_the_bounds_of_a_swing_are_in_its_range(machine: Machine, period: float, text: str) -> None:
    swing = f"period_s: {period}, damping_ratio: 0"
    machine.in_yaml("length_m: 1.2, damping_nms: 120, mass_kg: 300", swing)
    machine.in_dbc('"GenMsgCycleTime" BO_ 1024 20;', '"GenMsgCycleTime" BO_ 1024 200;')
    sensing(machine, text.replace("timeout_ms: 80", "timeout_ms: 900"), f"    sway: {{ {swing}")
    assert machine.load().axes["near_far"].sway_sensor is not None


@pytest.mark.parametrize(
    ("cycle", "keys", "length", "says"),
    [
        (
            400,
            "timeout_ms: 900, delay_ms: 500",
            1.2,
            "message: expected 6 messages or more in a swing of 2200 ms, got one in 400 ms",
        ),
        (
            200,
            "timeout_ms: 900, second_period_s: 0.7",
            1.2,
            "message: expected 6 messages or more in a swing of 700 ms, got one in 200 ms",
        ),
        (
            20,
            "timeout_ms: 80, delay_ms: 450",
            0.6,
            "delay_ms: expected up to 392 ms, a quarter of a swing, got 450 ms",
        ),
    ],
)
def test_too_few_or_too_old_messages_for_a_swing(
    machine: Machine, cycle: int, keys: str, length: float, says: str
) -> None:
    machine.in_dbc('"GenMsgCycleTime" BO_ 1024 20;', f'"GenMsgCycleTime" BO_ 1024 {cycle};')
    line = sensing(machine, changed("timeout_ms: 80", keys))
    machine.in_yaml("length_m: 1.2", f"length_m: {length}")
    assert machine.problems() == [f"machine.yaml:{line}: axes.near_far.sway_sensor.{says}"]


def test_a_time_constant_a_little_too_short(machine: Machine) -> None:
    swing = "period_s: 2.0, damping_ratio: 0"
    machine.in_yaml("length_m: 1.2, damping_nms: 120, mass_kg: 300", swing)
    line = sensing(machine, f"{INCLINED}, fusion_s: 2.999", f"    sway: {{ {swing}")
    assert machine.problems() == [
        f"machine.yaml:{line}: axes.near_far.sway_sensor.fusion_s: expected 3.0 s or more, 1.5"
        " swings, got 2.999 s"
    ]
