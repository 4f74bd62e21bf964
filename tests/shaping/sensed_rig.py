"""A sway sensor next to a pendulum."""

import math

from canshaper.shaping.axis import ShapedAxis
from canshaper.shaping.limits import OutputLimits
from canshaper.shaping.shapers.gff import Gff
from canshaper.shaping.states import CommandInput, Trust
from canshaper.shaping.sway import Measured, SensorLimits, SensorTiming, SwayMode, SwayModel
from tests.shaping.observed import sensed_sway

TICK_S = 0.02
MODE = SwayMode(2.86, 0.05)
SCALE = 0.8


class Rig:
    """An axis, the pendulum that it really moves, and the sensor on it."""

    def __init__(self, *, damps: bool = True, offset_rad: float = 0.0) -> None:
        self.model, self.real = SwayModel(MODE, TICK_S), SwayModel(MODE, TICK_S)
        self.axis = ShapedAxis(
            TICK_S, OutputLimits(tail_s=0.5), sway=self.model, shaper=Gff(self.model, (-5.0, -4.0))
        )
        timing = SensorTiming(Measured.ANGLE, TICK_S, 0.0, 0.0, lost_s=0.07)
        limits = SensorLimits(math.radians(0.1), math.radians(3.0))
        self.sensed = self.axis.sensed = sensed_sway(self.model, timing, limits, damps=damps)
        self.offset_rad = offset_rad
        self.most = 1.0 if damps else 0.0
        self.command = 0.0
        self.push = 0.0  # on the grapple, normalised

    @property
    def angle(self) -> float:
        """Of the grapple, rad."""
        return SCALE * self.real.angle + self.offset_rad

    def run(self, seconds: float, value: float | None = math.inf, *, damps: bool = False) -> "Rig":
        """Run on; by default the sensor shows the grapple, otherwise this value.

        With ``damps`` as while another axis makes the grapple swing.
        """
        for _ in range(round(seconds / TICK_S)):
            shown = self.angle if value == math.inf else value
            self.sensed.measure(shown, SCALE, commanded=self.axis.output.commanded, damps=damps)
            joystick = CommandInput(command=self.command, enabled=True)
            self.axis.command(joystick, 0.0, damps=damps)
            self.axis.propagate()
            self.real.step(self.axis.output.setpoint)
            self.real.rate += TICK_S * self.push
        return self

    def trusted(self) -> "Rig":
        """After a stroke that has proved the sensor, in motion."""
        self.run(1.0)
        self.command = 0.8
        self.run(1.2)
        assert self.sensed.state is Trust.TRUSTED
        assert self.sensed.weight == self.most
        return self

    def fed_back(self) -> bool:
        return self.model.free_angle != 0.0 or self.model.free_rate != 0.0
