"""``canshaper robust``: design the robust shaper of an axis."""

from typing import TYPE_CHECKING, Any

import typer

from canshaper.cli.common import FILE, echo, loader, refuse_shipped
from canshaper.cli.filter_file import write_filter, written_line
from canshaper.errors import DesignError, UsageError

if TYPE_CHECKING:
    from rich.console import Console
    from rich.table import Table

    from canshaper.config.filters import Filter
    from canshaper.design.tuning.evaluate import Evaluation
    from canshaper.design.tuning.modes import SecondMode
    from canshaper.design.tuning.robust import RobustShaper
    from canshaper.machine.deployment import Deployment
    from canshaper.shaping.sway import SwayMode

# Digits of a tap in the file: below a thousandth of the smallest tap that matters.
_DIGITS = 7


def robust(
    file: str = FILE,
    axis: str = typer.Option(..., "--axis", help="Axis to design for."),
    range_pct: float = typer.Option(15.0, "--range", help="Pendulum length error covered, +- %."),
    duration_s: float | None = typer.Option(
        None, "--duration", help="Length of the impulse response in s. Default: 0.77 of a swing."
    ),
    residual_pct: float | None = typer.Option(
        None, "--residual", help="Instead: the shortest that leaves at most this % of the swing."
    ),
    second: str | None = typer.Option(
        None,
        "--second",
        metavar="PERIOD,DAMPING,RANGE",
        help="A second mode too: s, damping ratio, +- % of its length.",
    ),
    write: bool = typer.Option(False, "--write", help="Write filter and tail into the file."),
) -> None:
    """Design the shaper that leaves least swing over a range of pendulum lengths.

    A non-negative impulse response within the valve's rate, by linear programming, with a least tap
    that makes one movement of a tap of the joystick. Prints what it does and, without --write, the
    lines for the file.

    With --second it leaves a second mode in peace too, such as that of grapple and rotator with
    long logs, and prints what that costs and gains.

    Examples:

      canshaper robust config/forwarder.yaml --axis near_far

      canshaper robust config/forwarder.yaml --axis slew --range 30 --duration 2.4 --write

      canshaper robust config/forwarder.yaml --axis near_far --residual 5

      canshaper robust config/forwarder.yaml --axis near_far --second 0.6,0.1,20
    """
    design(
        file,
        axis,
        range_pct=range_pct,
        duration_s=duration_s,
        residual_pct=residual_pct,
        second=second,
        write=write,
    )


def design(
    file: str,
    axis: str,
    *,
    range_pct: float = 15.0,
    duration_s: float | None = None,
    residual_pct: float | None = None,
    second: str | None = None,
    write: bool = False,
) -> None:
    """Design, print and write; arguments as the options of the verb."""
    from canshaper.config.edit import flow
    from canshaper.config.filters import filter_of
    from canshaper.design.swinging import swinging_axis
    from canshaper.design.tuning.evaluate import Machine, evaluate
    from canshaper.report.console import SafeConsole
    from canshaper.shaping.registry import build_shaper

    console = SafeConsole()
    deployment = loader(file)()
    if write:
        refuse_shipped(file)
    bound, sway = swinging_axis(deployment, axis)
    mode, rate = sway.mode(), bound.config.limits.slowest_per_s
    tick_ms = bound.period_ticks * deployment.config.tick_ms
    tick_s = tick_ms / 1000.0
    if residual_pct is not None and duration_s is not None:
        raise UsageError("expected one of --duration and --residual, got both")
    asked: dict[str, Any] = {"tick_s": tick_s, "range_pct": range_pct, "rate_per_s": rate}
    two = _second(second, mode, tick_s, rate)
    try:
        without = _designed(mode, None, duration_s, residual_pct, asked)
        found = _designed(mode, two, duration_s, residual_pct, asked) if two else without
        taps = [round(tap, _DIGITS) for tap in found.taps]
        measured = evaluate(
            mode,
            tick_s,
            lambda model: build_shaper("robust", tick_s, model, valve_rate_per_s=rate, taps=taps),
            Machine.of(bound),
        )
    except ValueError as error:
        raise UsageError(f"axis {axis}: {error}") from None
    console.print(
        f"Robust shaper for {axis}: {found.duration_s:.2f} s, mean delay"
        f" {found.mean_delay_s:.2f} s, at most {100.0 * found.residual:.1f} % of the swing left at"
        f" lengths within ±{range_pct:g} %."
    )
    console.print(_table(measured))
    if two:
        console.print(_second_table(without, found, two, tick_s))
    section = _section(found, mode, asked, tick_ms, two)
    chosen = filter_of("robust", **{k: v for k, v in section.items() if k != "kind"})
    needed_s = _print_stop(deployment, axis, chosen, found.duration_s, console)
    if write:
        gone = dict.fromkeys(bound.config.filter.model_dump(exclude_none=True))
        echo("\n".join(write_filter(deployment, axis, gone | section, needed_s)))
        echo(written_line(deployment.path))
    else:
        echo(f"filter: {flow(section)}")


