"""An added velocity may end at once; nothing else may grow beyond the valve's rates."""

import pytest

from canshaper.machine.binding import load_deployment
from tests.faults import shipped
from tests.guard.bench import Bench


def robust() -> Bench:
    return Bench(load_deployment(shipped.CONFIG / "forwarder-robust.yaml"), "near_far")


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
        bench = robust()
        bench.ramp(sign * before, **sticks)
        refusal = bench.sends(sign * steps, **sticks)
        assert ("limit=rate" in refusal) == (steps > most), (steps, refusal)


def test_what_was_added_gives_the_own_part_no_longer_tail() -> None:
    bench = robust()
    bench.ramp(119, near_far=1.0, slew=1.0)
    refused = [bool(bench.sends(119, slew=1.0)) for _ in range(200)]
    # tail_s, timeout_ms, the longest standstill and three periods
    assert refused.index(True) == (2200 + 100 + 100 + 60) // 20
