"""What one axis may be sent at a moment, and what the log says where it may not.

Full command is 125 steps without a dead band here, a step 0.008 of full speed. A command may be
half a step above its limit, and the one after it one step more.
"""

from dataclasses import replace

import pytest

from canshaper.config.control import Control
from canshaper.guard.axis import GuardedAxis
from tests.faults import variants
from tests.guard.bench import LATE_NS, TICK_NS, Bench, bench, limited, signs


def axis(one: Bench) -> GuardedAxis:
    valve = one.guard.valves[one.valve.message.key]
    assert isinstance(valve, GuardedAxis)
    return valve


@signs
def test_beyond_the_command(sign: int) -> None:
    one = bench()
    assert not one.sends(sign * 25, near_far=sign * 0.2)
    why = one.sends(sign * 50, near_far=sign * 0.2)
    assert why == f"axis=near_far limit=asked speed={sign * 0.4:.3f} allowed=0.200"


@signs
def test_beyond_the_maximum(sign: int) -> None:
    one = bench(max_pct=80.0)
    assert not one.sends(sign * 100, near_far=sign * 1.0)
    why = one.sends(sign * 110, near_far=sign * 1.0)
    assert why == f"axis=near_far limit=maximum speed={sign * 0.88:.3f} allowed=0.800"


@signs
def test_beyond_the_rates(sign: int) -> None:
    one = bench(rise_per_s=5.0)
    assert not one.sends(0, near_far=float(sign))
    why = one.sends(sign * 50, near_far=float(sign))
    assert why == f"axis=near_far limit=rate speed={sign * 0.4:.3f} allowed=0.112"


@signs
@pytest.mark.parametrize(("steps", "passes"), [(36, True), (37, False)])
def test_faster_than_the_last_by_the_rise(sign: int, steps: int, passes: bool) -> None:
    one = bench(rise_per_s=4.0, fall_per_s=2.0)  # 0.08 and 0.04 in a tick
    one.ramp(sign * 25, near_far=float(sign))
    assert not one.sends(sign * 25, missed=5, near_far=float(sign))
    why = one.sends(sign * steps, near_far=float(sign))
    # 0.2, a step, the rise, and half a step
    assert (why == "") is passes, why
    if why:
        assert why.endswith(f"limit=rate speed={sign * 0.296:.3f} allowed=0.292")


@signs
@pytest.mark.parametrize(
    ("missed", "allowed"),
    [
        (0, 0.004),  # not at zero yet: what is rounded to
        (4, 0.012),  # (5 ticks - 0.196 / 0.04) * 0.08 and half a step
        (9, 0.412),
    ],
)
def test_the_other_way_by_way_of_zero(sign: int, missed: int, allowed: float) -> None:
    one = bench(rise_per_s=4.0, fall_per_s=2.0)
    one.ramp(sign * 25, near_far=float(sign))
    why = one.sends(-sign * 125, missed=missed, near_far=-float(sign))
    assert why == f"axis=near_far limit=rate speed={-sign:.3f} allowed={allowed:.3f}"


@signs
def test_a_command_of_another_length_is_none(sign: int) -> None:
    one = bench()
    one.ramp(sign * 25, near_far=sign * 0.2)
    one.receive(one.joysticks(near_far=sign * 0.2))
    speed = sign * float("inf")
    assert one.sent(sign * 25, cut=1) == f"axis=near_far limit=command speed={speed} allowed=0.200"


@signs
@pytest.mark.parametrize("size", [60, 125])
def test_both_were_commanded_of_late_and_it_still_goes_by_way_of_zero(sign: int, size: int) -> None:
    one = bench(fall_per_s=2.0)
    one.ramp(sign * size, near_far=float(sign))
    for _ in range(30):
        assert not one.sends(0, near_far=float(sign))
    one.ramp(-sign * size, near_far=-float(sign))
    assert "limit=rate" in one.sends(sign * (size - 5), near_far=-float(sign))


@signs
def test_against_the_joystick(sign: int) -> None:
    one = bench()
    one.ramp(0, near_far=-sign * 0.5)
    why = one.sends(sign * 25, near_far=-sign * 0.5)
    assert why == f"axis=near_far limit=asked speed={sign * 0.2:.3f} allowed=0.000"


@signs
def test_what_was_refused_the_other_way_is_no_reason_to_go_faster(sign: int) -> None:
    one = bench(rise_per_s=5.0, fall_per_s=2.0)
    one.ramp(sign * 25, near_far=sign * 0.2)
    assert "limit=rate" in one.sends(-sign * 100, near_far=-float(sign))
    assert "limit=asked" in one.sends(sign * 35, near_far=-float(sign))


@signs
def test_the_same_command_may_leave_again_for_the_tail(sign: int) -> None:
    one = bench(stop_s=5.0, tail_s=1.0)
    one.sends(sign * 50, near_far=sign * 0.5)
    assert axis(one).valid_until_ns == LATE_NS + 1_000_000_000
    one.sends(sign * 50, near_far=sign * 0.2)  # the one before counts
    assert axis(one).valid_until_ns == LATE_NS + 1_000_000_000


@signs
def test_the_same_command_may_leave_again_until_a_stop_were_over(sign: int) -> None:
    one = bench(stop_s=1.0, tail_s=5.0)
    one.sends(sign * 50, near_far=sign * 0.5)
    assert axis(one).valid_until_ns == LATE_NS + 1_000_000_000


