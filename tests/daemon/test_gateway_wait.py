"""The daemon in the line between two deadlines: what comes then leaves then."""

import logging
import socket
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import pytest

from canshaper.bus.packet import CAN_FRAME
from canshaper.bus.port import open_port
from canshaper.bus.raw import RawPort
from canshaper.codec.frame import FrameFault
from canshaper.config.bus import Bus
from canshaper.daemon import gateway
from canshaper.daemon.gateway import CHECK_NS, MOST_EMPTY, InlineGateway
from canshaper.errors import GatewayError
from canshaper.gate.cycle import Standstill
from canshaper.protocols.gateway.cangw import Rule
from tests.rigs.gateway import GatewayRig

WAIT_S = 0.1
VIRTUAL = ("interface: socketcan", "interface: virtual")


@pytest.fixture
def rig(tmp_path: Path) -> GatewayRig:
    return GatewayRig(tmp_path, yaml=(VIRTUAL,))


@pytest.fixture
def ends() -> Iterator[tuple[dict[str, RawPort], dict[str, socket.socket], list[FrameFault]]]:
    """Ports on one end of a pair each, as the daemon has them, and the other ends."""
    ports, others, faults = {}, {}, []
    for name in ("joysticks", "machine"):
        ours, others[name] = socket.socketpair(socket.AF_UNIX, socket.SOCK_SEQPACKET)
        for one in (ours, others[name]):
            one.setblocking(False)
        ports[name] = RawPort(
            name,
            Bus(interface="socketcan", channel=""),
            faults.append,
            None,
            (),
            open_sockets=lambda _bus, _ids, one=ours: [one],
            has_echo=bool,
        )
    yield ports, others, faults
    for port in ports.values():
        port.close()
    for one in others.values():
        one.close()


Ends = tuple[dict[str, RawPort], dict[str, socket.socket], list[FrameFault]]


def ignore(_fault: FrameFault) -> None:
    pass


def test_a_joystick_frame_does_not_wait_for_the_tick(rig: GatewayRig, ends: Ends) -> None:
    ports, others, _ = ends
    frames = [rig.joystick() for _ in range(3)]
    for frame in frames:
        others["joysticks"].send(CAN_FRAME.pack(frame.can_id, 8, frame.data))
    InlineGateway(rig.deployment, ignore).wait(
        WAIT_S, rig.controller, ports, Standstill(rig.deployment)
    )
    for frame in frames:
        word, length, data = CAN_FRAME.unpack(others["machine"].recv(CAN_FRAME.size))
        assert (word, length) == (0x110, 8)
        assert data[4:] == frame.data[4:]  # the counters of both begin with 1
    with pytest.raises(BlockingIOError):
        others["joysticks"].recv(CAN_FRAME.size)


def test_nothing_is_passed_on_that_came_while_the_loop_stood_still(
    rig: GatewayRig, ends: Ends, monkeypatch: pytest.MonkeyPatch
) -> None:
    """A wait that sleeps through the deadline leaves it to the tick to find out for how long."""
    ports, others, _ = ends
    frame = rig.joystick()
    others["joysticks"].send(CAN_FRAME.pack(frame.can_id, 8, frame.data))
    now_ns = [0]
    select = gateway.select.select

    def stopped(*arguments: Any) -> Any:
        now_ns[0] += 5_000_000_000
        return select(*arguments)

    monkeypatch.setattr(gateway.select, "select", stopped)
    standstill = Standstill(rig.deployment)
    standstill.clock = lambda: now_ns[0]
    InlineGateway(rig.deployment, ignore).wait(WAIT_S, rig.controller, ports, standstill)
    with pytest.raises(BlockingIOError):
        others["machine"].recv(CAN_FRAME.size)
    assert [one.can_id for one in ports["joysticks"].frames()] == [frame.can_id]


def test_what_is_of_no_use_does_not_keep_the_loop_busy(
    rig: GatewayRig, ends: Ends, monkeypatch: pytest.MonkeyPatch
) -> None:
    """Frames that count as none: after a few it sleeps until its deadline."""
    ports, others, faults = ends
    for _ in range(2 * MOST_EMPTY):
        others["joysticks"].send(b"no frame")
    calls: list[int] = []
    select = gateway.select.select
    monkeypatch.setattr(
        gateway.select, "select", lambda *a: calls.append(1) or select(*a), raising=True
    )
    InlineGateway(rig.deployment, ignore).wait(
        WAIT_S, rig.controller, ports, Standstill(rig.deployment)
    )
    assert len(calls) <= MOST_EMPTY + 1
    assert set(faults) == {FrameFault.WRONG_LENGTH}


def test_a_port_that_is_gone_is_waited_for(rig: GatewayRig, ends: Ends) -> None:
    ports, others, _ = ends
    ports["machine"].close()
    frame = rig.joystick()
    others["joysticks"].send(CAN_FRAME.pack(frame.can_id, 8, frame.data))
    InlineGateway(rig.deployment, ignore).wait(
        WAIT_S, rig.controller, ports, Standstill(rig.deployment)
    )
    assert rig.controller.counters.last_fault is FrameFault.SEND_FAILED


def test_ports_without_a_file_descriptor_are_read_with_the_tick(rig: GatewayRig) -> None:
    """As those of python-can's virtual interface, and of some adapters."""
    buses = rig.deployment.config.buses
    ports = {name: open_port(name, bus, ignore) for name, bus in buses.items()}
    assert [port.fileno() for port in ports.values()] == [-1, -1]
    InlineGateway(rig.deployment, ignore).wait(
        0.001, rig.controller, ports, Standstill(rig.deployment)
    )
    for port in ports.values():
        port.close()


def test_without_socketcan_it_says_that_others_do_not_pass(
    rig: GatewayRig, caplog: pytest.LogCaptureFixture
) -> None:
    line = InlineGateway(rig.deployment, ignore)
    line.check(0, neutral=True)  # nor are there rules to look at
    assert line.pass_others() == 0
    line.close()
    assert [r.message for r in caplog.records] == [
        "gateway=nothing-passes others are passed on with socketcan only"
    ]


def test_rules_are_looked_at_while_nothing_moves_and_reported_once(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, caplog: pytest.LogCaptureFixture
) -> None:
    caplog.set_level(logging.INFO)
    line = InlineGateway(GatewayRig(tmp_path).deployment, ignore)
    kernel_rules: list[Rule] = []
    calls: list[int] = []
    monkeypatch.setattr(gateway, "rules", lambda: calls.append(1) or list(kernel_rules))
    line.check(0, neutral=False)
    assert calls == []
    line.check(0, neutral=True)
    line.check(1, neutral=True)
    assert calls == [1]  # not at every tick
    kernel_rules += gateway.passing_rules(GatewayRig(tmp_path).deployment)
    line.check(CHECK_NS, neutral=True)
    line.check(2 * CHECK_NS, neutral=True)
    kernel_rules.append(kernel_rules[0])
    line.check(3 * CHECK_NS, neutral=True)

    def refuse() -> list[Rule]:
        raise GatewayError("no")

    monkeypatch.setattr(gateway, "rules", refuse)
    line.check(4 * CHECK_NS, neutral=True)
    assert [r.message for r in caplog.records] == [
        "gateway=rules-missing 40 of 40",
        "gateway=rules-right",
        f"gateway=rules-too-many {kernel_rules[0]}",
        "gateway=rules-not-known no",
    ]
