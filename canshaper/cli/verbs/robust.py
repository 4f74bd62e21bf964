"""``canshaper robust``: design the robust shaper of an axis."""

from typing import TYPE_CHECKING, Any

import typer

from canshaper.cli.common import FILE, echo, loader, refuse_shipped
from canshaper.errors import UsageError

if TYPE_CHECKING:
    from rich.console import Console
    from rich.table import Table

    from canshaper.config.filters import Filter
    from canshaper.design.tuning.evaluate import Evaluation
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
    write: bool = typer.Option(False, "--write", help="Write the filter into the file."),
) -> None:
    """Design the shaper that leaves least swing over a range of pendulum lengths.

    A non-negative impulse response within the valve's rate, by linear programming, with a least tap
    that makes one movement of a tap of the joystick. Prints what it does and, without --write, the
    lines for the file.

    Examples:

      canshaper robust config/forwarder.yaml --axis near_far

      canshaper robust config/forwarder.yaml --axis slew --range 30 --duration 2.4 --write

      canshaper robust config/forwarder.yaml --axis near_far --residual 5
    """
    from canshaper.config.edit import Value, flow, set_values
    from canshaper.config.filters import filter_of
    from canshaper.design.swinging import swinging_axis
    from canshaper.design.tuning.evaluate import Machine, evaluate
    from canshaper.design.tuning.robust import least_residual, shortest
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
        raise UsageError("found both, allowed is one of --duration and --residual")
    try:
        asked: dict[str, Any] = {"tick_s": tick_s, "range_pct": range_pct, "rate_per_s": rate}
        if residual_pct is None:
            seconds = duration_s or round(0.77 * mode.period_s / tick_s) * tick_s
            found = least_residual(mode, duration_s=seconds, **asked)
        else:
            found = shortest(mode, residual_pct=residual_pct, **asked)
        taps = [round(tap, _DIGITS) for tap in found.taps]
        measured = evaluate(
            mode,
            tick_s,
            lambda model: build_shaper("robust", tick_s, model, valve_rate_per_s=rate, taps=taps),
            Machine.of(bound),
        )
        section = _section(found, mode, range_pct, rate, tick_ms)
        if write:
            gone = bound.config.filter.model_dump(exclude_none=True).keys()
            values: dict[str, Value] = dict.fromkeys(gone)
            values |= section
            set_values(deployment.path, ("axes", axis, "filter"), values)
    except ValueError as error:
        raise UsageError(f"axis {axis}: {error}") from None
    console.print(
        f"Robust shaper for {axis}: {found.duration_s:.2f} s, mean delay"
        f" {found.mean_delay_s:.2f} s, at most {100.0 * found.residual:.1f} % of the swing left at"
        f" lengths within ±{range_pct:g} %."
    )
    console.print(_table(measured))
    chosen = filter_of("robust", tick_ms=tick_ms, taps=taps)
    _print_stop(deployment, axis, chosen, found.duration_s, console)
    if write:
        console.print(f"Written to {deployment.path}; a running daemon takes it with SIGHUP.")
    else:
        echo(f"filter: {flow(section)}")


def _section(
    found: "RobustShaper", mode: "SwayMode", range_pct: float, rate_per_s: float, tick_ms: int
) -> dict[str, Any]:
    """The filter section of the file."""
    from canshaper.config.filters import designed
    from canshaper.config.runs import shortened

    return {
        "kind": "robust",
        "tick_ms": tick_ms,
        "taps": shortened([round(tap, _DIGITS) for tap in found.taps]),
        "designed_for": {
            **designed(mode),
            "length_range_pct": range_pct,
            "duration_s": round(found.duration_s, 4),
            "valve_rate_per_s": rate_per_s,
        },
    }


def _print_stop(
    deployment: "Deployment", axis: str, chosen: "Filter", duration_s: float, console: "Console"
) -> None:
    """Say what tail the filter needs, and how far the tip travels."""
    from canshaper.commissioning.stopping import consequences

    tail_s = deployment.axes[axis].config.limits.tail_s
    needed_s = round(duration_s + 0.1, 1) if tail_s < duration_s else None
    if needed_s is not None:
        console.print(
            f"tail_s is {tail_s:g} s: it ends the run-on early; give {axis} at least"
            f" tail_s: {needed_s:.1f}"
        )
    console.print(consequences(deployment, axis, chosen, needed_s))


def _table(measured: "Evaluation") -> "Table":
    from canshaper.report.console import new_table

    table = new_table("swing left, %", *(f"{r.length_pct:+g} %" for r in measured.residuals))
    table.add_row("through the machine", *(f"{100 * r.machine:.1f}" for r in measured.residuals))
    table.add_row("shaper alone", *(f"{100 * r.linear:.1f}" for r in measured.residuals))
    return table
