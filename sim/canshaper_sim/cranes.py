"""Several cranes in one deployment: take out the part that belongs to one crane.

The name of such an axis is the name of its crane, an underscore, and the name of a simulated axis:
``front_slew`` and ``rear_slew`` are the slew axes of the cranes ``front`` and ``rear``. A file with
a section ``crane``, which says what its axes move, has one crane.
"""

from dataclasses import replace

from canshaper.errors import DesignError
from canshaper.machine.deployment import Deployment
from canshaper.machine.valves import BoundAxis
from canshaper_sim.axes import ALL_AXES, ROTATOR


def cranes(deployment: Deployment) -> list[str]:
    """Return the names of the cranes of a deployment; empty if its axes form a single crane."""
    names: dict[str, None] = {}
    for name in deployment.axes if deployment.config.crane is None else ():
        for axis in (*ALL_AXES, ROTATOR):
            if name.endswith(f"_{axis}") and name not in ALL_AXES:
                names[name.removesuffix(f"_{axis}")] = None
    return list(names)


def axes_of(deployment: Deployment, crane: str) -> list[str]:
    """Return the names of a crane's axes, less those of a crane whose name begins with its own."""
    others = tuple(f"{one}_" for one in cranes(deployment) if one.startswith(f"{crane}_"))
    begins = f"{crane}_"
    return [n for n in deployment.axes if n.startswith(begins) and not n.startswith(others)]


def one_crane(deployment: Deployment, crane: str) -> Deployment:
    """Return the deployment of one crane: ``front_slew`` of the crane ``front`` becomes ``slew``.

    Joysticks, switches and buses stay if its axes need them, the emergency stop if its bus stays.

    Raises:
        DesignError: the deployment has no such crane.
    """
    names = cranes(deployment)
    if crane not in names:
        expected = f"one of {', '.join(names)}" if names else "none, there is one"
        raise DesignError(f"crane: expected {expected}, got {crane!r}")
    axes: dict[str, BoundAxis] = {
        name.removeprefix(f"{crane}_"): deployment.axes[name] for name in axes_of(deployment, crane)
    }
    moving = {axis.config.command.joystick for axis in axes.values()}
    # And those whose switches enable them.
    needed = {c for name in moving for c in deployment.joysticks[name].conditions}
    joysticks = moving | {condition.joystick for condition in needed}
    switches = [one for one in deployment.switches if {*one.switches} & {c.name for c in needed}]
    own = {n: joystick for n, joystick in deployment.joysticks.items() if n in joysticks}
    buses = {axis.config.valve.bus for axis in axes.values()}
    buses |= {one.key[0] for one in (*own.values(), *switches)}
    config = deployment.config.model_copy(
        update={"buses": {n: b for n, b in deployment.config.buses.items() if n in buses}}
    )
    stop = deployment.emergency_stop
    return replace(
        deployment,
        config=config,
        axes=axes,
        joysticks=own,
        switches=switches,
        emergency_stop=stop if stop and stop.key[0] in buses else None,
    )
