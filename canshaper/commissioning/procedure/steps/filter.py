"""The filter of each axis that swings: designs for what was measured side by side, a choice."""

import math
from dataclasses import dataclass, replace
from functools import partial

from rich.table import Table

from canshaper.commissioning import robust_report, tuned
from canshaper.commissioning.procedure.state import Context, Outcome, Step
from canshaper.commissioning.procedure.steps.swing import swinging
from canshaper.commissioning.robust import RobustDesign, design_robust
from canshaper.commissioning.tuned import TunedDesign, design_tuned
from canshaper.config.filters import Filter
from canshaper.design.tuning.evaluate import evaluate, press
from canshaper.design.tuning.verdict import Verdict, judged, on_axis
from canshaper.errors import CanshaperError
from canshaper.machine.deployment import Deployment
from canshaper.report.console import axis_title, new_table

ROBUST, GFF = "robust", "gff"
_NAMES = {ROBUST: "robust", GFF: "gff, of the paper"}
_WORDS = ("good", "poor", "useless")
_LENGTHS_PCT = (-10, 0, 10)
_PRESS_S = 10.0

Design = RobustDesign | TunedDesign


@dataclass(frozen=True)
class Offer:
    """A design with its figures behind the limits of the machine, with the tail that is written.

    Attributes:
        design: robust shaper or G_FF.
        chosen: its filter section.
        verdict: whether it damps.
        figures: swing left (right length, at worst within 10 % of it) and dip in %, peak of the
            swing in degrees and without the filter, run-on in m, of a full press and release.
    """

    design: Design
    chosen: Filter
    verdict: Verdict
    figures: dict[str, float]


def run(context: Context) -> Outcome:
    """Design both filters for each axis; where every axis has both, ask which one to write."""
    deployment, outcome = context.deployment, Outcome()
    offers = {name: _offers(deployment, name, outcome) for name in swinging(deployment)}
    kinds = [kind for kind in _NAMES if all(kind in one for one in offers.values())]
    if not kinds:
        outcome.problems.append("no filter suits every axis; see above")
        return outcome
    words = {kind: [by_kind[kind].verdict.word for by_kind in offers.values()] for kind in kinds}
    recommended = min(kinds, key=lambda kind: max(map(_WORDS.index, words[kind])))
    for name, by_kind in offers.items():
        outcome.sheet.print(_table(name, by_kind))
    before = context.state.of(FILTER.name).numbers.get("chosen")
    kind = recommended
    if len(kinds) > 1:
        question = f"filter: which one, {' or '.join(kinds)}; recommended is {recommended}"
        lines = [_line(name, one[kind]) for name, one in offers.items() for kind in kinds]
        kept = before if before in kinds else recommended
        kind = context.bench.person.answer("\n".join([question, *lines, " "]), kept, kinds)
    outcome.sheet.print(f"Recommended: {recommended}. Chosen: {kind}")
    outcome.numbers = {"chosen": kind, "recommended": recommended, "offered": kinds}
    designs = []
    for name, by_kind in offers.items():
        outcome.numbers[name] = {
            one: {**offer.figures, "verdict": offer.verdict.word} for one, offer in by_kind.items()
        }
        offer = by_kind[kind]
        designs.append(offer.design)
        _show(deployment, offer.design, outcome)
        if offer.verdict.useless:
            outcome.problems.append(f"{name}: {offer.verdict}")
    outcome.edit = partial(_write, designs=designs)
    return outcome


def _offers(deployment: Deployment, axis: str, outcome: Outcome) -> dict[str, Offer]:
    """Return the designs of an axis by kind; show why a kind has none."""
    result = {}
    for kind in _NAMES:
        try:
            design: Design = (
                design_robust(deployment, axis)
                if kind == ROBUST
                else design_tuned(deployment, axis, {"third_pole": True})
            )
        except (CanshaperError, ValueError) as error:
            outcome.sheet.print(f"{axis}: no filter {kind}: {error}")
            continue
        result[kind] = _offer(deployment, design)
    return result


def _offer(deployment: Deployment, design: Design) -> Offer:
    limits, sway = design.bound.config.limits, design.bound.config.sway
    assert sway is not None
    if isinstance(design, RobustDesign):
        chosen, needed_s = design.chosen, design.needed_s
    else:
        chosen, needed_s = design.setting.filter, design.tail[0] if design.tail else None
    tail_s, axis = max(limits.tail_s, needed_s or 0.0), design.bound.name
    setup = on_axis(deployment, axis, chosen, tail_s=tail_s)
    measured, traces = evaluate(*setup, _LENGTHS_PCT), press(*setup, _PRESS_S)
    to_deg = math.degrees(setup[0].angle_per_speed_rad * sway.full_speed_m_s)
    figures = {
        "left_pct": 100.0 * measured.worst(0.0),
        "left_within_10_pct": 100.0 * measured.worst(),
        "peak_deg": to_deg * max(map(abs, traces.swing)),
        "raw_peak_deg": to_deg * max(map(abs, traces.swing_raw)),
        "run_on_m": measured.mean_delay_s * sway.full_speed_m_s,
        "dip_pct": 100.0 * measured.dip,
    }
    verdict = judged(deployment, axis, chosen, tail_s=tail_s)
    if verdict.word != "good":
        verdict = replace(verdict, cures=design.verdict.cures or verdict.cures)
    return Offer(design, chosen, verdict, {key: round(one, 2) for key, one in figures.items()})


def _cells(offer: Offer) -> tuple[str, ...]:
    f = offer.figures
    left = f"{f['left_pct']:.1f}", f"{f['left_within_10_pct']:.1f}"
    peak = f"{f['peak_deg']:.1f} of {f['raw_peak_deg']:.1f}"
    return *left, peak, f"{f['run_on_m']:.2f}", f"{f['dip_pct']:.0f}", offer.verdict.word


def _line(axis: str, offer: Offer) -> str:
    """Return the figures of a design as a line of the question."""
    left, around, peak, run_on, dip, word = _cells(offer)
    return (
        f"  {axis}, {offer.chosen.kind}: leaves {left} %, {around} % within ±10 %; peak {peak}"
        f" degrees; run-on {run_on} m; dip {dip} %; {word}"
    )


def _table(axis: str, by_kind: dict[str, Offer]) -> Table:
    """Return a table of the designs side by side."""
    heads = ("left, %", "±10 %", "peak, deg", "run-on, m", "dip, %", "verdict")
    table = new_table("filter", *heads, title=axis_title(axis))
    for kind, offer in by_kind.items():
        table.add_row(_NAMES[kind], *_cells(offer))
    return table


def _show(deployment: Deployment, design: Design, outcome: Outcome) -> None:
    """Print and draw the design that was chosen."""
    name = design.bound.name
    if isinstance(design, RobustDesign):
        robust_report.print_design(deployment, design, outcome.sheet)
        outcome.figures[name] = partial(robust_report.figure, design)
    else:
        tuned.print_tuned(deployment, design, outcome.sheet)
        outcome.figures[name] = partial(tuned.figure, design)


def _write(deployment: Deployment, designs: list[Design]) -> list[str]:
    lines: list[str] = []
    for one in designs:
        lines += (
            robust_report.write_design(deployment, one)
            if isinstance(one, RobustDesign)
            else tuned.write_tuned(deployment, one)
        )
    return [line for line in lines if line.startswith(("NOTE", "WARNING"))]


FILTER = Step(
    "filter",
    "Filter, designed",
    "designs the robust shaper and G_FF for that swing and valve, side by side; asks which one",
    run,
    writes="`filter`, `tail_s`",
    needs=("swing", "valve"),
    applies=swinging,
)
