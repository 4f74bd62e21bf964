"""A designed filter into the deployment file, with the tail that it needs."""

from collections.abc import Iterator, Mapping
from difflib import unified_diff
from pathlib import Path
from typing import TYPE_CHECKING, Any

if TYPE_CHECKING:
    from canshaper.config.edit import Value
    from canshaper.machine.deployment import Deployment


def write_filter(
    deployment: "Deployment", axis: str, filter_values: "Mapping[str, Value]", tail_s: float | None
) -> list[str]:
    """Write a filter, and a longer tail where the stopping distance of the file allows it.

    Args:
        deployment: the machine, as its file says.
        axis: the axis.
        filter_values: keys of its section filter; see ``set_values``.
        tail_s: tail that the filter needs; None or less than that of the file changes nothing.

    Returns:
        Lines that have changed, and why the tail has not.

    Raises:
        ConfigError: the file cannot be changed, or is no good deployment with the filter: a range
            in which the sway may be adjusted can be too wide for it. The file is as it was.
    """
    from canshaper.config.edit import set_values
    from canshaper.errors import ConfigError
    from canshaper.machine.binding import load_deployment
    from canshaper.machine.stopping import stop_fault

    path, config = deployment.path, deployment.axes[axis].config
    before = path.read_bytes()
    set_values(path, ("axes", axis, "filter"), filter_values)
    try:
        load_deployment(path)
    except ConfigError:
        path.write_bytes(before)
        raise
    kept = None
    if tail_s is not None and tail_s > config.limits.tail_s:
        limits = config.limits.model_copy(update={"tail_s": tail_s})
        kept = stop_fault(deployment, axis, config.model_copy(update={"limits": limits}))
        if not kept:
            _write_tail(path, axis, tail_s, section="limits" in config.model_fields_set)
    lines = list(_changed(before.decode(), path.read_text(encoding="utf-8")))
    if kept:
        text = f"expected {tail_s:g} s, got {config.limits.tail_s:g} s, which stays"
        lines.append(f"WARNING: axes.{axis}.limits.tail_s: {text}: stop_distance_m: {kept}")
    return lines


def written_line(path: Path) -> str:
    """What to do next."""
    return f"Written to {path}; a running daemon takes it with SIGHUP."


def _write_tail(path: Path, axis: str, tail_s: float, *, section: bool) -> None:
    from canshaper.config.edit import set_values

    values: dict[str, Any] = {"tail_s": tail_s}
    if section:
        set_values(path, ("axes", axis, "limits"), values)
    else:
        set_values(path, ("axes", axis), {"limits": values})


def _changed(before: str, after: str) -> Iterator[str]:
    """Lines of the file that went and came."""
    lines = unified_diff(before.splitlines(), after.splitlines(), n=0, lineterm="")
    for line in list(lines)[2:]:
        if not line.startswith("@@"):
            yield line
