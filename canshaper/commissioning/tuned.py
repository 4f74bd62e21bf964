"""The G_FF of an axis: tuned by options and file, judged, shown, written into the file."""

import math
from collections.abc import Callable, Mapping
from dataclasses import asdict, dataclass, fields
from typing import TYPE_CHECKING, Any

from rich.console import Console

from canshaper.commissioning.origins import write_filters
from canshaper.commissioning.stopping import consequences
from canshaper.config.desk import Objective
from canshaper.config.filters import designed
from canshaper.design.profiles import swinging_axis
from canshaper.design.tuning import deploy, preference
from canshaper.design.tuning.evaluate import Machine, gff
from canshaper.design.tuning.formulation import Requirements, Task, Weights
from canshaper.design.tuning.verdict import Verdict, judge
from canshaper.errors import UsageError
from canshaper.machine.deployment import Deployment
from canshaper.machine.valves import BoundAxis
from canshaper.shaping.shapers.gff import denominator_from_poles

if TYPE_CHECKING:
    from matplotlib.figure import Figure

    from canshaper.design.tuning.optimal import Tuning

# What a tuning aims at, one of: a preference, a range of lengths, Eq. 15.
_AIMS = ({"preference"}, {"length_range_pct"}, {"q", "r", "s", "p", "states"})
# Options that the manual rule cannot keep.
_BEYOND = ("max_jump", "max_rate_per_s", "max_run_on_s", "third_pole", *_AIMS[0], *_AIMS[1])


@dataclass(frozen=True)
class TunedDesign:
    """A G_FF that was tuned for an axis.

    Attributes:
        bound: the axis.
        task: what was asked for.
        tuning: the poles that answer it.
        setting: the poles with the digits of a file, and what they do.
        before: the setting in the file, where its filter is a G_FF.
        tail: tail that it needs, s, and part of the swing that it leaves; None for none.
        verdict: whether it damps.
        objective: keys for the file that tune it again; None for the manual rule.
        choices: settings that a preference has chosen from; none without a preference.
    """

    bound: BoundAxis
    task: Task
    tuning: "Tuning"
    setting: deploy.Setting
    before: deploy.Setting | None
    tail: tuple[float, float] | None
    verdict: Verdict
    objective: dict[str, Any] | None
    choices: list[preference.Choice]

    @property
    def section(self) -> dict[str, Any]:
        """The filter section of the file."""
        details = {
            "length_range_pct": self.task.length_range_pct,
            "duration_s": self.tail[0] if self.tail else None,
            "valve_rate_per_s": self.task.require.max_rate_per_s,
            "objective": self.objective,
        }
        designed_for = designed(self.task.mode) | details
        values = {**self.setting.values(), "designed_for": _present(designed_for)}
        return {"kind": "gff", **_present(values)}

    @property
    def longer_tail(self) -> tuple[float, float] | None:
        """``tail`` where that of the file is shorter; else None."""
        short = self.tail and self.tail[0] > self.bound.config.limits.tail_s
        return self.tail if short else None


def _present(values: Mapping[str, Any]) -> dict[str, Any]:
    return {key: value for key, value in values.items() if value is not None}


def design_tuned(
    deployment: Deployment,
    axis: str,
    given: Mapping[str, Any],
    *,
    method: str = "optimal",
    starts: int = 3,
    report: Callable[[float, str], None] = lambda _done, _what: None,
) -> TunedDesign:
    """Tune the G_FF of an axis.

    Args:
        deployment, axis: the machine, and the name of an axis with sway data.
        given: what is asked, by the names of ``Objective``, with ``max_rate_per_s`` and
            ``length_range_pct``; the rest is as the filter in the file was tuned, else the default.
        method: "optimal", or "manual" for the paper's rule.
        starts: starts of the solver.
        report: called with the part done, 0 to 1, and what is done next.

    Raises:
        DesignError: the axis has no sway data, a value is out of range, no setting fits.
        UsageError: the options contradict each other.
    """
    if method not in ("optimal", "manual"):
        raise UsageError(f"--method: expected optimal or manual, got {method}")
    if method == "manual" and any(given.get(name) is not None for name in _BEYOND):
        raise UsageError(
            "the manual rule knows the damping of the sway only; limits, a third pole and"
            " a length range are for --method optimal"
        )
    bound, sway = swinging_axis(deployment, axis)
    asked = _asked(bound, given)
    task = Task(
        sway.mode(),
        deployment.config.tick_ms / 1000.0 * bound.period_ticks,
        asked["horizon_s"],
        Weights(tuple(asked["q"]), asked["r"], asked["s"], asked["p"]),
        asked["states"],
        Requirements(**{one.name: asked[one.name] for one in fields(Requirements)}),
        asked["length_range_pct"],
    )
    machine, wanted = Machine.of(bound), asked["preference"]
    choices: list[preference.Choice] = []
    report(0.0, "loading the solver")
    from canshaper.design.tuning import optimal  # noqa: PLC0415  # CasADi takes its time

    if method == "manual":
        tuning = optimal.manual(task.mode)
    elif wanted is not None:
        choices = preference.front(task, machine, wanted, on_progress=report)
        first, second, *third = preference.chosen(choices, wanted).poles_rad_s
        a1, a2 = denominator_from_poles((first, second))
        name = f"preference {wanted:g}"
        tuning = optimal.Tuning((first, second), third[0] if third else None, a1, a2, name)
    else:
        tuning = optimal.tune(task, starts, report)
    setting = deploy.deployed(tuning, task.mode, task.tick_s, machine)
    shaper = gff(setting.poles_rad_s, setting.third_pole_rad_s)
    verdict = judge(task.mode, task.tick_s, shaper, machine, task.length_range_pct or 0.0)
    before, tail = None, deploy.tail_for(setting, task.mode, task.tick_s, machine)
    if bound.config.filter.kind == "gff":
        parameters = bound.config.filter.parameters()
        before = deploy.from_parameters(parameters, task.mode, task.tick_s, machine)
        verdict = verdict.with_cure(before.measures.worst(0.0), "the filter in the file")
    others = {"horizon_s", *_AIMS[2]} if wanted is not None or task.length_range_pct else set()
    kept = (name for name in Objective.model_fields if name not in others)
    objective = {name: asked[name] for name in kept if asked[name] is not None}
    again = objective if method == "optimal" else None
    return TunedDesign(bound, task, tuning, setting, before, tail, verdict, again, choices)


