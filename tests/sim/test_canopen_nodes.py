"""The simulated nodes of CANopen: what starts them."""

import pytest

from canshaper.codec.frame import HEARTBEAT, NMT, Frame, NodeState
from canshaper_sim.canopen import CanopenSide
from tests.rigs.files import CONFIG, read


@pytest.mark.parametrize(
    ("data", "started"),
    [
        ((1,), 0),  # CiA 301: two bytes, the second names the node
        ((), 0),
        ((128, 0), 0),
        ((1, 0), 5),
        ((1, 16), 1),
        ((1, 99), 0),
    ],
)
def test_a_start_names_a_node_or_all(data: tuple[int, ...], started: int) -> None:
    side = CanopenSide(read(CONFIG / "canopen-forwarder.yaml"))
    side.receive(Frame("crane", NMT, False, bytes(data)))
    states = [one.data for one in side.frames(0.0) if one.can_id > HEARTBEAT]
    assert states.count(bytes((NodeState.OPERATIONAL,))) == started, states
