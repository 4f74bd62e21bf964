"""The closed loop without clock and bus: operator, controller and crane tick by tick.

The loop runs the daemon's own controller and passes all data in the same frames.
"""

from collections.abc import Callable, Iterator, Sequence
from itertools import chain
from pathlib import Path
from typing import Protocol, TypedDict, Unpack

from canshaper.codec.frame import Frame, MessageKey
from canshaper.controller.controller import Controller
from canshaper.controller.gated import GatedController
from canshaper.errors import DriveError
from canshaper.gate.cycle import FrameProcessor, Standstill, io_cycle
from canshaper.machine.deployment import Deployment
from canshaper_sim.crane import CraneParameters
from canshaper_sim.cranes import cranes, one_crane
from canshaper_sim.grapple import Grapple, Sway
from canshaper_sim.joysticks import JoystickNode
from canshaper_sim.operator import Script
from canshaper_sim.plant import PlantNode
from canshaper_sim.recorder import Recorder
from canshaper_sim.recording import Recording
from canshaper_sim.unit import unit_of

OnFrame = Callable[[Frame, float], object]
"""Called with a frame and its time in s."""
Received = Callable[[MessageKey], bool]


class Joysticks(Protocol):
    """A source of joystick frames, such as ``JoystickNode``."""

    def frames_of_tick(self, time_ms: int, tick_ms: int) -> Sequence[Frame]:
        """Return the frames since the last tick, in order; times in ms."""


class PlantPort:
    """One port in place of all buses of a machine, between controller, plant and joysticks.

    Args:
        plant: the crane, which receives the sent frames.
        received: returns whether the machine's sockets pass frames of this bus, id and format;
            None passes all.
        on_frame: called with every frame and its time in s; None if nobody listens.
        sends: the messages that may be sent, by bus, id and format; None without a limit.

    Attributes:
        arrived_ns: arrival time of every waiting frame: just before the tick.
    """

    def __init__(
        self,
        plant: PlantNode,
        received: Received | None,
        on_frame: OnFrame | None,
        sends: frozenset[MessageKey] | None = None,
    ) -> None:
        self.arrived_ns = 0
        self._plant, self._on_frame = plant, on_frame
        self._received, self._sends = received, sends
        self._waiting: list[Frame] = []
        self._time_s = 0.0

    def begin(self, time_ms: int, frames: Sequence[Frame]) -> None:
        """Begin a tick; these joystick frames wait, unfiltered, behind the frames of the plant."""
        self.arrived_ns, self._time_s = time_ms * 1_000_000, time_ms / 1000.0
        self._report(frames, self._time_s)
        self._waiting += frames

    def end(self, step_s: float) -> None:
        """End the tick: the plant moves for step_s seconds and sends its feedback."""
        self._plant.advance(step_s)
        frames = self._plant.feedback()
        self._report(frames, self._time_s + step_s)
        received = self._received
        self._waiting = [one for one in frames if received is None or received(one[:3])]

    def _report(self, frames: Sequence[Frame], time_s: float) -> None:
        if self._on_frame is not None:
            for frame in frames:
                self._on_frame(frame, time_s)

    def frames(self) -> Iterator[Frame]:
        """Yield every waiting frame."""
        waiting, self._waiting = self._waiting, []
        return iter(waiting)

    def background(self) -> Iterator[Frame]:
        """Return no frames."""
        return iter(())

    def send(self, frame: Frame) -> bool:
        """Send a frame to the plant, or drop one that may not be sent; always return True."""
        if self._sends is not None and frame[:3] not in self._sends:
            return True
        self._plant.receive(frame)
        if self._on_frame is not None:
            self._on_frame(frame, self._time_s)
        return True


class LockStep:
    """A controller and a plant, tick by tick, through the I/O cycle of the daemon.

    Args:
        processor: the controller behind its gate, or a drive around that.
        joysticks: the sources of joystick frames.
        on_frame: called with every frame and its time in s; None if nobody listens.
        received: see ``PlantPort``.

    Attributes:
        time_ms: time of the next tick.
        processor: the ``processor`` above; it may be replaced between two ticks.
    """

    def __init__(
        self,
        deployment: Deployment,
        processor: FrameProcessor,
        plant: PlantNode,
        joysticks: Sequence[Joysticks],
        on_frame: OnFrame | None = None,
        *,
        received: Received | None = None,
    ) -> None:
        self.time_ms, self._tick_ms = 0, deployment.config.tick_ms
        self.processor, self._joysticks = processor, joysticks
        self._port = PlantPort(plant, received, on_frame, _sends(deployment))
        self._ports = dict.fromkeys(deployment.config.buses, self._port)
        self._standstill = Standstill(deployment)
        self._standstill.clock = lambda: 0  # nothing is ever late here

    def step(self) -> None:
        """Run one tick, and let time pass until the next one."""
        time_ms, tick_ms = self.time_ms, self._tick_ms
        frames = [one.frames_of_tick(time_ms, tick_ms) for one in self._joysticks]
        self._port.begin(time_ms, [*chain.from_iterable(frames)])
        io_cycle(self.processor, self._ports, time_ms * 1_000_000, 0, self._standstill)
        self._port.end(tick_ms / 1000.0)
        self.time_ms = time_ms + tick_ms


