"""Figure 6 of the paper: what the swing does with the speed of the tip, over frequency."""

from collections.abc import Sequence
from typing import Any, Final, Protocol

from matplotlib.axes import Axes
from matplotlib.figure import Figure

from canshaper.report.style import new_figure
from studies.paper.style import (
    LEFT,
    PLANT_COLOUR,
    RIGHT,
    TEXT_COLOUR,
    footnote,
    headline,
    plain,
)

_LABEL: Final[dict[str, Any]] = {"fontsize": 11, "color": TEXT_COLOUR}
_COLOURS: Final = {"G11": PLANT_COLOUR["real"], "G22": PLANT_COLOUR["linear"]}
_WORDS: Final = {
    "G11": "G11: slewing makes it swing across",
    "G22": "G22: near-far makes it swing along",
}


class Curve(Protocol):
    """Curves of one transfer function; see ``BodeCurve`` of the reproduction."""

    @property
    def name(self) -> str: ...  # noqa: D102
    @property
    def omega_rad_s(self) -> list[float]: ...  # noqa: D102
    @property
    def magnitude_db(self) -> list[float]: ...  # noqa: D102
    @property
    def phase_deg(self) -> list[float]: ...  # noqa: D102
    @property
    def printed_db(self) -> list[float]: ...  # noqa: D102
    @property
    def resonance_rad_s(self) -> float: ...  # noqa: D102
    @property
    def damping_ratio(self) -> float: ...  # noqa: D102


def bode_figure(curves: Sequence[Curve], slewing_rad_s: tuple[float, float]) -> Figure:
    """Magnitude above phase; the peaks and the curves of Eq. 12 as printed are named.

    Args:
        curves: G11 and G22.
        slewing_rad_s: the two natural frequencies while slewing at full speed.
    """
    fig = new_figure(*(1600, 1000))
    headline(fig, bode_finding(curves))
    grid = fig.add_gridspec(
        2, 1, left=LEFT, right=RIGHT, top=0.91, bottom=0.1, hspace=0.1, height_ratios=[1.5, 1]
    )
    magnitude = fig.add_subplot(grid[0])
    phase = fig.add_subplot(grid[1], sharex=magnitude)
    for panel in (magnitude, phase):
        plain(panel)
        panel.set_xscale("log")
    for curve in curves:
        _draw(magnitude, phase, curve)
    ticks = [0.3, 0.5, 1.0, 2.0, 3.0, 5.0, 10.0, 20.0, 30.0]
    phase.set_xticks(ticks, [f"{t:g}" for t in ticks])
    phase.minorticks_off()
    magnitude.tick_params(labelbottom=False)
    magnitude.set_xlim(ticks[0], ticks[-1])
    magnitude.set_ylim(-45.0, 36.0)
    magnitude.set_ylabel("magnitude, dB (G11: 1, G22: rad/m)", **_LABEL)
    phase.set_ylabel("phase, °", **_LABEL)
    phase.set_yticks([-180.0, -90.0, 0.0, 90.0, 180.0])
    phase.set_xlabel("frequency, rad/s", **_LABEL)
    slow, fast = slewing_rad_s
    footnote(
        fig,
        "At rest, radius 3 m, assumed grapple. Dashed: Eq. 12 as printed, its factor 3 in G22 in"
        " place of G11 and no minus."
        f" While slewing at 0.5 rad/s the modes lie at {slow:.2f} and {fast:.2f} rad/s.",
    )
    return fig


def bode_finding(curves: Sequence[Curve]) -> str:
    """The finding: how near the two natural frequencies are."""
    g11, g22 = curves
    low, high = sorted(curve.resonance_rad_s for curve in curves)
    return (
        f"The two swings lie {100.0 * (high / low - 1.0):.0f} % apart: "
        f"{g11.resonance_rad_s:.2f} rad/s across the boom, {g22.resonance_rad_s:.2f} rad/s along it"
    )


def _draw(magnitude: Axes, phase: Axes, curve: Curve) -> None:
    colour = _COLOURS[curve.name]
    magnitude.plot(curve.omega_rad_s, curve.magnitude_db, color=colour, linewidth=2.2)
    magnitude.plot(curve.omega_rad_s, curve.printed_db, "--", color=colour, linewidth=1.1)
    phase.plot(curve.omega_rad_s, curve.phase_deg, color=colour, linewidth=2.2)
    top = max(range(len(curve.omega_rad_s)), key=lambda k: curve.magnitude_db[k])
    at, peak = curve.omega_rad_s[top], curve.magnitude_db[top]
    first = curve.name == "G11"
    magnitude.plot([at], [peak], "o", color=colour, markersize=8, markeredgecolor="white")
    magnitude.annotate(
        f"{_WORDS[curve.name]}\n{curve.resonance_rad_s:.2f} rad/s, {peak:.0f} dB,"
        f" damping ratio {curve.damping_ratio:.3f}",
        xy=(at, peak),
        xytext=(-26, -4) if first else (0, -150),
        textcoords="offset points",
        ha="right" if first else "center",
        va="center",
        arrowprops={"arrowstyle": "-", "color": colour, "linewidth": 1.0, "shrinkB": 5},
        color=colour,
        fontsize=13,
        weight="bold",
    )
    magnitude.text(
        curve.omega_rad_s[-1] * 0.98,
        curve.printed_db[-1] + (1.2 if not first else -1.2),
        f"{curve.name} as printed",
        color=colour,
        fontsize=12,
        ha="right",
        va="top" if first else "bottom",
    )
    magnitude.text(
        curve.omega_rad_s[-1] * 0.98,
        curve.magnitude_db[-1] + (-1.2 if first else 1.2),
        curve.name,
        color=colour,
        fontsize=13,
        weight="bold",
        ha="right",
        va="top" if first else "bottom",
    )
    place = len(curve.omega_rad_s) // 5
    phase.text(
        curve.omega_rad_s[place],
        curve.phase_deg[place] - 8.0,
        curve.name,
        color=colour,
        fontsize=13,
        weight="bold",
        va="top",
    )
