"""A reload carries over reports of other nodes, and latched states."""

import pytest

from canshaper.codec.frame import Frame
from canshaper.controller.axis_control import AxisControl
from canshaper.inputs.input import PartKey
from canshaper.inputs.value import Following
from canshaper.shaping.states import State
from tests.controller.reloaded import reload
from tests.rigs.canopen import OPERATIONAL, PRE_OPERATIONAL, CanopenRig
from tests.rigs.forwarder import Make, Rig
from tests.rigs.j1939 import Rig as J1939Rig
from tests.rigs.j1939 import avef, bjm

FOREIGN = Frame("crane", 0x200, False, b"\0\0")
FLOW_COMMAND_LATE = 0x8003


@pytest.mark.parametrize(
    "changes",
    [
        (),
        (("heartbeat_ms: 500", "heartbeat_ms: 600"),),
        (("bus: crane", "bus: boom"), ("\n  crane:", "\n  boom:")),
        (("slew: { id: 0x20", "swing: { id: 0x20"), ("node: slew", "node: swing")),
    ],
)
def test_an_error_of_a_valve_is_still_there(
    canopen: CanopenRig, changes: tuple[tuple[str, str], ...]
) -> None:
    """Whatever its bus and its node are called, and where the bus was opened again too."""
    canopen.emergency("slew", FLOW_COMMAND_LATE)
    canopen.run(5)
    reload(canopen, *changes)
    (canopen.bus,) = canopen.deployment.config.buses
    canopen.run(100)
    assert canopen.axis() == ("NEUTRAL_WAIT", "NODE_FAULT")
    assert canopen.axis("lift")[0] == "READY"
    canopen.emergency("slew", 0, register=0)
    canopen.until(lambda: canopen.axis()[0] == "READY")


def test_a_part_is_known_by_what_it_is_on_the_machine(rig: Rig) -> None:
    """Inputs, messages that are sent, and axes: these by their valve and by their name."""
    here, controller = ("socketcan", "vcan0"), rig.controller
    parts = controller._parts()
    inputs = [("input", *here, can_id, False) for can_id in (272, 273)]
    sent = [512, 513, 514, 784, 785, 768, 769, 770]
    senders = [("sender", *here, can_id, False) for can_id in sent]
    valves = {"slew": 512, "near_far": 513, "lift": 514}
    controls: dict[PartKey, AxisControl] = {
        ("axis", name): controller.axes[name] for name in valves
    }
    for name, can_id in valves.items():
        controls["valve", *here, can_id, False, "Velocity"] = controller.axes[name]
    assert set(parts) == {*inputs, *senders, *controls}
    assert all(parts[key] is control for key, control in controls.items())
    for *_, can_id, extended in inputs:
        part = parts["input", *here, can_id, extended]
        assert part is controller.inputs["crane", can_id, extended]
    for key, sender in controller._senders.items():
        assert parts["sender", *here, *key[1:]] is sender


def test_of_another_node_nothing_is_known(canopen: CanopenRig) -> None:
    canopen.emergency("slew", FLOW_COMMAND_LATE)
    reload(canopen, ("id: 0x20", "id: 0x2F"))
    for _ in range(30):
        canopen.receive(0x72F, bytes((OPERATIONAL,)))
        canopen.run()
    assert canopen.axis()[0] == "READY"


def test_a_heartbeat_is_as_old_as_it_was(canopen: CanopenRig) -> None:
    canopen.states["slew"] = -1
    canopen.run(10)
    reload(canopen)
    lost = next(n for n in range(100) if canopen.run() and "state=lost" in canopen.texts[-1])
    assert lost == 15  # 500 ms after the last one
    canopen.run()
    assert canopen.axis() == ("NEUTRAL_WAIT", "NODE_FAULT")
    assert canopen.last_fault == "HEARTBEAT_LOST"


def test_on_a_bus_that_was_opened_again_it_has_to_come_again(canopen: CanopenRig) -> None:
    canopen.states["slew"] = -1
    reload(canopen, ("bitrate: 250000", "bitrate: 500000"))
    canopen.run(30)
    assert canopen.axis() == ("NEUTRAL_WAIT", "NODE_FAULT")
    assert canopen.axis("lift")[0] == "READY"


def test_a_node_is_not_started_twice_as_often(canopen: CanopenRig) -> None:
    canopen.states["slew"] = PRE_OPERATIONAL
    canopen.run(1)
    assert canopen.commands
    reload(canopen)
    started = [bool(canopen.run(1) and canopen.commands) for _ in range(25)]
    assert started == [False] * 24 + [True]


def test_a_valve_is_brought_to_active_from_init(canopen: CanopenRig) -> None:
    """Also one that is active: what it does between two deployments is not known."""
    reload(canopen)
    assert canopen.run(1)["slew"]["ControlWord"] == 0x8
    canopen.until(lambda: canopen.axis()[0] == "READY")


def test_another_sender_that_no_tick_has_seen_trips(rig: Rig) -> None:
    """It is read after a tick sent its commands to the valves, and before the reload comes."""
    rig.run(3)
    rig.receive(FOREIGN)
    reload(rig)
    rig.run(1)
    assert (rig.state(), rig.reason()) == (State.TRIPPED, "SECOND_SENDER")
    rig.run(48)
    rig.run(1, Reset=1)
    assert rig.state() is State.TRIPPED
    rig.run(2)
    rig.run(1, Reset=1)
    rig.run(1)
    assert rig.state() is State.READY


def test_a_trip_that_no_tick_has_seen_is_one(rig: Rig) -> None:
    rig.moving()
    rig.controller.send_failed(FOREIGN)
    reload(rig)
    rig.run(1)
    assert (rig.state(), rig.reason()) == (State.TRIPPED, "SEND_FAILED")


def test_a_trip_stays_with_its_valve_whatever_the_axis_is_called(
    changed_rig: Make,
) -> None:
    rig = changed_rig()
    rig.run(3)
    rig.receive(FOREIGN)
    rig.run(2)
    reload(rig, ("  slew:\n", "  swing:\n"))
    rig.run(3)
    assert (rig.state("swing"), rig.reason("swing")) == (State.TRIPPED, "SECOND_SENDER")
    assert rig.state("lift") is State.READY


def test_a_valve_that_does_not_follow_is_still_reported(j1939: J1939Rig) -> None:
    for number in range(3):
        j1939.receive(avef(number, 0.0))
    j1939.run(1)
    j1939.receive(avef(0, 60.0))
    j1939.run(1)
    feedback = j1939.controller.axes["slew"].feedback
    assert feedback is not None
    assert feedback.following is Following.NO
    reload(j1939)
    j1939.events.clear()
    j1939.run(5)
    feedback = j1939.controller.axes["slew"].feedback
    assert feedback is not None
    assert feedback.following is Following.NO
    assert not [text for text in j1939.events if "valve=" in text]


def test_the_joystick_that_counted_still_does(j1939: J1939Rig) -> None:
    reload(j1939)
    j1939.events.clear()
    j1939.tick(bjm("BJM1", 0x34), bjm("BJM2"))
    assert j1939.fault == "SECOND_SENDER"
    assert "bus=crane message=BJM1 source=0x34 ignored, received=0x33" in j1939.events
    reload(j1939)
    j1939.events.clear()
    j1939.tick(bjm("BJM1", 0x34), bjm("BJM1"), bjm("BJM2"))
    assert not [text for text in j1939.events if "BJM1" in text]  # it has been reported
    assert j1939.state() is State.READY
