"""No filter."""

from canshaper.shaping.shapers.kind import ShaperKind


class Off:
    """No shaping: the output limits alone stand between joystick and valve."""

    __slots__ = ()

    def step(self, command: float) -> float:
        """Return the command itself."""
        return command


KINDS = (
    ShaperKind(
        "off",
        "No shaping: output limits only.",
        lambda _tick_s: Off(),
        lambda _mode, _tick_s: {"off": {}},
    ),
)
