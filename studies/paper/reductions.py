"""The paper's reductions of the sway against ours, in every reading of "reduction".

The paper says neither of what its percentages are (peak, RMS, what is left after the stop) nor with
which grapple, stroke and valve. So each claim is given for all readings on both plants, and the
readings that depend on an assumption are driven over a range of it. Nothing is tuned.
"""

from collections.abc import Callable, Mapping
from dataclasses import asdict, dataclass, replace
from typing import Any, Final

from canshaper_sim.grapple import Grapple
from studies.paper.plants import HOLD_S, PLANTS, PRESS_S, REST_S, linear_run
from studies.paper.printed import optimal_poles
from studies.paper.runs import METRICS, Metric, Plane, Run

# (axis that is driven, axis whose printed poles the filter has, plant) -> run
Runs = Mapping[tuple[str, str, str], Run]
METRIC_WORDS: Final[dict[Metric, str]] = {"peak": "peak", "rms": "RMS", "residual": "residual"}
LENGTHS_M: Final = (0.4, 0.6, 0.8, 1.0, 1.2, 1.4, 1.6, 1.8, 2.0)
RESTS_S: Final = (4.0, REST_S, 10.0, 20.0)


@dataclass(frozen=True)
class Claim:
    """A reduction that the paper claims: ``more_than_pct`` in this plane, with these poles."""

    section: str
    axis: str
    poles_of: str
    plane: Plane
    more_than_pct: float
    remark: str = ""


CLAIMS: Final = (
    Claim("4.1", "slew", "slew", "perpendicular", 63.0),
    Claim("4.1", "slew", "slew", "parallel", 67.0),
    Claim("4.2", "near_far", "near_far", "parallel", 67.0),
    # 4.2 is about near-far, but its sentence says "during slew movement" and has both planes.
    Claim("4.2", "slew", "near_far", "perpendicular", 63.0, "as the sentence reads"),
    Claim("4.2", "slew", "near_far", "parallel", 67.0, "as the sentence reads"),
)
AVERAGE_PCT: Final = 60.0  # abstract: "averaging a decrease of more than 60%"
_AVERAGED: Final = CLAIMS[:3]
_BOTH: Final = CLAIMS[0], CLAIMS[2]  # across the boom by slewing, along it by near-far


def reduction_pct(runs: Runs, claim: Claim, plant: str, metric: Metric) -> float:
    """The reduction that a claim is about, percent."""
    reduced_pct = runs[claim.axis, claim.poles_of, plant].swing(claim.plane, metric).reduction_pct
    assert reduced_pct is not None  # every claim is of a plane that swings
    return reduced_pct


def rows(runs: Runs) -> list[dict[str, Any]]:
    """One row a claim, for the average and for both: the claim, ours in each reading, where so."""
    result = []
    for claim in CLAIMS:
        ours = {
            plant: {m: reduction_pct(runs, claim, plant, m) for m in METRICS} for plant in PLANTS
        }
        result.append(asdict(claim) | _judged(ours, claim.more_than_pct))
    mean = {
        plant: {
            m: sum(reduction_pct(runs, c, plant, m) for c in _AVERAGED) / len(_AVERAGED)
            for m in METRICS
        }
        for plant in PLANTS
    }
    average = {
        "section": "abstract",
        "axis": "both",
        "poles_of": "each",
        "plane": "average",
        "more_than_pct": AVERAGE_PCT,
        "remark": "mean of the first three rows",
    }
    least = {
        plant: {m: min(reduction_pct(runs, c, plant, m) for c in _BOTH) for m in METRICS}
        for plant in PLANTS
    }
    both = average | {"section": "5", "plane": "least"}
    both["remark"] = "as the sentence of the conclusion reads: smaller of rows 1 and 3"
    return [*result, average | _judged(mean, AVERAGE_PCT), both | _judged(least, AVERAGE_PCT)]


def _judged(ours: dict[str, dict[Metric, float]], more_than_pct: float) -> dict[str, Any]:
    holds = {
        plant: [m for m in METRICS if values[m] > more_than_pct] for plant, values in ours.items()
    }
    rounded = {p: {m: round(v, 1) for m, v in values.items()} for p, values in ours.items()}
    return {"ours_pct": rounded, "holds_for": holds}


