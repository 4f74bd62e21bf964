"""What the status messages of a daemon tell: states with their reasons, counters."""

from dataclasses import dataclass
from typing import Any

from canshaper.codec.codecs import ACTIVE_SET, ServiceStatusCodec
from canshaper.codec.frame import FrameFault
from canshaper.machine.deployment import Deployment
from canshaper.recording.channels import Key
from canshaper.recording.listen import Heard
from canshaper.shaping.states import Reason, State

COUNTED = [name for name in ServiceStatusCodec.SIGNALS if name not in ServiceStatusCodec.CODES]


@dataclass(frozen=True, slots=True)
class AxisStatus:
    """Status of one axis, as it was told.

    Attributes:
        time_ns: when.
        state: name of the state, or its number where it is unknown.
        reason: the same of the reason.
        command: stick, percent of full speed.
        sent: command that was sent, percent.
        sway_deg: predicted swing.
        active_set: number of the parameter set; 0 where that is not told.
    """

    time_ns: int
    state: str
    reason: str
    command: float
    sent: float
    sway_deg: float
    active_set: int


@dataclass(frozen=True, slots=True)
class Told:
    """One line for people: a state that is new, or a counter that has gone up."""

    time_ns: int
    text: str


class History:
    """Takes frames; knows the last status of everything, and notes what changes.

    Attributes:
        axes: last status by axis.
        counters: last counters of the service, and LastFault by its name.
        counted_ns: when they were told; None before.
        changes: every change, oldest first.
    """

    MOST_CHANGES = 100_000

    def __init__(self, deployment: Deployment) -> None:
        self.axes: dict[str, AxisStatus] = {}
        self.counters: dict[str, int] = {}
        self.last_fault = ""
        self.counted_ns: int | None = None
        self.changes: list[Told] = []
        self._axis_of: dict[Key, str] = {
            axis.status.sender.key: name for name, axis in deployment.axes.items() if axis.status
        }
        self._senders = {
            axis.status.sender.key: axis.status.sender
            for axis in deployment.axes.values()
            if axis.status
        }
        self._service = deployment.status.sender if deployment.status else None

    def take(self, frame: Heard) -> None:
        """Take a data frame; one that is no status is passed over."""
        key = (frame.bus, frame.can_id, frame.extended)
        if name := self._axis_of.get(key):
            raw = self._decoded(self._senders[key], frame.data)
            if raw is not None:
                self._axis(name, self._senders[key], raw, frame.time_ns)
        elif self._service is not None and key == self._service.key:
            raw = self._decoded(self._service, frame.data)
            if raw is not None:
                self._counters(raw, frame.time_ns)

    @staticmethod
    def _decoded(sender: Any, data: bytes) -> dict[str, Any] | None:
        if len(data) != sender.fields.message.length:
            return None
        raw: dict[str, Any] = sender.fields.layout.decode(data)
        return raw

    def _axis(self, name: str, sender: Any, raw: dict[str, Any], time_ns: int) -> None:
        def value(signal: str) -> float:
            found = next(s for s in sender.fields.message.signals if s.name == signal)
            return float(raw[signal] * found.scale + found.offset)

        status = AxisStatus(
            time_ns,
            named(State, raw["State"]),
            named(Reason, raw["Reason"]),
            value("RawCommand"),
            value("ShapedCommand"),
            value("PredictedSway"),
            int(raw.get(ACTIVE_SET, 0)),
        )
        last = self.axes.get(name)
        self.axes[name] = status
        if last is None or (last.state, last.reason) != (status.state, status.reason):
            was = f" from={last.state}" if last else ""
            self._note(time_ns, f"axis={name} state={status.state}{was} reason={status.reason}")

    def _counters(self, raw: dict[str, Any], time_ns: int) -> None:
        self.counted_ns = time_ns
        fault = named(FrameFault, raw["LastFault"])
        counters = {name: int(raw[name]) for name in COUNTED}
        for name, count in counters.items():
            last = self.counters.get(name)
            if last is not None and count != last:
                self._note(time_ns, f"{name}={count} was={last} last_fault={fault}")
        self.counters, self.last_fault = counters, fault

    def _note(self, time_ns: int, text: str) -> None:
        if len(self.changes) < self.MOST_CHANGES:
            self.changes.append(Told(time_ns, text))


def named(kind: Any, number: int) -> str:
    """Name of a number of an enumeration; the number itself where it has none."""
    try:
        return str(kind(number).name)
    except ValueError:
        return f"unknown ({number})"
