"""Feedback of one valve by itself: which value follows which commands, to the last bit."""

from typing import Any

import pytest

from canshaper.codec.frame import FrameFault
from canshaper.inputs.value import Feedback, Following
from canshaper.shaping.states import Reason
from tests.rigs.forwarder import Make

DBC = {
    "BO_ 1024 GrappleSway": "BO_ 800 SlewFlow: 2 PLANT\n"
    ' SG_ Flow : 0|8@1- (1,0) [-100|100] "%" SHAPER\n'
    ' SG_ Count : 8|8@1+ (1,0) [0|255] "" SHAPER\n\nBO_ 1024 GrappleSway'
}
STATUS = "    status: { bus: crane, message: SlewStatus }\n"
TIMEOUT_NS = 100_000_000
NOW_NS = 7_000_000_000
# Full is a power of two: parts and their limits are exact.
FLOW = (
    "bus: crane, message: SlewFlow, signal: Flow, timeout_ms: 100, full: 64,"
    " alive_counter: Count, cycle_ms: 20"
)


def feedback(make: Make, period_s: float = 0.02, more: str = "") -> tuple[Feedback, Any]:
    """The feedback of slew, not yet compared with anything, and its message."""
    rig = make({STATUS: f"    feedback: {{ {FLOW}{more} }}\n{STATUS}"}, DBC)
    bound = rig.deployment.axes["slew"].feedback
    assert bound is not None
    return Feedback(bound, period_s), rig.message("SlewFlow")


def frame(message: Any, flow: int, count: int) -> bytes:
    return bytes(message.encode({"Flow": flow, "Count": count}))


def qualified(one: Feedback, message: Any, flow: int = 0) -> int:
    """Receive what a sequence needs to count; the last count."""
    for count in range(10):
        one.receive(frame(message, flow, count), NOW_NS)
        if one.measured_ns is not None:
            return count
    pytest.fail("no frame counted")


@pytest.mark.parametrize(
    ("flow", "following"),
    [
        (-16, Following.YES),  # 25 % of full below the least of the commands
        (-17, Following.NO),
        (32, Following.YES),  # 25 % above the largest
        (33, Following.NO),
    ],
)
def test_the_tolerance_itself_still_follows(
    changed_rig: Make, flow: int, following: Following
) -> None:
    one, message = feedback(changed_rig, more=", tolerance_pct: 25")
    qualified(one, message, flow)
    one.check(0.25, NOW_NS)
    assert one.following is following


def test_before_the_first_command_the_valve_was_closed(changed_rig: Make) -> None:
    one, message = feedback(changed_rig)
    qualified(one, message, 0)
    one.check(1.0, NOW_NS)
    assert one.following is Following.YES


@pytest.mark.parametrize(
    ("settle_ms", "period_s", "ticks"),
    [(500, 0.02, 25), (510, 0.02, 26), (1001, 0.1, 11), (1001, 1.0, 2)],
)
def test_a_command_counts_for_the_settling_time_and_no_longer(
    changed_rig: Make, settle_ms: int, period_s: float, ticks: int
) -> None:
    """Settling times between two ticks count to the next one."""
    one, message = feedback(changed_rig, period_s, f", settle_ms: {settle_ms}")
    qualified(one, message, 64)
    one.check(1.0, NOW_NS)
    seen = []
    for _ in range(ticks + 1):
        one.check(0.0, NOW_NS)
        seen.append(one.following)
    assert seen == [Following.YES] * ticks + [Following.NO]


def test_what_is_invalid_is_waited_for_again_and_not_lost_at_once(changed_rig: Make) -> None:
    one, message = feedback(changed_rig)
    qualified(one, message)
    one.invalidate()
    later_ns = NOW_NS + 10 * TIMEOUT_NS
    one.check(0.0, later_ns)
    assert one.following is Following.UNKNOWN
    one.check(0.0, later_ns + TIMEOUT_NS)
    assert one.following is Following.UNKNOWN
    one.check(0.0, later_ns + TIMEOUT_NS + 1)
    assert one.following is Following.LOST


def test_a_reload_carries_the_sequence_over_and_what_was_reported(changed_rig: Make) -> None:
    before, message = feedback(changed_rig)
    count = qualified(before, message, 64)
    for _ in range(30):
        before.check(0.0, NOW_NS)
    after, _ = feedback(changed_rig)
    after.copy_state(before)
    assert after.following is Following.NO
    assert after.fresh(NOW_NS) is None  # it has to come again
    assert after.receive(frame(message, 0, count), NOW_NS + 1) is FrameFault.COUNTER_REPEATED
    assert after.lost(NOW_NS + 1) is Reason.JOYSTICK_UNTRUSTED
