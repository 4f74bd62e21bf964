"""The operator's joysticks as a node on CAN: a script in, joystick frames out."""

from canshaper.codec.frame import Frame
from canshaper.errors import DesignError
from canshaper.machine.deployment import Deployment
from canshaper_sim.axes import JOINT_AXES, SLEW
from canshaper_sim.hand import Hand, Held
from canshaper_sim.strokes import Script


def switches_off(deployment: Deployment) -> bool:
    """Return whether a joystick can switch anti-sway off; if none can, every drive is shaped."""
    return any(one.config.anti_sway_off for one in deployment.joysticks.values())


class JoystickNode:
    """All joysticks of a deployment, moved by a script, with the enable switch held.

    Args:
        deployment: names the joystick messages and their switches.
        script: the strokes of the operator.
        bypass: the operator has switched anti-sway off.

    Raises:
        DesignError: the script moves a boom joint that the crane lacks, or any axis that a crane
            with boom joints lacks. Other axes that the crane lacks are left out.
    """

    def __init__(self, deployment: Deployment, script: Script, *, bypass: bool = False) -> None:
        joints = {*JOINT_AXES} - {SLEW}
        foreign = {*script.axes} - {*deployment.axes}
        if foreign & joints or (foreign and joints & deployment.axes.keys()):
            raise DesignError(
                f"script {script.name} moves {', '.join(script.axes)};"
                f" the deployment has {', '.join(deployment.axes)}"
            )
        self.script = script
        self._hand, self._axes, self._bypass = Hand(deployment), list(deployment.axes), bypass
        self.cycle_ms = self._hand.cycle_ms
        self._held = Held()

    def frames(self, time_ms: int) -> list[Frame]:
        """Return the frames that are due at this time of the script in ms; none between cycles."""
        if time_ms % self.cycle_ms:
            return []
        joysticks = {axis: self.script.command(axis, time_ms / 1000.0) for axis in self._axes}
        if not self._held.enable or joysticks != self._held.joysticks:
            self._held = Held(joysticks, enable=True, anti_sway=not self._bypass)
        return self._hand.frames(time_ms, self._held)

    def frames_of_tick(self, time_ms: int, tick_ms: int) -> list[Frame]:
        """Return every frame due in the last tick_ms up to time_ms, the oldest first."""
        return [frame for ms in self._hand.due(time_ms, tick_ms) for frame in self.frames(ms)]
