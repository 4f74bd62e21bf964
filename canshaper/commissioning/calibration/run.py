"""Run a measurement: on the buses of the machine, or on the simulated crane in lock-step."""

import signal
import time
from collections.abc import Callable
from contextlib import ExitStack
from types import FrameType
from typing import Any

from canshaper.bus.port import Port, open_port
from canshaper.codec.frame import FrameFault
from canshaper.commissioning.calibration.drive import CalibrationDrive
from canshaper.controller.controller import Controller
from canshaper.controller.gated import GatedController
from canshaper.design.lockstep import LockStep
from canshaper.gate.cycle import Standstill, boottime_ns, io_cycle, run_at_deadlines
from canshaper.machine.deployment import Deployment
from canshaper_sim.crane import CraneParameters
from canshaper_sim.joysticks import JoystickNode
from canshaper_sim.operator import Script, Stroke
from canshaper_sim.plant import PlantNode

# How often neutral is sent to every valve at the end: a frame may be lost.
LAST_FRAMES = 3
# A measurement waits so long for the enable, a neutral joystick and feedback of the speed.
WAIT_LIMIT_S = 60.0
# Signals by which a terminal ends or stops a program: no valve may stay open after them.
_STOPS = ("SIGINT", "SIGTERM", "SIGHUP", "SIGQUIT", "SIGTSTP")
STOPS = [getattr(signal, name) for name in _STOPS if hasattr(signal, name)]


def run_live(
    drive: CalibrationDrive, deployment: Deployment, on_progress: Callable[[CalibrationDrive], None]
) -> None:
    """Drive the axes of the machine until the ramp is over, something stops it, or Ctrl-C.

    It also ends where the ramp cannot begin within ``WAIT_LIMIT_S``; ``drive.ended`` says why.
    However it ends, the last frames to every valve are neutral.

    Args:
        drive, deployment: the measurement, and its machine.
        on_progress: called five times a second, and at the end.

    Raises:
        BusError: a bus cannot be opened.
    """
    ports: dict[str, Port] = {}
    stopped = ""

    def ignore(_fault: FrameFault) -> None:
        pass

    def stop(number: int, _frame: FrameType | None) -> None:
        nonlocal stopped
        stopped = "Ctrl-C" if number == signal.SIGINT else signal.Signals(number).name

    before = {number: signal.signal(number, stop) for number in STOPS}
    next_report_ns = 0
    limit_ns = boottime_ns() + round(1e9 * WAIT_LIMIT_S)
    standstill = Standstill(deployment)

    def body(now_ns: int, missed: int, _late_ns: int) -> bool:
        nonlocal next_report_ns
        io_cycle(drive, ports, now_ns, missed, standstill)
        if now_ns >= next_report_ns:
            next_report_ns = now_ns + 200_000_000
            on_progress(drive)
        if stopped and not drive.ended:
            drive.ended = f"stopped: {stopped}"
        if (waiting := drive.waiting_for) and now_ns >= limit_ns and not drive.ended:
            drive.ended = (
                f"stopped: it did not begin within {WAIT_LIMIT_S:g} s, it waits for {waiting}"
            )
        return not drive.ended

    with ExitStack() as open_ports:
        open_ports.callback(_restore, before)
        for name, bus in deployment.config.buses.items():
            ports[name] = open_port(name, bus, ignore, fd=deployment.routing.buses[name].fd)
            open_ports.callback(ports[name].close)
        try:
            run_at_deadlines(deployment.config.tick_ms * 1_000_000, body)
        finally:
            for _ in range(LAST_FRAMES):
                for frame in drive.neutral_frames():
                    ports[frame.bus].send(frame)
                time.sleep(deployment.config.tick_ms / 1000.0)
    on_progress(drive)


def _restore(handlers: dict[signal.Signals, Any]) -> None:
    """Restore the signal handlers from before the measurement."""
    for number, handler in handlers.items():
        signal.signal(number, handler)


# A measurement that has not begun by then waits for something that never comes.
LONGEST_WAIT_S = 5.0
# To give an axis room, the simulated person drives it back at this level, at most for so long.
BACK, LONGEST_BACK_S = -0.4, 30.0


def run_simulated(
    drive: CalibrationDrive,
    deployment: Deployment,
    parameters: CraneParameters | None,
    on_progress: Callable[[CalibrationDrive], None],
) -> None:
    """Drive the axes of the simulated crane, with enable held, until ``drive.ended`` says why.

    Before, each axis is driven back until it has room for its ramp, at most 30 s.

    Raises:
        ConfigError: the deployment does not fit the simulated machine.
    """
    plant = PlantNode(deployment, parameters)
    for axis in drive.turns[-1]:
        _give_room(plant, deployment, axis, drive.ramp.travel_s)
    joysticks = JoystickNode(deployment, Script("held", (), 1e9))
    lock_step = LockStep(deployment, drive, plant, [joysticks])
    while not drive.ended:
        lock_step.step()
        if drive.waiting_for and lock_step.time_ms > 1000 * LONGEST_WAIT_S:
            drive.ended = f"stopped: waits for {drive.waiting_for}"
        if lock_step.time_ms % 1000 == 0:
            on_progress(drive)


def _give_room(plant: PlantNode, deployment: Deployment, axis: str, travel_s: float) -> None:
    """Drive the axis back by its joystick until it has room for so many seconds of full speed."""
    actuator = plant.crane.boom.axes[deployment.coordinates.get(axis, axis)]
    back = Script("back", (Stroke(axis, 0.0, LONGEST_BACK_S, BACK),), 2.0 * LONGEST_BACK_S)
    hand = JoystickNode(deployment, back)
    lock_step = LockStep(deployment, GatedController(Controller(deployment)), plant, [hand])
    while actuator.room_s < travel_s and lock_step.time_ms < 1000 * LONGEST_BACK_S:
        lock_step.step()
