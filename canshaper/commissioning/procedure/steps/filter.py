"""The filter of each axis that swings, designed for what was measured."""

from functools import partial

from canshaper.commissioning.procedure.state import Context, Outcome, Step
from canshaper.commissioning.procedure.steps.swing import swinging, swings
from canshaper.commissioning.robust import (
    RobustDesign,
    design_robust,
    figure,
    print_design,
    write_design,
)
from canshaper.machine.deployment import Deployment


def run(context: Context) -> Outcome:
    """Design a robust shaper for each axis."""
    outcome = Outcome()
    designs = []
    for name in swinging(context.deployment):
        one = design_robust(context.deployment, name)
        designs.append(one)
        print_design(context.deployment, one, outcome.sheet)
        outcome.numbers[name] = {
            "residual_pct": round(100.0 * one.shaper.residual, 2),
            "duration_s": round(one.shaper.duration_s, 3),
            "mean_delay_s": round(one.shaper.mean_delay_s, 3),
            "verdict": one.verdict.word,
        }
        outcome.figures[name] = partial(figure, one)
        if one.verdict.useless:
            outcome.poor.append(f"{name}: {one.verdict}")
    outcome.edit = partial(_write, designs=designs)
    return outcome


def _write(deployment: Deployment, designs: list[RobustDesign]) -> list[str]:
    lines = [line for one in designs for line in write_design(deployment, one)]
    return [line for line in lines if line.startswith(("NOTE", "WARNING"))]


FILTER = Step(
    "filter",
    "Filter, designed",
    "designs the robust shaper for that swing and valve; says so where it replaces another kind",
    run,
    writes="`filter`, `tail_s`",
    needs=("swing", "valve"),
    applies=swings,
)
