"""Origins of the numbers that decide about movement: assumed, default, typed or measured."""

from collections.abc import Iterable, Iterator, Mapping
from pathlib import Path
from typing import Any

from canshaper.config.load import load_config
from canshaper.config.schema import DeploymentConfig
from canshaper.config.section import Origin, Section, sections
from canshaper.config.source import Place
from canshaper.edit.edit import Change, change, sections_of
from canshaper.machine.used_message import key_path

# Sections of an axis whose numbers decide how it moves, and the keys that say where they are from.
_DECIDE = ("sway", "slewing", "limits", "filter", "sway_sensor")
_ORIGINS = {"sway": ("origin",), "limits": ("curve_origin",), "filter": ("designed_for", "origin")}
_ORIGINS["sway_sensor"] = ("origin",)
MEASURE = "measure it (canshaper commission), or read it in a manual; then take it out of assumed"


def assumptions(config: DeploymentConfig) -> Iterator[tuple[Place, str]]:
    """Yield the numbers that no one has measured or typed, by axis: where, and what to do."""
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
    """Change of the file, where one is due: someone has measured or typed these numbers.

    Raises:
        ConfigError: the file cannot be read.
    """
    assumed, known = load_config(path)[0].assumed, {*keys}
    left = [key for key in assumed if key not in known]
    return [((), {"assumed": left or None}, "")] if left != assumed else []


def write_numbers(path: Path, values: Mapping[str, float]) -> None:
    """Write numbers that a person has set into a deployment file; see ``change``.

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
