"""Filters for several loads: all breakpoints of a gain schedule, and a range of pendulums."""

from collections.abc import Sequence
from typing import Any

from rich.console import Console

from canshaper.commissioning.robust import (
    RobustDesign,
    design_robust,
    print_consequences,
    summary_line,
)
from canshaper.config.limits import Sway
from canshaper.design.profiles import swinging_axis
from canshaper.design.tuning.evaluate import Machine, shaper_of, swing_left
from canshaper.errors import UsageError
from canshaper.machine.deployment import Deployment
from canshaper.report.console import new_table

# So long the responses are alike: a load that is known so late in a movement changes no output. It
# costs the longer ones next to nothing.
ALIKE_S = 0.5


def lengths_of(text: str | None) -> tuple[float, float] | None:
    """Return the shortest and the longest pendulum of the option --lengths, m."""
    if text is None:
        return None
    try:
        low_m, high_m = (float(word) for word in text.split(":"))
    except ValueError:
        raise UsageError(
            f"--lengths: expected LOW:HIGH in m, such as 1.2:1.6, got {text}"
        ) from None
    if not 0.05 <= low_m <= high_m <= 150.0:
        most = min(high_m, 150.0)
        raise UsageError(f"--lengths: expected LOW of 0.05 to {most:g} m, up to HIGH, got {text}")
    return low_m, high_m


def design_loads(
    deployment: Deployment, axis: str, *, duration_s: float | None, **options: Any
) -> list[RobustDesign]:
    """Design the filter of every breakpoint of an axis, and its own where that is of another kind.

    ``duration_s`` is for the shortest swing; others get more in proportion. See ``design_robust``.

    Raises:
        UsageError: there is no gain schedule, or no such shaper.
    """
    bound, own = swinging_axis(deployment, axis)
    config = bound.config
    if not config.gain_schedule:
        raise UsageError(f"--loads: expected a gain_schedule with the swing of each load at {axis}")
    swings: dict[int | None, Sway] = {None: own} if config.filter.kind != "robust" else {}
    swings |= {i: one.sway for i, one in enumerate(config.gain_schedule)}
    periods_s = {at: sway.mode().period_s for at, sway in swings.items()}
    first: Sequence[float] = ()
    designs = []
    for at, period_s in sorted(periods_s.items(), key=lambda one: one[1]):
        lasts_s = duration_s and duration_s * period_s / min(periods_s.values())
        one = design_robust(deployment, axis, at=at, duration_s=lasts_s, first=first, **options)
        first = first or one.shaper.taps[: round(ALIKE_S / one.tick_s)]
        designs.append(one)
    return designs


def print_loads(deployment: Deployment, designs: Sequence[RobustDesign], console: Console) -> None:
    """Print what each design leaves with each load, and the stopping distance with the longest."""
    bound = designs[0].bound
    loads = {f"{one.breakpoint:g}": one.sway.mode() for one in bound.config.gain_schedule}
    names = [*(f"for {name}" for name in loads), "own"]
    table = new_table("swing left, %", *(f"with {name}" for name in loads))
    rate, machine = bound.config.limits.slowest_per_s, Machine.of(bound)
    for one in designs:
        name = names[-1 if one.at is None else one.at]
        console.print(f"{name}: {summary_line(one)}")
        shaper = shaper_of(one.chosen, one.tick_s, rate)
        left = swing_left(one.mode, one.tick_s, shaper, machine, [*loads.values()])
        table.add_row(name, *(f"{100.0 * part:.1f}" for part in left))
    console.print(table)
    longest = max(designs, key=lambda one: one.shaper.duration_s)
    print_consequences(deployment, longest, console)
