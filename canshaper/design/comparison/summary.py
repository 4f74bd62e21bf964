"""One row a candidate, and a plain recommendation."""

from dataclasses import dataclass

from canshaper.design.comparison.candidates import Candidate
from canshaper.design.comparison.measure import Outcome

# A filter that leaves more than this part of the unshaped swing, at lengths within 15 %, is not
# recommended as "fast": the operator would still wait for the grapple.
FAST_LEAVES = 0.12
# "Balanced" may stop later than the fast one, up to this share of a swing in all.
BALANCED_PERIODS = 0.9
# Run-on is read from feedback every 20 ms.
HALF_TICK_S = 0.01


@dataclass(frozen=True)
class Row:
    """What a candidate did in all manoeuvres.

    Attributes:
        stop_s, rise_s, dip, re_rise, peak_deg, residual_deg, cross_deg: of the pulse at the right
            length.
        pulse_15_deg: largest residual of the pulse at length errors up to 15 %.
        worst_15_deg, worst_30_deg: largest residual of all manoeuvres but random and initial sway
            at length errors up to 15 and 30 %.
        random_deg: largest residual of the random sticks.
        initial_deg: residual of the pulse that began with swing.
    """

    name: str
    ours: bool
    stop_s: float
    rise_s: float
    residual_deg: float
    cross_deg: float
    pulse_15_deg: float
    worst_15_deg: float
    worst_30_deg: float
    random_deg: float
    initial_deg: float
    peak_deg: float
    dip: float
    re_rise: float


def rows(found: list[Candidate], outcomes: list[Outcome]) -> list[Row]:
    """Summaries in the order of the candidates."""
    return [_row(c, [o for o in outcomes if o.candidate == c.name]) for c in found]


def _row(candidate: Candidate, outcomes: list[Outcome]) -> Row:
    pulses = [o for o in outcomes if o.manoeuvre == "pulse"]
    pulse = next(o for o in pulses if o.length_pct == 0)

    def worst(range_pct: int) -> float:
        return max(
            o.residual_deg
            for o in outcomes
            if abs(o.length_pct) <= range_pct and not o.manoeuvre.startswith(("random", "initial"))
        )

    return Row(
        candidate.name,
        candidate.ours,
        pulse.stop_s if pulse.stop_s is not None else float("nan"),
        pulse.rise_s if pulse.rise_s is not None else float("nan"),
        pulse.residual_deg,
        pulse.cross_deg,
        max(o.residual_deg for o in pulses if abs(o.length_pct) <= 15),
        worst(15),
        worst(30),
        max(o.residual_deg for o in outcomes if o.manoeuvre.startswith("random")),
        next(o.residual_deg for o in outcomes if o.manoeuvre == "initial sway"),
        pulse.peak_deg,
        pulse.dip or 0.0,
        pulse.re_rise or 0.0,
    )


def beaten_by(row: Row, table: list[Row]) -> Row | None:
    """One of ours that stops as soon, to half a tick, and leaves less over +-30 %; or None."""
    better = [
        r
        for r in table
        if r.ours and r.stop_s <= row.stop_s + HALF_TICK_S and r.worst_30_deg < row.worst_30_deg
    ]
    return min(better, key=lambda r: r.worst_30_deg, default=None)


def recommendations(table: list[Row], period_s: float) -> dict[str, tuple[Row, str]]:
    """For "fast", "balanced" and "calm" a row and a sentence that says why."""
    off = next(r for r in table if r.name == "off")
    quiet = [r for r in table if r.worst_15_deg <= FAST_LEAVES * off.worst_15_deg]
    fast = min(quiet or table, key=lambda r: (r.stop_s, r.worst_15_deg))
    in_time = [r for r in table if r.stop_s <= BALANCED_PERIODS * period_s]
    balanced = min(in_time or table, key=lambda r: (r.worst_15_deg, r.stop_s))
    calm = min(table, key=lambda r: (r.worst_30_deg, r.stop_s))
    return {
        "fast": (
            fast,
            f"fast: {fast.name} stops soonest, {fast.stop_s:.1f} s after release, of all that leave"
            f" at most {100 * FAST_LEAVES:.0f} % of the unshaped swing at lengths within 15 %"
            f" ({fast.worst_15_deg:.1f} of {off.worst_15_deg:.1f} degrees)",
        ),
        "balanced": (
            balanced,
            f"balanced: {balanced.name} leaves least at lengths within 15 %"
            f" ({balanced.worst_15_deg:.1f} degrees) of all that stop within"
            f" {BALANCED_PERIODS:g} of a swing ({balanced.stop_s:.1f} s)",
        ),
        "calm": (
            calm,
            f"calm: {calm.name} leaves least at lengths within 30 %"
            f" ({calm.worst_30_deg:.1f} of {off.worst_30_deg:.1f} degrees);"
            f" it stops {calm.stop_s:.1f} s after release",
        ),
    }
