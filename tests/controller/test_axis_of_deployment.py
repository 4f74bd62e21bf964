"""Values of a deployment reach the axis: tick, neutral band, grid, filter, limits."""

from typing import Any

import pytest

from canshaper.shaping.axis import ShapedAxis
from canshaper.shaping.shapers.fir import Fir
from canshaper.shaping.shapers.limit_aware import LimitAware
from canshaper.shaping.shapers.smoothing import FirstOrder
from canshaper.shaping.states import CommandInput, State
from canshaper.shaping.sway import SwayModel
from tests.rigs.forwarder import Make, Rig

FILTER = "    filter: { kind: gff, a1: 0.708, a2: 0.12 }\n"
LIMITS = "limits: { deadband_pct: 5, rise_per_s: 5, fall_per_s: 5, tail_s: 2.0, stop_s: 2.0"
SLEW = "BO_ 512 SlewCommand: 2 SHAPER\n SG_ Velocity : 0|8@1- (0.8,0)"


@pytest.mark.parametrize("cycle_ms", [20, 60])
def test_the_model_of_an_axis_has_the_cycle_of_its_valve(changed_rig: Make, cycle_ms: int) -> None:
    rig = changed_rig(dbc={"BO_ 512 20;": f"BO_ 512 {cycle_ms};"})
    sway = rig.controller.axes["slew"].axis.sway
    assert sway is not None
    assert sway.tick_s == cycle_ms / 1000.0


def test_the_neutral_band_is_that_of_the_joystick(changed_rig: Make) -> None:
    rig = changed_rig({"signal: Slew, neutral_pct: 2": "signal: Slew, neutral_pct: 5"})
    rig.run(10, Slew=50)
    assert rig.state() is State.READY
    rig.run(1, Slew=51)
    assert rig.state() is State.ACTIVE


def test_the_grid_is_that_of_the_valve(changed_rig: Make) -> None:
    rig = changed_rig(dbc={SLEW: SLEW.replace("0.8", "1")})
    rig.run(3, AntiSwayOff=1)
    assert rig.run(50, Slew=1000, AntiSwayOff=1)["SlewCommand"]["Velocity"] == 100


def sent(rig: Rig, axis: ShapedAxis) -> tuple[list[float], list[float]]:
    """Setpoints of slew, and of an axis made by hand, through a stroke of two seconds."""
    got, expected = [], []
    for tick in range(200):
        joystick = 1000 if 3 <= tick < 100 else 0
        rig.run(1, Slew=joystick)
        axis.tick(CommandInput(joystick / 1000.0))
        got.append(rig.controller.axes["slew"].axis.output.setpoint)
        expected.append(axis.output.setpoint)
    return got, expected


def by_hand(rig: Rig, sway: SwayModel | None, shaper: Any) -> ShapedAxis:
    config = rig.deployment.axes["slew"].config
    return ShapedAxis(0.02, config.limits.output_limits(), sway=sway, shaper=shaper)


def test_a_filter_that_needs_the_tick_has_it(changed_rig: Make) -> None:
    rig = changed_rig({FILTER: "    filter: { kind: first_order, time_constant_s: 0.3 }\n"})
    got, expected = sent(rig, by_hand(rig, None, FirstOrder(0.02, time_constant_s=0.3)))
    assert got == expected
    assert max(got) > 0.9


@pytest.mark.parametrize(("rise", "fall"), [(1.0, 3.0), (3.0, 1.0)])
def test_a_filter_that_feeds_back_knows_the_slower_rate_of_the_valve(
    changed_rig: Make, rise: float, fall: float
) -> None:
    rates = LIMITS.replace(
        "rise_per_s: 5, fall_per_s: 5", f"rise_per_s: {rise}, fall_per_s: {fall}"
    )
    robust = "    filter: { kind: robust, tick_ms: 20, taps: [0.5, 0.5] }\n"
    rig = changed_rig({FILTER: robust, LIMITS: rates})
    mode = rig.deployment.axes["slew"].config.sway
    assert mode is not None
    sway = SwayModel(mode.mode(), 0.02)
    got, expected = sent(rig, by_hand(rig, sway, LimitAware(sway, Fir([0.5, 0.5]), 1.0)))
    assert got == expected
    assert max(got) > 0.5


@pytest.mark.parametrize(("cycle_ms", "sent"), [(20, [True] * 6), (40, [True, False] * 3)])
def test_its_status_is_as_frequent_as_its_message(
    changed_rig: Make, cycle_ms: int, sent: list[bool]
) -> None:
    cycle = 'BA_ "GenMsgCycleTime" BO_ 770 '
    rig = changed_rig(dbc={f"{cycle}100;": f"{cycle}{cycle_ms};"})
    assert ["LiftStatus" in rig.tick() for _ in range(6)] == sent


def test_an_axis_without_sway_reports_none(changed_rig: Make) -> None:
    rig = changed_rig()
    for tick in range(20):
        status = rig.run(1, Lift=1000 if tick > 2 else 0).get("LiftStatus")
        assert status is None or status["PredictedSway"] == 0.0
    assert rig.state("lift") is State.ACTIVE


def test_an_axis_takes_its_joystick_from_where_it_is_connected(rig: Rig) -> None:
    class Elsewhere:
        deflection = 0.0

        def command(self, *_arguments: object) -> tuple[CommandInput, int]:
            return CommandInput(self.deflection), 0

    source = Elsewhere()
    rig.controller.axes["slew"].isolate(source)
    rig.run(3)
    source.deflection = 0.5
    sent = rig.run(120)  # the real joystick stands in neutral
    assert sent["SlewCommand"]["Velocity"] > 40
    assert sent["NearFarCommand"]["Velocity"] == 0
