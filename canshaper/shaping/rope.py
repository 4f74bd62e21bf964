"""Length of a rope by its signal: a signal that is lost or jumps makes no jump of the length."""

from typing import Final

from canshaper.shaping.states import Lost

# No hoist is faster. A message may come once in half a second, and round what it says.
MOST_M_S: Final = 3.0
MOST_SILENT_S: Final = 0.5
ROUNDING_M: Final = 0.3
# A length that has jumped counts again when it has not for so long.
SETTLES_S: Final = 1.0
# Fastest change of the length that filters follow in motion, of itself in a second.
MOST_PER_S: Final = 1.0


class RopeLength:
    """Length that the filters of an axis follow.

    Args:
        lowest_m: shortest rope that they know; a shorter one counts as this.
        highest_m: longest one. Until a length is known this is it.
        lost: what holds while the length is not known.

    Attributes:
        length_m: the length now.
        state: known, lost or jumped.
    """

    __slots__ = (
        "_highest",
        "_lost",
        "_lowest",
        "_measured",
        "_settles_s",
        "_since_s",
        "length_m",
        "state",
    )

    def __init__(self, lowest_m: float, highest_m: float, lost: Lost) -> None:
        self._lowest, self._highest, self._lost = lowest_m, highest_m, lost
        self.length_m = highest_m
        self.state = "known"
        self._measured: float | None = None  # what was measured last
        self._since_s = 0.0  # since that has changed
        self._settles_s = 0.0

    @property
    def stops(self) -> bool:
        """Whether the axis may not move with this length."""
        return self._lost == "neutral" and self.state != "known"

    def step(self, measured_m: float | None, elapsed_s: float, *, rests: bool) -> bool:
        """Take what is measured now; return whether the state has changed.

        Args:
            measured_m: the length; None where none is known. None is 0 or less.
            elapsed_s: since the last step.
            rests: the axis is at rest, so a change of its filter moves nothing.
        """
        state, before = self._state(measured_m, elapsed_s), self.state
        self.state = state
        wanted = self.length_m
        if state == "known" and measured_m is not None:
            wanted = min(max(measured_m, self._lowest), self._highest)
        elif self._lost == "longest":
            wanted = self._highest
        if not rests:
            most = MOST_PER_S * elapsed_s * self.length_m
            wanted = min(max(wanted, self.length_m - most), self.length_m + most)
        self.length_m = wanted
        return state != before

    def _state(self, measured_m: float | None, elapsed_s: float) -> str:
        self._since_s += elapsed_s
        if measured_m is None or not measured_m > 0.0:
            self._measured = None
            return "lost"
        last, self._measured = self._measured, measured_m
        self._settles_s = max(self._settles_s - elapsed_s, 0.0)
        if last is not None and measured_m != last:
            way = MOST_M_S * min(self._since_s, MOST_SILENT_S) + ROUNDING_M
            self._since_s = 0.0
            if abs(measured_m - last) > way:
                self._settles_s = SETTLES_S
        return "jumped" if self._settles_s else "known"
