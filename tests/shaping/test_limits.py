import math

import pytest
from hypothesis import given
from hypothesis import strategies as st

from canshaper.config.limits import Limits
from canshaper.shaping.limits import (
    OutputLimits,
    RecentDemand,
    allowed_range,
    on_grid,
    rate_limited,
    with_deadband,
    within,
    without_deadband,
)

velocities = st.floats(-1.0, 1.0)
rates = st.floats(1e-3, 2.0)
deadbands = st.floats(0.0, 0.5)
grids = st.integers(10, 1000)


# -- rise and fall ---------------------------------------------------------------------------------


@pytest.mark.parametrize(
    ("target", "last", "expected"),
    [
        (1.0, 0.0, 0.2),  # away from zero: rise
        (1.0, 0.5, 0.7),
        (0.6, 0.5, 0.6),  # within reach
        (0.0, 0.5, 0.1),  # towards zero: fall
        (0.0, 0.3, 0.0),
        (0.4, 0.5, 0.4),
        (-1.0, 0.5, 0.1),  # a reversal falls first
        (-1.0, 0.4, 0.0),  # the whole tick goes into the way to zero
        (-1.0, 0.1, -0.15),  # a quarter of the tick for that, three quarters of a rise
        (-0.1, 0.1, -0.1),
        (-1.0, 0.0, -0.2),
        (0.0, 0.0, 0.0),
    ],
)
def test_rise_and_fall_are_separate(target: float, last: float, expected: float) -> None:
    assert rate_limited(target, last, 0.2, 0.4) == pytest.approx(expected, abs=1e-15)
    assert rate_limited(-target, -last, 0.2, 0.4) == pytest.approx(-expected, abs=1e-15)


@given(velocities, velocities, rates, rates)
def test_a_tick_is_spent_at_most_once(target: float, last: float, rise: float, fall: float) -> None:
    got = rate_limited(target, last, rise, fall)
    assert min(target, last) <= got <= max(target, last)
    # time the change takes, in ticks: way towards zero at fall, away from zero at rise
    if last * got >= 0.0:
        step = abs(got) - abs(last)
        spent = step / rise if step > 0.0 else -step / fall
    else:
        spent = abs(last) / fall + abs(got) / rise
    assert spent <= 1.0 + 1e-9
    if got != target:
        assert spent == pytest.approx(1.0)  # and none of it is wasted


# -- what the operator allows ----------------------------------------------------------------------

DEFAULT = OutputLimits()
FASTER = OutputLimits(allow_faster=True)
REVERSE = OutputLimits(allow_reverse=True)
BOTH = OutputLimits(allow_faster=True, allow_reverse=True)


@pytest.mark.parametrize(
    ("limits", "recent", "expected"),
    [
        (DEFAULT, (0.0, 0.0), (0.0, 0.0)),
        (DEFAULT, (0.0, 0.5), (0.0, 0.5)),
        (DEFAULT, (0.0, 0.8), (0.0, 0.8)),  # as fast as asked within the tail
        (DEFAULT, (-0.3, 0.8), (-0.3, 0.8)),
        (FASTER, (0.0, 0.2), (0.0, 1.0)),
        (FASTER, (-0.3, 0.2), (-1.0, 1.0)),
        (FASTER, (-0.3, 0.0), (-1.0, 0.0)),
        (FASTER, (0.0, 0.0), (0.0, 0.0)),  # nothing asked: nothing moves
        (REVERSE, (0.0, 0.5), (-0.5, 0.5)),
        (REVERSE, (-0.3, 0.8), (-0.8, 0.8)),
        (REVERSE, (0.0, 0.0), (0.0, 0.0)),
        (BOTH, (0.0, 0.1), (-1.0, 1.0)),
        (BOTH, (0.0, 0.0), (0.0, 0.0)),
        (OutputLimits(maximum=0.4), (0.0, 0.9), (0.0, 0.4)),
        (OutputLimits(maximum=0.4, allow_faster=True), (-0.1, 0.0), (-0.4, 0.0)),
        (OutputLimits(maximum=0.4, allow_reverse=True), (-0.9, 0.0), (-0.4, 0.4)),
    ],
)
def test_allowed_range(
    limits: OutputLimits,
    recent: tuple[float, float],
    expected: tuple[float, float],
) -> None:
    assert allowed_range(*recent, limits) == expected


# -- minimum and non-numbers -----------------------------------------------------------------------


@pytest.mark.parametrize(
    ("velocity", "minimum", "expected"),
    [
        (0.4, 0.0, 0.4),
        (2.0, 0.0, 0.8),
        (-2.0, 0.0, -0.2),
        (1e308, 0.0, 0.8),
        (0.09, 0.1, 0.0),
        (0.1, 0.1, 0.1),
        (-0.09, 0.1, 0.0),
        (-0.15, 0.1, -0.15),
        (-0.5, 0.3, 0.0),  # what the range leaves is below the minimum
    ],
)
def test_within(velocity: float, minimum: float, expected: float) -> None:
    assert within(velocity, -0.2, 0.8, minimum) == expected


