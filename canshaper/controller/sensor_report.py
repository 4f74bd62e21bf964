"""What is reported of the sway sensor of an axis: where it says something else than before."""

from collections.abc import Iterator

from canshaper.controller.events import SwaySensorEvent, SwingLengthEvent
from canshaper.controller.runner import AxisRunner
from canshaper.shaping.sway import GRAVITY_M_S2, SwayMode
from canshaper.shaping.swing_length import SwingLength
from canshaper.shaping.trust import Trust

# A length that differs by this factor from the one that was reported last is reported.
LENGTH_NEWS = 1.1


class SensorReport:
    """Of one axis with a sway sensor.

    Args:
        name: name of the axis.
        runner: the axis.
    """

    def __init__(self, name: str, runner: AxisRunner) -> None:
        self._name, self._runner = name, runner
        self._trust = Trust.NO_DATA
        self._length: SwingLength | None = None
        self._reported_m = 0.0

    def events(self) -> Iterator[SwaySensorEvent | SwingLengthEvent]:
        """What has changed since the last call: what is thought of the sensor, the length."""
        trust = self._runner.trust
        if trust is not self._trust:
            self._trust = trust
            yield SwaySensorEvent(self._name, trust)
        sensed = self._runner.axis.sensed
        if sensed is not None and (length := sensed.length.result) is not self._length:
            assert length is not None  # one that was measured stays
            self._length = length
            sway = self._runner.bound.config.sway
            assert sway is not None  # checked with the deployment
            if self._is_news(length, sway.mode()):
                yield SwingLengthEvent(self._name, length, sway)

    def _is_news(self, length: SwingLength, mode: SwayMode) -> bool:
        """Whether the grapple swings by another length than was reported last, or is in the file.

        Of the load of a breakpoint nothing is: the key that is reported is not that in force.
        """
        model = self._runner.axis.sway
        assert model is not None  # of an axis with a sensor
        if model.mode != mode:
            return False
        file_m = GRAVITY_M_S2 / mode.omega_rad_s**2
        ratio = length.length_m / (self._reported_m or file_m)
        if 1.0 / LENGTH_NEWS <= ratio <= LENGTH_NEWS:
            return False
        self._reported_m = length.length_m
        return True
