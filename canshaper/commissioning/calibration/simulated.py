"""A measurement of a valve on the simulated crane, in lock-step."""

from collections.abc import Callable

from canshaper.commissioning.calibration.drive import CalibrationDrive
from canshaper.controller.controller import Controller
from canshaper.controller.guarded import Guarded
from canshaper.design.lockstep import LockStep
from canshaper.machine.deployment import Deployment
from canshaper_sim.crane import CraneParameters
from canshaper_sim.joysticks import JoystickNode
from canshaper_sim.operator import Script, Stroke
from canshaper_sim.plant import PlantNode

# A measurement that has not begun by then waits for something that never comes.
LONGEST_WAIT_S = 5.0
# A person who gives an axis room takes it back slowly, and no longer.
BACK, LONGEST_BACK_S = -0.4, 30.0


def run_simulated(
    drive: CalibrationDrive,
    deployment: Deployment,
    parameters: CraneParameters | None,
    on_progress: Callable[[CalibrationDrive], None],
) -> None:
    """Drive the axis of the simulated crane, with the enable switch held, to the end.

    Before that it is brought to where it has room for its ramp.

    Raises:
        ConfigError: the deployment does not fit the machine.
    """
    plant = PlantNode(deployment, parameters)
    _give_room(plant, deployment, drive)
    joysticks = JoystickNode(deployment, Script("held", (), 1e9))
    lock_step = LockStep(deployment, drive, plant, [joysticks])
    while not drive.ended:
        lock_step.step()
        if drive.waiting_for and lock_step.time_ms > 1000 * LONGEST_WAIT_S:
            drive.ended = f"stopped: waits for {drive.waiting_for}"
        if lock_step.time_ms % 1000 == 0:
            on_progress(drive)


def _give_room(plant: PlantNode, deployment: Deployment, drive: CalibrationDrive) -> None:
    """Bring the axis back with its joystick, as a person does on request."""
    actuator = plant.crane.boom.axes[drive.axis]
    back = Script("back", (Stroke(drive.axis, 0.0, LONGEST_BACK_S, BACK),), 2.0 * LONGEST_BACK_S)
    hand = JoystickNode(deployment, back)
    lock_step = LockStep(deployment, Guarded(Controller(deployment)), plant, [hand])
    while actuator.room_s < drive.ramp.travel_s and lock_step.time_ms < 1000 * LONGEST_BACK_S:
        lock_step.step()
