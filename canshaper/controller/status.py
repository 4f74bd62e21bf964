"""Status messages: of every axis, and of the service."""

from collections.abc import Collection, Iterable, Iterator, Mapping

from canshaper.codec.frame import Frame
from canshaper.codec.sent import Sender
from canshaper.codec.status import StatusCodec
from canshaper.controller.counters import Counters
from canshaper.controller.runner import AxisRunner
from canshaper.machine.deployment import Deployment
from canshaper.protocols.interface import MessageKey


class StatusMessages:
    """All status messages of a machine.

    Args:
        deployment: the machine.
        axes: its axes.
        senders: what sends each of its messages.
    """

    def __init__(
        self,
        deployment: Deployment,
        axes: Iterable[AxisRunner],
        senders: Mapping[MessageKey, Sender],
    ) -> None:
        self._deployment, self._axes, self._senders = deployment, list(axes), senders

    def frames(
        self, changed: Collection[AxisRunner], counters: Counters, last: int, now: int
    ) -> Iterator[Frame]:
        """Status of the axes that changed and of all that are due, and of the service.

        Args:
            changed: axes whose state has just changed.
            counters: those of the service.
            last: number of the deadline of the tick before.
            now: number of this one.
        """
        for runner in self._axes:
            if (runner in changed or _due(last, now, runner.bound.status_ticks)) and (
                frame := runner.status_frame()
            ):
                yield frame
        status = self._deployment.status
        if status and _due(last, now, self._deployment.status_ticks):
            yield self._senders[status.message.key].frame(status.values(counters.status()))

    def identity(self, status: StatusCodec[int]) -> Frame:
        """The digest of what runs, in the message that carries it."""
        values = status.values(self._deployment.identity.digest)
        return self._senders[status.message.key].frame(values)


def _due(last: int, now: int, period: int) -> bool:
    """Whether a multiple of the period lies after the first deadline, up to the second."""
    return period > 0 and now // period > last // period
