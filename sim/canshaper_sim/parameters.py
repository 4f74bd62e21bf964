"""Parameters of the simulated crane by name, for the command line."""

import dataclasses
from typing import TYPE_CHECKING, Any, TypeVar

from canshaper.errors import DesignError, did_you_mean
from canshaper_sim.crane import CraneParameters

if TYPE_CHECKING:
    from canshaper.machine.deployment import Deployment

P = TypeVar("P")


def parameter_names(parameters: Any = None, prefix: str = "") -> dict[str, float]:
    """Every parameter by its name, such as ``grapple.l2_m``, with its value."""
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
    """The nominal crane, as its file says, with NAME=VALUE changes put in; see `changed`."""
    crane = CraneParameters()
    if deployment and (section := deployment.config.crane):
        own = [f"{name}={value}" for name, value in section.simulated.items()]
        crane = changed(crane, own, f"{deployment.path}: crane.simulated:")
    return changed(crane, changes, "--set")


def changed(parameters: P, changes: list[str], option: str) -> P:
    """Parameters with NAME=VALUE changes of this option put in, such as grapple.l2_m=1.5.

    Raises:
        DesignError: no such parameter, no number, or a value that cannot be.
    """
    known = parameter_names(parameters)
    for change in changes:
        name, _, text = change.partition("=")
        if name not in known:
            names = did_you_mean(name, known) or f"; there are {', '.join(known)}"
            raise DesignError(f"{option} {change}: expected a parameter, got {name!r}{names}")
        try:
            value = float(text)
        except ValueError:
            raise DesignError(f"{option} {change}: expected a number, got {text!r}") from None
        parameters = _replaced(parameters, name, value)
    return parameters


def _replaced(owner: Any, name: str, value: float) -> Any:
    """A copy of a parameter object with the parameter of that dotted name changed."""
    group, _, rest = name.partition(".")
    new = _replaced(getattr(owner, group), rest, value) if rest else value
    return dataclasses.replace(owner, **{group: new})
