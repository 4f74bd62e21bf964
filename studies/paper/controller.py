"""The paper's numbers about model and filter against ours: poles, optima, frequencies, gains."""

import math
from collections.abc import Callable, Mapping
from dataclasses import dataclass
from typing import Final

from canshaper.design.tuning.formulation import (
    PAPER_NEAR_FAR,
    PAPER_SLEW,
    Requirements,
    Task,
    Weights,
)
from canshaper.design.tuning.optimal import Tuning, manual, tune
from canshaper.shaping.shapers.gff import denominator_from_poles
from canshaper.shaping.sway import GRAVITY_M_S2
from canshaper_sim.grapple import Grapple
from studies.paper import printed
from studies.paper.bode import BodeCurve, Slewing, apart_pct, dc_gains_are_zero
from studies.paper.plants import TICK_S, printed_mode, swinging_deg
from studies.paper.reductions import METRIC_WORDS
from studies.paper.runs import METRICS, Metric, Run

_WEIGHTS: Final[dict[str, Weights]] = {"slew": PAPER_SLEW, "near_far": PAPER_NEAR_FAR}
# The paper does not ask that the output stays within the command.
_FREE: Final = Requirements(within_command=False)
_FITTED_HORIZON_S: Final = 1.0  # N = 50
TUNINGS: Final = 5
_START_DEG: Final = 10.0


@dataclass(frozen=True)
class Fact:
    """One printed number.

    Attributes:
        section: of the paper.
        what: what the number is of.
        paper: as printed.
        ours: what comes out here.
        agrees: whether it is the same; None where the paper leaves too much open to on_progress.
        remark: why, or on which assumption.
    """

    section: str
    what: str
    paper: str
    ours: str
    agrees: bool | None
    remark: str


def facts(
    curves: tuple[BodeCurve, BodeCurve],
    turning: Slewing,
    ladders: Mapping[tuple[str, str], list[Run]],
    on_progress: Callable[[], None],
) -> list[Fact]:
    """Every printed number that is not a reduction.

    Args:
        curves: of figure 6.
        turning: the linearisation while slewing.
        ladders: runs of figures 3 and 4 by (axis, plant).
        on_progress: called ``TUNINGS`` times, after every tuning.
    """
    result = []
    for axis in ("slew", "near_far"):
        result.append(_roots(axis))
        result.append(_optimum(axis, on_progress))
    result += [_pole_distance(on_progress), _manual_rule(), *_poles_and_sway(ladders)]
    return [*result, *_model(curves, turning), _initial_sway()]


def _initial_sway() -> Fact:
    left, still = swinging_deg(_START_DEG)
    return Fact(
        "1, 5",
        f"Initial sway, here {_START_DEG:g} deg",
        "robust, adaptable",
        f"{left:.1f} deg left, {still:.1f} standing still",
        None,
        "near-far stroke with the near-far filter, linear valve, later than 2.5 s after release: it"
        " adds hardly any swing, and takes none of that away: no feedforward filter knows of it",
    )


def _roots(axis: str) -> Fact:
    p, q = printed.POLES[axis]
    fast, slow = printed.optimal_poles(axis)
    a1, a2 = denominator_from_poles((p, q))
    return Fact(
        "4.1" if axis == "slew" else "4.2",
        f"{_title(axis)}: poles of a1, a2",
        f"{q:.4f}, {p:.4f}",
        f"{fast:.4f}, {slow:.4f}",
        abs(a1 / printed.DENOMINATORS[axis][0] - 1.0) < 0.002
        and abs(a2 / printed.DENOMINATORS[axis][1] - 1.0) < 0.002,
        f"the printed poles give a1 = {a1:.5f}, a2 = {a2:.6f}: rounded to the printed ones",
    )


def _optimum(axis: str, on_progress: Callable[[], None]) -> Fact:
    a1, a2 = printed.DENOMINATORS[axis]
    assumed = printed_mode(Grapple())
    ours = tune(Task(assumed, TICK_S, weights=_WEIGHTS[axis], require=_FREE))
    on_progress()
    fitted = tune(_fitted_task(axis, _FREE))
    on_progress()
    mode = printed.FITTED[axis]
    length = GRAVITY_M_S2 / mode.omega_rad_s**2
    return Fact(
        "4.1" if axis == "slew" else "4.2",
        f"{_title(axis)}: optimal a1, a2",
        f"{a1:g}, {a2:g}",
        f"{ours.a1:.3f}, {ours.a2:.4f}",
        abs(ours.a1 / a1 - 1.0) < 0.02 and abs(ours.a2 / a2 - 1.0) < 0.02,
        f"Eq. 14-15 for the assumed grapple, l2 = {Grapple().l2_m:g} m."
        f" {fitted.a1:.3f}, {fitted.a2:.4f} come out for l2 = {length:.2f} m,"
        f" damping ratio {mode.damping_ratio:.2f}, Q on the deviation,"
        " N = 50: fitted, so possible, no more",
    )


