import math

import pytest

from canshaper.report.metrics import axis_metrics
from canshaper_sim.recording import AxisTrace, Recording
from tests.report.drives import Signal, held, sampled, zero

LAG_S = 0.3  # a first-order tip: 95 % after LAG_S ln 20, coasting LAG_S x speed
SETTLE_S = LAG_S * math.log(20.0)
PRESSED = held((1.0, 4.0, 1.0))


def lagging(press: float, release: float, level: float = 1.0) -> Signal:
    """Tip of first order behind one held stroke (long enough to reach its level)."""

    def speed(t: float) -> float:
        if t < press:
            return 0.0
        if t < release:
            return level * (1.0 - math.exp(-(t - press) / LAG_S))
        return level * math.exp(-(t - release) / LAG_S)

    return speed


def ringing(start: float, amplitude: float, decay: float = 0.1, omega: float = 2.8) -> Signal:
    return lambda t: (
        amplitude * math.exp(-decay * (t - start)) * math.sin(omega * (t - start))
        if t > start
        else 0.0
    )


def one_axis(sway: Signal, duration_s: float = 12.0, **kw: object) -> Recording:
    return sampled(duration_s, near_far=(PRESSED, PRESSED, lagging(1.0, 4.0), sway), **kw)


def test_residual_is_the_first_extreme_of_a_decaying_sine_after_the_dwell() -> None:
    decay, omega = 0.1, 2.8
    extremes = [(math.atan(omega / decay) + k * math.pi) / omega for k in range(20)]
    first = next(t for t in extremes if t >= 2.5)
    expected = abs(10.0 * math.exp(-decay * first) * math.sin(omega * first))
    metrics = axis_metrics(one_axis(ringing(4.0, 10.0)), "near_far")
    assert metrics.residual_deg == pytest.approx(expected, rel=1e-3)
    assert metrics.peak_deg == pytest.approx(
        10.0 * math.exp(-decay * extremes[0]) * math.sin(omega * extremes[0]), rel=1e-3
    )


def test_swing_before_the_dwell_is_no_residual() -> None:
    metrics = axis_metrics(one_axis(lambda t: 9.0 if t < 6.45 else 0.5), "near_far")
    assert metrics.residual_deg == 0.5
    assert metrics.peak_deg == 9.0


def test_rms_is_weighted_by_time_whatever_samples_are_lost() -> None:
    omega = 2.0 * math.pi / 2.0  # six whole periods
    # Lost samples all around the positive peaks would bias a mean over samples.
    lost = frozenset(k for k in range(600) if k % 100 in (22, 24, 26, 28) or k % 97 == 5)
    recording = one_axis(lambda t: 8.0 * math.sin(omega * t), drop=lost)
    metrics = axis_metrics(recording, "near_far")
    assert metrics.rms_deg == pytest.approx(8.0 / math.sqrt(2.0), rel=2e-3)


def test_response_and_run_on_of_a_first_order_tip() -> None:
    metrics = axis_metrics(one_axis(zero), "near_far")
    assert metrics.time_to_95_s == pytest.approx(SETTLE_S, abs=2e-3)
    assert metrics.run_on_s == pytest.approx(SETTLE_S, abs=2e-3)
    assert metrics.run_on_travel == pytest.approx(LAG_S, rel=2e-3)
    assert metrics.dip == 0.0
    assert metrics.re_rise == 0.0


def test_response_is_asked_of_the_plateau_and_run_on_of_full_speed() -> None:
    joystick = held((1.0, 4.0, -0.5))
    recording = sampled(12.0, slew=(joystick, joystick, lagging(1.0, 4.0, -0.5), zero))
    metrics = axis_metrics(recording, "slew")
    assert metrics.time_to_95_s == pytest.approx(SETTLE_S, abs=2e-3)
    assert metrics.run_on_s == pytest.approx(LAG_S * math.log(10.0), abs=2e-3)
    assert metrics.run_on_travel == pytest.approx(0.5 * LAG_S, rel=2e-3)


def test_worst_stroke_counts_and_a_stroke_too_short_does_not() -> None:
    joystick = held((1.0, 4.0, 1.0), (8.0, 8.4, 1.0))
    long, short = lagging(1.0, 4.0), lagging(8.0, 8.4)
    recording = sampled(14.0, lift=(joystick, joystick, lambda t: long(t) + short(t), None))
    assert axis_metrics(recording, "lift").time_to_95_s == pytest.approx(SETTLE_S, abs=2e-3)
    only_short = held((8.0, 8.4, 1.0))
    recording = sampled(14.0, lift=(only_short, only_short, short, None))
    assert axis_metrics(recording, "lift").time_to_95_s is None


def test_speed_that_is_lost_again_was_not_reached() -> None:

    def speed(t: float) -> float:  # a spike to full speed, a dip to 40 %, back by ramp at 3.0
        if t < 1.2 or t >= 4.0:
            return 0.0
        return 1.0 if t < 1.6 else min(1.0, 0.4 + 0.6 * (t - 2.0)) if t >= 2.0 else 0.4

    recording = sampled(10.0, near_far=(PRESSED, PRESSED, speed, zero))
    expected = 1.0 + 0.55 / 0.6  # 95 % on the ramp from 40 % at 2.0 s
    assert axis_metrics(recording, "near_far").time_to_95_s == pytest.approx(expected, abs=1e-6)


def test_a_tip_that_moves_off_again_has_not_stopped() -> None:
    speed = held((1.0, 4.2, 1.0), (4.6, 5.0, 0.3))
    metrics = axis_metrics(sampled(10.0, slew=(PRESSED, PRESSED, speed, zero)), "slew")
    assert metrics.run_on_s == pytest.approx(1.0, abs=0.021)


