"""Values that the status message of an axis reports."""

from types import SimpleNamespace
from typing import Any

from canshaper.shaping.states import State


def report(
    state: State,
    reason: int,
    command: float = 0.0,
    sent: float = 0.0,
    sway_deg: float = 0.0,
    *,
    active_set: int = 0,
) -> Any:
    """An axis with these values."""
    output = SimpleNamespace(setpoint=sent)
    axis = SimpleNamespace(state=state, demand=command, output=output)
    return SimpleNamespace(axis=axis, reason=reason, sway_deg=sway_deg, active_set=active_set)
