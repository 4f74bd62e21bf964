"""Enable released, joystick silent, emergency stop pressed or lost: nothing moves or falls on."""

from tests.faults import variants
from tests.guard.bench import LATE_NS, TICK_NS, Bench, bench, signs


@signs
def test_released_it_may_not_even_fall(sign: int) -> None:
    one = bench(fall_per_s=2.0)
    one.ramp(sign * 100, near_far=float(sign))
    one.receive(one.joysticks(enable=False, near_far=float(sign)))
    why = one.sent(sign * 25)
    assert why == f"axis=near_far limit=enable speed={sign * 0.2:.3f} allowed=0.000"


@signs
def test_silent_it_may_not_even_fall(sign: int) -> None:
    one = bench(fall_per_s=2.0, stop_s=0.5)
    one.ramp(sign * 100, near_far=float(sign))
    last = (LATE_NS + 500_000_000) // TICK_NS
    assert not any(one.sent(sign * 100) for _ in range(last))
    why = one.sent(sign * 25)
    assert why == f"axis=near_far limit=silence speed={sign * 0.2:.3f} allowed=0.000"


def test_at_the_very_end_of_the_silence_it_is_not_what_stops() -> None:
    one = bench(stop_s=0.5, max_pct=80.0)
    one.ramp(100, near_far=1.0)
    for _ in range((LATE_NS + 500_000_000) // TICK_NS - 1):
        one.sent(100)
    assert "limit=maximum" in one.sent(125)
    assert "limit=silence" in one.sent(125)


class TestEmergencyStop:
    """Of a machine that has one, 140 ms of silence and it counts as pressed."""

    def moving(self) -> Bench:
        one = Bench(variants.machine("protected")[1], "near_far")
        one.ramp(60, near_far=1.0)
        return one

    def test_pressed_it_may_not_even_fall(self) -> None:
        one = self.moving()
        bound = one.deployment.emergency_stop
        assert bound is not None
        check = bound.protection.check
        assert check is not None
        one.receive(one.joysticks(near_far=1.0))
        pressed = next(d for d in (bytes([1, 0, c]) for c in range(256)) if check.verify(d))
        one.guard.inputs[bound.key].note(pressed, one.now_ns)
        assert "limit=emergency-stop speed=0.284 allowed=0.000" in one.sent(40)

    def test_before_it_was_received_nothing_moves(self) -> None:
        one = Bench(variants.machine("protected")[1], "near_far")
        bound = one.deployment.emergency_stop
        assert bound is not None
        one.receive([f for f in one.joysticks(near_far=1.0) if f[:3] != bound.key])
        assert "limit=emergency-stop" in one.sent(10)

    def test_at_the_very_end_of_its_silence_it_is_not_what_stops(self) -> None:
        one = self.moving()
        bound = one.deployment.emergency_stop
        assert bound is not None
        stop = one.guard.inputs[bound.key]
        while one.now_ns < stop.received_ns + stop.timeout_ns:
            one.receive([f for f in one.joysticks(near_far=1.0) if f[:3] != bound.key])
            assert not one.sent(60)
        assert one.now_ns == stop.received_ns + stop.timeout_ns
        assert "limit=rate" in one.sent(125)
        assert "limit=emergency-stop" in one.sent(60)
