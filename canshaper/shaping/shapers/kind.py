"""A kind of filter as one row: name, parameters, constructor, and what else depends on the kind.

The schema of the deployment file, ``build_shaper``, the table in docs/deployment.md, the rows of
``canshaper compare`` and the lists in the tests are made from these rows.
"""

import re
from collections.abc import Callable, Mapping
from dataclasses import dataclass
from typing import Any, Protocol, runtime_checkable

from canshaper.shaping.sway import SwayMode

Parameters = dict[str, Any]
"""Parameters of a filter, by the names that they have in the deployment file."""

_NAME = re.compile(r"[a-z][a-z0-9_]*")
# Names that the section of the file, ``build_shaper`` or a constructor has already.
_RESERVED = {"kind", "parameters", "sway", "tick_s", "valve_rate_per_s"}


class Shaper(Protocol):
    """Interface that every filter implements.

    A filter with a memory also has ``reset_to_steady_state(command)``: as if the command had long
    been there; and, where it can go on from another one of its class, ``copy_state(old)``. One
    whose output is the command spread over time, with the same travel, has ``spreads = True``.
    """

    def step(self, command: float) -> float:
        """Return the output the filter asks for, before limits; ``command`` in [-1, 1].

        Called once a tick, also while the axis is neutral (then with command 0).
        """
        ...


@runtime_checkable
class Following(Protocol):
    """A shaper that follows the swing of a rope; its kind has ``ShaperKind.follows``."""

    def prepare(self, least: float, most: float) -> None:
        """Make ready for periods from least to most, in parts of that of the file."""

    def follow(self, factor: float) -> None:
        """Suit the sway model as it is now, whose period is so many times that of the file."""


@dataclass(frozen=True, slots=True)
class Parameter:
    """A number in the filter's section of the file, or a list of such numbers.

    Attributes:
        name: its key.
        low: least value.
        high: largest value.
        unit: unit of both, "" without one.
        description: what it is, in a few words.
        whole: only whole numbers.
        default: value where the key is missing.
        optional: the key may be missing, and then the constructor does not get it.
        entries: of a list: least and largest number of entries.

    Raises:
        ValueError: the default is outside of the range, or there is no range.
    """

    name: str
    low: float
    high: float
    unit: str
    description: str
    whole: bool = False
    default: float | None = None
    optional: bool = False
    entries: tuple[int, int] | None = None

    def __post_init__(self) -> None:
        value = self.low if self.default is None else self.default
        if not self.low <= value <= self.high:
            raise ValueError(
                f"parameter {self.name}: default {value:g}, range {self.low:g} to {self.high:g}"
            )


@dataclass(frozen=True, slots=True)
class ShaperKind:
    """A kind of filter.

    Attributes:
        name: ``kind`` in the deployment file.
        summary: what it is, one sentence; for the schema and the documentation.
        build: makes the filter: ``build(tick_s, **parameters)``, or ``build(sway, **parameters)``
            where it needs the sway; ValueError says why they make none.
        settings: for the sway mode and tick (s) of an axis the settings that ``canshaper compare``
            drives, by their names there; the tests build them too.
        parameters: what stands in the file.
        needs_sway: ``build`` gets the axis' sway model, which the axis steps with what was sent.
        needs_valve_rate: ``build`` also gets ``valve_rate_per_s``, full speeds per second.
        limit_aware: it damps the swing that the limits of the output make.
        check: called with the parameters of a file; ValueError says what does not go together.
        interpolable: gives the same parameters in a form in which each number may run in a straight
            line from one set to another.
        stretched: the same filter for a swing of so many times the period; of a kind whose
            parameters hold for one period only.
        follows: parameters as the filter has them while it follows a rope to so many times the
            period, by ``follow(factor)``; None where it cannot.
        designed_by: verb of ``canshaper`` that finds the parameters, "" without one.

    Raises:
        ValueError: a name is no word, is reserved, or stands twice.

    Examples:
        A package adds one by an entry point of the group ``canshaper.shapers`` that names it:

        >>> from canshaper import Fir, Parameter, ShaperKind
        >>> kind = ShaperKind(
        ...     "halved",
        ...     "Half of the command now, half of it a tick later.",
        ...     lambda tick_s, *, first: Fir([first, 1.0 - first]),
        ...     lambda mode, tick_s: {"halved": {"first": 0.5}},
        ...     (Parameter("first", 0.0, 1.0, "", "part that comes at once"),),
        ... )
        >>> shaper = kind.build(0.02, first=0.5)
        >>> [shaper.step(command) for command in (1.0, 1.0, 0.0)]
        [0.5, 1.0, 0.5]
    """

    name: str
    summary: str
    build: Callable[..., Shaper]
    settings: Callable[[SwayMode, float], Mapping[str, Parameters]]
    parameters: tuple[Parameter, ...] = ()
    needs_sway: bool = False
    needs_valve_rate: bool = False
    limit_aware: bool = False
    check: Callable[..., object] | None = None
    interpolable: Callable[[Parameters], Parameters] | None = None
    stretched: Callable[[Parameters, float], Parameters] | None = None
    follows: Callable[[Parameters, float], Parameters] | None = None
    designed_by: str = ""

    def __post_init__(self) -> None:
        names = [parameter.name for parameter in self.parameters]
        for name in (self.name, *names):
            if not _NAME.fullmatch(name) or name in _RESERVED or names.count(name) > 1:
                raise ValueError(f"filter {self.name}: the name {name!r} is not allowed here")


def carry_over(old: Shaper, new: Shaper, command: float) -> None:
    """Give a new shaper a memory: that of the one before it, where both are of one kind.

    Args:
        old: the one before.
        new: the new one.
        command: the command now; without a better memory it counts as the one for long.
    """
    if type(old) is type(new) and hasattr(new, "copy_state"):
        new.copy_state(old)
    elif hasattr(new, "reset_to_steady_state"):
        new.reset_to_steady_state(command)


def spreads(shaper: Shaper) -> bool:
    """Whether a shaper's output is the command spread over time, with the same travel."""
    return bool(getattr(shaper, "spreads", False))
