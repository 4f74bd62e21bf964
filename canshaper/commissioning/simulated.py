"""A drive of the simulated crane as a log."""

from collections.abc import Callable
from pathlib import Path

from canshaper.codec.frame import Frame
from canshaper.controller.controller import Controller
from canshaper.controller.guarded import Guarded
from canshaper.design.lockstep import LockStep
from canshaper.machine.deployment import Deployment
from canshaper.recording.listen import ReceivedFrame
from canshaper_sim.crane import CraneParameters
from canshaper_sim.hand import Hand, Held
from canshaper_sim.joysticks import JoystickNode
from canshaper_sim.plant import PlantNode
from canshaper_sim.strokes import Script


class _Releasing(JoystickNode):
    """An operator who lets go of the enable switch for a while, and holds the joystick."""

    def __init__(
        self, deployment: Deployment, script: Script, bypass: bool, released: tuple[float, float]
    ) -> None:
        super().__init__(deployment, script, bypass=bypass)
        self._without = Hand(deployment)
        self._deployed = list(deployment.axes)
        self._released_ms = [1000.0 * time_s for time_s in released]

    def frames(self, time_ms: int) -> list[Frame]:
        """Frames that are due at this time of the script; both hands count their frames."""
        joysticks = {a: self.script.command(a, time_ms / 1000.0) for a in self._deployed}
        begin_ms, end_ms = self._released_ms
        without = self._without.frames(time_ms, Held(joysticks, enable=False))
        held = super().frames(time_ms)
        return without if begin_ms <= time_ms < end_ms else held


def log_simulated(
    path: Path,
    deployment: Deployment,
    parameters: CraneParameters,
    script: Script,
    on_progress: Callable[[float], None] = lambda _done: None,
    *,
    bypass: bool = False,
    released: tuple[float, float] | None = None,
) -> None:
    """Drive a script in lock-step and write every frame, as ``candump -L`` does.

    Args:
        path: the log; one that is there is replaced.
        deployment: the machine; one that only listens leaves its valves neutral.
        parameters: the crane.
        script: what the operator does.
        on_progress: called with the part that is driven, 0 to 1.
        bypass: the operator has switched anti-sway off.
        released: from when to when the enable switch is not held, s; None for always held.

    Raises:
        ConfigError: the deployment does not fit the machine.
        DesignError: nor does the script.
        OSError: the log cannot be written.
    """
    plant = PlantNode(deployment, parameters)
    hand = (
        _Releasing(deployment, script, bypass, released)
        if released
        else JoystickNode(deployment, script, bypass=bypass)
    )
    with path.open("w", encoding="ascii", newline="\n") as log:
        buses = deployment.config.buses

        def write(frame: Frame, time_s: float) -> None:
            time_ns, channel = round(1e9 * time_s), buses[frame.bus].channel
            log.write(ReceivedFrame(time_ns, frame.bus, channel, *frame[1:], "").line())

        lock_step = LockStep(deployment, Guarded(Controller(deployment)), plant, [hand], write)
        while lock_step.time_ms < 1000.0 * script.duration_s:
            lock_step.step()
            if lock_step.time_ms % 1000 == 0:
                on_progress(lock_step.time_ms / 1000.0 / script.duration_s)
