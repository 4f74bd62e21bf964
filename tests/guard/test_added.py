"""An added velocity may end at once; nothing else may grow beyond the valve's rates."""

import pytest

from canshaper.guard.output import OutputGuard
from canshaper.machine.binding import load_deployment
from canshaper_sim.hand import Hand, Held
from tests.faults import shipped

TICK_NS = 20_000_000
STEPS = 125


class Bench:
    """The guard of the robust forwarder; a near-far command in every tick."""

    def __init__(self) -> None:
        self.deployment = load_deployment(shipped.CONFIG / "forwarder-robust.yaml")
        self.guard, self.hand = OutputGuard(self.deployment), Hand(self.deployment)
        self.valve = self.deployment.axes["near_far"].valve
        self.number = 0

    def sends(self, steps: int, **sticks: float) -> str:
        """One tick; why near-far's command may not leave."""
        now_ns = self.number * TICK_NS
        for frame in self.hand.frames(self.number * 20, Held(sticks, enable=True)):
            self.guard.note(frame, now_ns)
        self.number += 1
        self.guard.begin(0)
        self.valve.put(steps)
        frame = self.valve.message.frame()
        valve = self.guard.valve(frame)
        assert valve is not None
        return valve.refusal(frame.data, now_ns, self.guard.at)

    def ramp(self, steps: int, **sticks: float) -> None:
        """Up to there by less than the rates, and on for a while."""
        for part in (0.25, 0.5, 0.75, *[1.0] * 10):
            assert not self.sends(round(steps * part), **sticks)


# Before, sticks, and the most that may follow. Velocity of n of 125 steps behind 5 % dead band:
# (n / 125 - 0.05) / 0.95. The rise is 0.1 in a tick, and up to 0.25 is added.
CASES = {
    "what was added against the own part ends": (25, {"near_far": 1.0, "slew": 1.0}, 68),
    "it was more than the own part": (-10, {"near_far": 0.9, "slew": 1.0}, 45),
    "not beyond what the own joystick asked": (25, {"near_far": 0.3, "slew": 1.0}, 42),
    "nothing was added": (25, {"near_far": 1.0}, 38),
    "no own part": (10, {"slew": 1.0}, 23),
}


@pytest.mark.parametrize("case", CASES)
@pytest.mark.parametrize("sign", [1, -1])
def test_what_may_follow_at_once(sign: int, case: str) -> None:
    before, sticks, most = CASES[case]
    sticks = {name: sign * value for name, value in sticks.items()}
    for steps in (most, most + 1):
        bench = Bench()
        bench.ramp(sign * before, **sticks)
        refusal = bench.sends(sign * steps, **sticks)
        assert ("limit=rate" in refusal) == (steps > most), (steps, refusal)


def test_what_was_added_gives_the_own_part_no_longer_tail() -> None:
    bench = Bench()
    bench.ramp(119, near_far=1.0, slew=1.0)
    refused = [bool(bench.sends(119, slew=1.0)) for _ in range(200)]
    # tail_s, timeout_ms, the longest standstill and three periods
    assert refused.index(True) == (2200 + 100 + 100 + 60) // 20
