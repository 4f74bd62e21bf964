"""A tuning as it goes into the deployment file, with its measures and its recommendation."""

import math
from collections.abc import Callable, Mapping
from dataclasses import dataclass, replace
from typing import Any

from rich.table import Table

from canshaper.config.filters import Filter, filter_of
from canshaper.design.tuning.evaluate import Evaluation, Machine, ShaperFor, evaluate, gff
from canshaper.design.tuning.formulation import longest_tail_s
from canshaper.design.tuning.optimal import FLAT, Tuning
from canshaper.report.console import new_table
from canshaper.shaping.shapers.gff import denominator_from_poles, poles_from_denominator
from canshaper.shaping.sway import SwayMode

_DIGITS = 6
# A tail that ends the run-on early is reported from so much more residual sway on.
_TAIL_MATTERS = 0.01


@dataclass(frozen=True, slots=True)
class Setting:
    """A G_FF with the values of a deployment file, and its measures.

    Attributes:
        a1: coefficient of s in Eq. 13, s.
        a2: coefficient of s^2 in Eq. 13, s^2.
        poles_rad_s: the poles of these coefficients, slowest first.
        third_pole_rad_s: pole of the lag on the command, or None.
        measures: see ``evaluate``.
    """

    a1: float
    a2: float
    poles_rad_s: tuple[float, float]
    third_pole_rad_s: float | None
    measures: Evaluation

    @property
    def filter(self) -> Filter:
        """The setting as the filter of an axis."""
        return filter_of("gff", a1=self.a1, a2=self.a2, third_pole_rad_s=self.third_pole_rad_s)

    def values(self) -> dict[str, float | None]:
        """Return the keys of the filter section with their values; None for a key to delete."""
        return {
            "a1": self.a1,
            "a2": self.a2,
            "third_pole_rad_s": self.third_pole_rad_s,
            "poles_rad_s": None,
        }


def setting(
    *,
    a1: float,
    a2: float,
    third_pole_rad_s: float | None,
    mode: SwayMode,
    tick_s: float,
    machine: Machine,
) -> Setting:
    """Return the setting of this denominator, with its measures."""
    fast, slow = poles_from_denominator(a1, a2)
    measures = evaluate(mode, tick_s, gff((slow, fast), third_pole_rad_s), machine)
    return Setting(a1, a2, (slow, fast), third_pole_rad_s, measures)


def deployed(tuning: Tuning, mode: SwayMode, tick_s: float, machine: Machine) -> Setting:
    """Return the tuning with its values rounded as in a file, measured with these values.

    a2 and a1 are rounded up, so that no pole turns complex. The third pole becomes slower, so that
    the first jump does not grow, but for half a unit of its last digit.
    """
    a2 = _up(tuning.a2)
    a1 = _up(max(tuning.a1, 2.0 * math.sqrt(a2)))
    third = tuning.third_pole_rad_s
    if third is not None:
        third = -1.0 / _up(-1.0 / third)
        third = round(third, _DIGITS - 1 - math.floor(math.log10(-third)))
    return setting(a1=a1, a2=a2, third_pole_rad_s=third, mode=mode, tick_s=tick_s, machine=machine)


def from_parameters(
    parameters: Mapping[str, Any], mode: SwayMode, tick_s: float, machine: Machine
) -> Setting:
    """Return the setting of a deployment's gff section, with its measures."""
    third = parameters.get("third_pole_rad_s")
    if "poles_rad_s" in parameters:
        a1, a2 = denominator_from_poles(parameters["poles_rad_s"])
        a1 = max(a1, 2.0 * math.sqrt(a2))  # rounding of a double pole
    else:
        a1, a2 = parameters["a1"], parameters["a2"]
    return setting(a1=a1, a2=a2, third_pole_rad_s=third, mode=mode, tick_s=tick_s, machine=machine)


def tail_for(
    setting: Setting, mode: SwayMode, tick_s: float, machine: Machine
) -> tuple[float, float] | None:
    """Return the shortest ``tail_s`` that adds under 1 % of residual sway, and the part it leaves.

    Return None if only the longest tail that is tried (``longest_tail_s``) does so.
    """
    shaper = gff(setting.poles_rad_s, setting.third_pole_rad_s)
    longest_s = longest_tail_s(mode)
    best = _left(mode, tick_s, shaper, machine, longest_s)
    result = None
    for tenths in range(round(10.0 * longest_s) - 1, -1, -1):
        left = _left(mode, tick_s, shaper, machine, tenths / 10.0)
        if left - best >= _TAIL_MATTERS:
            break
        result = tenths / 10.0, left
    return result


