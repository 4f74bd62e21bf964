"""Writing of a filter with its tail into the deployment file."""

from collections.abc import Mapping, Sequence
from pathlib import Path

from canshaper.config.schema import AxisSection
from canshaper.config.source import Place
from canshaper.edit.edit import Change, FileValue, change, note, of_limits, written_by
from canshaper.errors import UsageError
from canshaper.machine.deployment import Deployment
from canshaper.machine.stop_distance import stop_fault


def write_filters(
    deployment: Deployment,
    axis: str,
    filters: Sequence[tuple[Place, Mapping[str, FileValue]]],
    tail_s: float | None,
    verb: str,
) -> list[str]:
    """Write filters of an axis into the file; see ``filter_changes``.

    Returns:
        Lines that have changed, and the notes.

    Raises:
        ConfigError: the file cannot be changed, or is no good deployment with the filters: a range
            in which the sway may be adjusted can be too wide for it. The file is as it was.
    """
    changes, notes = filter_changes(deployment, axis, filters, tail_s, verb)
    return [*change(deployment.path, changes), *notes]


def filter_changes(
    deployment: Deployment,
    axis: str,
    filters: Sequence[tuple[Place, Mapping[str, FileValue]]],
    tail_s: float | None,
    verb: str,
    *,
    sway: Mapping[str, FileValue] | None = None,
    rope: Mapping[str, FileValue] | None = None,
) -> tuple[list[Change], list[str]]:
    """Filters of an axis, and a longer tail where the stopping distance of the file allows it.

    What they were designed for carries where it comes from: measured as the swing was.

    Args:
        deployment: the machine, as its file says.
        axis: the axis.
        filters: place below the axis, () for its own or that of a breakpoint; kind and the other
            keys of its section filter, see ``change``.
        tail_s: tail that they need; None or less than that of the file changes nothing.
        verb: that designed them.
        sway: keys of the axis' own swing to write with them.
        rope: keys of the length that it follows.

    Returns:
        Changes of the file; notes on the kind that its own replaces, and why the tail stays.
    """
    config = deployment.axes[axis].config
    changes: list[Change] = [
        (("axes", axis, *place, "filter"), _with_origin(config, values, verb), note(verb))
        for place, values in filters
    ]
    if sway:
        changes.append((("axes", axis, "sway"), sway, note(verb)))
    if rope:
        changes.append((("axes", axis, "sway", "length"), rope, note(verb)))
    kept = None
    if tail_s is not None and tail_s > config.limits.tail_s:
        limits = config.limits.model_copy(update={"tail_s": tail_s})
        kept = stop_fault(deployment, axis, config.model_copy(update={"limits": limits}))
        if not kept:
            changes.append(of_limits(axis, config, {"tail_s": tail_s}))
    notes = []
    was = config.filter.kind
    for kind in (values["kind"] for place, values in filters if not place):
        if was != kind:
            notes.append(f"NOTE: axes.{axis}.filter.kind: {kind} replaces {was}")
    if kept:
        text = f"expected {tail_s:g} s, got {config.limits.tail_s:g} s, which stays"
        notes.append(f"WARNING: axes.{axis}.limits.tail_s: {text}: stop_distance_m: {kept}")
    return changes, notes


def refuse_scheduled(deployment: Deployment, axis: str, cure: str) -> None:
    """Refuse to write one filter where a gain schedule has others, which would stay as they are.

    Args:
        deployment: the machine.
        axis: name of the axis.
        cure: what to do instead.

    Raises:
        UsageError: the axis has a gain schedule.
    """
    bound = deployment.axes.get(axis)
    if bound and bound.config.gain_schedule:
        points = ", ".join(f"{one.breakpoint:g}" for one in bound.config.gain_schedule)
        text = f"expected an axis without gain_schedule, got {axis} with {points}"
        raise UsageError(f"--write: {text}, whose filters would stay: {cure}")


def _with_origin(
    config: AxisSection, filter_values: Mapping[str, FileValue], verb: str
) -> dict[str, FileValue]:
    """Return the values with the origin of the design."""
    designed_for = filter_values["designed_for"]
    assert isinstance(designed_for, Mapping)
    swing = config.sway.origin if config.sway else None
    simulated = swing.source == "simulated" if swing and swing.source else None
    made = written_by(verb, simulated=simulated, log=swing.log if swing else None)
    return {**filter_values, "designed_for": {**designed_for, "origin": made}}


def written_line(path: Path) -> str:
    """Return the next thing to do, after the file was written."""
    return f"Written to {path}; a running daemon takes it with SIGHUP."
