"""The lane itself: interfaces are there and carry frames, seen with foreign tools too."""

import shutil
import socket
import struct
import subprocess
from collections.abc import Iterator

import can
import pytest

FRAME = struct.Struct("=IB3x8s")  # struct can_frame
ANSWER_S = 30.0  # only to end a test that hangs; emulated processors are slow


def raw_socket(name: str) -> socket.socket:
    raw = socket.socket(socket.AF_CAN, socket.SOCK_RAW, socket.CAN_RAW)
    raw.settimeout(ANSWER_S)
    raw.bind((name,))
    return raw


def tool(name: str) -> str:
    return shutil.which(name) or pytest.skip(f"{name} not found (Debian package can-utils)")


@pytest.fixture
def bus() -> Iterator[can.BusABC]:
    with can.Bus(interface="socketcan", channel="vcan0", ignore_config=True) as opened:
        yield opened


def test_vcan_carries_a_frame() -> None:
    frame = FRAME.pack(0x123, 3, b"\x01\x02\x03")
    with raw_socket("vcan0") as sender, raw_socket("vcan0") as receiver:
        sender.send(frame)
        assert receiver.recv(FRAME.size) == frame


def test_the_two_vcan_are_apart() -> None:
    with raw_socket("vcan0") as sender, raw_socket("vcan1") as receiver:
        receiver.setblocking(False)
        sender.send(FRAME.pack(0x123, 0, b""))  # vcan delivers before send() returns
        with pytest.raises(BlockingIOError):
            receiver.recv(FRAME.size)


def test_controllers_share_one_bus(can_pair: tuple[str, str]) -> None:
    first, second = can_pair
    extended = 0x0CFE5A27 | socket.CAN_EFF_FLAG
    frame = FRAME.pack(extended, 8, bytes(range(8)))
    with raw_socket(first) as one, raw_socket(second) as two:
        one.send(frame)
        assert two.recv(FRAME.size) == frame
        two.send(frame)
        assert one.recv(FRAME.size) == frame


def test_python_can_receives_from_cansend(bus: can.BusABC) -> None:
    subprocess.run([tool("cansend"), "vcan0", "0CFE5A27#0102030405060708"], check=True)
    message = bus.recv(ANSWER_S)
    assert message is not None
    assert (message.arbitration_id, message.is_extended_id) == (0x0CFE5A27, True)
    assert bytes(message.data) == bytes(range(1, 9))


def test_candump_receives_from_python_can(bus: can.BusABC) -> None:
    hello = can.Message(arbitration_id=0x7FF, is_extended_id=False)
    expected = can.Message(arbitration_id=0x321, data=[0xDE, 0xAD], is_extended_id=False)
    quiet_ms = str(int(ANSWER_S * 1000))  # candump ends after so long without a frame
    with subprocess.Popen(
        [tool("candump"), "-L", "-T", quiet_ms, "vcan0"], stdout=subprocess.PIPE, text=True
    ) as candump:
        assert candump.stdout is not None
        try:
            greeting = bus.send_periodic(hello, 0.02)
            # whenever candump listens at last, it prints the next greeting
            assert candump.stdout.readline().split()[1:] == ["vcan0", "7FF#"]
            greeting.stop()
            bus.send(expected)
            assert any(line.split()[1:] == ["vcan0", "321#DEAD"] for line in candump.stdout)
        finally:
            candump.terminate()