def test_a_stop_cut_short_counts_with_the_time_it_had() -> None:
    joystick = held((1.0, 4.0, 1.0), (4.5, 7.0, 1.0))
    recording = sampled(12.0, slew=(joystick, joystick, held((1.0, 7.1, 1.0)), zero))
    assert axis_metrics(recording, "slew").run_on_s == pytest.approx(0.48, abs=1e-6)


def test_dip_and_re_rise_of_the_sent_command() -> None:
    sent = held(
        (1.0, 1.4, 0.9), (1.4, 2.0, 0.35), (2.0, 4.0, 1.0), (4.0, 4.4, 0.1), (4.4, 5.0, 0.48)
    )
    metrics = axis_metrics(sampled(10.0, slew=(PRESSED, sent, sent, zero)), "slew")
    assert metrics.dip == pytest.approx(0.55)
    assert metrics.re_rise == pytest.approx(0.38)


def test_a_joystick_moved_by_ramps_and_a_wandering_hand_is_no_dip() -> None:
    def joystick(t: float) -> float:
        ramp = max(0.0, min(1.0, (t - 1.0) / 0.4, (4.0 - t) / 0.4))
        return ramp * (0.98 + 0.02 * math.sin(9.0 * t))

    metrics = axis_metrics(sampled(10.0, slew=(joystick, joystick, joystick, zero)), "slew")
    assert metrics.dip == pytest.approx(0.0, abs=1e-9)
    assert metrics.re_rise == pytest.approx(0.0, abs=0.02)  # what is left in the neutral band


@pytest.mark.parametrize(
    "other",
    [(3.0, 3.2, 1.0), (3.9, 4.6, -1.0), (0.5, 1.5, 1.0)],
    ids=["within", "across the release", "held at the press"],
)
def test_a_stroke_with_another_axis_has_no_residual(other: tuple[float, float, float]) -> None:
    recording = sampled(
        12.0,
        near_far=(PRESSED, PRESSED, PRESSED, ringing(4.0, 10.0)),
        slew=(held(other), held(other), zero, zero),
    )
    metrics = axis_metrics(recording, "near_far")
    assert metrics.residual_deg is None
    assert metrics.cross_residual_deg is None
    assert metrics.run_on_s is None


def test_a_window_ends_when_any_joystick_is_moved() -> None:
    joystick, other = held((1.0, 4.0, 1.0)), held((9.0, 10.0, 1.0))
    recording = sampled(
        20.0,
        near_far=(joystick, joystick, joystick, lambda t: 0.4 if t < 9.0 else 12.0),
        lift=(other, other, zero, None),
    )
    assert axis_metrics(recording, "near_far").residual_deg == 0.4


def test_a_rest_shorter_than_half_a_period_after_the_dwell_has_no_residual() -> None:
    joystick = held((1.0, 4.0, 1.0), (7.4, 8.0, 1.0))
    recording = sampled(9.0, near_far=(joystick, joystick, joystick, ringing(4.0, 10.0)))
    assert axis_metrics(recording, "near_far").residual_deg is None


def test_cross_residual_is_the_swing_left_in_the_other_plane() -> None:
    recording = sampled(
        12.0,
        slew=(PRESSED, PRESSED, PRESSED, lambda t: -3.0 if t > 4.0 else 0.0),
        near_far=(zero, zero, zero, lambda t: -7.0 if t > 7.0 else 9.0),
        lift=(zero, zero, zero, None),
    )
    assert axis_metrics(recording, "slew").residual_deg == 3.0
    assert axis_metrics(recording, "slew").cross_residual_deg == 9.0
    assert axis_metrics(recording, "near_far").residual_deg is None
    alone = sampled(12.0, slew=(PRESSED, PRESSED, PRESSED, zero), lift=(zero, zero, zero, None))
    assert axis_metrics(alone, "slew").cross_residual_deg is None


def test_a_reversal_is_two_strokes() -> None:
    joystick = held((1.0, 4.0, 1.0), (4.0, 7.0, -1.0))
    sway = ringing(7.0, 6.0, decay=0.0)
    metrics = axis_metrics(sampled(14.0, slew=(joystick, joystick, joystick, sway)), "slew")
    assert metrics.residual_deg == pytest.approx(6.0, rel=1e-3)
    assert metrics.run_on_s == 0.0
    assert metrics.dip == 0.0


@pytest.mark.parametrize(
    ("t_s", "joystick", "message"),
    [
        ([0.0, 0.02, 0.02], [0.0] * 3, "time of a recording must increase"),
        ([0.0, 0.02, 0.04], [0.0] * 2, r"slew\.joystick has 2 samples"),
        ([0.0, 0.02, 0.04], [0.0, math.nan, 0.0], r"slew\.joystick holds a value"),
    ],
)
def test_a_malformed_recording_is_named(
    t_s: list[float], joystick: list[float], message: str
) -> None:
    recording = Recording(t_s, {"slew": AxisTrace(joystick, [0.0] * 3, [0.0] * 3, None)})
    with pytest.raises(ValueError, match=message):
        axis_metrics(recording, "slew")


def test_still_after_is_that_of_the_plane_of_the_axis() -> None:
    recording = one_axis(lambda t: 6.0 if t < 5.0 else 1.0, lift=(zero, zero, zero, None))
    metrics = axis_metrics(recording, "near_far")
    assert metrics.still_s == pytest.approx(1.0, abs=0.021)
    assert metrics.swings_on is False
    assert axis_metrics(recording, "near_far", still_deg=0.5).swings_on is True
    lift = axis_metrics(recording, "lift")
    assert (lift.still_s, lift.swings_on) == (None, None)
