"""The gate: what an axis may do while it is not armed, and what counts of it later."""

from canshaper.codec.frame import Frame
from tests.gate.bench import Bench, bench, limited, load, signs

NOT_AVAILABLE = 32767


@signs
def test_a_joystick_held_before_it_was_in_neutral_asks_for_no_run_on(sign: int) -> None:
    one = bench(tail_s=2.0)
    for _ in range(10):
        assert not one.sends(0, near_far=float(sign))
    one.rests(2)
    assert "limit=asked" in one.sends(sign * 50)
    one.rests(2)
    one.rests(2, enable=False)
    one.rests(2)
    assert not one.sends(sign * 50, near_far=float(sign))
    assert not one.sends(sign * 50)  # this one does


@signs
def test_nothing_is_added_to_an_axis_in_its_shaped_stop(sign: int) -> None:
    """Its own velocity is lost, and slew would move it."""
    quick = limited(load("forwarder-robust"), "near_far", fall_per_s=100.0)
    one, left = Bench(quick, "near_far"), quick.joysticks["left"]

    def without_near_far(frame: Frame) -> Frame:
        if frame.can_id != left.message.frame_id:
            return frame
        raw = left.layout.decode(frame.data)
        return frame._replace(data=left.layout.encode({**raw, "NearFar": NOT_AVAILABLE}))

    one.rests()
    assert not one.sends(sign * 10, slew=1.0)
    one.change = without_near_far
    assert "limit=asked" in one.sends(sign * 10, slew=1.0)
