"""Messages of J1939 that are known by their group, from whatever address they come."""

from collections.abc import Sequence

from canshaper.can.frame import Frame, FrameFault
from canshaper.service.input import Input
from canshaper.service.runner import AxisRunner


class AnySource:
    """An input from the first address that is heard; from another one when that falls silent.

    Args:
        taken: the input.
        timeout_ns: its age limit.
        own: our address on the bus; nobody else may send from it.
    """

    def __init__(self, taken: Input, timeout_ns: int, own: int | None) -> None:
        self._input = taken
        self._timeout_ns = timeout_ns
        self._own = own
        self._source: int | None = None
        self._heard_ns = 0

    def receive(self, frame: Frame, now_ns: int) -> FrameFault:
        """Take a frame; two levers that send the same group cannot be told apart."""
        source = frame.can_id & 0xFF
        if source == self._own:
            return FrameFault.SECOND_SENDER
        if source != self._source:
            if self._source is not None and now_ns - self._heard_ns <= self._timeout_ns:
                return FrameFault.SECOND_SENDER
            self._source = source
        self._heard_ns = now_ns
        return self._input.receive(frame.data, now_ns)


class CommandedByOthers:
    """Commands to valves of ours, from another address."""

    def __init__(self, runners: Sequence[AxisRunner]) -> None:
        self._runners = runners

    def receive(self, _frame: Frame, now_ns: int) -> FrameFault:
        """Two controllers must not drive one crane."""
        for runner in self._runners:
            runner.contested_ns = now_ns
        return FrameFault.SECOND_SENDER
