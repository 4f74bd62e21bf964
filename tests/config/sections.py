"""Sections of a deployment file."""

from collections.abc import Callable

Problems = Callable[[str | bytes], list[str]]
TOP = (
    "version, tick_ms, tick, buses, dbc, joysticks, switches, axes, crane, motion, hydraulics,"
    " gateway, emergency_stop, load_state, profile, status, identity, control, assumed, still_deg,"
    " uncertainty, accept"
)


def changed(text: str, old: str, new: str) -> tuple[str, int]:
    """The text with the first ``old`` replaced, and the line of that."""
    assert old in text
    return text.replace(old, new, 1), text[: text.index(old)].count("\n") + 1
