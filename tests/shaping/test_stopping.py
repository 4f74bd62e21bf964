"""How far an axis travels when it stops: by letting it run, and by what its limits allow."""

from dataclasses import asdict
from typing import Any

import pytest
from hypothesis import given
from hypothesis import strategies as st

from canshaper.commissioning.stopping import Travel, travel
from canshaper.machine.stop_distance import allowed_s
from canshaper.shaping.axis import ShapedAxis
from canshaper.shaping.limits import OutputLimits, ValveCurve
from canshaper.shaping.registry import build_shaper
from canshaper.shaping.sway import SwayMode, SwayModel

MODE = SwayMode(2.7, 0.04)
FILTERS: list[tuple[str, dict[str, Any]]] = [
    ("off", {}),
    ("first_order", {"time_constant_s": 0.4}),
    ("first_order", {"time_constant_s": 5.0}),
    ("s_curve", {"rate_per_s": 0.4, "jerk_per_s2": 1.0}),
    ("gff", {"poles_rad_s": [-3.0, -2.5]}),
    ("zv", {}),
    ("zvd", {}),
]


def axis_with(
    limits: OutputLimits,
    kind: str = "off",
    *,
    period_s: float = 0.02,
    stop_s: float = 2.0,
    **p: Any,
) -> ShapedAxis:
    sway = SwayModel(MODE, period_s)
    shaper = build_shaper(kind, period_s, sway, **p)
    return ShapedAxis(period_s, limits, sway=sway, shaper=shaper, stop_s=stop_s, grid_steps=1000)


def test_without_a_filter_it_is_the_fall_and_the_wait() -> None:
    limits = OutputLimits(fall_per_s=2.0)
    got = travel(lambda: axis_with(limits), timeout_s=0.1, period_s=0.02)
    falling = sum(1.0 - 0.04 * n for n in range(1, 25)) * 0.02  # 0.24 s of full speed
    assert got.release == pytest.approx(0.02 + falling)
    assert got.reversal == pytest.approx(0.02 + falling, abs=1e-3)  # the last tick goes back
    assert got.lost == pytest.approx(0.12 + falling)
    assert got.enable == pytest.approx(0.02)


def test_a_filter_travels_on_as_long_as_it_lags() -> None:
    """A lag of the first order travels its time constant; the tail ends what takes longer."""

    def release(tail_s: float) -> float:
        limits = OutputLimits(tail_s=tail_s, rise_per_s=100.0, fall_per_s=100.0)
        return travel(
            lambda: axis_with(limits, "first_order", time_constant_s=0.4),
            timeout_s=0.1,
            period_s=0.02,
        ).release

    assert release(4.0) == pytest.approx(0.4, abs=0.025)
    assert release(0.2) == pytest.approx(0.4 * (1 - 2.718**-0.5), abs=0.025)


def test_a_stop_is_ended_by_stop_s() -> None:
    limits = OutputLimits(tail_s=4.0)
    got = travel(
        lambda: axis_with(limits, "first_order", stop_s=0.3, time_constant_s=5.0),
        timeout_s=0.2,
        period_s=0.02,
    )
    assert 0.4 < got.lost < 0.52
    assert got.release > 2.0


def test_of_a_valve_that_is_slower_one_way_the_other_way_counts() -> None:
    curve = ValveCurve([-1.0, -0.05, 0.05, 1.0], [-1.0, 0.0, 0.0, 0.5])
    got = travel(lambda: axis_with(OutputLimits(curve=curve)), timeout_s=0.1, period_s=0.02)
    assert got.enable == pytest.approx(0.02)
    assert got.release == pytest.approx(0.02 + 0.09, abs=1e-3)


def test_allowed_is_a_whole_tail_at_full_speed_and_the_fall() -> None:
    limits = OutputLimits(maximum=0.5, tail_s=2.0, fall_per_s=1.0)
    # Half a period is what rounding to ticks may add.
    got = allowed_s(limits, stop_s=0.1, timeout_s=0.1, period_s=0.02)
    assert got == pytest.approx(0.5 * (0.02 + 2.01) + 0.125)


def test_allowed_is_a_stop_that_begins_when_the_loss_is_known() -> None:
    limits = OutputLimits(tail_s=0.5, fall_per_s=1.0)

    def allowed(stop_s: float) -> float:
        return allowed_s(limits, stop_s=stop_s, timeout_s=0.4, period_s=0.02)

    assert allowed(5.0) == pytest.approx(0.42 + 0.51 + 0.5)  # tail and fall end it
    assert allowed(1.0) == pytest.approx(0.42 + 0.51 + 0.5 - 0.5 * 0.5**2)  # the fall is cut off
    # So short a stop goes less far than a release.
    assert allowed(0.2) == pytest.approx(0.02 + 0.51 + 0.5)


def test_allowed_is_shorter_the_quicker_it_falls() -> None:
    """From 0.8 at 2 per s: straight down to zero in 0.4 s, or to 0.2 in 0.3 s."""
    limits = OutputLimits(maximum=0.8, tail_s=0.5, fall_per_s=2.0)

    def allowed(stop_s: float, timeout_s: float) -> float:
        return allowed_s(limits, stop_s=stop_s, timeout_s=timeout_s, period_s=0.02)

    assert allowed(0.1, 0.1) == pytest.approx(0.8 * (0.02 + 0.51) + 0.4 * 0.8 / 2.0)
    assert allowed(0.8, 0.4) == pytest.approx(0.8 * (0.42 + 0.51) + 0.3 * (0.8 + 0.2) / 2.0)
    assert allowed(5.0, 0.4) == pytest.approx(0.8 * (0.42 + 0.51) + 0.4 * 0.8 / 2.0)


@pytest.mark.slow
@given(
    limits=st.builds(
        OutputLimits,
        maximum=st.floats(0.05, 1.0),
        rise_per_s=st.floats(0.2, 20.0),
        fall_per_s=st.floats(1.0, 20.0),
        deadband=st.sampled_from([0.0, 0.2]),
        tail_s=st.floats(0.0, 3.0),
        allow_faster=st.booleans(),
        allow_reverse=st.booleans(),
    ),
    chosen=st.sampled_from(FILTERS),
    stop_s=st.floats(0.1, 3.0),
    timeout_s=st.floats(0.04, 0.5),
    period_s=st.sampled_from([0.02, 0.05]),
)
def test_no_filter_travels_farther_than_the_limits_allow(
    limits: OutputLimits,
    chosen: tuple[str, dict[str, Any]],
    stop_s: float,
    timeout_s: float,
    period_s: float,
) -> None:
    kind, parameters = chosen
    got = travel(
        lambda: axis_with(limits, kind, period_s=period_s, stop_s=stop_s, **parameters),
        timeout_s=timeout_s,
        period_s=period_s,
    )
    allowed = allowed_s(limits, stop_s=stop_s, timeout_s=timeout_s, period_s=period_s)
    ways = asdict(got)
    if limits.allow_reverse:  # then a joystick that is held lets the filter go on the other way
        del ways["reversal"]
    del ways["reversal_s"]  # a time
    assert max(ways.values()) <= allowed + 1e-9


def test_the_worst_of_several() -> None:
    one, other = Travel(1.0, 0.2, 3.0, 0.4, 5.0), Travel(0.1, 2.0, 0.3, 4.0, 0.5)
    assert Travel.worst([one, other]) == Travel(1.0, 2.0, 3.0, 4.0, 5.0)
