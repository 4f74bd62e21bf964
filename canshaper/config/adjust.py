"""Numbers of an axis by their keys: which ones may change while the axis runs, and the result."""

import re
from collections.abc import Iterator, Mapping
from typing import Any, NamedTuple, Self, TypeVar

from pydantic import ValidationError

from canshaper.config.schema import AxisSection
from canshaper.config.section import Section
from canshaper.shaping.registry import KINDS

S = TypeVar("S", bound=Section)

# Limits that no filter and no run-on has in its memory.
LIMITS = ("max_pct", "rise_per_s", "fall_per_s")
_SECTIONS = ("sway", "filter", "limits")
_KEY = re.compile(r"axes\.(.+)\.(\w+)\.(\w+)")


class AxisKey(NamedTuple):
    """AxisKey of a number in the deployment file: ``axes.AXIS.SECTION.NAME``."""

    axis: str
    section: str
    name: str

    @classmethod
    def parsed(cls, text: str) -> Self | None:
        """Parse the text of a key; return None where it cannot be the key of an axis."""
        match = _KEY.fullmatch(text)
        return cls(*match.groups()) if match else None

    def __str__(self) -> str:
        return f"axes.{self.axis}.{self.section}.{self.name}"


def value(config: AxisSection, key: AxisKey) -> float | None:
    """Return the number at a key; None where the section has no number of that name."""
    section = getattr(config, key.section, None) if key.section in _SECTIONS else None
    number = getattr(section, key.name, None)
    return number if isinstance(number, float) else None


def adjusted(
    config: AxisSection, values: Mapping[AxisKey, float], file: AxisSection
) -> AxisSection:
    """Return the configuration of an axis with some numbers changed.

    A changed period stretches a filter that is made for one period, always from the file's filter.

    Args:
        config: the present configuration of the axis.
        values: the new numbers, by key.
        file: the configuration of the axis in the file.

    Raises:
        ValueError: the result is no valid configuration; the message says where and why.
    """
    parts: dict[str, Any] = {}
    for name in {key.section for key in values}:
        new = {key.name: float(one) for key, one in values.items() if key.section == name}
        parts[name] = _with(getattr(config, name), name, new)
    result = config.model_copy(update=parts)
    stretch = KINDS[file.filter.kind].stretched
    if stretch and "sway" in parts and result.sway and file.sway:
        factor = result.sway.mode().period_s / file.sway.mode().period_s
        design = file.filter.design()
        if design and (fault := design.stretch_fault(factor)):
            raise ValueError(f"filter.designed_for.second.period_s: {fault}")
        new = stretch(file.filter.parameters(), factor) if factor != 1.0 else {}
        result = result.model_copy(update={"filter": _with(file.filter, "filter", new)})
    return result


def _with(section: S, name: str, new: Mapping[str, Any]) -> S:
    """Return the section with some values replaced and validated."""
    try:
        return type(section).model_validate(section.model_dump(exclude_none=True) | {**new})
    except ValidationError as error:
        first = error.errors()[0]
        where = ".".join((name, *(str(part) for part in first["loc"])))
        raise ValueError(f"{where}: {first.get('ctx', {}).get('error', first['msg'])}") from None


def faults(key: AxisKey, config: AxisSection, low: float, high: float) -> Iterator[str]:
    """Yield the reasons why a number of an axis cannot be adjustable within [low, high]."""
    now = value(config, key)
    if now is None:
        yield "expected a number in the axis' sway, filter or limits, got none of that name"
    elif key.section == "limits" and key.name not in LIMITS:
        yield f"expected one of the limits {', '.join(LIMITS)}, got {key.name}"
    elif config.gain_schedule or config.profiles:
        yield f"axis {key.axis} has a gain schedule or profiles, which choose its numbers"
    elif config.sway and config.sway.length:
        yield f"axis {key.axis} has a measured length, which chooses its numbers"
    elif config.sway is None and key.section == "filter":
        yield f"axis {key.axis} has no sway data; adjustable are its limits"
    elif not low <= now <= high:
        yield f"expected a range around the number itself, {now:g}, got {low:g} to {high:g}"
    else:
        section = getattr(config, key.section)
        for end in (low, high):
            try:
                type(section).model_validate(
                    section.model_dump(exclude_none=True) | {key.name: end}
                )
            except ValidationError as error:
                # Rules between two numbers are checked later, when both have their new values.
                if any(one["loc"] == (key.name,) for one in error.errors()):
                    yield f"expected both ends within the range of this key, got {end:g}"