def assumptions(on_progress: Callable[[], None]) -> list[dict[str, Any]]:
    """The claims of the linear plant over the length l2 of the grapple and the length of rest.

    All other parameters stay as assumed, and the filter knows the grapple. The rest matters to the
    RMS only: it is taken over the whole drive, and the longer the rest, the more the swing that is
    left weighs.

    Args:
        on_progress: called after every length and rest.

    Returns:
        Per claim, the reductions by l2 in m and by rest in s.
    """
    result: list[dict[str, Any]] = [asdict(c) | {"by_l2_m": {}, "by_rest_s": {}} for c in CLAIMS]
    for length_m in LENGTHS_M:
        _vary(result, "by_l2_m", length_m, replace(Grapple(), l2_m=length_m), REST_S)
        on_progress()
    for rest_s in RESTS_S:
        _vary(result, "by_rest_s", rest_s, Grapple(), rest_s)
        on_progress()
    return result


def _vary(
    result: list[dict[str, Any]], name: str, value: float, grapple: Grapple, rest_s: float
) -> None:
    for claim, row in zip(CLAIMS, result, strict=True):
        run = linear_run(claim.axis, optimal_poles(claim.poles_of), grapple, rest_s)
        row[name][value] = {
            m: round(run.swing(claim.plane, m).reduction_pct or 0.0, 1) for m in METRICS
        }


def in_words(table: list[dict[str, Any]], varied: list[dict[str, Any]]) -> list[str]:
    """Say plainly for which reading and assumption each claim holds."""
    return [
        _sentence(row, varied[i] if i < len(varied) else None)
        for i, row in enumerate(table)
        if not row["remark"].startswith("as the sentence")
    ]


def _sentence(row: dict[str, Any], varied: dict[str, Any] | None) -> str:
    bound = row["more_than_pct"]
    what = {
        "both": "Average",
        "slew": f"Slew, {row['plane']}",
        "near_far": f"Near-far, {row['plane']}",
    }[row["axis"]]
    linear, real = (row["holds_for"][plant] for plant in PLANTS)
    text = f"{what}, more than {bound:g} %: {_readings(linear)} on the linear valve"
    if linear == real:
        text = f"{what}, more than {bound:g} %: {_readings(linear)}, on both valves"
    else:
        text += f", {_readings(real)} on the real one"
    if varied is None:
        return f"{text}."
    text += f". With l2 from {LENGTHS_M[0]:g} to {LENGTHS_M[-1]:g} m on the linear valve: "
    text += ", ".join(
        f"{METRIC_WORDS[m]} {_where([v[m] > bound for v in varied['by_l2_m'].values()])}"
        for m in METRICS
    )
    rests = [v for v, ours in varied["by_rest_s"].items() if ours["rms"] > bound]
    if 0 < len(rests) < len(RESTS_S):
        text += f"; RMS at {Grapple().l2_m:g} m too where the rest is {min(rests):g} s or longer"
    return f"{text}."


def _where(holds: list[bool]) -> str:
    """Where over ``LENGTHS_M``: "always", "never", or the lengths."""
    if all(holds):
        return "always"
    if not any(holds):
        return "never"
    lengths = [v for v, yes in zip(LENGTHS_M, holds, strict=True) if yes]
    first, last = lengths[0], lengths[-1]
    if sum(holds) == LENGTHS_M.index(last) - LENGTHS_M.index(first) + 1:
        return f"at {first:g} to {last:g} m" if first < last else f"at {first:g} m"
    return f"at {', '.join(f'{v:g}' for v in lengths)} m"


def _readings(metrics: list[Metric]) -> str:
    if len(metrics) == len(METRICS):
        return "holds in every reading"
    if not metrics:
        return "holds in no reading"
    return f"holds for {' and '.join(METRIC_WORDS[m] for m in metrics)} only"


DRIVE: Final = (
    f"full deflection for {HOLD_S:g} s, pressed at {PRESS_S:g} s, {REST_S:g} s of rest;"
    " peak and RMS over the whole drive, residual later than 2.5 s after release"
)
