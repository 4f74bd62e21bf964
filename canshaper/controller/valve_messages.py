"""Valve messages and their axes; counters of faults; detection of an overrun."""

from collections.abc import Mapping, Sequence
from typing import Self

from canshaper.codec.frame import Frame, FrameFault, MessageKey
from canshaper.codec.message import Sender
from canshaper.controller.axis_control import AxisControl
from canshaper.protocols.interface import ForwardingRule
from canshaper.shaping.states import Reason

Turn = tuple[str, AxisControl, Sender | None, ForwardingRule | None]
"""Name and control of an axis; for the last axis of a message its sender and forwarding rule."""


class ValveMessages:
    """All valve messages of a machine, each with the axes in it.

    Args:
        axes: the axes by name, in their order.
        valves: names of the axes that command each message, by its identifier.
        forwarding: rules by which joystick frames leave in place of a valve message, by its
            identifier.

    Attributes:
        turns: the axes in their order; a message goes out with the last one of its axes.
    """

    def __init__(
        self,
        axes: Mapping[str, AxisControl],
        valves: Mapping[MessageKey, Sequence[str]],
        forwarding: Mapping[MessageKey, ForwardingRule],
    ) -> None:
        self._axes = {key: [axes[name] for name in names] for key, names in valves.items()}
        self._forwarding = forwarding
        self.turns: list[Turn] = []
        for name, control in axes.items():
            key = control.valve.key
            if self._axes[key][-1] is control:
                self.turns.append((name, control, control.valve, forwarding.get(key)))
            else:
                self.turns.append((name, control, None, None))

    def foreign_sender(self, key: MessageKey, arrived_ns: int) -> None:
        """Trip the axes of a message that another sender has sent."""
        for control in self._axes.get(key, ()):
            control.stops.foreign_sender(arrived_ns)

    def send_failed(self, key: MessageKey) -> None:
        """Trip the moving axes of a message that did not reach its bus."""
        for control in self._axes.get(key, ()):
            control.trip_in_motion(Reason.SEND_FAILED)

    def withhold(self, frame: Frame) -> bool:
        """Return whether a late frame moves a valve and must not leave; if so, reuse its count."""
        moves = any(control.axis.output.steps for control in self._axes[frame[:3]])
        if moves:
            self.take_back(frame[:3])
        return moves

    def take_back(self, key: MessageKey) -> None:
        """Take back the count of a frame that does not leave: its valve sees no gap."""
        self._axes[key][0].valve.take_back()

    def refused(self, frame: Frame) -> Frame:
        """Trip the axes of a frame that the gate has refused.

        Returns:
            The same frame with neutral commands, to be sent in its place.
        """
        controls = self._axes[frame[:3]]
        for control in controls:
            control.stops.trip = Reason.OUTPUT_REFUSED
            control.put(0)
        return controls[0].valve.instead(frame)

    def neutral_frames(self, silent: frozenset[str], errors: list[Exception]) -> list[Frame]:
        """Return a neutral frame, to be sent last, for every valve whose bus is not silent.

        Where a gateway forwards to the valve, it is returned only if the last one may move it.

        Args:
            silent: names of the silent buses.
            errors: list that gets the exceptions; the other valves still get their frames.
        """
        frames: list[Frame] = []
        for key, controls in self._axes.items():
            try:
                for control in controls:
                    control.put(0)
                if (rule := self._forwarding.get(key)) is not None:
                    frames += rule.last()
                elif key[0] not in silent:
                    frames.append(controls[-1].valve.frame())
            except Exception as error:
                errors.append(error)
        return frames


class Counters:
    """Counts of faults, by the signal names of the status message, and the last fault."""

    __slots__ = ("last_fault", "values")

    SIGNAL_OF = {  # noqa: RUF012  (a constant table)
        FrameFault.WRONG_LENGTH: "WrongLength",
        FrameFault.UNKNOWN_ID: "UnknownId",
        FrameFault.ERROR_FRAME: "ErrorFrames",
        FrameFault.INVALID_SIGNAL: "InvalidSignals",
        FrameFault.SEND_FAILED: "SendFailures",
        FrameFault.MISSED_DEADLINE: "MissedDeadlines",
        FrameFault.CHECKSUM: "InvalidSignals",
        FrameFault.COUNTER_REPEATED: "InvalidSignals",
        FrameFault.COUNTER_JUMP: "InvalidSignals",
        FrameFault.BUS_OFF: "ErrorFrames",
        FrameFault.BUS_PASSIVE: "ErrorFrames",
        FrameFault.NOT_CONFIRMED: "SendFailures",
    }

    def __init__(self) -> None:
        self.values = dict.fromkeys(self.SIGNAL_OF.values(), 0)
        self.last_fault = FrameFault.NONE

    def add(self, fault: FrameFault, count: int = 1) -> None:
        """Count a fault, and store it as the last one; without a counter it is only stored."""
        self.last_fault = fault
        signal = self.SIGNAL_OF.get(fault)
        if signal is not None:
            self.values[signal] += count

    def status(self) -> dict[str, int]:
        """Return the counts and the last fault, by the signal names of the status message."""
        return {**self.values, "LastFault": int(self.last_fault)}


# A late tick adds five to the count, a punctual one takes one away. Ten late ticks in a row, or
# more than one in six for long, are an overrun. It ends at the count 0, after 50 punctual ticks.
LATE_WEIGHT = 5
LATE_LIMIT = 50


class OverrunDetector:
    """Counts late ticks against punctual ones.

    Attributes:
        late: the count; at 0 the caller leaves out punctual ticks.
    """

    __slots__ = ("_overrun", "late")

    def __init__(self) -> None:
        self.late = 0
        self._overrun = False

    def copy_state(self, before: Self) -> None:
        """Copy the state of the detector before a reload."""
        self.late, self._overrun = before.late, before._overrun

    def tick(self, *, late: bool) -> bool:
        """Count a tick, at count 0 only a late one; return whether there is an overrun."""
        if late:
            self.late = min(self.late + LATE_WEIGHT, LATE_LIMIT)
            self._overrun |= self.late == LATE_LIMIT
        else:
            self.late -= 1
            self._overrun &= self.late > 0
        return self._overrun
