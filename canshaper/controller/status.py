"""Status messages: of every axis, and of the service."""

from collections.abc import Collection, Iterable, Iterator

from canshaper.codec.frame import Frame
from canshaper.controller.counters import Counters
from canshaper.controller.runner import AxisRunner
from canshaper.machine.deployment import Deployment


def status_frames(
    deployment: Deployment,
    axes: Iterable[AxisRunner],
    changed: Collection[AxisRunner],
    counters: Counters,
    deadlines: tuple[int, int],
) -> Iterator[Frame]:
    """Status of the axes that changed and of all that are due, and of the service.

    Args:
        deployment: the machine.
        axes: its axes.
        changed: those whose state has just changed.
        counters: those of the service.
        deadlines: numbers of the deadlines of the tick before and of this one.
    """
    for runner in axes:
        if (runner in changed or _due(deadlines, runner.bound.status_ticks)) and (
            frame := runner.status_frame()
        ):
            yield frame
    if deployment.status and _due(deadlines, deployment.status_ticks):
        yield deployment.status.frame(counters.status())


def _due(deadlines: tuple[int, int], period: int) -> bool:
    """Whether a multiple of the period lies after the first deadline, up to the second."""
    last, now = deadlines
    return period > 0 and now // period > last // period
