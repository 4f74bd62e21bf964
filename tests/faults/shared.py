"""Rules of the oil that axes share and of their end stops, by docs/deployment.md.

It knows the file and the frames, and nothing of how the demands are bounded.
"""

from collections.abc import Mapping
from typing import Any

from canshaper.codec.frame import Frame
from tests.faults.axis import Ends
from tests.faults.axis_rules import SLACK_NS, AxisRules

# So long after its tail an axis at an end stop may still creep: what a motion has moved it comes
# back, and the position is a cycle old.
CREEP_NS = 1_000_000_000


class EndRules:
    """An axis that has been at its end stop for long does not move towards it."""

    def __init__(self, axis: AxisRules, ends: Ends, tick_ns: int) -> None:
        self._axis, self._ends = axis, ends
        tail_ns = axis.axis.tail * axis.axis.period_ticks * tick_ns
        self._creeps_ns = tail_ns + CREEP_NS
        self._last_ns = self._since_ns = 0
        self._side = 0

    def receive(self, frame: Frame, arrived_ns: int) -> None:
        """A frame that may have its position."""
        if frame[:3] != self._ends.key or len(frame.data) != self._ends.length:
            return
        ends, steps = self._ends, self._ends.field.get(int.from_bytes(frame.data, "little"))
        valid = 0 <= steps <= ends.field.full and steps not in ends.field.special
        side = (steps >= ends.high) - (steps <= ends.low) if valid else 0
        if side != self._side or arrived_ns - self._last_ns > ends.timeout_ns:
            self._side, self._since_ns = side, arrived_ns
        self._last_ns = arrived_ns

    def wrong(self, now_ns: int) -> str:
        """Return the fault of the velocity that its axis sends now; empty for none."""
        axis, ends = self._axis, self._ends
        fresh = now_ns - self._last_ns <= ends.timeout_ns - 2 * SLACK_NS
        if not self._side or not fresh or now_ns - axis.bypassed_ns < self._creeps_ns:
            return ""
        towards = axis.velocity * self._side * ends.sign
        if now_ns - self._since_ns > self._creeps_ns and towards > axis.axis.step:
            return f"sent {axis.raw} towards the end stop that it is at"
        return ""


class FlowRules:
    """Together the axes are commanded no faster than the pump delivers oil for."""

    def __init__(self, section: Mapping[str, Any], axes: Mapping[str, AxisRules]) -> None:
        shares = section.get("shares", {})
        self._axes = [(one, shares.get(name, 1.0)) for name, one in axes.items()]
        self._flow = section["flow"] - section.get("others", 0.0)

    def decide(self, now_ns: int) -> None:
        """Tell every axis how much of its command counts."""
        # At its end stop an axis takes none.
        asked = sum(s * abs(one.certain) for one, s in self._axes if "ends" not in one.axis.limits)
        factor = min(1.0, self._flow / asked) if asked else 1.0
        for one, _ in self._axes:
            one.share_oil(now_ns, 1.0 if one.joystick.bypasses() else factor)