@pytest.mark.parametrize("bad", [math.nan, math.inf, -math.inf])
def test_what_is_no_number_never_passes(bad: float) -> None:
    with pytest.raises(ValueError, match=f"^velocity is {bad}$"):
        within(bad, -1.0, 1.0, 0.0)


# -- deadband and grid -----------------------------------------------------------------------------


@given(velocities, deadbands)
def test_deadband_and_its_inverse(velocity: float, deadband: float) -> None:
    command = with_deadband(velocity, deadband)
    assert abs(command) <= 1.0
    assert without_deadband(command, deadband) == pytest.approx(velocity, abs=1e-15)
    if velocity:
        assert abs(command) >= deadband
        assert math.copysign(1.0, command) == math.copysign(1.0, velocity)


@pytest.mark.parametrize("deadband", [0.0, 0.05, 0.5])
def test_the_ends_of_the_deadband(deadband: float) -> None:
    assert with_deadband(0.0, deadband) == 0.0
    assert with_deadband(1.0, deadband) == 1.0
    assert with_deadband(-1.0, deadband) == -1.0
    assert without_deadband(1.0, deadband) == 1.0
    for inside in (0.0, 0.5 * deadband, deadband, -0.5 * deadband, -deadband):
        assert without_deadband(inside, deadband) == 0.0


@given(velocities, velocities, velocities, deadbands, grids)
def test_rounding_never_passes_the_bounds(
    velocity: float, one: float, other: float, deadband: float, steps: int
) -> None:
    low, high = min(one, velocity, 0.0), max(other, velocity, 0.0)
    raw, sent = on_grid(velocity, low, high, deadband, steps)
    assert abs(raw) <= steps
    assert low <= sent <= high
    assert sent == without_deadband(raw / steps, deadband)  # the exact inverse of what is sent
    assert raw * velocity >= 0
    # half a step to the nearest, another one where the nearest passes a bound
    step = 1.0 / (steps * (1.0 - deadband))
    assert abs(sent - velocity) <= step + 1e-12
    if low <= velocity - 0.5 * step and velocity + 0.5 * step <= high:
        assert abs(sent - velocity) <= 0.5 * step + 1e-12


@given(deadbands, grids)
def test_every_step_of_the_frame_is_its_own_image(deadband: float, steps: int) -> None:
    for raw in range(-steps, steps + 1):
        sent = without_deadband(raw / steps, deadband)
        # a step inside the deadband moves nothing; then the frame carries a clean zero
        assert on_grid(sent, -1.0, 1.0, deadband, steps) == ((raw, sent) if sent else (0, 0.0))


@pytest.mark.parametrize(
    ("velocity", "low", "high", "deadband", "expected"),
    [
        (0.26, 0.0, 1.0, 0.0, (3, 0.3)),
        (0.26, 0.0, 0.26, 0.0, (2, 0.2)),
        (-0.26, -0.26, 0.0, 0.0, (-2, -0.2)),
        (0.04, 0.0, 1.0, 0.0, (0, 0.0)),
        (-0.04, -1.0, 0.0, 0.0, (0, 0.0)),
        (0.0, 0.0, 0.0, 0.3, (0, 0.0)),
        (1.0, 0.0, 1.0, 0.3, (10, 1.0)),
        (1e-9, 0.0, 1.0, 0.3, (0, 0.0)),  # step 3 is the deadband itself
        (1e-9, 0.0, 1e-9, 0.36, (0, 0.0)),  # step 4 would open the valve further than allowed
    ],
)
def test_rounding_to_ten_steps(
    velocity: float, low: float, high: float, deadband: float, expected: tuple[int, float]
) -> None:
    raw, sent = on_grid(velocity, low, high, deadband, 10)
    assert (raw, pytest.approx(sent)) == expected


# -- recent commands -------------------------------------------------------------------------------


def test_before_the_first_command_nothing_was_asked() -> None:
    recent = RecentDemand(5)
    assert (recent.low, recent.high) == (0.0, 0.0)
    recent.age(3)
    assert (recent.low, recent.high) == (0.0, 0.0)


events = st.lists(
    st.one_of(velocities, st.sampled_from([0.0, 0.5, -0.5]), st.sampled_from(["clear", 1, 4, 30])),
    max_size=60,
)


@given(events, st.integers(0, 12))
def test_recent_command_is_the_window_seen_by_brute_force(
    happenings: list[float | int | str], ticks: int
) -> None:
    recent = RecentDemand(ticks)
    seen: list[float | None] = []  # one entry per tick, None for one without a command
    for event in happenings:
        if event == "clear":
            recent.clear()
            seen = [None] * len(seen)
            assert (recent.low, recent.high) == (0.0, 0.0)
        elif isinstance(event, int):
            recent.age(event)
            seen += [None] * event
        elif isinstance(event, float):
            recent.add(event)
            seen.append(event)
            window = [c for c in seen[-ticks - 1 :] if c is not None]
            assert recent.high == max(0.0, *window)
            assert recent.low == min(0.0, *window)


def test_limits_where_nothing_is_said_are_those_of_a_deployment_that_says_nothing() -> None:
    assert OutputLimits() == Limits().output_limits()