def _second(
    text: str | None, first: "SwayMode", tick_s: float, rate_per_s: float
) -> "SecondMode | None":
    """What --second asks for."""
    from canshaper.design.tuning.modes import second_mode

    if text is None:
        return None
    try:
        period_s, damping_ratio, range_pct = (float(word) for word in text.split(","))
    except ValueError:
        wanted = "PERIOD,DAMPING,RANGE, such as 0.6,0.1,20"
        raise UsageError(f"--second: expected {wanted}, got {text!r}") from None
    try:
        values = (period_s, damping_ratio, range_pct)
        return second_mode(first, *values, tick_s=tick_s, rate_per_s=rate_per_s)
    except DesignError as error:
        raise UsageError(f"--second: {error}") from None


def _designed(
    mode: "SwayMode",
    second: "SecondMode | None",
    duration_s: float | None,
    residual_pct: float | None,
    asked: dict[str, Any],
) -> "RobustShaper":
    from canshaper.design.tuning.robust import least_residual, shortest

    if residual_pct is not None:
        return shortest(mode, residual_pct=residual_pct, second=second, **asked)
    tick_s = asked["tick_s"]
    seconds = duration_s or round(0.77 * mode.period_s / tick_s) * tick_s
    return least_residual(mode, duration_s=seconds, second=second, **asked)


def _section(
    found: "RobustShaper",
    mode: "SwayMode",
    asked: dict[str, Any],
    tick_ms: int,
    second: "SecondMode | None",
) -> dict[str, Any]:
    """The filter section of the file."""
    from canshaper.config.filters import designed
    from canshaper.config.runs import shortened

    designed_for: dict[str, Any] = {
        **designed(mode),
        "length_range_pct": asked["range_pct"],
        "duration_s": round(found.duration_s, 4),
        "valve_rate_per_s": asked["rate_per_s"],
    }
    if second:
        covers = {"length_range_pct": second.range_pct}
        designed_for["second"] = {**designed(second.mode), **covers}
    return {
        "kind": "robust",
        "tick_ms": tick_ms,
        "taps": shortened([round(tap, _DIGITS) for tap in found.taps]),
        "designed_for": designed_for,
    }


def _print_stop(
    deployment: "Deployment", axis: str, chosen: "Filter", duration_s: float, console: "Console"
) -> float | None:
    """Say how far the tip travels, and what tail the filter needs: that, where it is longer."""
    from canshaper.commissioning.stopping import consequences

    tail_s = deployment.axes[axis].config.limits.tail_s
    needed_s = round(duration_s + 0.1, 1) if tail_s < duration_s else None
    if needed_s is not None:
        console.print(
            f"tail_s is {tail_s:g} s: it ends the run-on early; give {axis} at least"
            f" tail_s: {needed_s:.1f}"
        )
    console.print(consequences(deployment, axis, chosen, needed_s))
    return needed_s


def _second_table(
    without: "RobustShaper", found: "RobustShaper", second: "SecondMode", tick_s: float
) -> "Table":
    """What a second mode costs and gains."""
    from canshaper.design.tuning.modes import second_residual
    from canshaper.report.console import new_table

    table = new_table("", "run-on, s", "mean delay, s", "first mode, %", "second mode, %")
    for name, one in (("without --second", without), ("with it", found)):
        left = second_residual(one.taps, second, tick_s)
        numbers = (f"{one.duration_s:.2f}", f"{one.mean_delay_s:.2f}")
        table.add_row(name, *numbers, f"{100.0 * one.residual:.1f}", f"{100.0 * left:.1f}")
    return table


def _table(measured: "Evaluation") -> "Table":
    from canshaper.report.console import new_table

    table = new_table("swing left, %", *(f"{r.length_pct:+g} %" for r in measured.residuals))
    table.add_row("through the machine", *(f"{100 * r.machine:.1f}" for r in measured.residuals))
    table.add_row("shaper alone", *(f"{100 * r.linear:.1f}" for r in measured.residuals))
    return table
