"""Frames received of the joysticks, against their cycle and their timeout."""

import errno
import os
import socket
import struct
from collections.abc import Iterable
from itertools import accumulate
from pathlib import Path
from typing import Any

import pytest

from canshaper.bus.packet import CAN_FRAME, SO_TIMESTAMPNS
from canshaper.cli.verbs.doctor import _listened
from canshaper.codec.frame import Frame
from canshaper.commissioning.doctor import joysticks as listening
from canshaper.commissioning.doctor.joysticks import arrival_findings
from canshaper.commissioning.doctor.verdict import Finding, Level
from canshaper.errors import WrongDeviceError
from canshaper.machine.binding import load_deployment
from tests.commissioning.doctor.conftest import SHIPPED
from tests.rigs.files import ROOT
from tests.rigs.j1939 import bjm

MS = 1_000_000
DEPLOYMENT = load_deployment(SHIPPED)  # cycle 20 ms, timeout 100 ms


def at(gaps_ms: Iterable[float]) -> list[int]:
    return [round(t * MS) for t in accumulate(gaps_ms)]


def judged(gaps_ms: Iterable[float]) -> Finding:
    arrivals = {"joystick left": at(gaps_ms), "joystick right": at([20.0] * 50)}
    left, right = arrival_findings(DEPLOYMENT, arrivals)
    assert (right.subject, right.level) == ("joystick right", Level.OK)
    return left


@pytest.mark.parametrize(
    ("gaps_ms", "level"),
    [
        ([20.0] * 100, Level.OK),
        ([20.0] * 99 + [49.0], Level.OK),
        ([20.0] * 99 + [50.0], Level.WARNING),
        ([20.0] * 99 + [99.0], Level.WARNING),
        ([20.0] * 99 + [100.0], Level.BAD),
        ([9.0] * 100, Level.WARNING),
        ([31.0] * 100, Level.WARNING),
        ([], Level.BAD),
        ([20.0], Level.BAD),
    ],
)
def test_levels(gaps_ms: list[float], level: Level) -> None:
    finding = judged(gaps_ms)
    assert finding.level is level
    assert bool(finding.remedy) == (level is not Level.OK)


def test_what_is_said() -> None:
    text = "100 frames, a period of 20.0 ms (DBC: 20 ms), the longest 60.0 ms"
    assert judged([20.0] * 99 + [60.0]).found == text
    assert judged([]).found == "0 frames received"


def test_other_buses_are_not_listened_to(two_buses: Path) -> None:
    arrivals = {"joystick left": at([20.0] * 50)}
    findings = arrival_findings(load_deployment(two_buses), arrivals)
    assert [(f.subject, f.level) for f in findings] == [
        ("joystick left", Level.OK),
        ("joystick right", Level.NOTE),
        ("emergency stop", Level.NOTE),
    ]


class Packets:
    """A socket with frames of every 20 ms, and something to read as long as there is one."""

    def __init__(self, frames: list[tuple[Frame, int]]) -> None:
        self._frames = frames
        self._end, other = os.pipe()
        os.close(other)

    def fileno(self) -> int:
        return self._end

    def setsockopt(self, *_options: int) -> None:
        """It always tells the time."""

    def recvmsg(self, *_sizes: int) -> tuple[bytes, list[tuple[int, int, bytes]], int, None]:
        if not self._frames:
            return CAN_FRAME.pack(socket.CAN_ERR_FLAG, 8, bytes(8)), [], 0, None
        frame, flags = self._frames.pop(0)
        flags |= socket.CAN_EFF_FLAG if frame.extended else 0
        packet = CAN_FRAME.pack(frame.can_id | flags, len(frame.data), frame.data)
        stamp = struct.pack("=qq", 0, 1_000_000_000 - 5 * MS * len(self._frames))
        return packet, [(socket.SOL_SOCKET, SO_TIMESTAMPNS, stamp)], 0, None

    def close(self) -> None:
        os.close(self._end)


def test_joysticks_of_j1939_are_received_from_whatever_address(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    frames = []
    for _ in range(20):
        frames += [(bjm("BJM1", 0x33, 6), 0), (bjm("BJM2", 0x34), 0)]
        frames += [(bjm("BJM1", 0x35), 0), (bjm("BJM1", 0x33), socket.CAN_RTR_FLAG)]

    def sockets(*_names: Any) -> list[Packets]:
        return [Packets(frames)]

    monkeypatch.setattr(listening, "open_sockets", sockets)
    deployment = load_deployment(ROOT / "config" / "j1939-forwarder.yaml")
    arrivals = listening.listen(deployment, 0.1, lambda _passed: None)
    assert {name: len(times) for name, times in arrivals.items()} == {
        "joystick left": 20,
        "joystick right": 20,
    }
    assert {f.level for f in arrival_findings(deployment, arrivals)} == {Level.OK}


@pytest.mark.parametrize(
    ("error", "why"),
    [
        (OSError(errno.ENODEV, "No such device"), "No such device"),
        (WrongDeviceError("expected driver a, but vcan0 has driver b"), "expected driver a, but"),
    ],
)
def test_an_interface_that_cannot_be_listened_to_is_a_finding(
    monkeypatch: pytest.MonkeyPatch, error: Exception, why: str
) -> None:
    def refuse(*_arguments: Any) -> list[Any]:
        raise error

    monkeypatch.setattr(listening, "open_sockets", refuse)
    (finding,) = _listened(DEPLOYMENT, 0.1)
    assert (finding.subject, finding.level) == ("joysticks", Level.BAD)
    assert finding.found.startswith(f"cannot listen: {why}")
