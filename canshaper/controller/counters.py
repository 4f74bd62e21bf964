"""Counters of the service: what went wrong so far."""

from canshaper.codec.frame import FrameFault


class Counters:
    """What went wrong so far, by the signal names of the status message."""

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
        """Count a fault and remember it as the last one."""
        self.last_fault = fault
        signal = self.SIGNAL_OF.get(fault)
        if signal is not None:
            self.values[signal] += count

    def status(self) -> dict[str, int]:
        """Values of the status message."""
        return {**self.values, "LastFault": int(self.last_fault)}
