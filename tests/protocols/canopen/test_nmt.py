"""NMT on a bus of CANopen: we boot, beat and start nodes; a second one of us; other services."""

from itertools import pairwise
from pathlib import Path

import pytest

from canshaper.codec.frame import Frame
from canshaper.daemon.daemon import Daemon
from canshaper.daemon.ports import close_ports
from canshaper.machine.binding import load_deployment
from tests.rigs.canopen import (
    NODES,
    OPERATIONAL,
    OURS,
    PRE_OPERATIONAL,
    STOPPED,
    CanopenRig,
    write_variant,
)

START = 1


@pytest.fixture
def guest(tmp_path: Path) -> CanopenRig:
    """A machine in which another one is the master."""
    return CanopenRig(write_variant(tmp_path, ("master: true", "master: false")))


def test_we_boot_and_then_beat_every_200_ms(rig: CanopenRig) -> None:
    beats = []
    for _ in range(61):
        rig.run()
        beats += [(rig.now_ns, f.data) for f in rig.sent if f.can_id == 0x700 + OURS]
    assert [data for _, data in beats] == [b"\0"] + [b"\x05"] * (len(beats) - 1)
    times = [at for at, _ in beats]
    assert {b - a for a, b in pairwise(times)} == {200_000_000}
    assert len(times) == 7


def test_what_we_send_has_standard_ids_on_the_bus_of_the_nodes(rig: CanopenRig) -> None:
    rig.heartbeat("left", PRE_OPERATIONAL)
    rig.tick()
    assert Frame("crane", 0x700 + OURS, False, b"\0") in rig.sent
    assert Frame("crane", 0x000, False, bytes((START, NODES["left"]))) in rig.sent
    rig.run(10)
    assert Frame("crane", 0x700 + OURS, False, bytes((OPERATIONAL,))) in rig.sent


def test_a_node_that_boots_is_started_at_once_and_again_until_it_works(rig: CanopenRig) -> None:
    rig.states = dict.fromkeys(NODES, -1)
    rig.states["slew"] = PRE_OPERATIONAL
    rig.heartbeat("slew", 0)
    commands = []
    for _ in range(51):
        rig.run()
        commands += rig.commands
    assert commands == [bytes((START, NODES["slew"]))] * 3  # now, after 0.5 s, after 1 s
    assert rig.axis() == ("NEUTRAL_WAIT", "NODE_FAULT")
    rig.states["slew"] = OPERATIONAL
    rig.run(40)
    assert not rig.commands
    assert rig.axis("lift") == ("NEUTRAL_WAIT", "NODE_FAULT")  # never seen, never started


def test_a_stopped_node_is_started_too(rig: CanopenRig) -> None:
    rig.ready()
    rig.states["left"] = STOPPED
    rig.run()
    assert rig.commands == [bytes((START, NODES["left"]))]


def test_a_node_of_which_nothing_is_known_after_a_stall_is_not_started(rig: CanopenRig) -> None:
    rig.ready()
    rig.controller.stalled()
    rig.tick()
    assert not rig.commands
    assert "bus=crane node=slew state=lost emergency=0x0000" in rig.texts


def test_who_is_no_master_starts_no_one(guest: CanopenRig) -> None:
    guest.states = dict.fromkeys(NODES, PRE_OPERATIONAL)
    for node in NODES:
        guest.heartbeat(node, 0)
    for _ in range(60):
        guest.run()
        assert not guest.commands
    guest.states = dict.fromkeys(NODES, OPERATIONAL)
    guest.ready()


@pytest.mark.parametrize("can_id", [0x700 + OURS, 0x000])
def test_a_second_one_of_us_is_reported(rig: CanopenRig, can_id: int) -> None:
    """Our heartbeat, and the commands of the master, come from no other node."""
    rig.ready()
    rig.receive(can_id, b"\x05" if can_id else b"\x80\x00")
    assert rig.last_fault == "SECOND_SENDER"


def test_another_master_is_welcome_where_we_are_none(guest: CanopenRig) -> None:
    guest.receive(0x000, bytes((START, 0)))
    assert guest.last_fault == "NONE"


@pytest.mark.parametrize("can_id", [0x080, 0x085, 0x100, 0x5A0, 0x620, 0x705, 0x77F, 0x7E5])
def test_other_services_are_daily_life(rig: CanopenRig, can_id: int) -> None:
    """SYNC, EMCY and heartbeats of nodes that are not ours to watch, TIME, SDO, LSS."""
    rig.receive(can_id, bytes(8))
    assert rig.last_fault == "NONE"
    rig.controller.receive(Frame("crane", can_id, True, bytes(8)), rig.now_ns)
    assert rig.last_fault == "UNKNOWN_ID"


@pytest.mark.parametrize("can_id", [0x001, 0x101, 0x1A5, 0x480, 0x6FF])
def test_a_pdo_that_no_one_knows_is_a_fault(rig: CanopenRig, can_id: int) -> None:
    rig.receive(can_id, bytes(8))
    assert rig.last_fault == "UNKNOWN_ID"


@pytest.mark.parametrize(("base", "data"), [(0x700, b""), (0x700, b"\5\5"), (0x80, bytes(7))])
def test_wrong_length(rig: CanopenRig, base: int, data: bytes) -> None:
    rig.ready()
    rig.receive(base + NODES["slew"], data)
    assert rig.last_fault == "WRONG_LENGTH"
    rig.run()
    assert rig.axis()[0] == "READY"


def test_the_daemon_opens_a_bus_of_canopen(tmp_path: Path) -> None:
    """A bus is a key of what is open; that has to work with the nodes in it."""
    file = write_variant(
        tmp_path, ("interface: socketcan", "interface: virtual"), ("vcan0", "canopen-test")
    )
    daemon = Daemon(lambda: load_deployment(file))
    assert set(daemon._ports) == {"crane"}
    close_ports(daemon._ports.values())
