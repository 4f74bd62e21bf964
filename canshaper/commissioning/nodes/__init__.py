"""Nodes of CANopen by their EDS or DCF: what they send and receive, and what has to be set."""

from dataclasses import dataclass


@dataclass(frozen=True)
class MessageTiming:
    """How a deployment uses a message: sent every so many ms, lost after so many."""

    cycle_ms: int | None
    timeout_ms: int
