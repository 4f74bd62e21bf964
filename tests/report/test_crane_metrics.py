import math
from dataclasses import replace

import pytest

from canshaper.report.metrics import report_dict
from canshaper.report.stroke_metrics import CraneMetrics, crane_metrics
from canshaper.report.strokes import aligned, rests
from canshaper_sim.recording import CraneTrace, Recording
from tests.report.drives import Signal, sampled, zero

SLEW, NEAR_FAR = (1.0, 3.0), (2.0, 4.0)  # press and release
END_S = 12.0


def held(press: float, release: float) -> Signal:
    return lambda t: 1.0 if press - 1e-9 <= t < release - 1e-9 else 0.0


def both(sway: Signal, run_on_s: float = 0.5) -> Recording:
    """Slew and near-far overlap; the tip goes on along x at 1 m/s for so long."""
    slew, near_far = held(*SLEW), held(*NEAR_FAR)
    speed = held(NEAR_FAR[0], NEAR_FAR[1] + run_on_s)
    recording = sampled(
        END_S, slew=(slew, slew, slew, zero), near_far=(near_far, near_far, speed, zero)
    )
    way = [(min(max(t - NEAR_FAR[0], 0.0), 2.0 + run_on_s), 7.0) for t in recording.t_s]
    return replace(recording, crane=CraneTrace(way, way, [sway(t) for t in recording.t_s]))


def measured(recording: Recording) -> CraneMetrics:
    assert recording.crane is not None
    return crane_metrics(recording, recording.crane)


def test_a_rest_is_from_the_last_release_to_the_next_press() -> None:
    recording = both(zero)
    (rest,) = rests(recording)
    times = recording.t_s[rest[0]], recording.t_s[rest[-1]]
    assert times == pytest.approx((NEAR_FAR[1], END_S))


@pytest.mark.parametrize("late_s", [0.0, 0.02])
def test_two_that_are_released_together_begin_one_rest(late_s: float) -> None:
    a, b, again = held(1.0, 3.0), held(1.0, 3.0 + late_s), held(5.0, 6.0)
    recording = sampled(
        8.0, slew=(lambda t: a(t) + again(t), zero, zero, zero), lift=(b, zero, zero, None)
    )
    starts = [recording.t_s[rest[0]] for rest in rests(recording)]
    assert starts == pytest.approx([3.0 + late_s, 6.0])


def test_residual_and_run_on_after_both_joysticks() -> None:
    def sway(t: float) -> float:
        return 3.0 if t >= NEAR_FAR[1] + 2.5 else 9.0 if t >= SLEW[1] else 4.0

    measures = measured(both(sway))
    assert measures.peak_deg == 9.0
    assert measures.residual_deg == 3.0
    # From the release of the last joystick; 0.01 s of the sample before it stands.
    assert measures.run_on_s == pytest.approx(0.5, abs=0.021)
    assert measures.run_on_m == pytest.approx(0.5, abs=0.021)
    assert measures.rms_deg == pytest.approx(
        math.sqrt((16 * 3 + 81 * 3.5 + 9 * 5.5) / 12), rel=0.01
    )


def test_run_on_is_the_farthest_from_where_the_tip_was_at_the_release() -> None:
    recording = both(zero)
    # Half a metre on after the release, and 0.4 m back.
    after = [max(0.0, t - NEAR_FAR[1]) for t in recording.t_s]
    way = [(3.0 + (t if t < 0.5 else max(1.0 - t, 0.1)), 0.0) for t in after]
    crane = CraneTrace(way, way, after)
    assert crane_metrics(recording, crane).run_on_m == pytest.approx(0.5, abs=0.021)


def test_a_drive_that_is_never_let_go_has_no_residual_and_no_run_on() -> None:
    joystick = held(1.0, END_S + 1.0)
    recording = sampled(END_S, slew=(joystick, joystick, joystick, zero))
    here = [(3.0, 0.0)] * len(recording.t_s)
    crane = CraneTrace(here, here, [5.0] * len(here))
    measures = crane_metrics(recording, crane)
    assert measures == CraneMetrics(None, None, 5.0, pytest.approx(5.0), None, None, None)


def test_report_has_the_crane_where_the_drives_know_the_tip() -> None:
    raw = both(lambda _t: 8.0, run_on_s=0.2)
    shaped = both(lambda _t: 2.0, run_on_s=1.2)
    report = report_dict(raw, shaped, transport="", missed_deadlines=None)
    crane = report["crane"]
    assert (crane["raw"]["residual_deg"], crane["shaped"]["residual_deg"]) == (8.0, 2.0)
    assert crane["residual_reduction_pct"] == 75.0
    assert crane["raw"]["run_on_m"] == pytest.approx(0.2, abs=0.021)
    assert crane["shaped"]["run_on_m"] == pytest.approx(1.2, abs=0.021)
    unknown = report_dict(replace(raw, crane=None), shaped, transport="", missed_deadlines=None)
    assert unknown["crane"] is None


def test_aligned_drives_keep_the_crane_with_its_time() -> None:
    raw = both(lambda t: t)
    later = replace(raw, t_s=[t + 1.0 for t in raw.t_s])
    early, late = aligned(raw, later)
    assert early.crane is not None
    assert early.crane == late.crane
    assert len(early.crane.tip_m) == len(early.crane.sway_deg) == len(early.t_s)


@pytest.mark.parametrize(
    ("still_deg", "still_s", "swings_on"),
    [(2.0, 1.5, False), (4.0, 0.5, False), (0.5, 8.0, True), (9.0, 0.0, False)],
)
def test_still_after_is_the_last_time_at_which_it_swings_more(
    still_deg: float, still_s: float, swings_on: bool
) -> None:
    """Swing of 5 degrees that falls by 2 in each second, to 1 that stays; it crosses zero."""

    def sway(t: float) -> float:
        return max(5.0 - 2.0 * (t - NEAR_FAR[1]), 1.0)

    recording = both(sway)
    assert recording.crane is not None
    metrics = crane_metrics(recording, recording.crane, still_deg)
    assert metrics.still_s == pytest.approx(still_s, abs=0.021)
    assert metrics.swings_on is swings_on


def test_a_swing_that_just_passes_zero_at_the_end_goes_on() -> None:
    recording = both(lambda t: 0.0 if t > END_S - 0.5 else 8.0)
    metrics = measured(recording)
    assert metrics.still_s == pytest.approx(END_S - 0.5 - NEAR_FAR[1], abs=0.05)
    assert metrics.swings_on is True
