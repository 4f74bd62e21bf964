"""Everything that ``canshaper reproduce`` computes, figure by figure and for the table."""

from collections.abc import Callable
from dataclasses import asdict
from typing import Any, Final

from canshaper.machine.deployment import Deployment
from canshaper_sim.axes import NEAR_FAR, SLEW
from canshaper_sim.grapple import Grapple
from studies.paper import bode, controller, reductions
from studies.paper.plants import LINEAR, PLANTS, linear_run, real_run
from studies.paper.printed import LADDER, optimal_poles
from studies.paper.runs import Plane, Run

FIGURES: Final = (3, 4, 6, 7, 8)
AXIS_OF: Final = {3: SLEW, 4: NEAR_FAR, 7: SLEW, 8: NEAR_FAR}
PARAMETERS: Final = (
    "the paper publishes no lengths, masses, damping, speeds, times or sampling; taken are"
    " l1 0.2 m, l2 1.2 m, 40 and 300 kg, 120 N m s/rad in each joint, radius 3 m, full deflection"
    " 0.5 rad/s and 1 m/s, lag 100 ms, commands at 50 Hz"
)


class Study:
    """The drives and curves, each made once, when it is asked for.

    Args:
        deployment: the shipped one, for the real plant.
        on_progress: called after every drive and tuning; see ``steps``.

    Raises:
        ValueError: the deployment lacks slew or near_far, or one of them has no sway data.
    """

    def __init__(self, deployment: Deployment, on_progress: Callable[[], None]) -> None:
        for axis in (SLEW, NEAR_FAR):
            bound = deployment.axes.get(axis)
            if bound is None or bound.config.sway is None:
                raise ValueError(f"the deployment has no axis {axis} with sway data")
        self._deployment = deployment
        self._on_progress = on_progress
        self._runs: dict[tuple[str, tuple[float, float], str], Run] = {}
        self._curves: tuple[bode.BodeCurve, bode.BodeCurve] | None = None
        self._turning: bode.Slewing | None = None

    def run(self, axis: str, poles_rad_s: tuple[float, float], plant: str) -> Run:
        """A stroke without and with the filter."""
        key = (axis, poles_rad_s, plant)
        if key not in self._runs:
            if plant == LINEAR:
                self._runs[key] = linear_run(axis, poles_rad_s)
            else:
                self._runs[key] = real_run(self._deployment, axis, poles_rad_s)
            self._on_progress()
        return self._runs[key]

    def ladder(self, figure: int) -> list[tuple[Run, Run]]:
        """Figures 3 and 4: for every pair of poles the run on the linear and on the real plant."""
        axis = AXIS_OF[figure]
        return [(self.run(axis, p, PLANTS[0]), self.run(axis, p, PLANTS[1])) for p in LADDER]

    def optimal(self, figure: int) -> tuple[Run, Run]:
        """Figures 7 and 8: the printed optimum on both plants."""
        axis = AXIS_OF[figure]
        poles = optimal_poles(axis)
        return self.run(axis, poles, PLANTS[0]), self.run(axis, poles, PLANTS[1])

    def claims(self, figure: int) -> list[tuple[Plane, float]]:
        """Figures 7 and 8: plane and percentage of the paper's claims."""
        axis = AXIS_OF[figure]
        return [
            (c.plane, c.more_than_pct)
            for c in reductions.CLAIMS
            if c.axis == axis and c.poles_of == axis
        ]

    def curves(self) -> tuple[bode.BodeCurve, bode.BodeCurve]:
        """Figure 6."""
        if self._curves is None:
            self._curves = bode.bode()
            self._on_progress()
        return self._curves

    def turning(self) -> bode.Slewing:
        """Figure 6 while slewing."""
        self._turning = self._turning or bode.slewing()
        return self._turning

    def figure_numbers(self, figure: int) -> dict[str, Any]:
        """Key numbers of the curves of a figure, for JSON."""
        if figure == 6:
            return {"figure": 6, **bode.figure_numbers(self.curves(), self.turning())}
        pairs = self.ladder(figure) if figure in (3, 4) else [self.optimal(figure)]
        return {
            "figure": figure,
            "axis": AXIS_OF[figure],
            "drive": reductions.DRIVE,
            "runs": [run.numbers() for pair in pairs for run in pair],
        }

    def table(self) -> dict[str, Any]:
        """The paper's numbers against ours, for JSON and terminal."""
        runs = {
            (c.axis, c.poles_of, plant): self.run(c.axis, optimal_poles(c.poles_of), plant)
            for c in reductions.CLAIMS
            for plant in PLANTS
        }
        rows = reductions.rows(runs)
        varied = reductions.assumptions(self._on_progress)
        ladders = {
            (AXIS_OF[figure], plant): [pair[i] for pair in self.ladder(figure)]
            for figure in (3, 4)
            for i, plant in enumerate(PLANTS)
        }
        facts = controller.facts(self.curves(), self.turning(), ladders, self._on_progress)
        return {
            "paper": "Optimal sway motion reduction in forestry cranes, Front. Robot. AI, 2024",
            "assumed": {"why": PARAMETERS, "grapple": asdict(Grapple())},
            "drive": reductions.DRIVE,
            "reductions": rows,
            "in_words": reductions.in_words(rows, varied),
            "assumptions": varied,
            "others": [asdict(fact) for fact in facts],
        }


def steps(figures: tuple[int, ...], *, table: bool) -> int:
    """How often a study of these figures will call ``on_progress``."""
    expected = set(FIGURES) if table else set(figures)
    count = sum(len(LADDER) * len(PLANTS) for f in (3, 4) if f in expected)
    count += sum(len(PLANTS) for f in (7, 8) if f in expected) + (6 in expected)
    if table:
        # The slewing crane with the near-far poles is in no figure.
        count += len(PLANTS) + len(reductions.LENGTHS_M) + len(reductions.RESTS_S)
        count += controller.TUNINGS
    return count
