"""Who puts a frame on a bus: a line that does so past the gate could move a valve."""

import ast
from collections import Counter
from pathlib import Path

CANSHAPER = Path(__file__).parents[2] / "canshaper"
# Calls of ``send`` that reach a bus, by file; those of its neighbours in the ring are the gate's.
ALLOWED = {
    "gate/cycle.py": (2, "what the gate passes"),
    "daemon/daemon.py": (2, "the digest, which the gate passes; neutral at the second signal"),
    "daemon/ports.py": (1, "neutral at the end"),
    "daemon/gateway.py": (1, "frames of others, without a joystick's and a valve's"),
    "commissioning/calibration/run.py": (1, "neutral at the end"),
    "bus/port.py": (1, "a port hands on"),
    "bus/python_can.py": (1, "to the adapter"),
    "bus/apart.py": (1, "to the adapter"),
    "commissioning/doctor/loop.py": (1, "a port of sockets in place of a bus"),
    "studio/session.py": (1, "joysticks, where the page drives a simulated machine"),
}
# A socket that is no bus.
OTHER = {
    "bus/apart.py": (1, "wakes a thread"),
    "bus/netlink.py": (1, "asks the kernel"),
    "daemon/control_server.py": (1, "answers"),
    "commissioning/control_client.py": (1, "asks"),
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
    found = {
        str(file.relative_to(CANSHAPER)): number
        for file in CANSHAPER.rglob("*.py")
        if (number := calls(file.read_text(encoding="utf-8")))
    }
    known: Counter[str] = Counter()
    for table in (ALLOWED, OTHER):
        known.update({name: number for name, (number, _) in table.items()})
    assert found == known


def test_a_call_is_found() -> None:
    assert calls("port.send(frame)") == calls("if not ports[frame.bus].send(frame): pass") == 1
    assert calls("send = port.send") == 0
