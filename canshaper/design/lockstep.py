"""The closed loop without clock and bus: operator, controller and crane tick by tick.

The controller is the daemon's own, and everything passes through the same frames.
"""

from collections.abc import Callable, Iterator, Sequence

from canshaper.codec.frame import Frame
from canshaper.controller.controller import Controller
from canshaper.controller.guarded import Guarded
from canshaper.daemon.io_cycle import FrameProcessor, io_cycle
from canshaper.daemon.standstill import Standstill
from canshaper.errors import DriveError
from canshaper.machine.deployment import Deployment
from canshaper_sim.crane import CraneParameters
from canshaper_sim.cranes import cranes, one_crane
from canshaper_sim.grapple import Grapple, Sway
from canshaper_sim.joysticks import JoystickNode
from canshaper_sim.operator import Script
from canshaper_sim.plant import PlantNode
from canshaper_sim.recorder import Recorder
from canshaper_sim.recording import Recording


class PlantPort:
    """All buses of a machine at once, between the plant and those who hold its joysticks.

    Args:
        plant: the crane, which gets what is sent.
        on_frame: called with every frame and its time in s.

    Attributes:
        arrived_ns: every frame that waits came just before the tick.
    """

    def __init__(self, plant: PlantNode, on_frame: Callable[[Frame, float], object]) -> None:
        self.arrived_ns = 0
        self._plant = plant
        self._on_frame = on_frame
        self._waiting: list[Frame] = []
        self._time_s = 0.0

    def begin(self, time_ms: int, frames: Sequence[Frame]) -> None:
        """A tick begins; these come from the joysticks, behind what the plant has sent."""
        self.arrived_ns, self._time_s = time_ms * 1_000_000, time_ms / 1000.0
        for frame in frames:
            self._on_frame(frame, self._time_s)
        self._waiting += frames

    def end(self, step_s: float) -> None:
        """It is over: the plant moves until the next one, and sends what it measures."""
        self._plant.advance(step_s)
        self._waiting = self._plant.feedback()
        for frame in self._waiting:
            self._on_frame(frame, self._time_s + step_s)

    def frames(self) -> Iterator[Frame]:
        """Every frame that waits."""
        waiting, self._waiting = self._waiting, []
        return iter(waiting)

    def background(self) -> Iterator[Frame]:
        """There are none."""
        return iter(())

    def send(self, frame: Frame) -> bool:
        """Send to the plant."""
        self._plant.receive(frame)
        self._on_frame(frame, self._time_s)
        return True


class LockStep:
    """A controller and a plant, tick by tick, through the I/O cycle of the daemon.

    Args:
        deployment: the machine.
        processor: the controller, or what stands around one.
        plant: the crane.
        joysticks: those who hold the joysticks.
        on_frame: called with every frame and its time in s.

    Attributes:
        time_ms: when the next tick is.
    """

    def __init__(
        self,
        deployment: Deployment,
        processor: FrameProcessor,
        plant: PlantNode,
        joysticks: Sequence[JoystickNode],
        on_frame: Callable[[Frame, float], object] = lambda _frame, _time_s: None,
    ) -> None:
        self.time_ms = 0
        self._tick_ms = deployment.config.tick_ms
        self._processor = processor
        self._joysticks = joysticks
        self._port = PlantPort(plant, on_frame)
        self._ports = dict.fromkeys(deployment.config.buses, self._port)
        self._standstill = Standstill(deployment)
        self._standstill.clock = lambda: 0  # nothing is ever late here

    def step(self) -> None:
        """One tick, and the time until the next one."""
        time_ms, tick_ms = self.time_ms, self._tick_ms
        hands = self._joysticks
        frames = [frame for hand in hands for frame in hand.frames_of_tick(time_ms, tick_ms)]
        self._port.begin(time_ms, frames)
        io_cycle(self._processor, self._ports, time_ms * 1_000_000, 0, self._standstill)
        self._port.end(tick_ms / 1000.0)
        self.time_ms = time_ms + tick_ms


def drive(
    deployment: Deployment,
    script: Script,
    *,
    bypass: bool = False,
    parameters: CraneParameters | None = None,
    machine: str | None = None,
    sway: Sway | None = None,
    load: tuple[float, Grapple] | None = None,
    prepare: Callable[[Controller], None] | None = None,
    crane: str | None = None,
    on_progress: Callable[[float], None] | None = None,
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
        load: time in s at which a load is picked up, and what hangs there from then on.
        prepare: called with the fresh controller, to put another filter in.
        on_progress: called with the simulated seconds now and then.

    Returns:
        The recorded drive, one row a tick.

    Raises:
        ConfigError: the deployment does not fit the machine.
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
    lock_step = LockStep(deployment, guarded, plant, hands, recorder.receive)
    end_ms = round(script.duration_s * 1000.0)
    while (time_ms := lock_step.time_ms) < end_ms:
        if load and time_ms >= 1000.0 * load[0]:
            plant.crane.pick_up(load[1])
            load = None
        lock_step.step()
        controller.events.clear()
        if on_progress and time_ms % 1000 == 0:
            on_progress(time_ms / 1000.0)
    return recorder.recording()
