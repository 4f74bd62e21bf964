"""One stroke without and with a filter, and what it says of the swing in both planes.

The paper gives reductions without saying of what. Here are the three readings of "reduction of
the sway" that are in use, always side by side.
"""

from dataclasses import dataclass
from functools import cached_property
from typing import Final, Literal

from canshaper.report.metrics import AxisComparison, compare
from canshaper_sim.recording import Recording

Plane = Literal["perpendicular", "parallel"]
Metric = Literal["peak", "rms", "residual"]
# The axis whose trace holds the swing of the plane: theta5 across the boom, theta6 along it.
TRACE_OF: Final[dict[Plane, str]] = {"perpendicular": "slew", "parallel": "near_far"}
PLANES: Final[tuple[Plane, ...]] = ("perpendicular", "parallel")
METRICS: Final[tuple[Metric, ...]] = ("peak", "rms", "residual")


@dataclass(frozen=True)
class Swing:
    """One measure of the swing in one plane, without and with the filter.

    ``reduction_pct`` is 100 (1 - shaped / raw); None where there is no swing to reduce.
    """

    raw_deg: float
    shaped_deg: float
    reduction_pct: float | None


@dataclass(frozen=True)
class Run:
    """A stroke of one axis on one plant, without and with G_FF.

    Attributes:
        axis: the axis that is driven, ``slew`` or ``near_far``.
        plant: ``linear`` or ``real``.
        poles_rad_s: poles of the filter, the slower one first.
        raw: the drive without filter.
        shaped: the same stroke with it.
    """

    axis: str
    plant: str
    poles_rad_s: tuple[float, float]
    raw: Recording
    shaped: Recording

    @cached_property
    def compared(self) -> dict[str, AxisComparison]:
        """Every measure of both drives."""
        return compare(self.raw, self.shaped)

    @property
    def planes(self) -> tuple[Plane, ...]:
        """Planes in which the stroke makes the grapple swing; near-far has the parallel one."""
        return PLANES if self.axis == "slew" else ("parallel",)

    @property
    def largest_command(self) -> float:
        """Largest |command| that was sent, fraction of full speed."""
        return max(map(abs, self.shaped.axes[self.axis].sent))

    def swing(self, plane: Plane, metric: Metric) -> Swing:
        """The swing of a plane.

        ``peak``: largest angle of the whole drive; ``rms``: root mean square over the whole drive;
        ``residual``: largest angle later than 2.5 s after the release of the joystick.
        """
        across = TRACE_OF[plane] != self.axis
        # The residual of the plane that the axis does not drive is kept with the axis it follows.
        owner = self.axis if metric == "residual" else TRACE_OF[plane]
        name = "cross_residual" if across and metric == "residual" else metric
        compared = self.compared[owner]
        raw, shaped = (getattr(m, f"{name}_deg") or 0.0 for m in (compared.raw, compared.shaped))
        return Swing(raw, shaped, getattr(compared, f"{name}_reduction_pct"))

    def numbers(self) -> dict[str, object]:
        """Everything of the run for JSON: degrees to 0.01, percent to 0.1."""
        own = self.compared[self.axis].shaped
        return {
            "plant": self.plant,
            "poles_rad_s": list(self.poles_rad_s),
            "largest_command": round(self.largest_command, 3),
            "time_to_95_s": _round(own.time_to_95_s, 2),
            "run_on_s": _round(own.run_on_s, 2),
            "swing": {
                plane: {
                    metric: {
                        "raw_deg": round(swing.raw_deg, 2),
                        "shaped_deg": round(swing.shaped_deg, 2),
                        "reduction_pct": _round(swing.reduction_pct, 1),
                    }
                    for metric in METRICS
                    for swing in (self.swing(plane, metric),)
                }
                for plane in self.planes
            },
        }


def _round(value: float | None, digits: int) -> float | None:
    return None if value is None else round(value, digits)
