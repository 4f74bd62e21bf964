"""Where the numbers that decide about movement come from; numbers and filters written with that.

A number is assumed (a guess of ``init``), the default, typed by a person, or measured.
"""

from collections.abc import Iterable, Iterator, Mapping, Sequence
from ipaddress import ip_address
from itertools import islice
from pathlib import Path
from typing import Any

from canshaper.config.bus import Bus
from canshaper.config.load import load_config
from canshaper.config.schema import AxisSection, DeploymentConfig
from canshaper.config.section import Origin, Section, sections
from canshaper.config.source import Place
from canshaper.edit.edit import Change, FileValue, change, note, of_limits, sections_of, written_by
from canshaper.errors import CutOffError, UsageError
from canshaper.machine.database import Messages
from canshaper.machine.deployment import Deployment
from canshaper.machine.stop_distance import stop_fault
from canshaper.machine.used_message import key_path
from canshaper.recording.log import LogFile
from canshaper.recording.tables import is_table
from canshaper_sim.axes import SWAY_SIGNALS

# Sections of an axis whose numbers decide how it moves, and the keys that say where they are from.
_DECIDE = ("sway", "slewing", "limits", "filter", "sway_sensor")
_ORIGINS = {"sway": ("origin",), "limits": ("curve_origin",), "filter": ("designed_for", "origin")}
_ORIGINS["sway_sensor"] = ("origin",)
MEASURE = "measure it (canshaper commission), or read it in a manual; then take it out of assumed"


def assumptions(config: DeploymentConfig) -> Iterator[tuple[Place, str]]:
    """Yield wrong keys of ``assumed``, and by axis the guessed numbers: where, and what to do."""
    known = {key_path(place): value for place, value in _numbers(config)}
    for i, key in enumerate(config.assumed):
        if key not in known:
            yield ("assumed", i), f"expected a key of this file with a number, got {key!r}"
    for name in config.axes:
        of_axis = [key for key in config.assumed if key.startswith(f"axes.{name}.")]
        numbers = (f"{k.removeprefix(f'axes.{name}.')} {known.get(k)}" for k in of_axis)
        if of_axis:
            where = config.assumed.index(of_axis[0])
            yield ("assumed", where), f"{name} moves by {', '.join(numbers)}: a guess; {MEASURE}"


def confirmed(path: Path, keys: Iterable[str]) -> list[Change]:
    """Return the change, if any, that takes numbers now measured or typed out of ``assumed``.

    Raises:
        ConfigError: the file cannot be read.
    """
    assumed, known = load_config(path)[0].assumed, {*keys}
    left = [key for key in assumed if key not in known]
    return [((), {"assumed": left or None}, "")] if left != assumed else []


def write_numbers(path: Path, values: Mapping[str, float]) -> None:
    """Write numbers that a person has set into a deployment file, by key; none stays assumed.

    Raises:
        ConfigError: the file cannot be changed.
    """
    numbers = [(place, of_section, "") for place, of_section in sections_of(values).items()]
    change(path, [*numbers, *confirmed(path, values)])


def origins(config: DeploymentConfig) -> Iterator[tuple[str, str, str]]:
    """Yield key, value and origin of every number that decides how an axis moves."""
    for name, axis in config.axes.items():
        timeout = f"axes.{name}.valve.timeout_ms"
        yield timeout, f"{axis.valve.timeout_ms}", _origin(config, timeout, axis.valve, None)
        for part in _DECIDE:
            section = getattr(axis, part)
            if section is None:
                continue
            made: Any = section
            for key in _ORIGINS.get(part, ("origin",)):
                made = getattr(made, key, None)
            for key, value in section:
                measured = part != "limits" or key.startswith("curve_")
                measured &= key != "full_speed_m_s"  # which a log of a swing does not show
                if isinstance(value, int | float | list) and not isinstance(value, bool):
                    path = f"axes.{name}.{part}.{key}"
                    text = _origin(config, path, section, made if measured else None)
                    yield path, _short(value), text


def _origin(config: DeploymentConfig, path: str, section: Section, made: Origin | None) -> str:
    if path in config.assumed:
        return "ASSUMED"
    if made:
        log = f" from {made.log}" if made.log else ""
        return f"{made.source or 'measured'}: {made.by}, {made.date}{log}"
    return "typed" if path.rpartition(".")[2] in section.model_fields_set else "default"


def _short(value: float | list[Any]) -> str:
    return f"{len(value)} numbers" if isinstance(value, list) else f"{value:g}"


def _numbers(config: DeploymentConfig) -> Iterator[tuple[Place, float]]:
    for place, section in sections(config):
        for key, value in section:
            if isinstance(value, int | float) and not isinstance(value, bool):
                yield (*place, key), value


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
    """Return changes that write filters of an axis, and a longer tail where stop_distance_m allows.

    ``designed_for`` carries the origin of the swing: of a machine, or simulated.

    Args:
        deployment, axis: the machine, as its file says, and the name of its axis.
        filters: place below the axis, () for its own filter or that of a breakpoint; and the keys
            of the section filter, see ``change``.
        tail_s: tail that they need; None, or one below that of the file, changes nothing.
        verb: the verb that designed them.
        sway: keys of the axis' own swing to write with them.
        rope: keys of the length that it follows.

    Returns:
        Changes of the file; notes: which kind of filter is replaced, and why the tail stays.
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

    ``cure`` is what to do instead.

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
    """Return the line that names the written file, and how a running daemon takes it."""
    return f"Written to {path}; a running daemon takes it with SIGHUP."


# Only the simulated crane sends these: no sensor of a machine reports the swing in both directions.
_OWN = sorted({name.partition(".")[0] for name in SWAY_SIGNALS.values()})
# So many frames hold every message of a bus; the simulated crane sends its own every 20 ms.
_FRAMES = 5000


def is_simulated(log: Path, messages: Messages) -> bool:
    """Return whether a log is of a virtual bus, or has messages of the simulated crane.

    Its first ``_FRAMES`` frames are looked at. A table is of a machine.

    Raises:
        LogError: the log cannot be read.
    """
    if is_table(log):
        return False
    found = [entry[1] for name in _OWN if not isinstance(entry := messages.find(name), str)]
    own = {(message.frame_id, message.is_extended_frame) for message in found}
    try:
        return any(
            (frame.can_id, frame.extended) in own or _is_virtual(frame.channel)
            for frame in islice(LogFile(log), _FRAMES)
        )
    except CutOffError:
        return False


def _is_virtual(channel: str) -> bool:
    """Return whether a channel of a log is one of vcan, or the address of a bus over UDP."""
    if channel.startswith(("vcan", "vxcan")):
        return True
    try:
        ip_address(channel)
    except ValueError:
        return False
    return True


def origin_of(
    verb: str,
    logs: Sequence[Path] = (),
    messages: Messages | None = None,
    *,
    live: Iterable[Bus] = (),
) -> dict[str, Any]:
    """Return the origin of values that a verb has measured, as keys of a section.

    Args:
        verb: the verb.
        logs: the logs that they were computed from; without any the values were measured at once.
        messages: of the DBC files, with logs.
        live: the buses that they were measured on; none for the simulated crane.

    Raises:
        LogError: a log cannot be read.
    """
    if logs and messages:
        simulated = any(is_simulated(path, messages) for path in logs)
        return written_by(verb, simulated=simulated, log=", ".join(path.name for path in logs))
    buses = [bus.is_virtual for bus in live]
    return written_by(verb, simulated=not buses or any(buses))
