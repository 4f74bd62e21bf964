"""The flow budget: one factor for all demands, down at once, up slowly."""

import pytest
from hypothesis import given
from hypothesis import strategies as st

from canshaper.shaping.demand_bounds import FlowBudget

TICK_S = 0.02
STILL = [0.0, 0.0, 0.0]
velocities = st.floats(-1.0, 1.0)


FLOW = 1.2


def budget() -> FlowBudget:
    return FlowBudget((1.0, 1.0, 0.5), TICK_S)


def test_what_there_is_oil_for_is_not_scaled() -> None:
    one = budget()
    assert one.step(FLOW, [0.7, -0.5, 0.0], STILL) == 1.0
    assert one.step(FLOW, [0.5, 0.5, -0.4], STILL) == 1.0
    assert one.step(FLOW, STILL, [0.9, 0.9, 0.9]) == 1.0  # asked for nothing


def test_it_is_scaled_at_once_to_what_there_is_by_the_share_of_each() -> None:
    assert budget().step(FLOW, [1.0, -1.0, 0.0], STILL) == pytest.approx(0.6)
    assert budget().step(FLOW, [1.0, 1.0, 1.0], STILL) == pytest.approx(1.2 / 2.5)


def test_it_comes_back_within_half_a_second() -> None:
    one = budget()
    one.step(FLOW, [1.0, 1.0, 0.0], STILL)
    scales = [one.step(FLOW, [1.0, 0.0, 0.0], STILL) for _ in range(25)]
    assert scales[0] == pytest.approx(0.64)
    assert scales[8:11] == pytest.approx([0.96, 1.0, 1.0])


def test_missed_ticks_count_as_time() -> None:
    one, other = budget(), budget()
    for each in (one, other):
        each.step(FLOW, [1.0, 1.0, 0.0], STILL)
    for _ in range(4):
        one.step(FLOW, [1.0, 0.0, 0.0], STILL)
    assert other.step(FLOW, [1.0, 0.0, 0.0], STILL, 4) == pytest.approx(one.scale)


@pytest.mark.parametrize("demand", [0.0, -0.2])
def test_an_axis_that_runs_on_still_takes_its_oil(demand: float) -> None:
    """Also one that was reversed: its filter lets the old direction end first."""
    scale = budget().step(FLOW, [1.0, demand, 0.0], [0.6, 0.6, 0.0])
    assert scale == pytest.approx((1.2 - 0.6) / (1.0 + abs(demand)))


def test_where_others_take_all_of_it_nothing_is_left() -> None:
    assert budget().step(0.5, [1.0, 0.0, 0.0], [0.0, 1.0, 0.0]) == 0.0


@given(st.lists(st.tuples(*[velocities] * 6), max_size=60), st.floats(0.1, 3.0))
def test_never_faster_than_asked_and_never_more_than_there_is(
    history: list[tuple[float, ...]], flow: float
) -> None:
    one, before = budget(), 1.0
    for values in history:
        demands, outputs = values[:3], values[3:]
        scale = one.step(flow, demands, outputs)
        assert 0.0 <= scale <= min(1.0, before + TICK_S / 0.5 + 1e-12)
        asked = sum(s * abs(d) for s, d in zip((1.0, 1.0, 0.5), demands, strict=True))
        assert scale * asked <= flow + 1e-9
        before = scale
