"""A kind of filter as one row: name, parameters, constructor, and all else that differs by kind.

The schema of the deployment file, ``build_shaper``, the table in docs/deployment.md, the rows of
``canshaper compare`` and the lists in the tests are made from these rows.
"""

import re
from collections.abc import Callable, Mapping
from dataclasses import dataclass, field
from typing import Any, Protocol, runtime_checkable

from canshaper.shaping.sway import SwayMode

Parameters = dict[str, Any]
"""Parameters of a filter, by the names that they have in the deployment file."""

_NAME = re.compile(r"[a-z][a-z0-9_]*")
# Reserved names: the section of the file, ``build_shaper`` or a constructor uses them already.
_RESERVED = {"kind", "parameters", "runs_ahead", "sway", "tick_s", "valve_rate_per_s"}


class Shaper(Protocol):
    """Interface that every filter implements.

    A filter with a memory also has ``reset_to_steady_state(command)``: as if the command had long
    been there; and, where it can go on from another one of its class, ``copy_state(old)``. One
    whose output has the travel of the command, spread over so many ticks that the valve cannot
    resolve a tap, has ``spreads = True``: see ``small_strokes``.
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
        """Prepare a filter that has not run for factors of ``follow`` from least to most."""

    def follow(self, factor: float) -> None:
        """Adapt to the present sway model, whose period is ``factor`` times the file's."""


@dataclass(frozen=True, slots=True)
class Parameter:
    """A number in the filter's section of the file, or a list of such numbers.

    Attributes:
        name: key in the file.
        low: least value.
        high: largest value.
        unit: unit of both, "" without one.
        description: meaning in a few words.
        whole: whether only whole numbers are permitted.
        default: value where the key is missing.
        optional: whether the key may be missing; the constructor then does not get it.
        entries: least and largest number of entries of a list; None for one number.

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
        summary: description of the kind in one sentence, for the schema and the documentation.
        build: makes the filter: ``build(tick_s, **parameters)``, or ``build(sway, **parameters)``
            where the filter needs the sway; raises ValueError where the parameters make none.
        settings: returns, for sway mode and tick (s) of an axis, the settings that ``canshaper
            compare`` drives, by their names there; the tests build them too.
        runs_ahead: whether the output may travel farther than the demand by more than 0.4 s of full
            speed, as one that damps swing may; the gate allows it 1.5 s or more.
        parameters: parameters of the filter in the file.
        needs_sway: ``build`` gets the axis' sway model, which the axis steps with what was sent.
        needs_valve_rate: ``build`` also gets ``valve_rate_per_s``, full speeds per second.
        limit_aware: whether the filter damps the swing that the output limits cause.
        check: called with the parameters of a file; raises ValueError where they contradict.
        interpolable: converts the parameters to a form in which each number may be interpolated
            linearly between two sets.
        stretched: returns the parameters for ``factor`` times the period, for a kind whose
            parameters hold for one period only; else None.
        follows: returns the parameters that the filter has while it follows a rope to ``factor``
            times the period, by ``follow(factor)``; None where it cannot follow.
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
        ...     runs_ahead=False,
        ... )
        >>> shaper = kind.build(0.02, first=0.5)
        >>> [shaper.step(command) for command in (1.0, 1.0, 0.0)]
        [0.5, 1.0, 0.5]
    """

    name: str
    summary: str
    build: Callable[..., Shaper]
    settings: Callable[[SwayMode, float], Mapping[str, Parameters]]
    runs_ahead: bool = field(kw_only=True)
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
    """Give a new shaper a memory: that of the old shaper, where both are of one class.

    Args:
        old: the old shaper.
        new: the new shaper.
        command: the present command; a shaper of another class starts as if it were constant.
    """
    if type(old) is type(new) and hasattr(new, "copy_state"):
        new.copy_state(old)
    elif hasattr(new, "reset_to_steady_state"):
        new.reset_to_steady_state(command)


def spreads(shaper: Shaper) -> bool:
    """Return whether a shaper only spreads the command over time, with the same travel."""
    return bool(getattr(shaper, "spreads", False))