def _fitted_task(axis: str, require: Requirements) -> Task:
    mode, weights = printed.FITTED[axis], _WEIGHTS[axis]
    return Task(mode, TICK_S, _FITTED_HORIZON_S, weights, "deviation", require)


def _pole_distance(on_progress: Callable[[], None]) -> Fact:
    require = Requirements(pole_distance="printed", within_command=False)
    optimum: Tuning = tune(_fitted_task("slew", require))
    on_progress()
    needed = min(printed.POLES["slew"]) / 5.0
    return Fact(
        "3.1",
        "Eq. 14e: poles against 5 Re P",
        ">= 5 Re P",
        "<= 5 Re P",
        False,
        "the text asks for poles far enough out, the print for near ones; with the print the fitted"
        f" slew optimum is {optimum.poles_rad_s[0]:.2f}, {optimum.poles_rad_s[1]:.2f}, and the"
        f" printed poles need Re P <= {needed:.2f} rad/s (assumed grapple:"
        f" {printed_mode(Grapple()).pole.real:.2f})",
    )


def _manual_rule() -> Fact:
    poles = manual(printed_mode(Grapple())).poles_rad_s
    return Fact(
        "3",
        "Manual rule: 5 Re P, then < 2x",
        "no poles",
        f"{poles[0]:.2f}, {poles[1]:.2f}",
        None,
        "depends on damping alone: far slower than either printed optimum on the assumed grapple",
    )


def _poles_and_sway(ladders: Mapping[tuple[str, str], list[Run]]) -> list[Fact]:
    """Figures 3 and 4 in words: -3, -3 is best; poles far out reduce sway too."""
    result = []
    for axis, figure in (("slew", 3), ("near_far", 4)):
        plane = ladders[axis, "linear"][0].planes[0]
        by_metric: dict[Metric, list[float]] = {
            m: [run.swing(plane, m).reduction_pct or 0.0 for run in ladders[axis, "linear"]]
            for m in METRICS
        }
        at_three = printed.LADDER.index((-3.0, -3.0))
        reported = "; ".join(
            f"{METRIC_WORDS[m]} " + ", ".join(str(round(v)) for v in values)
            for m, values in by_metric.items()
        )
        if figure == 3:
            best = [
                METRIC_WORDS[m] for m, v in by_metric.items() if max(v[at_three:]) == v[at_three]
            ]
            result.append(
                Fact(
                    "4.1",
                    "Fig. 3: -3, -3 leaves least sway",
                    "of those shown",
                    f"least {' and '.join(best)}" if best else "not least",
                    bool(best),
                    "of -3, -5 and -10; the other pairs of the figure are not in the text."
                    " -2, -2 leaves less peak and RMS, and is slower",
                )
            )
        far = {m: values[-1] for m, values in by_metric.items()}
        result.append(
            Fact(
                "4.1" if figure == 3 else "4.2",
                f"Fig. {figure}: poles far out",
                "reduce sway",
                f"peak by {round(far['peak'])} % at -10",
                all(value > 0.0 for value in far.values()),
                f"reduction in %, {plane}, linear valve, double poles -2, -3, -5, -10: {reported};"
                " the farther out, the less of the peak and the RMS",
            )
        )
    return result


def _model(curves: tuple[BodeCurve, BodeCurve], turning: Slewing) -> list[Fact]:
    g11, g22 = curves
    radius = printed.RADIUS_M
    low, high = turning.omegas_rad_s
    return [
        Fact(
            "3, Fig. 6",
            "Natural frequencies of G11, G22",
            '"too close"',
            f"{g11.resonance_rad_s:.2f}, {g22.resonance_rad_s:.2f} rad/s",
            None,
            f"{apart_pct(curves):.0f} % apart on the assumed grapple at rest;"
            f" {low:.2f} and {high:.2f} rad/s while slewing at {turning.slew_rate_rad_s:g} rad/s",
        ),
        Fact(
            "3",
            "DC gain of G12, G13, G23",
            "about 0",
            "0",
            True,
            f"but that of every G is 0; at rest {', '.join(dc_gains_are_zero())} are 0 at every"
            f" frequency, while slewing G21 peaks at {turning.peak_g21:.1f} and G11 at"
            f" {turning.peak_g11:.1f}",
        ),
        Fact(
            "3, Eq. 12",
            "Factor 3 (the radius in m)",
            "in G22",
            "in G11",
            False,
            f"high-frequency gains {_gain(g11):.2f} = {radius:g} m x {_gain(g11) / radius:.3f} 1/m"
            f" and {_gain(g22):.2f} 1/m: the radius belongs to slewing, and G11 has a minus",
        ),
    ]


def _gain(curve: BodeCurve) -> float:
    """|G| far above the resonance, from the magnitude at the last frequency."""
    w, end = curve.resonance_rad_s, curve.omega_rad_s[-1]
    ratio = end / w
    shape = ratio**2 / math.hypot(1.0 - ratio**2, 2.0 * curve.damping_ratio * ratio)
    return math.pow(10.0, curve.magnitude_db[-1] / 20.0) / shape


def _title(axis: str) -> str:
    return axis.replace("_", "-").capitalize()
