"""One pump for all axes: how the oil is shared where it does not last."""

import math
from collections.abc import Mapping
from dataclasses import replace

import pytest

from canshaper.errors import DesignError
from canshaper_sim.axes import LIFT, NEAR_FAR, SLEW
from canshaper_sim.crane import Crane, CraneParameters
from canshaper_sim.parameters import changed_parameters

FULL = {SLEW: 1.0, NEAR_FAR: 1.0, LIFT: 0.0}
ROOM = ("radius_max_m=30", "slew.deadband=0", "near_far.deadband=0", "lift.deadband=0")


def crane(*changes: str) -> Crane:
    return Crane(changed_parameters([*ROOM, *changes]))


def openings(of: Crane, commands: Mapping[str, float], seconds: float = 3.0) -> list[float]:
    for _ in range(round(seconds / 0.02)):
        of.step(0.02, commands)
    return [of.opening(axis) for axis in (SLEW, NEAR_FAR, LIFT)]


def test_enough_oil_changes_nothing() -> None:
    one, other = crane(), crane("pump_flow=2.5")
    for tick in range(400):
        commands = {SLEW: math.sin(tick / 20.0), NEAR_FAR: math.cos(tick / 31.0), LIFT: 0.3}
        one.step(0.02, commands)
        other.step(0.02, commands)
        assert one.state == other.state


@pytest.mark.parametrize("sign", [1.0, -1.0])
def test_valves_that_share_the_flow_get_the_same_part_of_what_they_ask_for(sign: float) -> None:
    got = openings(crane("pump_flow=1.2"), {SLEW: sign, NEAR_FAR: 0.5 * sign, LIFT: 0.0})
    assert got == pytest.approx([0.8 * sign, 0.4 * sign, 0.0], abs=1e-6)
    assert openings(crane("pump_flow=1.2"), {**FULL, LIFT: 1.0}) == pytest.approx([0.4] * 3)


def test_one_axis_alone_has_its_full_speed() -> None:
    assert openings(crane("pump_flow=1"), {SLEW: 1.0, NEAR_FAR: 0.0}) == pytest.approx([1, 0, 0])


def test_plain_load_sensing_starves_the_heaviest_load_first() -> None:
    plain = ("pump_flow=1.2", "pump.shares_flow=0")
    assert openings(crane(*plain), FULL) == pytest.approx([0.2, 1.0, 0.0])
    assert openings(crane(*plain), {**FULL, LIFT: 1.0}) == pytest.approx([0.0, 1.0, 0.2])
    lighter = crane(*plain, "pump.slew_load=0.1")
    assert openings(lighter, FULL) == pytest.approx([1.0, 0.2, 0.0])


def test_an_axis_gets_its_oil_back_when_another_one_stops() -> None:
    both = crane("pump_flow=1.2")
    assert openings(both, FULL)[0] == pytest.approx(0.6)
    assert openings(both, {**FULL, NEAR_FAR: 0.0}) == pytest.approx([1.0, 0.0, 0.0], abs=1e-6)


def test_a_pump_with_a_lag_delivers_later() -> None:
    slow, quick = (
        openings(crane("pump_flow=3", f"pump.lag_s={lag_s}"), FULL, seconds=0.3)[0]
        for lag_s in (0.3, 0.0)
    )
    assert 0.2 < slow < quick - 0.2
    assert openings(crane("pump_flow=3", "pump.lag_s=0.3"), FULL)[0] == pytest.approx(1.0, abs=1e-3)


@pytest.mark.parametrize("flow", [0.0, -1.0, math.nan])
def test_a_pump_that_delivers_nothing_is_refused(flow: float) -> None:
    with pytest.raises(DesignError, match=r"crane: pump_flow: expected 0\.1 \.\. inf"):
        replace(CraneParameters(), pump_flow=flow)


def test_a_part_of_sharing_is_refused() -> None:
    with pytest.raises(DesignError, match=r"pump: shares_flow: expected 0 or 1, got 0.3"):
        crane("pump.shares_flow=0.3")