def recommendation(axis: str, setting: Setting, tail: tuple[float, float] | None) -> str:
    """Return a plain sentence for a person, and a second one where ``tail_for`` gave a ``tail``."""
    m = setting.measures
    third = f", third_pole_rad_s: {setting.third_pole_rad_s:g}" if setting.third_pole_rad_s else ""
    text = (
        f"Use a1: {setting.a1:g}, a2: {setting.a2:g}{third} for {axis}:"
        f" {100 * m.worst(0.0):.0f} % of the swing is left at the given length,"
        f" at most {100 * m.worst(10.0):.0f} % within ±10 % of it,"
        f" and the crane runs on for {m.run_on_s:.1f} s."
    )
    if tail is not None:
        text += (
            f" The limits end the run-on early: with tail_s: {tail[0]:g} it would be"
            f" {100 * tail[1]:.1f} % at the given length."
        )
    return text


def optimum_lines(tuning: Tuning) -> list[str]:
    """Return lines for a person: what bounds the optimum, its flatness, the solver's starts."""
    held = ", ".join(tuning.active) or "nothing: an optimum between all limits"
    return [
        f"Held by: {held}",
        f"Flat: poles of {flatness(tuning)}",
        f"Solver: {tuning.converged} of {tuning.starts} starts ended here,"
        f" {tuning.build_s + tuning.solve_s:.2f} s",
    ]


def flatness(tuning: Tuning) -> str:
    """Return the range of each pole within one percent more cost, as a sentence."""
    ranges = [f"{slow:.2f} to {fast:.2f}" for slow, fast in tuning.ranges_rad_s]
    return f"{' and '.join(ranges)} rad/s cost at most {100 * FLAT:.0f} % more"


def _up(value: float) -> float:
    """Return the value rounded up to ``_DIGITS`` significant digits."""
    digits = _DIGITS - 1 - math.floor(math.log10(value))
    rounded = round(value, digits)
    return rounded if rounded >= value else round(rounded + 10.0**-digits, digits)


def _left(
    mode: SwayMode, tick_s: float, shaper: ShaperFor, machine: Machine, tail_s: float
) -> float:
    longer = replace(machine, limits=replace(machine.limits, tail_s=tail_s))
    return evaluate(mode, tick_s, shaper, longer, (0,)).worst()


def table(setting: Setting, before: Setting | None, method: str) -> Table:
    """Return a table of ``before``, the file's setting or None, and the setting by ``method``."""
    columns = [setting] if before is None else [before, setting]
    result = new_table("", *([] if before is None else ["in the file"]), method)

    def row(title: str, cell: Callable[[Setting], str]) -> None:
        result.add_row(title, *(cell(column) for column in columns))

    row("poles, rad/s", lambda c: f"{c.poles_rad_s[0]:.3f}  {c.poles_rad_s[1]:.3f}")
    if any(c.third_pole_rad_s for c in columns):
        row("third pole", lambda c: f"{c.third_pole_rad_s:.3f}" if c.third_pole_rad_s else "-")
    row("a1, s", lambda c: f"{c.a1:g}")
    row("a2, s²", lambda c: f"{c.a2:g}")
    row("first jump, %", lambda c: f"{100 * c.measures.first_jump:.0f}")
    row("largest output, %", lambda c: f"{100 * c.measures.peak:.0f}")
    row("rise to 95 %, s", lambda c: f"{c.measures.rise_s:.2f}")
    row("dip while held, %", lambda c: f"{100 * c.measures.dip:.0f}")
    row("run-on, s", lambda c: f"{c.measures.run_on_s:.2f}")
    row("mean delay, s", lambda c: f"{c.measures.mean_delay_s:.2f}")
    result.add_row("swing left, %: machine | filter alone")
    for i, residual in enumerate(setting.measures.residuals):
        row(
            f"  length {residual.length_pct:+.0f} %" if residual.length_pct else "  length right",
            lambda c, i=i: (  # type: ignore[misc]
                f"{100 * c.measures.residuals[i].machine:.1f} |"
                f" {100 * c.measures.residuals[i].linear:4.1f}"
            ),
        )
    return result
