"""A replay as a recorded drive: what the table and the picture are made of."""

import math
from array import array

from canshaper.machine.deployment import Deployment
from canshaper.recording.ticks import Result, Tick
from canshaper.shaping.sway import SwayModel
from canshaper_sim.recording import AxisTrace, Recording

# Three hours of a loop of 20 ms; a longer drive is replayed, but not drawn, to its end.
MOST_ROWS = 540_000


class Trace:
    """Rows of the ticks of one replay.

    The log has no sway and no speed of the crane. Sway is that of the deployment's own model, and
    the speed of an axis is taken to be what was sent to its valve.

    Args:
        deployment: whose axes they are.
        begin_s: seconds after the first tick from which rows are kept.
        end_s: up to where; None for the end.

    Attributes:
        start_ns: time of the first tick; None before.
        end_ns: of the last one.
        full: whether there were more ticks than rows are kept.
    """

    def __init__(self, deployment: Deployment, begin_s: float, end_s: float | None) -> None:
        self.start_ns: int | None = None
        self.end_ns = 0
        self.full = False
        self._begin_s, self._end_s = begin_s, end_s
        self._t_s = array("d")
        self._rows = {name: [array("d") for _ in range(4)] for name in deployment.axes}
        self._models: dict[str, tuple[SwayModel, float]] = {}
        tick_s = deployment.config.tick_ms / 1000.0
        for name, axis in deployment.axes.items():
            if axis.config.sway is not None:
                sway = axis.config.sway
                self._models[name] = SwayModel(sway.mode(), tick_s), sway.full_speed_m_s

    def add(self, tick: Tick, result: Result) -> None:
        """Take the rows of a tick."""
        if self.start_ns is None:
            self.start_ns = tick.now_ns
        self.end_ns = tick.now_ns
        time_s = (tick.now_ns - self.start_ns) / 1e9
        kept = time_s >= self._begin_s and (self._end_s is None or time_s <= self._end_s)
        kept = kept and not (self._t_s and time_s <= self._t_s[-1])
        if kept and len(self._t_s) >= MOST_ROWS:
            kept, self.full = False, True
        if kept:
            self._t_s.append(time_s)
        for name, row in result.rows.items():
            straight = 0.0
            if name in self._models:
                model, full_speed = self._models[name]
                model.step(row.command)
                straight = math.degrees(model.sway_rad(full_speed))
            if kept:
                for column, value in zip(self._rows[name], (*row[:3], straight), strict=True):
                    column.append(value)

    @property
    def rows(self) -> int:
        """How many ticks are kept."""
        return len(self._t_s)

    def recording(self) -> Recording:
        """The drive as it was replayed."""
        return self._recording(sent=1, sway=2)

    def straight(self) -> Recording:
        """The drive as it would be with the joystick straight to the valve."""
        return self._recording(sent=0, sway=3)

    def _recording(self, sent: int, sway: int) -> Recording:
        axes = {}
        for name, columns in self._rows.items():
            applied = list(columns[sent])
            swings = list(columns[sway]) if name in self._models else None
            axes[name] = AxisTrace(list(columns[0]), applied, applied, swings)
        return Recording(list(self._t_s), axes)
