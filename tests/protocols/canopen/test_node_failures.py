"""Failures of another node: none is missed, however short it was; what the log says of them."""

from collections.abc import Callable

import pytest

from canshaper.config.bus import CanopenNode
from canshaper.protocols.canopen.network import NodeGate
from canshaper.protocols.canopen.nodes import RemoteNode
from canshaper.shaping.states import Reason
from tests.rigs.canopen import BOOT_UP, INIT, OPERATIONAL, PRE_OPERATIONAL, STOPPED, CanopenRig

MS = 1_000_000
IN_TIME, TOO_LATE = 100 * MS, 100 * MS + 1
FLOW_COMMAND_LATE = 0x8003
REGISTER = 0x81

Message = Callable[[RemoteNode, int], object]


def beat(state: int) -> Message:
    return lambda node, now_ns: node.heartbeat(bytes((state,)), now_ns)


def alarm(code: int) -> Message:
    data = code.to_bytes(2, "little") + bytes((REGISTER if code else 0, *5 * (0,)))
    return lambda node, now_ns: node.alarm(data, now_ns)


def tick(node: RemoteNode, now_ns: int) -> bool:
    return node.lost(now_ns)


@pytest.mark.parametrize(
    ("messages", "stops", "alarms"),
    [
        pytest.param([(IN_TIME, beat(STOPPED)), (0, beat(OPERATIONAL))], 1, 0, id="stopped"),
        pytest.param(
            [(0, beat(BOOT_UP)), (0, beat(PRE_OPERATIONAL)), (0, beat(OPERATIONAL))],
            2,
            0,
            id="restarted",
        ),
        pytest.param([(TOO_LATE, tick), (0, beat(OPERATIONAL))], 1, 0, id="silent at a tick"),
        pytest.param([(TOO_LATE, beat(OPERATIONAL))], 1, 0, id="silent between two ticks"),
        pytest.param(
            [(TOO_LATE, beat(BOOT_UP)), (0, beat(OPERATIONAL))],
            2,
            0,
            id="silent between two ticks, then restarted",
        ),
        pytest.param(
            [(TOO_LATE, tick), (0, beat(BOOT_UP)), (0, beat(OPERATIONAL))],
            2,
            0,
            id="silent at a tick, then restarted",
        ),
        pytest.param([(0, alarm(FLOW_COMMAND_LATE)), (0, alarm(0))], 0, 1, id="emergency"),
        pytest.param(
            [(0, alarm(FLOW_COMMAND_LATE)), (0, alarm(0x5000)), (0, alarm(0))],
            0,
            2,
            id="two emergencies",
        ),
    ],
)
def test_a_failure_that_is_over_counts_each_time_it_happens(
    messages: list[tuple[int, Message]], stops: int, alarms: int
) -> None:
    """The same once more, after the gate was asked, is seen like the first."""
    node = RemoteNode(CanopenNode(id=0x20, heartbeat_ms=100))
    gate = NodeGate(node, Reason.VALVE_FAULT)
    now_ns = 0
    node.heartbeat(bytes((OPERATIONAL,)), now_ns)
    assert (node.stops, node.alarms) == (0, 0)
    assert gate(False, now_ns) is None
    for times in (1, 2, 3):
        for passed_ns, message in messages:
            now_ns += passed_ns
            message(node, now_ns)
        assert (node.stops, node.alarms) == (times * stops, times * alarms)
        assert gate(False, now_ns) is Reason.VALVE_FAULT
        assert gate(False, now_ns) is None


def test_a_valve_whose_node_restarts_between_two_ticks_begins_with_init(rig: CanopenRig) -> None:
    """Though its status word says ACTIVE in the same tick."""
    rig.moving()
    rig.heartbeat("slew", BOOT_UP)
    assert rig.run(Slew=30000)["slew"] == {"ControlWord": INIT, "SetPoint": 0}
    assert rig.axis() == ("TRIPPED", "VALVE_FAULT")


@pytest.mark.parametrize(
    ("emergencies", "code"),
    [
        ([(FLOW_COMMAND_LATE, REGISTER)], FLOW_COMMAND_LATE),
        ([(FLOW_COMMAND_LATE, REGISTER), (0, REGISTER)], FLOW_COMMAND_LATE),
        ([(0, REGISTER)], 0x1000),  # generic error
    ],
)
def test_an_emergency_is_logged_with_the_code_that_is_known(
    rig: CanopenRig, emergencies: list[tuple[int, int]], code: int
) -> None:
    """Code 0 with errors left in the register does not say which."""
    rig.ready().texts.clear()
    for emergency in emergencies:
        rig.emergency("slew", *emergency)
    rig.run()
    assert f"bus=crane node=slew state=OPERATIONAL emergency={code:#06x}" in rig.texts


@pytest.mark.parametrize(
    ("state", "name"),
    [
        (BOOT_UP, "BOOT_UP"),
        (STOPPED, "STOPPED"),
        (PRE_OPERATIONAL, "PRE_OPERATIONAL"),
        (0x33, "unknown (51)"),
    ],
)
def test_a_state_is_logged_by_its_name(rig: CanopenRig, state: int, name: str) -> None:
    rig.ready().texts.clear()
    rig.states["slew"] = state
    rig.run()
    assert f"bus=crane node=slew state={name} emergency=0x0000" in rig.texts
