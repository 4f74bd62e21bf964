"""Which axes of a machine swing: those with sway data, which every design starts from."""

from canshaper.config.limits import Sway
from canshaper.errors import DesignError
from canshaper.machine.bound_axis import BoundAxis
from canshaper.machine.deployment import Deployment


def swinging_axis(deployment: Deployment, name: str) -> tuple[BoundAxis, Sway]:
    """An axis and its sway data.

    Raises:
        DesignError: there is no such axis, or it has none; names those that have.
    """
    bound = deployment.axes.get(name)
    sway = bound.config.sway if bound else None
    if bound is None or sway is None:
        fault = "no sway data" if bound else "no such axis"
        having = ", ".join(n for n, a in deployment.axes.items() if a.config.sway) or "none here"
        raise DesignError(f"axis {name}: expected one with sway data, {having}, got {fault}")
    return bound, sway
