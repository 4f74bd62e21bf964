"""History of a daemon's status messages: states with their reasons, and counters."""

from dataclasses import dataclass
from typing import Any

from canshaper.codec.status import LAST_FAULT, StatusCodec
from canshaper.machine.deployment import Deployment
from canshaper.machine.routing import Key
from canshaper.recording.listen import ReceivedFrame


@dataclass(frozen=True, slots=True)
class AxisStatus:
    """Status of one axis, as received.

    Attributes:
        time_ns: time of reception.
        values: decoded fields by name.
        shown: the same fields as texts for people.
    """

    time_ns: int
    values: dict[str, Any]
    shown: dict[str, str]

    @property
    def state(self) -> str:
        """Name of the state, or its number if it is unknown."""
        return self.shown["State"]

    @property
    def reason(self) -> str:
        """Name of the reason, or its number if it is unknown."""
        return self.shown["Reason"]


@dataclass(frozen=True, slots=True)
class HistoryEvent:
    """One line for people: a new state, or a changed counter."""

    time_ns: int
    text: str


class History:
    """Takes frames; keeps the last status of each axis and the service, and notes every change.

    Attributes:
        axes: last status by axis.
        counters: last counters of the service by name.
        last_fault: name of the service's last fault.
        counted_ns: time of the last counters; None before the first.
        changes: every change, oldest first.
    """

    MOST_CHANGES = 100_000

    def __init__(self, deployment: Deployment) -> None:
        self.axes: dict[str, AxisStatus] = {}
        self.counters: dict[str, int] = {}
        self.last_fault = ""
        self.counted_ns: int | None = None
        self.changes: list[HistoryEvent] = []
        self._axes = {a.status.message.key: n for n, a in deployment.axes.items() if a.status}
        self._codecs: dict[Key, StatusCodec[Any]] = {
            axis.status.message.key: axis.status for axis in deployment.axes.values() if axis.status
        }
        if deployment.status:
            self._codecs[deployment.status.message.key] = deployment.status

    def receive(self, frame: ReceivedFrame) -> str | None:
        """Take a data frame; return the axis if it is an axis' status, else None."""
        key = (frame.bus, frame.can_id, frame.extended)
        codec = self._codecs.get(key)
        if codec is None or (values := codec.decode(frame.data)) is None:
            return None
        shown = {one.name: one.shown(values[one.name]) for one in codec.fields}
        if name := self._axes.get(key):
            self._axis(name, AxisStatus(frame.time_ns, values, shown))
        else:
            self._counters(values, shown[LAST_FAULT.name], frame.time_ns)
        return name

    def _axis(self, name: str, status: AxisStatus) -> None:
        last = self.axes.get(name)
        self.axes[name] = status
        if last is None or (last.state, last.reason) != (status.state, status.reason):
            was = f" from={last.state}" if last else ""
            text = f"axis={name} state={status.state}{was} reason={status.reason}"
            self._note(status.time_ns, text)

    def _counters(self, values: dict[str, int], fault: str, time_ns: int) -> None:
        self.counted_ns = time_ns
        counters = {name: count for name, count in values.items() if name != LAST_FAULT.name}
        for name, count in counters.items():
            last = self.counters.get(name)
            if last is not None and count != last:
                self._note(time_ns, f"{name}={count} was={last} last_fault={fault}")
        self.counters, self.last_fault = counters, fault

    def _note(self, time_ns: int, text: str) -> None:
        if len(self.changes) < self.MOST_CHANGES:
            self.changes.append(HistoryEvent(time_ns, text))
