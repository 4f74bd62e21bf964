"""How a deployment uses the PDOs of its nodes; without the canopen library."""

from dataclasses import dataclass


@dataclass(frozen=True)
class MessageTiming:
    """How a deployment uses a message: sent every so many ms, lost after so many."""

    cycle_ms: int | None
    timeout_ms: int
