"""Numbers of a deployment that were measured on a simulated crane: where, and why that matters."""

from collections.abc import Iterator

from canshaper.config.origin import simulated
from canshaper.config.schema import DeploymentConfig
from canshaper.config.source import Place


def rehearsed(config: DeploymentConfig) -> Iterator[tuple[Place, str]]:
    """Sections with numbers of a simulated crane: where, and what to do."""
    for place in simulated(config.axes, ("axes",)):
        yield place, "measured on a simulated crane; measure it on the machine"


def rehearsed_valves(config: DeploymentConfig) -> Iterator[tuple[Place, str]]:
    """Valve curves of a simulated crane that would move valves on a real bus: where, and why."""
    for name, axis in config.axes.items():
        bus = config.buses[axis.valve.bus]
        if not bus.is_virtual:
            for place in simulated(axis.limits, ("axes", name, "limits")):
                text = (
                    "expected a valve measured on the machine, got one of a simulated crane, on"
                    f" {bus.interface} {bus.channel}; canshaper calibrate --live measures it,"
                    " canshaper run --simulated takes it as it is"
                )
                yield place, text
