import pytest

from canshaper.report.metrics import axis_metrics
from canshaper.report.strokes import aligned, find_strokes, residual_windows
from canshaper_sim.recording import Recording
from tests.report.drives import Signal, held, sampled, zero


def pressed(duration_s: float = 12.0, dt_s: float = 0.02, **joysticks: Signal) -> Recording:
    axes = {name: (joystick, joystick, joystick, zero) for name, joystick in joysticks.items()}
    return sampled(duration_s, dt_s=dt_s, **axes)


def test_strokes_have_press_release_direction_and_level() -> None:
    recording = pressed(slew=held((1.0, 2.0, 0.4), (3.0, 4.0, -0.8), (4.0, 5.0, 1.0)))
    strokes = find_strokes(recording)["slew"]
    times = [(recording.t_s[s.press], recording.t_s[s.release or 0]) for s in strokes]
    assert times == [pytest.approx(pair) for pair in ((1.0, 2.0), (3.0, 4.0), (4.0, 5.0))]
    assert [s.direction for s in strokes] == [1.0, -1.0, 1.0]
    assert [s.level for s in strokes] == [0.4, 0.8, 1.0]
    assert [bool(s.rest) for s in strokes] == [True, False, True]


def test_a_joystick_in_the_neutral_band_is_released() -> None:
    assert find_strokes(pressed(slew=lambda t: 0.02))["slew"] == []
    (stroke,) = find_strokes(pressed(slew=lambda t: 0.03))["slew"]
    assert stroke.release is None
    assert not stroke.rest


def test_the_plateau_is_where_the_joystick_is_held_longest_near_its_largest_deflection() -> None:
    joystick = held((1.0, 1.2, 1.0), (1.2, 2.0, 0.5), (2.0, 4.0, 0.97), (4.0, 5.0, 0.3))
    recording = pressed(slew=joystick)
    (stroke,) = find_strokes(recording)["slew"]
    first, last = stroke.plateau
    assert (recording.t_s[first], recording.t_s[last]) == pytest.approx((2.0, 3.98))
    assert stroke.level == 0.97


def test_a_rest_ends_when_another_joystick_is_released() -> None:
    near_far, slew = held((1.0, 4.0, 1.0)), held((0.5, 6.0, 1.0))
    # Letting go of slew makes the two-axis motion move near-far: not a re-rise of its own stop.
    sent = held((1.0, 4.0, 1.0), (4.0, 4.5, 0.5), (6.2, 7.0, 0.2))
    recording = sampled(12.0, near_far=(near_far, sent, sent, zero), slew=(slew, slew, slew, zero))
    (stroke,) = find_strokes(recording)["near_far"]
    assert recording.t_s[stroke.rest[-1]] == pytest.approx(5.98)
    assert not stroke.alone
    assert axis_metrics(recording, "near_far").re_rise == 0.0


def test_residual_windows_begin_after_the_dwell_and_end_at_the_next_move() -> None:
    recording = pressed(slew=held((1.0, 3.0, 1.0)), lift=held((8.0, 9.0, 1.0)))
    strokes = find_strokes(recording)
    (window,) = residual_windows(recording, strokes["slew"])
    assert recording.t_s[window[0]] == pytest.approx(5.5)
    assert recording.t_s[window[-1]] == pytest.approx(7.98)
    assert residual_windows(recording, strokes["lift"]) == []  # 0.5 s to the end


def test_aligned_drives_press_at_the_same_time_and_cover_the_same_span() -> None:
    raw = pressed(12.0, slew=held((1.0, 3.0, 1.0)))
    shaped = pressed(19.0, 0.0203, slew=held((1.6, 3.6, 1.0)))
    a, b = aligned(raw, shaped)
    starts = [d.t_s[find_strokes(d)["slew"][0].press] for d in (a, b)]
    assert starts == pytest.approx([1.0, 1.0], abs=1e-6)
    for d in (a, b):
        assert d.t_s[0] == pytest.approx(0.0, abs=0.021)
        assert d.t_s[-1] == pytest.approx(12.0, abs=0.021)
        assert len(d.axes["slew"].joystick) == len(d.axes["slew"].sway_deg or []) == len(d.t_s)


def test_drives_without_a_press_are_aligned_by_their_starts() -> None:
    a, b = aligned(pressed(3.0, slew=zero), pressed(2.0, slew=zero))
    assert a.t_s == pytest.approx(b.t_s)
