"""Who puts a frame on a bus: a line that does so past the gate could move a valve."""

import ast
from pathlib import Path

import pytest

CANSHAPER = Path(__file__).parents[2] / "canshaper"
# Methods that send, and those of ours that hand on to one: called, or taken under another name.
METHODS = {"send", "_send", "sendto", "sendmsg", "sendall", "send_message", "send_periodic"}
# Objects of the package canopen that send by themselves.
CANOPEN = {"canopen.Network", "canopen.RemoteNode"}
# How often each file sends: on a bus, or on a socket that is none.
SENDERS = {
    "gate/cycle.py": (2, "what the gate passes"),
    "daemon/daemon.py": (2, "the digest, which the gate passes; neutral at the second signal"),
    "daemon/ports.py": (1, "neutral at the end"),
    "daemon/gateway.py": (1, "frames of others, without a joystick's and a valve's"),
    "commissioning/calibration/run.py": (1, "neutral at the end"),
    "commissioning/nodes/parameters.py": (2, "SDOs of init, which a person confirms"),
    "bus/port.py": (1, "a port hands on"),
    "bus/interface.py": (2, "which socket of a bus sends"),
    "bus/raw.py": (1, "to that socket"),
    "bus/python_can.py": (1, "to the adapter"),
    "bus/apart.py": (2, "to the adapter; wakes its thread"),
    "commissioning/doctor/loop.py": (1, "a port of sockets in place of a bus"),
    "studio/crane.py": (1, "joysticks, where the page drives a simulated machine"),
    "bus/netlink.py": (1, "asks the kernel"),
    "daemon/notify.py": (6, "notifies systemd"),
    "daemon/control_server.py": (1, "answers on the control socket"),
    "commissioning/control_client.py": (1, "asks on the control socket"),
    "commissioning/doctor/joysticks.py": (2, "a pair of sockets"),
    "commissioning/doctor/measure.py": (1, "a pair of sockets"),
    "studio/client.py": (2, "to the page"),
}
# Who runs cycles, and with what: each has the gate in it, as a controller alone has not.
PROCESSORS = {
    "daemon/daemon.py": {"self._recorder"},
    "commissioning/calibration/run.py": {"drive", "GatedController(Controller(deployment))"},
    "commissioning/doctor/loop.py": {"self._gated"},
    "commissioning/procedure/bench.py": {"GatedController(Controller(deployment))"},
    "recording/ticks.py": {"self._gated"},
    "studio/in_process.py": {"self._gated"},
    # Those hand on what they were given.
    "gate/cycle.py": {"processor"},
    "daemon/gateway.py": {"processor"},
    "design/lockstep.py": {"self.processor", "gated"},
}
CYCLES = {"io_cycle": 0, "receive_waiting": 0, "LockStep": 1}  # which argument the processor is


def sends(text: str) -> int:
    """How often a text sends, or takes what sends under another name."""
    return sum(
        isinstance(node.ctx, ast.Load) and node.attr in METHODS
        if isinstance(node, ast.Attribute)
        else isinstance(node, ast.Call) and ast.unparse(node.func) in CANOPEN
        for node in ast.walk(ast.parse(text))
    )


def processors(text: str) -> set[str]:
    """Processors that the cycles of a module run with, as they stand in its text."""
    calls = (node for node in ast.walk(ast.parse(text)) if isinstance(node, ast.Call))
    named = ((call, CYCLES.get(ast.unparse(call.func))) for call in calls)
    return {ast.unparse(call.args[number]) for call, number in named if number is not None}


def texts() -> dict[str, str]:
    return {
        str(file.relative_to(CANSHAPER)): file.read_text(encoding="utf-8")
        for file in CANSHAPER.rglob("*.py")
    }


def test_every_line_that_sends_is_known() -> None:
    counts = {name: number for name, text in texts().items() if (number := sends(text))}
    assert counts == {name: number for name, (number, _) in SENDERS.items()}


def test_every_cycle_has_the_gate_in_it() -> None:
    assert {name: found for name, text in texts().items() if (found := processors(text))} == (
        PROCESSORS
    )


@pytest.mark.parametrize(
    ("text", "count"),
    [
        ("port.send(frame)", 1),
        ("if not ports[frame.bus].send(frame): pass", 1),
        ("self._send(data)", 1),
        ("self._send = sockets[0].send", 1),
        ("one.sendto(data, address); one.sendmsg([data])", 2),
        ("network.send_message(0, b'')", 1),
        ("network = canopen.Network(); network.add_node(canopen.RemoteNode(1, objects))", 2),
        ("def of(bus: canopen.Network) -> None: bus.send = None", 0),
        ("sent = port.sent", 0),
    ],
)
def test_what_counts_as_sending(text: str, count: int) -> None:
    assert sends(text) == count


def test_what_runs_a_cycle() -> None:
    assert processors("io_cycle(Controller(d), ports); LockStep(d, gated, plant)") == {
        "Controller(d)",
        "gated",
    }
