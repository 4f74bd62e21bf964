"""The operator's levers as a node on CAN: a script in, joystick frames out."""

from canshaper.can.binding import BoundLever, Deployment
from canshaper.can.codecs import Sender
from canshaper.can.frame import Frame
from canshaper.can.signals import find_signal
from canshaper_sim.axes import JOINT_AXES, SLEW
from canshaper_sim.strokes import Script


class _Lever:
    """One joystick message with its alive counter."""

    def __init__(self, lever: BoundLever, deployment: Deployment, *, bypass: bool) -> None:
        config = lever.config
        self.cycle_ms = lever.message.cycle_time or 20
        self._sender = Sender(config.bus, lever.message)
        self._axes = {
            axis.config.stick.signal: name
            for name, axis in deployment.axes.items()
            if axis.config.stick.lever == lever.name
        }
        self._full = {s.name: float(s.maximum or 0.0) for s in lever.message.signals}
        # Sticks that no axis listens to stand in neutral too.
        self._base = {
            s.name: 0
            for s in lever.message.signals
            if s.maximum is not None and s.minimum is not None and s.minimum < 0 < s.maximum
        }
        self._base[config.enable] = 1
        if config.anti_sway_off:
            self._base[config.anti_sway_off] = int(bypass)
        self._alive = config.alive_counter
        counter = find_signal(lever.message, config.alive_counter) if config.alive_counter else None
        self._range = 1 << counter.length if counter else 1
        self._count = 0

    def frame(self, script: Script, time_s: float) -> Frame:
        raw = dict(self._base)
        fields = self._sender.fields
        for signal, axis in self._axes.items():
            raw[signal] = fields.raw(signal, self._full[signal] * script.stick(axis, time_s))
        if self._alive:
            self._count = (self._count + 1) % self._range
            raw[self._alive] = self._count
        return self._sender.frame(raw)


class LeverNode:
    """All levers of a deployment, moved by a script, with the enable switch held.

    Args:
        deployment: names the joystick messages and their switches.
        script: what the operator does.
        bypass: the operator has switched anti-sway off.

    Raises:
        ValueError: the script was made for the other kind of crane, one driven by its tip or by
            its joints. Axes that a crane merely lacks are left out.
    """

    def __init__(self, deployment: Deployment, script: Script, *, bypass: bool = False) -> None:
        joints = {*JOINT_AXES} - {SLEW}
        foreign = {*script.axes} - {*deployment.axes}
        if foreign & joints or (foreign and joints & deployment.axes.keys()):
            raise ValueError(
                f"script {script.name} moves {', '.join(script.axes)};"
                f" the deployment has {', '.join(deployment.axes)}"
            )
        self.script = script
        self._levers = [_Lever(v, deployment, bypass=bypass) for v in deployment.levers.values()]
        self.cycle_ms = min(lever.cycle_ms for lever in self._levers)

    def frames(self, time_ms: int) -> list[Frame]:
        """Frames that are due at this time of the script."""
        return [
            lever.frame(self.script, time_ms / 1000.0)
            for lever in self._levers
            if time_ms % lever.cycle_ms == 0
        ]
