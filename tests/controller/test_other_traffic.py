"""A bus is shared, and a machine need not show everything: what passes by, and what is left out."""

import pytest

from canshaper.codec.frame import Frame, FrameFault
from canshaper.shaping.states import State
from tests.rigs.forwarder import Make, Rig, last_fault

TIP_ID = 0x401  # TipPosition of the shipped DBC: the shipped machine has no use for it
MOTION = (
    "motion: { crane: { slew: slew, near_far: near_far, radius:"
    " { bus: crane, message: TipPosition, signal: Radius, timeout_ms: 100 } } }\n"
)
STATUS = "    status: { bus: crane, message: SlewStatus }\n"
# -- frames of others ------------------------------------------------------------------------------


@pytest.mark.parametrize("data", [bytes(6), b"", bytes(8)])
def test_traffic_that_the_dbc_knows_is_no_fault(rig: Rig, data: bytes) -> None:
    """No one here listens to it: neither its length nor its content matters."""
    rig.moving()
    before = dict(rig.controller.counters.values)
    for _ in range(5):
        rig.receive(Frame("crane", TIP_ID, False, data))
        rig.run(1, Slew=1000)
    assert rig.controller.counters.values == before
    assert last_fault(rig) is FrameFault.NONE
    assert rig.state() is State.ACTIVE


def test_without_a_measured_radius_its_message_is_other_traffic(changed_rig: Make) -> None:
    fixed = MOTION[: MOTION.index("radius:")] + "radius_m: 3.0 } }\n"
    rig = changed_rig({"axes:\n": f"{fixed}axes:\n"})
    rig.receive(Frame("crane", TIP_ID, False, bytes(5)))
    assert (rig.count("WrongLength"), last_fault(rig)) == (0, FrameFault.NONE)


# -- what is not shown -----------------------------------------------------------------------------


def test_an_axis_without_a_status_message_works_and_shows_nothing(changed_rig: Make) -> None:
    rig = changed_rig({STATUS: ""})
    rig.run(3)
    shown = set()
    for _ in range(60):
        sent = rig.run(1, Slew=1000)
        shown |= set(sent)
    assert sent["SlewCommand"]["Velocity"] > 50
    assert "SlewStatus" not in shown
    assert {"NearFarStatus", "LiftStatus", "ShaperStatus"} <= shown


def test_a_machine_without_a_service_status_sends_none(changed_rig: Make) -> None:
    rig = changed_rig({"status: { bus: crane, message: ShaperStatus }": ""})
    shown = set()
    for _ in range(60):
        shown |= set(rig.run(1, Slew=0))
    assert "ShaperStatus" not in shown
    assert "SlewStatus" in shown


# -- at rest or not --------------------------------------------------------------------------------


def test_it_is_neutral_until_an_axis_moves_and_after_all_have_stopped(rig: Rig) -> None:
    """The daemon takes a new deployment, and ends, only in neutral."""
    assert rig.controller.neutral
    rig.run(3)
    assert rig.controller.neutral
    rig.run(1, Lift=1000)
    assert not rig.controller.neutral
    rig.run(50, Slew=1000)
    assert not rig.controller.neutral
    rig.run(200)
    assert rig.controller.neutral
    rig.run(50, Lift=-1000)
    rig.run(1, Lift=-1000, Enable=0)
    assert rig.state("lift") is State.TRIPPED
    assert rig.controller.neutral