@signs
@pytest.mark.parametrize("missed", [0, 4])  # which give no time to fall
def test_what_is_no_longer_commanded_falls_by_the_rate(sign: int, missed: int) -> None:
    one = bench(tail_s=0.0, stop_s=5.0, fall_per_s=2.0)  # 0.04 in a tick
    one.ramp(sign * 100, near_far=float(sign))
    for _ in range(LATE_NS // TICK_NS):
        assert not one.sends(sign * 100)
    # From the smaller of what was sent, with the step of rounding, and its bound.
    for steps in (96, 91, 80):
        one.number += missed
        one.receive(one.joysticks())
        assert not one.sent(sign * steps, missed)
    one.receive(one.joysticks())
    why = one.sent(sign * 90)
    assert why == f"axis=near_far limit=rate speed={sign * 0.72:.3f} allowed=0.608"


@signs
@pytest.mark.parametrize(("steps", "passes"), [(64, True), (65, False)])
def test_a_valve_of_three_ticks_rises_by_three_ticks(sign: int, steps: int, passes: bool) -> None:
    slow = limited(variants.machine("slow-valves")[1], "near_far", deadband_pct=0.0)
    one = Bench(slow, "near_far")
    for size in (0, 25):
        one.waits(2)
        assert not one.sends(sign * size, near_far=float(sign))
    one.waits(2)
    # 0.2, a step, 5 per second in 60 ms, and half a step
    assert (one.sends(sign * steps, near_far=float(sign)) == "") is passes


@signs
def test_by_a_curve_rounding_is_as_coarse_as_its_steepest_part(sign: int) -> None:
    curve = {"curve_command_pct": [-100, -50, -1, 1, 50, 100]}
    one = bench(**curve, curve_speed_pct=[-100, -20, 0, 0, 20, 100], rise_per_s=5.0)
    why = one.sends(sign * 100, near_far=float(sign))
    # 1.6 / 125 of full speed in a step: one and a half of them, and the rise
    assert why == f"axis=near_far limit=rate speed={sign * 0.68:.3f} allowed=0.119"


@signs
def test_a_slow_valve_falls_by_whole_periods(sign: int) -> None:
    slow = limited(variants.machine("slow-valves")[1], "near_far", tail_s=0.0, stop_s=5.0)
    one = Bench(slow, "near_far")
    for size in (0, 30, 50, *[60] * 10):
        one.waits(2)
        assert not one.sends(sign * size, near_far=float(sign))
    for _ in range(5):  # timeout_ms and the standstill are 60 ms each, three periods 180
        one.waits(2)
        assert not one.sends(sign * 60)
    one.waits(1)
    # Of its three ticks one was missed: no whole period has gone by in which it could fall.
    one.number += 1
    one.receive(one.joysticks())
    assert not one.sent(sign * 60, missed=1)
    one.waits(2)
    assert "limit=rate" in one.sends(sign * 60)


def test_at_full_command_a_valve_may_give_less_than_was_commanded() -> None:
    curve = {"curve_command_pct": [-100, -1, 1, 100], "curve_speed_pct": [-80, 0, 0, 90]}
    one = bench(**curve, tail_s=0.0, stop_s=5.0, fall_per_s=2.0)
    one.ramp(-125, near_far=-1.0)
    for _ in range(LATE_NS // TICK_NS):
        assert not one.sends(-125)
    assert not one.sends(-125)  # 0.8, and it may still be where 0.96 was meant
    assert "limit=rate speed=-0.800" in one.sends(-125)


@signs
@pytest.mark.parametrize(
    ("key", "ends", "allowed"), [("rise_per_s", [2.0, 5.0], 0.112), ("max_pct", [50.0, 80.0], 0.8)]
)
def test_by_the_largest_that_a_limit_may_be_set_to(
    sign: int, key: str, ends: list[float], allowed: float
) -> None:
    one = bench(**{key: ends[0]})
    control = Control(adjustable={f"axes.near_far.limits.{key}": ends})
    config = one.deployment.config.model_copy(update={"control": control})
    one = Bench(replace(one.deployment, config=config), "near_far")
    assert one.sends(sign * 125, near_far=float(sign)).endswith(f"allowed={allowed:.3f}")


@signs
def test_after_a_standstill_the_largest_of_before_is_forgotten(sign: int) -> None:
    one = bench(fall_per_s=2.0)
    one.ramp(sign * 100, near_far=float(sign))
    one.sends(sign * 100, near_far=sign * 0.5)
    one.guard.stalled()
    one.sent(0, cut=1)
    assert one.sends(sign * 100, near_far=sign * 0.5)


@signs
def test_the_other_way_as_fast_as_was_commanded_of_late(sign: int) -> None:
    one = bench(allow_reverse=True)
    for now in (0.4, 0.3, 0.0):
        assert not one.sends(0, near_far=sign * now)
    assert not one.sends(-sign * 50)
    why = one.sends(-sign * 51)
    assert why == f"axis=near_far limit=asked speed={-sign * 0.408:.3f} allowed=0.400"


@signs
def test_the_other_way_for_the_tail_only(sign: int) -> None:
    one = bench(allow_reverse=True, tail_s=0.0, stop_s=5.0)
    one.sends(0, near_far=sign * 0.4)
    held = [one.sent(-sign * 50) for _ in range(LATE_NS // TICK_NS + 1)]
    assert not any(held[:-1])
    assert held[-1] == f"axis=near_far limit=asked speed={-sign * 0.4:.3f} allowed=0.000"
