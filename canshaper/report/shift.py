"""Work of a crane in numbers, counted tick by tick; ``FIGURES`` defines each number."""

from collections.abc import Mapping
from dataclasses import dataclass, field
from statistics import median

LEG_M, TAP_S, REVERSAL_S = 2.0, 0.7, 0.5
# A longer pause is a break: no one waits for the grapple any more.
LONGEST_WAIT_S = 60.0

FIGURES = {
    "machine": "folder of the log, where a folder is given",
    "shift": "its begin in UTC: it ends with an hour (`--gap`) without a frame; or its day in UTC"
    " (`--by day`), its log (`--by file`, and where the log's clock has no date)",
    "crane": "of a deployment with several",
    "profile": "of the operator, where the file has `profiles`",
    "anti_sway": "`off`: an axis moves in BYPASS_ON, or the log has frames for its valve and none"
    " of canshaper's `status`; at rest as in the last movement",
    "logged_s": "time of the log from its first movement, with its pauses",
    "driven_s": "a joystick is beyond `neutral_pct`, or a valve has a command",
    "cycles": f"{LEG_M:g} m or more one way, then {LEG_M:g} m or more back, of the slewing axis; of"
    " a crane without one, of its first axis with `sway`",
    "way_m": "way of the tip by all axes with `sway`: commands of the valves times"
    " `full_speed_m_s` (slew: `full_speed_rad_s` times the radius of the `motion`, where it is"
    " measured), without the valves' lag",
    "waiting_s": "from where no joystick is beyond `neutral_pct` until the swing stays below"
    f" `still_deg`, or the next joystick moves; of one pause {LONGEST_WAIT_S:g} s at most",
    "taps": f"deflections of less than {TAP_S:g} s, of axes with `sway`",
    "reversals": f"an axis with `sway` is asked to the other side within {REVERSAL_S:g} s",
    "peak_deg": "largest swing: square root of the sum of squares over the axes",
    "cycle_peak_deg": "median of the largest swings of the cycles",
    "measured_pct": "part of the driven time in which a sway sensor shows the swing; else it is"
    " that of the model, driven by the commands of the valves",
}
"""Definition of each column."""


@dataclass
class Figures:
    """Sums over a part of the work, as ``FIGURES`` defines them.

    ``cycle_peaks_deg`` has the largest swing of each cycle; ``measured_s`` is the driven time in
    which a sway sensor shows the swing.
    """

    logged_s: float = 0.0
    driven_s: float = 0.0
    cycles: int = 0
    way_m: float = 0.0
    waiting_s: float = 0.0
    taps: int = 0
    reversals: int = 0
    peak_deg: float = 0.0
    cycle_peaks_deg: list[float] = field(default_factory=list)
    measured_s: float = 0.0

    def columns(self) -> dict[str, float | None]:
        """Return the cells of a row by column; None where nothing was measured."""
        peaks, driven_s = self.cycle_peaks_deg, self.driven_s
        return {
            **{name: value for name, value in vars(self).items() if name in FIGURES},
            "cycle_peak_deg": median(peaks) if peaks else None,
            "measured_pct": 100.0 * self.measured_s / driven_s if driven_s else None,
        }


class WorkCounter:
    """Counts the work of one crane tick by tick, into the figures of a row.

    Args:
        cycle_axis: the axis whose ways there and back count as cycles; empty for none.
        still_deg: swing below which the grapple counts as still.
    """

    def __init__(self, cycle_axis: str, still_deg: float) -> None:
        self._cycle_axis, self._still_deg = cycle_axis, still_deg
        self._legs, self._strokes = _Legs(), dict[str, _Strokes]()
        self._now_s = self._pause_s = self._swung_s = self._cycle_peak_deg = 0.0
        self._pause: Figures | None = None  # whose pause it is; None before the first stroke

    def add(
        self,
        figures: Figures,
        seconds: float,
        joysticks: Mapping[str, float],
        speeds_m_s: Mapping[str, float],
        sway_deg: float,
        *,
        moving: bool,
        measured: bool,
    ) -> None:
        """Add a tick of ``seconds`` to the figures of its row.

        Each joystick value is 0 within its neutral band; each speed is that of the tip by one axis
        with sway; ``sway_deg`` is the total swing. ``moving``: a valve has a command; ``measured``:
        a sensor measures the swing.
        """
        self._now_s += seconds
        deflected = any(joysticks.values())
        figures.logged_s += seconds
        if deflected or moving:
            figures.driven_s += seconds
            figures.measured_s += seconds * measured
        figures.way_m += seconds * sum(v * v for v in speeds_m_s.values()) ** 0.5
        figures.peak_deg = max(figures.peak_deg, sway_deg)
        for axis in speeds_m_s:
            strokes = self._strokes.setdefault(axis, _Strokes())
            strokes.step(figures, joysticks[axis], self._now_s)
        if deflected:
            self.end()
            self._pause = figures
        elif self._pause:
            self._pause_s += seconds
            if sway_deg >= self._still_deg:
                self._swung_s = min(self._pause_s, LONGEST_WAIT_S)
        self._cycle_peak_deg = max(self._cycle_peak_deg, sway_deg)
        if self._legs.step(seconds * speeds_m_s.get(self._cycle_axis, 0.0)):
            figures.cycles += 1
            figures.cycle_peaks_deg.append(self._cycle_peak_deg)
            self._cycle_peak_deg = sway_deg

    def end(self) -> None:
        """End the pause, if there is one; add its waiting time to the figures in which it began."""
        if self._pause:
            self._pause.waiting_s += self._swung_s
        self._pause, self._pause_s, self._swung_s = None, 0.0, 0.0


class _Legs:
    """Counter of ways there and back, each of at least ``LEG_M``."""

    def __init__(self) -> None:
        self._count = self._direction = 0
        self._at_m = self._low_m = self._high_m = 0.0  # low and high since the last turn

    def step(self, way_m: float) -> bool:
        """Add a way in m; return True when it completes a way back."""
        at_m = self._at_m = self._at_m + way_m
        self._low_m, self._high_m = min(self._low_m, at_m), max(self._high_m, at_m)
        up = self._direction <= 0 and at_m - self._low_m >= LEG_M
        down = self._direction >= 0 and self._high_m - at_m >= LEG_M
        if not (up or down):
            return False
        self._direction, self._low_m, self._high_m = 1 if up else -1, at_m, at_m
        self._count += 1
        return self._count % 2 == 0


class _Strokes:
    """Counter of the taps and reversals of one joystick."""

    def __init__(self) -> None:
        self._side = self._last = 0
        self._since_s = self._ended_s = 0.0

    def step(self, figures: Figures, joystick: float, now_s: float) -> None:
        """Take the joystick's deflection in a tick, 0 in neutral; add to ``figures``."""
        side = (joystick > 0.0) - (joystick < 0.0)
        if side == self._side:
            return
        if self._side:
            figures.taps += now_s - self._since_s < TAP_S
            self._last, self._ended_s = self._side, now_s
        if side:
            figures.reversals += self._last == -side and now_s - self._ended_s <= REVERSAL_S
            self._since_s = now_s
        self._side = side
