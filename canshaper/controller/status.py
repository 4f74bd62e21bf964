"""Status messages: of every axis, and of the service."""

from collections.abc import Collection, Iterable, Iterator, Mapping
from typing import TYPE_CHECKING

from canshaper.codec.frame import Frame
from canshaper.codec.message import Sender
from canshaper.codec.status import StatusCodec
from canshaper.controller.ends import AimPoint
from canshaper.controller.events import SwaySensorEvent, SwingLengthEvent
from canshaper.controller.runner import AxisControl
from canshaper.controller.valve_messages import Counters
from canshaper.machine.deployment import Deployment
from canshaper.protocols.interface import MessageKey
from canshaper.shaping.states import Trust
from canshaper.shaping.sway import GRAVITY_M_S2, SwayMode

if TYPE_CHECKING:
    from canshaper.shaping.swing_length import SwingLength


class StatusMessages:
    """All status messages of a machine.

    Args:
        deployment: the machine.
        axes: its axes.
        senders: what sends each of its messages.

    Attributes:
        aims: aim points of its cranes that are sent.
    """

    def __init__(
        self,
        deployment: Deployment,
        axes: Iterable[AxisControl],
        senders: Mapping[MessageKey, Sender],
    ) -> None:
        self._deployment, self._senders = deployment, senders
        self._axes = [one for one in axes if one.bound.status]
        self.aims: list[AimPoint] = []

    def frames(
        self, changed: Collection[AxisControl], counters: Counters, last: int, now: int
    ) -> Iterator[Frame]:
        """Yield the status of the axes that have changed or are due, of cranes and service.

        Args:
            changed: axes whose state has just changed.
            counters: those of the service.
            last: number of the deadline of the tick before.
            now: number of this one.
        """
        for runner in self._axes:
            ticks = runner.bound.status_ticks
            if (runner in changed or now // ticks > last // ticks) and (
                frame := runner.status_frame()
            ):
                yield frame
        for aim in self.aims:
            if now // aim.ticks > last // aim.ticks:
                aim.update()
                yield self._senders[aim.codec.message.key].frame(aim.codec.values(aim))
        status, ticks = self._deployment.status, self._deployment.status_ticks
        if status and now // ticks > last // ticks:
            yield self._senders[status.message.key].frame(status.values(counters.status()))

    def identity(self, status: StatusCodec[int]) -> Frame:
        """Return the digest of what runs, in the message that carries it."""
        values = status.values(self._deployment.identity.digest)
        return self._senders[status.message.key].frame(values)


# A length that differs by this factor from the one that was reported last is reported.
LENGTH_NEWS = 1.1


class SensorReport:
    """Reports changes of the sway sensor of one axis: its trust state, the pendulum length.

    Args:
        name: name of the axis.
        runner: the axis.
    """

    def __init__(self, name: str, runner: AxisControl) -> None:
        self._name, self._runner = name, runner
        self._trust = Trust.NO_DATA
        self._length: SwingLength | None = None
        self._reported_m = 0.0

    def events(self) -> Iterator[SwaySensorEvent | SwingLengthEvent]:
        """Yield changes since the last call: trust state of the sensor, pendulum length."""
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

    def _is_news(self, length: "SwingLength", mode: SwayMode) -> bool:
        """Whether the grapple swings by another length than was reported last, or is in the file.

        At the load of a breakpoint nothing is news: the key to report is not the one in force.
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
