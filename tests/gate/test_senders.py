"""Who puts a frame on a bus: a line that does so past the gate could move a valve."""

import ast
from pathlib import Path

CANSHAPER = Path(__file__).parents[2] / "canshaper"
# Calls of ``send`` by file: on a bus, or on a socket that is none.
SENDERS = {
    "gate/cycle.py": (2, "what the gate passes"),
    "daemon/daemon.py": (2, "the digest, which the gate passes; neutral at the second signal"),
    "daemon/ports.py": (1, "neutral at the end"),
    "daemon/gateway.py": (1, "frames of others, without a joystick's and a valve's"),
    "commissioning/calibration/run.py": (1, "neutral at the end"),
    "bus/port.py": (1, "a port hands on"),
    "bus/python_can.py": (1, "to the adapter"),
    "bus/apart.py": (2, "to the adapter; wakes its thread"),
    "commissioning/doctor/loop.py": (1, "a port of sockets in place of a bus"),
    "studio/crane.py": (1, "joysticks, where the page drives a simulated machine"),
    "bus/netlink.py": (1, "asks the kernel"),
    "daemon/control_server.py": (1, "answers on the control socket"),
    "commissioning/control_client.py": (1, "asks on the control socket"),
    "commissioning/doctor/joysticks.py": (1, "a pair of sockets"),
    "commissioning/doctor/measure.py": (1, "a pair of sockets"),
}


def calls(text: str) -> int:
    return sum(
        isinstance(node, ast.Call)
        and isinstance(node.func, ast.Attribute)
        and node.func.attr == "send"
        for node in ast.walk(ast.parse(text))
    )


def test_every_line_that_sends_is_known() -> None:
    counts = {
        str(file.relative_to(CANSHAPER)): number
        for file in CANSHAPER.rglob("*.py")
        if (number := calls(file.read_text(encoding="utf-8")))
    }
    assert counts == {name: number for name, (number, _) in SENDERS.items()}


def test_a_call_is_counted() -> None:
    assert calls("port.send(frame)") == calls("if not ports[frame.bus].send(frame): pass") == 1
    assert calls("send = port.send") == 0
