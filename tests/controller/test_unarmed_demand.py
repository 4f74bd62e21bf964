"""The gate: what a joystick demanded before the axis was armed gives no right to move later."""

from tests.gate.bench import bench, signs


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
