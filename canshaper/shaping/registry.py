"""Every filter that an axis may run, by the name it has in a deployment file."""

from typing import Protocol


class Shaper(Protocol):
    """What the axis asks of a filter."""

    def wanted(self, command: float) -> float:
        """Return the output the filter asks for, before limits; ``command`` in [-1, 1].

        Called once a tick, also while the axis is neutral (then with command 0).
        """
        ...


class Off:
    """No shaping: the output limits alone stand between stick and valve."""

    __slots__ = ()

    def wanted(self, command: float) -> float:
        """Return the command itself."""
        return command
