"""The closed loop without clock and bus: operator, controller and crane tick by tick.

The controller is the daemon's own, and everything passes through the same frames.
"""

from collections.abc import Callable

from canshaper.controller.controller import Controller
from canshaper.controller.guarded import Guarded
from canshaper.machine.deployment import Deployment
from canshaper_sim.crane import CraneParameters
from canshaper_sim.cranes import cranes, one_crane
from canshaper_sim.grapple import Sway
from canshaper_sim.joysticks import JoystickNode
from canshaper_sim.operator import Script
from canshaper_sim.plant import PlantNode
from canshaper_sim.recorder import Recorder
from canshaper_sim.recording import Recording


class DriveError(ValueError):
    """The drive could not be made; the message says why."""


def drive(
    deployment: Deployment,
    script: Script,
    *,
    bypass: bool = False,
    parameters: CraneParameters | None = None,
    machine: str | None = None,
    sway: Sway | None = None,
    prepare: Callable[[Controller], None] | None = None,
    crane: str | None = None,
    progress: Callable[[float], None] | None = None,
) -> Recording:
    """Drive a script through a deployment.

    Args:
        deployment: the machine; its buses are not opened.
        script: what the operator does.
        bypass: drive with anti-sway switched off.
        parameters: the crane; by default the nominal one.
        machine: tip, tip-controller or joints; by default what the axes of the deployment say.
        sway: swing of the grapple at the start; by default it hangs still.
        crane: which one moves, where the deployment has several; the others' joysticks stand still.
        prepare: called with the fresh controller, to put another filter in.
        progress: called with the simulated seconds now and then.

    Returns:
        The recorded drive, one row a tick.

    Raises:
        DeploymentError: the deployment does not fit the machine.
        DriveError: nor does the script, or there is no such machine or start pose.
    """
    controller = Controller(deployment)
    if prepare:
        prepare(controller)
    guarded = Guarded(controller)
    try:
        driven = one_crane(deployment, crane) if crane else deployment
        plant = PlantNode(driven, parameters, machine, sway)
        hands = [JoystickNode(driven, script, bypass=bypass)]
        for other in cranes(deployment):
            if other != crane:
                still = Script("still", (), script.duration_s)
                hands.append(JoystickNode(one_crane(deployment, other), still))
    except ValueError as error:
        raise DriveError(str(error)) from None
    recorder = Recorder(driven, parameters)
    tick_ms = deployment.config.tick_ms
    step_s = tick_ms / 1000.0
    for time_ms in range(0, round(script.duration_s * 1000.0), tick_ms):
        time_s = time_ms / 1000.0
        now_ns = time_ms * 1_000_000
        for frame in (f for hand in hands for f in hand.frames_of_tick(time_ms, tick_ms)):
            recorder.receive(frame, time_s)
            if (passed := guarded.receive(frame, now_ns)) is not None:  # by a gateway
                plant.receive(passed)
                recorder.receive(passed, time_s)
        for frame in guarded.tick(now_ns):
            plant.receive(frame)
            recorder.receive(frame, time_s)
        controller.events.clear()
        plant.advance(step_s)
        for frame in plant.feedback():
            guarded.receive(frame, now_ns + tick_ms * 1_000_000)
            recorder.receive(frame, time_s + step_s)
        if progress and time_ms % 1000 == 0:
            progress(time_s)
    return recorder.recording()