def _asked(bound: BoundAxis, given: Mapping[str, Any]) -> dict[str, Any]:
    """Return options, else those of the file's filter, else defaults; UsageError for two aims."""
    named = [aim for aim in _AIMS if aim & given.keys()]
    if len(named) > 1:
        raise UsageError("expected one of --preference, --length-range and weights, got several")
    chosen, limits = bound.config.filter, bound.config.limits
    design = chosen.design() if chosen.kind == "gff" else None
    asked = Objective().model_dump() | {"length_range_pct": None}
    asked["max_rate_per_s"] = limits.slowest_per_s
    if design and design.objective:
        asked |= design.objective.model_dump() | {"length_range_pct": design.length_range_pct}
        rate = design.valve_rate_per_s
        asked["max_rate_per_s"] = rate and min(rate, limits.slowest_per_s)
    if named:
        asked |= {"preference": None, "length_range_pct": None}
    asked |= given
    if asked["max_rate_per_s"] == math.inf:
        asked["max_rate_per_s"] = None
    if asked["within_command"] is None:
        asked["within_command"] = not limits.allow_faster
    if asked["length_range_pct"] is not None and asked["max_run_on_s"] is None:
        asked["max_run_on_s"] = limits.tail_s
    return asked


def print_tuned(deployment: Deployment, one: TunedDesign, console: Console) -> None:
    """Print the setting next to that of the file, the front, the verdict and what follows."""
    console.print(deploy.table(one.setting, one.before, one.tuning.method))
    if one.tuning.method == "optimal":
        console.print("\n".join(deploy.optimum_lines(one.tuning)))
    if one.choices and one.objective and one.bound.config.sway:
        speed_m_s = one.bound.config.sway.full_speed_m_s
        console.print(preference.table(one.choices, one.objective["preference"], speed_m_s))
    console.print(f"\nVerdict: {one.verdict}.", style="bold")
    if one.verdict.word == "good":
        console.print(deploy.recommendation(one.bound.name, one.setting, one.longer_tail))
    tail_s = one.longer_tail[0] if one.longer_tail else None
    console.print(consequences(deployment, one.bound.name, one.setting.filter, tail_s))


def write_tuned(deployment: Deployment, one: TunedDesign) -> list[str]:
    """Write a design into the file; see ``write_filters``."""
    values = dict.fromkeys(one.bound.config.filter.model_dump(exclude_none=True)) | one.section
    tail_s = one.tail[0] if one.tail else None
    return write_filters(deployment, one.bound.name, [((), values)], tail_s, "tune")


def figure(one: TunedDesign) -> "Figure":
    """Draw the setting next to that of the file."""
    from canshaper.design.tuning import plot  # noqa: PLC0415  # pictures alone need it

    assert one.bound.config.sway is not None
    return plot.figure(
        axis=one.bound.name,
        setting=one.setting,
        mode=one.task.mode,
        tick_s=one.task.tick_s,
        machine=Machine.of(one.bound),
        full_speed_m_s=one.bound.config.sway.full_speed_m_s,
        before=one.before,
        choices=one.choices,
    )


def as_dict(one: TunedDesign) -> dict[str, Any]:
    """Return the design as JSON data."""
    setting: dict[str, Any] = asdict(one.setting)
    result: dict[str, Any] = asdict(one.tuning) | setting.pop("measures") | setting
    return result | {
        "axis": one.bound.name,
        "in_file": asdict(one.before.measures) if one.before else None,
        "recommendation": deploy.recommendation(one.bound.name, one.setting, one.longer_tail),
        "verdict": one.verdict.as_dict(),
        "objective": one.objective,
        "tail_needed_s": one.longer_tail[0] if one.longer_tail else None,
    }
