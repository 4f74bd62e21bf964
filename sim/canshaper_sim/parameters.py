"""Parameters of the simulated crane by name, for the command line."""

import dataclasses
from collections.abc import Mapping
from typing import TYPE_CHECKING, Any, TypeVar

from canshaper.errors import DesignError, did_you_mean
from canshaper_sim.crane import CraneParameters

if TYPE_CHECKING:
    from canshaper.machine.deployment import Deployment

P = TypeVar("P")


def parameter_names(parameters: Any = None, prefix: str = "") -> dict[str, float]:
    """Return dotted name (grapple.l2_m) -> value of every parameter, by default the nominal."""
    values: dict[str, float] = {}
    owner = CraneParameters() if parameters is None else parameters
    for field in dataclasses.fields(owner):
        value = getattr(owner, field.name)
        if dataclasses.is_dataclass(value):
            values |= parameter_names(value, f"{prefix}{field.name}.")
        elif field.init:
            values[prefix + field.name] = value
    return values


def changed_parameters(
    changes: list[str], deployment: "Deployment | None" = None
) -> CraneParameters:
    """Return the nominal crane changed by ``crane.simulated`` of the file, then by NAME=VALUE."""
    crane = CraneParameters()
    if deployment and (section := deployment.config.crane):
        own = [f"{name}={value}" for name, value in section.simulated.items()]
        crane = changed(crane, own, f"{deployment.path}: crane.simulated:")
    return changed(crane, changes, "--set")


def changed(parameters: P, changes: list[str], option: str) -> P:
    """Return the parameters with NAME=VALUE changes applied, such as grapple.l2_m=1.5.

    Args:
        parameters: the parameters to change.
        changes: NAME=VALUE each.
        option: option or place that the changes come from, for the message.

    Raises:
        DesignError: no such parameter, no number, or a value outside its range.
    """
    known, values = parameter_names(parameters), dict[str, float]()
    for change in changes:
        name, _, text = change.partition("=")
        if name not in known:
            names = did_you_mean(name, known) or f"; there are {', '.join(known)}"
            raise DesignError(f"{option} {change}: expected a parameter, got {name!r}{names}")
        try:
            values[name] = float(text)
        except ValueError:
            raise DesignError(f"{option} {change}: expected a number, got {text!r}") from None
    return _replaced(parameters, values)


def _replaced(owner: P, values: Mapping[str, float]) -> P:
    """Return a copy of a parameter object with these values (by dotted name) set at once."""
    changes: dict[str, Any] = {name: one for name, one in values.items() if "." not in name}
    for group in {name.partition(".")[0] for name in values if "." in name}:
        inner = {n.partition(".")[2]: v for n, v in values.items() if n.startswith(f"{group}.")}
        changes[group] = _replaced(getattr(owner, group), inner)
    return dataclasses.replace(owner, **changes)  # type: ignore[type-var]
