"""Plant and operator in real time on the buses of a deployment."""

import signal
from types import FrameType

from canshaper.bus.port import Port, open_port
from canshaper.codec.frame import FrameFault
from canshaper.gate.cycle import run_at_deadlines
from canshaper.machine.deployment import Deployment
from canshaper_sim.crane import CraneParameters
from canshaper_sim.joysticks import JoystickNode
from canshaper_sim.operator import Script
from canshaper_sim.plant import PlantNode

# The plant looks for commands twice in a tick of 20 ms: a valve does not wait for our loop.
PLANT_STEP_MS = 10


class StopFlag:
    """A flag that SIGTERM or SIGINT sets; it takes over both signals of the process."""

    def __init__(self) -> None:
        self.set = False
        for number in (signal.SIGTERM, signal.SIGINT):
            signal.signal(number, self._on_signal)

    def _on_signal(self, _number: int, _frame: FrameType | None) -> None:
        self.set = True


def open_ports(deployment: Deployment) -> dict[str, Port]:
    """Open every bus of the deployment; faults of the simulated frames are ignored.

    Returns:
        bus name -> open port.

    Raises:
        BusError: a bus cannot be opened.
    """

    def ignore(_fault: FrameFault) -> None:
        pass

    return {
        name: open_port(name, bus, ignore, fd=deployment.routing.buses[name].fd)
        for name, bus in deployment.config.buses.items()
    }


def run_plant(
    deployment: Deployment, parameters: CraneParameters, machine: str | None = None
) -> None:
    """Simulate the crane until SIGTERM or SIGINT: valve frames in, feedback out every 20 ms."""
    node = PlantNode(deployment, parameters, machine)
    ports = open_ports(deployment)
    stop = StopFlag()
    steps_to_feedback = 0

    def body(_now_ns: int, missed: int, _late_ns: int) -> bool:
        nonlocal steps_to_feedback
        for port in ports.values():
            for frame in port.frames():
                node.receive(frame)
        node.advance((1 + missed) * PLANT_STEP_MS / 1000.0)
        if steps_to_feedback == 0:
            for frame in node.feedback():
                ports[frame.bus].send(frame)
        steps_to_feedback = 1 - steps_to_feedback
        return not stop.set

    try:
        run_at_deadlines(PLANT_STEP_MS * 1_000_000, body)
    finally:
        for port in ports.values():
            port.close()


def run_operator(deployment: Deployment, script: Script, *, bypass: bool) -> bool:
    """Play a script once, then send no more; return False if SIGTERM or SIGINT stopped it."""
    node = JoystickNode(deployment, script, bypass=bypass)
    ports = open_ports(deployment)
    stop = StopFlag()
    cycle_ms = node.cycle_ms
    time_ms = 0

    def body(_now_ns: int, missed: int, _late_ns: int) -> bool:
        nonlocal time_ms
        time_ms += missed * cycle_ms
        for frame in node.frames(time_ms):
            ports[frame.bus].send(frame)
        time_ms += cycle_ms
        return not stop.set and time_ms <= script.duration_s * 1000.0

    try:
        run_at_deadlines(cycle_ms * 1_000_000, body)
    finally:
        for port in ports.values():
            port.close()
    return not stop.set