def _sends(deployment: Deployment) -> frozenset[MessageKey] | None:
    """Return the messages that a listening deployment may send; None for one that drives."""
    if not deployment.listen_only:
        return None
    buses = deployment.routing.buses.items()
    return frozenset((bus, *key) for bus, ids in buses for key in ids.sent | ids.claims)


class DriveOptions(TypedDict, total=False):
    """Options of a drive besides its deployment and script.

    Attributes:
        bypass: drive with anti-sway switched off.
        parameters: the crane; by default the nominal one.
        machine: one of ``MACHINES``; by default the one that the deployment's axes name.
        sway: swing of the grapple at the start; by default it hangs still.
        loads: (time in s, grapple with its load) for each change of the load.
        prepare: called with the new controller before the drive, to replace its filter.
        crane: name of the crane that moves, if the deployment has several; the others stand still.
        disturb: returns a source of frames that disturbs those of the joysticks.
        unit: file of an FMU in place of our crane; raises DesignError where it is none.
    """

    bypass: bool
    parameters: CraneParameters | None
    machine: str | None
    sway: Sway | None
    loads: Sequence[tuple[float, Grapple]]
    prepare: Callable[[Controller], None] | None
    crane: str | None
    disturb: Callable[[Joysticks], Joysticks]
    unit: Path


def driven_part(deployment: Deployment, crane: str | None) -> Deployment:
    """Return the part of a deployment that belongs to this crane; the whole if crane is None.

    Raises:
        DriveError: no such crane.
    """
    try:
        return one_crane(deployment, crane) if crane else deployment
    except ValueError as error:
        raise DriveError(str(error)) from None


class Simulation:
    """Operator, controller and crane of one drive.

    Args:
        deployment: the machine; its buses are not opened.
        script: the strokes of the operator.
        on_frame: see ``PlantPort``; without it the plant sends only what the controller receives.
        options: see ``DriveOptions``.

    Attributes:
        controller: the daemon's controller.
        plant: the crane.

    Raises:
        ConfigError: the deployment does not fit the machine.
        DriveError: the script does not fit the machine, or there is no such machine or start pose.
    """

    def __init__(
        self,
        deployment: Deployment,
        script: Script,
        on_frame: OnFrame | None = None,
        **options: Unpack[DriveOptions],
    ) -> None:
        listeners = on_frame is not None
        self.controller = Controller(deployment if listeners else deployment.unreported)
        if prepare := options.get("prepare"):
            prepare(self.controller)
        crane, machine = options.get("crane"), options.get("machine")
        parameters, sway = options.get("parameters"), options.get("sway")
        driven = driven_part(deployment, crane)
        try:
            unit = unit_of(path) if (path := options.get("unit")) else None
            self.plant = PlantNode(
                driven, parameters, machine, sway, unit=unit, listeners=listeners
            )
            hand = JoystickNode(driven, script, bypass=options.get("bypass", False))
            hands: list[Joysticks] = [hand]
            for other in cranes(deployment):
                if other != crane:
                    still = Script("still", (), script.duration_s)
                    hands.append(JoystickNode(one_crane(deployment, other), still))
        except ValueError as error:
            raise DriveError(str(error)) from None
        if disturb := options.get("disturb"):
            hands = [*map(disturb, hands)]
        gated = GatedController(self.controller)
        self._lock_step = LockStep(
            deployment, gated, self.plant, hands, on_frame, received=deployment.routing.received
        )
        self._loads = [*options.get("loads", ())]
        self._end_ms = round(script.duration_s * 1000.0)

    def ticks(self) -> Iterator[int]:
        """Drive the script.

        Yields:
            The time of each tick in ms, once the crane has moved; then its events are dropped.
        """
        lock_step, loads = self._lock_step, self._loads
        while (time_ms := lock_step.time_ms) < self._end_ms:
            while loads and time_ms >= 1000.0 * loads[0][0]:
                self.plant.crane.pick_up(loads.pop(0)[1])
            lock_step.step()
            yield time_ms
            self.controller.events.clear()


def drive(
    deployment: Deployment,
    script: Script,
    on_progress: Callable[[float], None] | None = None,
    on_frame: OnFrame | None = None,
    **options: Unpack[DriveOptions],
) -> Recording:
    """Drive a script through a deployment.

    Args:
        deployment: the machine; its buses are not opened.
        script: the strokes of the operator.
        on_progress: called at each tick on a whole simulated second, with that time in s.
        on_frame: called with every frame and its time in s.
        options: see ``DriveOptions``.

    Returns:
        The recorded drive, one row for each sway frame of the crane.

    Raises:
        ConfigError: the deployment does not fit the machine.
        DriveError: the script does not fit the machine, or there is no such machine or start pose.
    """
    driven = driven_part(deployment, options.get("crane"))
    recorder = Recorder(driven, options.get("parameters"))

    def receive(frame: Frame, time_s: float) -> None:
        recorder.receive(frame, time_s)
        if on_frame:
            on_frame(frame, time_s)

    simulation = Simulation(
        deployment, script, receive if on_frame else recorder.receive, **options
    )
    for time_ms in simulation.ticks():
        if on_progress and time_ms % 1000 == 0:
            on_progress(time_ms / 1000.0)
    return recorder.recording()
